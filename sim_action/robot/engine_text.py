"""The URDF that an engine gets: only what was understood here, each part once, each number in one spelling.

What an engine reads otherwise than URDF has it, or than it was read here, is not in it: numbers with tabs between them,
limits that are left out, a <dynamics> or an <axis> that says nothing, elements of a dialect, prefixes of namespaces, a
second <inertial> (tests/integration/test_fuzz.py compares both).
"""

from __future__ import annotations

from typing import cast
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.robot.document import ModelDocument
from sim_action.robot.values import (
    CONTACT,
    MOMENTS,
    SHAPES,
    UNLIMITED,
    axis,
    child_of,
    limits,
    number,
    numbers,
    parent_of,
)


def engine_text(document: ModelDocument) -> str:
    """The model on short lines: the engine's parser cuts long ones inside a token."""
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
    """`scaling`: what Bullet multiplies the moments with, done here, as an engine of another make would not."""
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
    """All but stiffness and damping, which are of `Surface`: Bullet takes 0, too, and makes up the one left out."""
    written = Element("contact")
    parts = (_numbers(tag, contact.find(tag), "value") for tag in CONTACT if tag not in {"stiffness", "damping"})
    written.extend(part for part in parts if part.attrib)
    if contact.find("friction_anchor") is not None:
        ET.SubElement(written, "friction_anchor")
    return written


def _joint(joint: Element) -> Element:
    kind = joint.attrib["type"]
    written = _with_origin(Element("joint", name=joint.attrib["name"], type=kind), joint)
    ET.SubElement(written, "parent", link=parent_of(joint))
    ET.SubElement(written, "child", link=child_of(joint))
    if kind in ("revolute", "continuous", "prismatic"):
        # Bullet slides by as much more as the axis is longer than 1.
        ET.SubElement(written, "axis", xyz=_spelled(axis(joint)))
        written.append(_limit(joint))
    dynamics = _numbers("dynamics", joint.find("dynamics"), "damping", "friction")
    if dynamics.attrib:
        written.append(dynamics)
    return written


def _limit(joint: Element) -> Element:
    """Of a joint that nothing stops, it limits no position; otherwise both ways: Bullet has -1 for an upper one."""
    written = _numbers("limit", joint.find("limit"), "effort", "velocity")
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
    """An element with those of the attributes that are there."""
    found = {name: numbers(element, name) for name in names}
    return Element(tag, {name: _spelled(values) for name, values in found.items() if values is not None})


def _spelled(values: tuple[float, ...]) -> str:
    return " ".join(map(repr, values))
