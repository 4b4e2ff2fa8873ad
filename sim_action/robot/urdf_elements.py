"""Values in elements: what URDF calls them, and how they are read once the audit has found them to be there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import PurePath
from types import MappingProxyType
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.robot.robot_model import Plugin, Surface
from sim_action.robot.xml_document import ModelDocument

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


NUMBERS: Final = ("mu1", "mu2", "kp", "kd")
"""Tags of a link that are read."""

# There the lesser of two coefficients counts, here their product: on a ground of 1, the same once 1 is the most.
_MOST_FRICTION: Final = 1.0


def surface_of(document: ModelDocument, link: Element) -> Surface:
    """How a link touches: by the <contact> that Bullet knows in it, and by <gazebo reference=...>, which wins."""
    friction, stiffness, damping = (
        number(link.find(f"contact/{tag}"), "value") for tag in ("lateral_friction", "stiffness", "damping")
    )
    for tag in tags_of(document, link.attrib["name"]):
        mu1, mu2, kp, kd = (_number(tag, name) for name in NUMBERS)
        mu = mu2 if mu1 is None else mu1
        friction = friction if mu is None else min(mu, _MOST_FRICTION)
        stiffness, damping = kp or stiffness, damping if kd is None else kd
    # A stiffness of 0 carries nothing: it is how models leave it open.
    stated = {"friction": friction, "stiffness": stiffness or None, "damping": damping}
    return Surface(**{name: value for name, value in stated.items() if value is not None})


def tags_of(document: ModelDocument, name: str) -> Iterator[Element]:
    """The <gazebo> tags of a link or a joint."""
    return (tag for tag in document.elements("gazebo") if tag.get("reference") == name)


def number_text(tag: Element, name: str) -> str | None:
    """What stands where a number is due; None if nothing does."""
    element = tag.find(name)
    return None if element is None else element.get("value", element.text or "").strip()


def plugins_of(document: ModelDocument) -> tuple[Plugin, ...]:
    """All that the model asks a simulator to load."""
    return tuple(map(_plugin, document.elements("gazebo/plugin")))


def _number(tag: Element, name: str) -> float | None:
    text = number_text(tag, name)
    return None if text is None or is_expression(text) else float(text)


def _plugin(element: Element) -> Plugin:
    file = PurePath(element.get("filename", "")).name.removesuffix(".so").removeprefix("lib")
    return Plugin(file, tuple((child.tag, (child.text or "").strip()) for child in element))
