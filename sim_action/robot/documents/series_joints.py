"""Joints with several motions, as joints in series with massless links between them.

A planar joint is two slides in the plane normal to its axis and a hinge about the axis. A universal joint is two
hinges. A floating joint below the base is three slides and a ball joint. No motor holds any of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Vector3
from sim_action.core.records import dataclass, field
from sim_action.robot.documents.urdf_elements import axis, child_of, parent_of
from sim_action.robot.documents.xml_document import ModelDocument

SERIES: Final[Mapping[str, tuple[str, ...]]] = {
    "planar": ("x", "y", "turn"),
    "universal": ("1", "2"),
    "floating": ("slide_x", "slide_y", "slide_z"),
}
"""Type of a joint with several motions -> the ends of the names of its parts; in "floating", a ball joint follows."""


@dataclass(frozen=True, slots=True)
class Series:
    """The joints and links that replace joints with several motions."""

    # name of each joint -> name of the joint in the file of which it is a part
    joints: dict[str, str] = field(default_factory=dict)
    links: set[str] = field(default_factory=set)  # names of the massless links


def part_names(joint: Element) -> tuple[str, ...]:
    """Return the names of the joints in series that replace a joint; massless links have the same names."""
    return tuple(f"{joint.attrib['name']}_{end}" for end in SERIES.get(joint.attrib["type"], ()))


def expand_series(document: ModelDocument) -> Series:
    """Replace the joints with several motions."""
    made = Series()
    for joint in list(document.elements("joint")):
        if joint.attrib["type"] in SERIES:
            _expand(document.root, joint, made)
    return made


def _expand(root: Element, joint: Element, made: Series) -> None:
    name, kind, names = joint.attrib["name"], joint.attrib["type"], part_names(joint)
    ends = [*names, child_of(joint)] if kind == "floating" else [*names[:-1], child_of(joint)]
    above, parts = parent_of(joint), list[Element]()
    for made_joint, end, (motion, along) in zip(names, ends, _motions(joint), strict=False):
        written = _joint(made_joint, motion, above, end)
        ET.SubElement(written, "axis", xyz=" ".join(map(repr, along)))
        parts.append(written)
        made.joints[made_joint] = name
        above = end
    if kind == "floating":
        parts.append(_joint(name, "spherical", above, ends[-1]))
    parts[0].extend(joint.findall("origin"))
    for part in parts:
        part.extend(_dynamics(joint, part))
    place = list(root).index(joint)
    root[place : place + 1] = parts
    for end in ends[:-1]:
        ET.SubElement(root, "link", name=end)
        made.links.add(end)


def _motions(joint: Element) -> Iterator[tuple[str, Vector3]]:
    """Yield the type and axis of each part, in the order from the parent to the child."""
    kind = joint.attrib["type"]
    if kind == "floating":
        yield from (("prismatic", along) for along in geometry.AXES)
    elif kind == "planar":
        normal = axis(joint)
        first = _across(normal)
        yield "prismatic", first
        yield "prismatic", geometry.cross(normal, first)
        yield "continuous", normal
    else:
        for tag in ("axis", "axis2"):
            limit = joint.find(tag.replace("axis", "limit"))
            is_limited = limit is not None and bool({"lower", "upper"} & limit.attrib.keys())
            yield "revolute" if is_limited else "continuous", axis(joint, tag)


def _across(normal: Vector3) -> Vector3:
    """Return the x axis of the plane normal to an axis: x for z, y for x, z for y."""
    x, y, z = map(abs, normal)
    start = geometry.AXES[1 if x >= max(y, z) else 2 if y >= z else 0]
    along = sum(a * b for a, b in zip(start, normal, strict=True))
    rest = tuple(a - along * b for a, b in zip(start, normal, strict=True))
    length = math.hypot(*rest)
    return (rest[0] / length, rest[1] / length, rest[2] / length)


def _joint(name: str, kind: str, parent: str, child: str) -> Element:
    joint = Element("joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    return joint


def _dynamics(joint: Element, part: Element) -> Iterator[Element]:
    """Yield <limit> and <dynamics> of a part: in a universal joint each axis has its own, else only damping counts."""
    if joint.attrib["type"] == "universal":
        end = "2" if part.attrib["name"].endswith("_2") else ""
        for tag in ("limit", "dynamics"):
            stated = joint.find(tag + end)
            if stated is not None:
                yield Element(tag, stated.attrib)
        return
    stated = joint.find("dynamics")
    if stated is not None and "damping" in stated.attrib:
        yield Element("dynamics", damping=stated.attrib["damping"])
