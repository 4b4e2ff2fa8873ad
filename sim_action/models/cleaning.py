"""A model made into what an engine cannot misread."""

from __future__ import annotations

from typing import Final, cast
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.models.audit.inertia import principal_moments
from sim_action.models.audit.joints import LIMITED, UNSUPPORTED, is_free_base, trouble_of_mimic
from sim_action.models.document import ModelDocument
from sim_action.models.values import child_of, is_expression, number, parent_of

# Of a link that does not say what it weighs: this share of what the others weigh, as a ball of this radius in m.
_NEGLIGIBLE_SHARE: Final = 1e-4
_NEGLIGIBLE_RADIUS: Final = 0.05
_LEAST_MASS: Final = 1e-6


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
    """A body that resists no turning would turn without end: what was let go as that is a ball of the same mass."""
    for inertial in document.elements("link/inertial"):
        inertia = inertial.find("inertia")
        if inertia is not None and principal_moments(inertia)[0] <= 0:
            ball = _ball(number(inertial.find("mass"), "value") or _LEAST_MASS)
            inertia.attrib.update(cast(Element, ball.find("inertia")).attrib)


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
        joint.remove(cast(Element, joint.find("mimic")))


def fill_in_limits(document: ModelDocument) -> None:
    """A joint that was let go without limits has none; an engine would refuse one without the element."""
    for joint in document.elements("joint"):
        if joint.attrib["type"] in LIMITED and joint.find("limit") is None:
            ET.SubElement(joint, "limit")


def drop_expressions(document: ModelDocument) -> None:
    """What was let go as an expression is left out."""
    for element in document.root.iter():
        for name in [name for name, text in element.attrib.items() if is_expression(text)]:
            del element.attrib[name]


def drop_visuals(document: ModelDocument) -> None:
    """Nothing is rendered, and each is a file of somebody's that an engine would open."""
    for link in document.elements("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    for material in document.elements("material"):
        document.root.remove(material)


def engine_text(document: ModelDocument) -> str:
    """The model on short lines: the engine's parser cuts long ones inside a token."""
    ET.indent(document.root)
    return ET.tostring(document.root, encoding="unicode")
