"""Values in elements: what URDF calls them, and how they are read once the audit has found them to be there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3

MOMENTS: Final = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Attributes of <inertia>."""

SHAPES: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "box": ("size",),
        "sphere": ("radius",),
        "cylinder": ("radius", "length"),
        "capsule": ("radius", "length"),
    }
)
"""Shapes that are no meshes -> their attributes."""

CONTACT: Final = (
    "lateral_friction",
    "rolling_friction",
    "spinning_friction",
    "restitution",
    "contact_cfm",
    "contact_erp",
    "stiffness",
    "damping",
)
"""Of Bullet's <contact>, which is no part of URDF; beside its inertia_scaling."""

UNLIMITED: Final = 1e16
"""What exporters write, and SDF before 1.9 has, for a limit that is none; from there on SDF has infinity."""

MOST: Final = 1e18
"""Of any number: squares of what is larger overflow."""


def is_expression(text: str) -> bool:
    """Whether xacro was to put something else there."""
    return "${" in text or "$(" in text


def is_numbers(text: str, count: int) -> bool:
    """Whether a text is so many numbers that are not too large, with white space between them."""
    words = text.split()
    # Python reads digits of every script, and underscores between them; no engine does.
    if len(words) != count or not text.isascii() or "_" in text:
        return False
    try:
        return all(abs(float(word)) <= MOST for word in words)  # a NaN is not
    except ValueError:
        return False


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


def limits(joint: Element) -> tuple[float | None, float | None]:
    """How far a joint goes down and up, in rad, or m; None where nothing stops it.

    If one of the two is left out, it is URDF's 0; both left out were let go, and are none.
    """
    limit = joint.find("limit")
    lower, upper = number(limit, "lower"), number(limit, "upper")
    if joint.get("type") == "continuous" or (lower, upper) == (None, None):
        return None, None
    lower, upper = lower or 0.0, upper or 0.0
    return (lower if lower > -UNLIMITED else None), (upper if upper < UNLIMITED else None)


def parent_of(joint: Element) -> str:
    """The link that a joint hangs on."""
    return _link(joint, "parent")


def child_of(joint: Element) -> str:
    """The link that hangs on a joint."""
    return _link(joint, "child")


def _link(joint: Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")
