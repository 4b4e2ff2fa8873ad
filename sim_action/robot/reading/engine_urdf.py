"""The URDF text that an engine gets: the model is repaired, then written with only the parts that were understood.

An engine may read other parts differently from URDF, or from this reader. So they are left out, or normalised: tabs
between numbers, missing limits, an empty <dynamics> or <axis>, elements of a dialect, namespace prefixes, a second
<inertial>. tests/integration/test_fuzz.py compares both readers.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final, cast
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.records import replace
from sim_action.robot.audit.inertia import RigidBodies, increase, principal_moments
from sim_action.robot.audit.joints import is_free_base, mimic_problem, still_position
from sim_action.robot.audit.shapes import is_empty
from sim_action.robot.documents.urdf_elements import (
    BALLS,
    CONTACT,
    MOMENTS,
    SHAPES,
    UNLIMITED,
    axis,
    child_of,
    flag,
    limits,
    number,
    number_text,
    numbers,
    origin,
    parent_of,
)
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.robot_model import MOVING_TYPES, WORLD

# A link without <inertial> gets this share of the mass of the others, as a ball of this radius.
_NEGLIGIBLE_SHARE: Final = 1e-4
_NEGLIGIBLE_RADIUS_M: Final = 0.05
_LEAST_MASS: Final = 1e-6


def with_static_base(document: ModelDocument) -> ModelDocument:
    """Return the document of a model whose <gazebo> says <static>, with its root link fixed to a new link `world`."""
    links = {link.get("name", "") for link in document.elements("link")}
    roots = links.difference(map(child_of, document.elements("joint")))
    tags = (tag for tag in document.elements("gazebo") if tag.get("reference") is None)
    stated = next((tag for tag in tags if flag(number_text(tag, "static") or "")), None)
    if stated is None or WORLD in links or len(roots) != 1:
        return document
    world = ET.SubElement(document.root, "link", name=WORLD)
    (root,) = roots
    joint = ET.SubElement(document.root, "joint", name=f"{WORLD}_{root}", type="fixed")
    parts = (world, joint, ET.SubElement(joint, "parent", link=WORLD), ET.SubElement(joint, "child", link=root))
    return replace(document, places={**document.places, **dict.fromkeys(parts, document.places[stated])})


def fill_in_inertia(document: ModelDocument, massless: Collection[str]) -> None:
    """Add a negligible <inertial> to links without one, and one of 0 to massless links; an engine would assume 1 kg."""
    stated = sum(number(mass, "value") or 0.0 for mass in document.elements("link/inertial/mass"))
    mass = max(_LEAST_MASS, _NEGLIGIBLE_SHARE * stated)
    for link in document.elements("link"):
        if link.find("inertial") is None:
            link.append(_ball(0.0 if link.get("name") in massless else mass))


def _ball(mass: float) -> Element:
    moment = f"{0.4 * mass * _NEGLIGIBLE_RADIUS_M**2:.6g}"
    inertial = Element("inertial")
    ET.SubElement(inertial, "mass", value=f"{mass:.6g}")
    axes = {"ixx": moment, "iyy": moment, "izz": moment, "ixy": "0", "ixz": "0", "iyz": "0"}
    ET.SubElement(inertial, "inertia", axes)
    return inertial


def drop_massless_frames(document: ModelDocument) -> None:
    """Remove an <inertial> with a mass of 0 from links that are fixed to others with a mass."""
    bodies = RigidBodies(document)
    for link in document.elements("link"):
        inertial = link.find("inertial")
        if (
            inertial is not None
            and number(inertial.find("mass"), "value") == 0
            and bodies.holds_mass(link.attrib["name"])
        ):
            link.remove(inertial)


def drop_empty_shapes(document: ModelDocument) -> None:
    """Remove collision shapes without any extent."""
    for link in document.elements("link"):
        for collision in link.findall("collision"):
            shape = collision.find("geometry/*")
            if shape is not None and is_empty(shape):
                link.remove(collision)


def drop_zero_masses(document: ModelDocument) -> None:
    """Remove an <inertial> with a mass of 0, if the audit allowed it. The base link keeps it, which fixes the base."""
    children = {child_of(joint) for joint in document.elements("joint")}
    for link in document.elements("link"):
        inertial = link.find("inertial")
        if inertial is not None and link.get("name") in children and number(inertial.find("mass"), "value") == 0:
            link.remove(inertial)


def repair_inertia(document: ModelDocument) -> None:
    """Repair inertias that are impossible. An engine would ignore them, and no torque could turn the link."""
    for inertial in document.elements("link/inertial"):
        inertia = inertial.find("inertia")
        if inertia is None or (number(inertial.find("mass"), "value") == 0 and _is_zero(inertia)):
            continue
        if max(principal_moments(inertia)) <= 0:
            ball = _ball(number(inertial.find("mass"), "value") or _LEAST_MASS)
            inertia.attrib.update(cast(Element, ball.find("inertia")).attrib)
        elif (moment := increase(inertia)) > 0:
            _spread(inertia, moment)


def _is_zero(inertia: Element) -> bool:
    return not any(number(inertia, name) for name in MOMENTS)


def _spread(inertia: Element, moment: float) -> None:
    for name in ("ixx", "iyy", "izz"):
        inertia.set(name, repr((number(inertia, name) or 0.0) + moment))


def drop_empty_root(document: ModelDocument) -> None:
    """Remove an empty root link and its floating joint. They mean that the base is free, which is the default."""
    for joint in list(document.elements("joint")):
        if is_free_base(document, joint):
            (root,) = (link for link in document.elements("link") if link.attrib["name"] == parent_of(joint))
            document.root.remove(root)
            document.root.remove(joint)


def drop_invalid_mimics(document: ModelDocument) -> None:
    """Remove each <mimic> that cannot work, if the audit allowed it: the joint moves independently.

    A joint that its <mimic> never moves becomes fixed, at the position of the <mimic>.
    """
    joints = {joint.attrib["name"]: joint for joint in document.elements("joint")}
    for joint in joints.values():
        if (position := still_position(joint, joints)) is not None:
            fix_at(joint, position)
    odd = [joint for joint in joints.values() if mimic_problem(joint, joints) is not None]
    for joint in odd:
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)


def fix_at(joint: Element, position: float) -> None:
    """Make a joint fixed at a position in rad (m if prismatic)."""
    x, y, z = axis(joint)
    if joint.attrib["type"] == "prismatic":
        motion = Pose((x * position, y * position, z * position))
    else:
        sine = math.sin(position / 2)
        motion = Pose(orientation_xyzw=(x * sine, y * sine, z * sine, math.cos(position / 2)))
    at = geometry.compose(origin(joint), motion) if position and joint.attrib["type"] in MOVING_TYPES else origin(joint)
    for part in (*joint.findall("origin"), *joint.findall("mimic")):
        joint.remove(part)
    rpy = geometry.rpy_from_quaternion(at.orientation_xyzw)
    ET.SubElement(joint, "origin", xyz=_spelled(at.position_xyz), rpy=_spelled(rpy))
    joint.set("type", "fixed")


def engine_text(document: ModelDocument) -> str:
    """Return the URDF text, in short lines: the engine's parser splits long lines inside a token."""
    robot = Element("robot", name="robot")
    robot.extend(map(_link, document.elements("link")))
    robot.extend(map(_joint, document.elements("joint")))
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode")


