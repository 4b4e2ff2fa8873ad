"""Values in elements that the audit has found to hold them."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from sim_action import geometry
from sim_action.geometry import Pose, Vector3


def is_expression(text: str) -> bool:
    """Whether xacro was to put something else there."""
    return "${" in text or "$(" in text


def numbers(element: Element | None, name: str) -> tuple[float, ...] | None:
    """Its numbers; None if the element or the attribute is not there, or was let go as an expression."""
    text = None if element is None else element.get(name)
    return None if text is None or is_expression(text) else tuple(map(float, text.split()))


def number(element: Element | None, name: str) -> float | None:
    """One number; None as for `numbers`."""
    found = numbers(element, name)
    return found[0] if found else None


def vector(element: Element | None, name: str, otherwise: Vector3) -> Vector3:
    """Three numbers."""
    x, y, z = numbers(element, name) or otherwise
    return (x, y, z)


def origin(element: Element) -> Pose:
    """Where an element is, in the frame of what it belongs to."""
    stated = element.find("origin")
    rpy = vector(stated, "rpy", geometry.ZERO)
    return Pose(vector(stated, "xyz", geometry.ZERO), geometry.quaternion_from_rpy(*rpy))


def axis(joint: Element) -> Vector3:
    """The direction that a joint turns about or slides along, of unit length; x where there is none."""
    x, y, z = vector(joint.find("axis"), "xyz", (1.0, 0.0, 0.0))
    # Of the largest part first: squares of small ones would vanish.
    largest = max(abs(x), abs(y), abs(z)) or 1.0
    x, y, z = x / largest, y / largest, z / largest
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length) if length else (1.0, 0.0, 0.0)


def parent_of(joint: Element) -> str:
    """The link that a joint hangs on."""
    return _link(joint, "parent")


def child_of(joint: Element) -> str:
    """The link that hangs on a joint."""
    return _link(joint, "child")


def _link(joint: Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")
