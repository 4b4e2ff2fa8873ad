"""Values in elements that the audit has found to hold them."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from sim_action import geometry
from sim_action.geometry import Pose, Vector3


def is_expression(text: str) -> bool:
    """Whether xacro was to put something else there."""
    return "${" in text or "$(" in text


def number(element: Element | None, name: str) -> float | None:
    """One number; None if the element or the attribute is not there, or was let go as an expression."""
    text = None if element is None else element.get(name)
    return None if text is None or is_expression(text) else float(text)


def vector(element: Element | None, name: str, otherwise: Vector3) -> Vector3:
    """Three numbers."""
    text = None if element is None else element.get(name)
    if text is None or is_expression(text):
        return otherwise
    x, y, z = map(float, text.split())
    return (x, y, z)


def origin(element: Element) -> Pose:
    """Where an element is, in the frame of what it belongs to."""
    stated = element.find("origin")
    rpy = vector(stated, "rpy", geometry.ZERO)
    return Pose(vector(stated, "xyz", geometry.ZERO), geometry.quaternion_from_rpy(*rpy))


def parent_of(joint: Element) -> str:
    """The link that a joint hangs on."""
    return _link(joint, "parent")


def child_of(joint: Element) -> str:
    """The link that hangs on a joint."""
    return _link(joint, "child")


def _link(joint: Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")