def _link(link: Element) -> Element:
    written = Element("link", name=link.attrib["name"])
    inertial, contact = link.find("inertial"), link.find("contact")
    if inertial is not None:
        written.append(_inertial(inertial, number(link.find("contact/inertia_scaling"), "value")))
    written.extend(map(_collision, link.findall("collision")))
    if contact is not None:
        written.append(_contact(contact))
    return written


def _inertial(inertial: Element, scaling: float | None) -> Element:
    """Write <inertial>. `scaling`: Bullet's factor on the moments; applied here, because other engines ignore it."""
    written = _with_origin(Element("inertial"), inertial)
    written.append(_numbers("mass", inertial.find("mass"), "value"))
    moments = _numbers("inertia", inertial.find("inertia"), *MOMENTS)
    if scaling is not None:
        moments.attrib.update({name: repr(scaling * float(text)) for name, text in moments.attrib.items()})
    written.append(moments)
    return written


def _collision(collision: Element) -> Element:
    written = _with_origin(Element("collision"), collision)
    shape = next(iter(cast(Element, collision.find("geometry"))))
    geometry = ET.SubElement(written, "geometry")
    if shape.tag == "mesh":
        ET.SubElement(geometry, "mesh", filename=shape.attrib["filename"])
    else:
        geometry.append(_numbers(shape.tag, shape, *SHAPES[shape.tag]))
    return written


def _contact(contact: Element) -> Element:
    """Write <contact> without stiffness and damping, which are in `Surface`: Bullet would guess the missing one."""
    written = Element("contact")
    parts = (_numbers(tag, contact.find(tag), "value") for tag in CONTACT if tag not in {"stiffness", "damping"})
    written.extend(part for part in parts if part.attrib)
    if contact.find("friction_anchor") is not None:
        ET.SubElement(written, "friction_anchor")
    return written


def _joint(joint: Element) -> Element:
    kind = joint.attrib["type"] if joint.attrib["type"] not in BALLS else "spherical"
    written = _with_origin(Element("joint", name=joint.attrib["name"], type=kind), joint)
    ET.SubElement(written, "parent", link=parent_of(joint))
    ET.SubElement(written, "child", link=child_of(joint))
    if kind == "spherical":
        # It has no axis, but PyBullet warns without one.
        ET.SubElement(written, "axis", xyz="1 0 0")
    elif kind in ("revolute", "continuous", "prismatic"):
        # Bullet scales the motion of a prismatic joint by the length of its axis.
        ET.SubElement(written, "axis", xyz=_spelled(axis(joint)))
        written.append(_limit(joint))
    dynamics = _numbers("dynamics", joint.find("dynamics"), "damping", *(() if kind == "spherical" else ("friction",)))
    if dynamics.attrib:
        written.append(dynamics)
    return written


def _limit(joint: Element) -> Element:
    """Write <limit>: no positions if neither side is limited, else both, because Bullet's default upper limit is -1."""
    written = _numbers("limit", joint.find("limit"), "effort", "velocity")
    for name in ("effort", "velocity"):
        if float(written.get(name, 0)) < 0:
            del written.attrib[name]
    lower, upper = limits(joint)
    if (lower, upper) != (None, None):
        below, above = -UNLIMITED if lower is None else lower, UNLIMITED if upper is None else upper
        written.attrib.update(lower=repr(below), upper=repr(above))
    return written


def _with_origin(written: Element, element: Element) -> Element:
    origin = _numbers("origin", element.find("origin"), "xyz", "rpy")
    if origin.attrib:
        written.append(origin)
    return written


def _numbers(tag: str, element: Element | None, *names: str) -> Element:
    found = {name: numbers(element, name) for name in names}
    return Element(tag, {name: _spelled(values) for name, values in found.items() if values is not None})


def _spelled(values: tuple[float, ...]) -> str:
    return " ".join(map(repr, values))
