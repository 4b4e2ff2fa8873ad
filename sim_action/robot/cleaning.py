"""A model made into what an engine cannot misread."""

from __future__ import annotations

from typing import Final, cast
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.robot.audit.inertia import principal_moments
from sim_action.robot.audit.joints import UNSUPPORTED, is_free_base, trouble_of_mimic
from sim_action.robot.document import ModelDocument
from sim_action.robot.values import child_of, number, parent_of

# Of a link that does not say what it weighs: this share of what the others weigh, as a ball of this radius in m.
_NEGLIGIBLE_SHARE: Final = 1e-4
_NEGLIGIBLE_RADIUS: Final = 0.05
_LEAST_MASS: Final = 1e-6
# What engines are off by where they look for the principal axes: a flat plate is at the limit, and it is no mistake.
_ROUNDING: Final = 1e-6


def fill_in_inertia(document: ModelDocument) -> None:
    """Gives links without <inertial> a negligible one; an engine would take 1 kg."""
    stated = sum(number(mass, "value") or 0.0 for mass in document.elements("link/inertial/mass"))
    mass = max(_LEAST_MASS, _NEGLIGIBLE_SHARE * stated)
    for link in document.elements("link"):
        if link.find("inertial") is None:
            link.append(_ball(mass))


def _ball(mass: float) -> Element:
    moment = f"{0.4 * mass * _NEGLIGIBLE_RADIUS**2:.6g}"
    inertial = Element("inertial")
    ET.SubElement(inertial, "mass", value=f"{mass:.6g}")
    axes = {"ixx": moment, "iyy": moment, "izz": moment, "ixy": "0", "ixz": "0", "iyz": "0"}
    ET.SubElement(inertial, "inertia", axes)
    return inertial


def drop_zero_masses(document: ModelDocument) -> None:
    """A mass of zero that was let go counts as left out, but for the base: it is held still."""
    children = {child_of(joint) for joint in document.elements("joint")}
    for link in document.elements("link"):
        inertial = link.find("inertial")
        if inertial is not None and link.get("name") in children and number(inertial.find("mass"), "value") == 0:
            link.remove(inertial)


def mend_inertia(document: ModelDocument) -> None:
    """Inertias that the engine would take for none at all, which is a body that no torque turns."""
    for inertial in document.elements("link/inertial"):
        inertia = inertial.find("inertia")
        if inertia is None:
            continue
        least, middle, most = sorted(principal_moments(inertia))
        if most <= 0:
            ball = _ball(number(inertial.find("mass"), "value") or _LEAST_MASS)
            inertia.attrib.update(cast(Element, ball.find("inertia")).attrib)
        elif (lacking := most - least - middle + _ROUNDING * most) > 0:
            _spread(inertia, lacking - min(0.0, least))


def _spread(inertia: Element, moment: float) -> None:
    """Adds as much about every axis: the principal axes stay, and with enough, each is less than the others' sum."""
    for name in ("ixx", "iyy", "izz"):
        inertia.set(name, repr((number(inertia, name) or 0.0) + moment))


def drop_empty_root(document: ModelDocument) -> None:
    """A floating joint from an empty root link says what is so in any case: the robot moves freely."""
    for joint in list(document.elements("joint")):
        if is_free_base(document, joint):
            (root,) = (link for link in document.elements("link") if link.attrib["name"] == parent_of(joint))
            document.root.remove(root)
            document.root.remove(joint)


def hold_odd_joints(document: ModelDocument) -> None:
    """Joints that were let go as no engine has them do not move."""
    for joint in document.elements("joint"):
        if joint.attrib["type"] in UNSUPPORTED:
            joint.set("type", "fixed")


def drop_odd_mimics(document: ModelDocument) -> None:
    """What was let go as it follows no other moves by itself."""
    joints = {joint.attrib["name"]: joint for joint in document.elements("joint")}
    odd = [joint for joint in joints.values() if trouble_of_mimic(joint, joints) is not None]
    for joint in odd:
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
