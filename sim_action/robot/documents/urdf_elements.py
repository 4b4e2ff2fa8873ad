"""Read values of URDF elements after the audit: numbers, poses, limits, and the supported parts of <gazebo> tags.

Supported in <gazebo> are contact coefficients, springs, <static> and plugins (classic.gazebosim.org, "URDF in Gazebo").
Numbers in <gazebo> are text, or an attribute `value`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location
from sim_action.core.geometry import Vector3
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.robot_model import Plugin, Surface

LENGTHS: Final = {"size": 3}  # attribute of a shape -> the count of its numbers; others have one

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
"""Elements of Bullet's <contact>, an extension of URDF, without inertia_scaling."""

MAX_NUMBER: Final = 1e18  # the largest number that is accepted: squares of larger numbers overflow
NUMBERS: Final = ("mu1", "mu2", "kp", "kd")  # the numbers that are read from the <gazebo> tag of a link

# Gazebo copies <collision> of a <gazebo> tag into each collision of the link.
_IN_SURFACE: Final[Mapping[str, str]] = {
    "mu1": "collision/surface/friction/ode/mu",
    "mu2": "collision/surface/friction/ode/mu2",
    "kp": "collision/surface/contact/ode/kp",
    "kd": "collision/surface/contact/ode/kd",
}

SPRING: Final = ("springStiffness", "springReference")  # the numbers that are read from the <gazebo> tag of a joint

# Gazebo uses the smaller of two coefficients, the engines their product: equal on a ground of 1 if none exceeds 1.
_MAX_FRICTION: Final = 1.0


def is_expression(text: str) -> bool:
    """Return True if a text contains a xacro expression."""
    return "${" in text or "$(" in text


def is_numbers(text: str, count: int) -> bool:
    """Return True if a text is `count` numbers that are not too large, separated by white space."""
    words = text.split()
    # Python accepts digits of every script, and underscores between digits; engines do not.
    if len(words) != count or not text.isascii() or "_" in text:
        return False
    try:
        return all(abs(float(word)) <= MAX_NUMBER for word in words)  # False for NaN
    except ValueError:
        return False


def numbers(element: Element | None, name: str) -> tuple[float, ...] | None:
    """Return the numbers of an attribute; None if element or attribute is missing, or an accepted xacro expression."""
    text = None if element is None else element.get(name)
    return None if text is None or is_expression(text) else tuple(map(float, text.split()))


def number(element: Element | None, name: str) -> float | None:
    """Return the number of an attribute; None as in `numbers`."""
    parsed = numbers(element, name)
    return parsed[0] if parsed else None


def vector(element: Element | None, name: str) -> Vector3 | None:
    """Return the three numbers of an attribute; None as in `numbers`."""
    parsed = numbers(element, name)
    return None if parsed is None else (parsed[0], parsed[1], parsed[2])


def parent_of(joint: Element) -> str:
    """Return the parent link of a joint."""
    return _link(joint, "parent")


def child_of(joint: Element) -> str:
    """Return the child link of a joint."""
    return _link(joint, "child")


def _link(joint: Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def surface_of(document: ModelDocument, link: Element) -> Surface:
    """Return the contact surface of a link, from Bullet's <contact> and from <gazebo reference=...>, which wins."""
    friction, stiffness, damping, rolling, spinning = (
        number(link.find(f"contact/{tag}"), "value")
        for tag in ("lateral_friction", "stiffness", "damping", "rolling_friction", "spinning_friction")
    )
    for tag in tags_of(document, link.attrib["name"]):
        mu1, mu2, kp, kd = (_number(tag, name) for name in NUMBERS)
        mu = mu2 if mu1 is None else mu1
        friction = friction if mu is None else min(mu, _MAX_FRICTION)
        stiffness, damping = kp or stiffness, damping if kd is None else kd
    # Models write a stiffness of 0 for "not specified".
    stated = {"friction": friction, "stiffness": stiffness or None, "damping": damping}
    stated |= {"rolling": rolling, "spinning": spinning}
    return Surface(**{name: value for name, value in stated.items() if value is not None})


def spring_of(document: ModelDocument, joint: Element) -> tuple[float, float]:
    """Return stiffness and rest position of a joint's spring, from <dynamics> or Gazebo's tags; or 0 and 0."""
    dynamics = joint.find("dynamics")
    stiffness, reference = (number(dynamics, name) for name in ("spring_stiffness", "spring_reference"))
    for tag in tags_of(document, joint.attrib["name"]):
        stated, at = (_number(tag, name) for name in SPRING)
        stiffness, reference = stated or stiffness, reference if at is None else at
    return (stiffness, reference or 0.0) if stiffness else (0.0, 0.0)


def tags_of(document: ModelDocument, name: str) -> Iterator[Element]:
    """Return the <gazebo> tags of a link or a joint."""
    return (tag for tag in document.elements("gazebo") if tag.get("reference") == name)


def number_text(tag: Element, name: str) -> str | None:
    """Return the text of a number in a <gazebo> tag; None if it is missing."""
    element = tag.find(name)
    if element is None and name in _IN_SURFACE:
        element = tag.find(_IN_SURFACE[name])
    return None if element is None else element.get("value", element.text or "").strip()


def flag(text: str) -> bool:
    """Return the flag in a <gazebo> tag, as Gazebo reads it."""
    return text.lower() in {"true", "yes", "1"}


def plugins_of(document: ModelDocument) -> tuple[Plugin, ...]:
    """Return the plugins that the model asks Gazebo to load."""
    return tuple(plugin_of(element, document.places.get(element)) for element in document.elements("gazebo/plugin"))


def _number(tag: Element, name: str) -> float | None:
    text = number_text(tag, name)
    return None if text is None or is_expression(text) else float(text)


def plugin_name(plugin: Element) -> str:
    """Return the file of a plugin, without "lib" and ".so"."""
    return PurePath(plugin.get("filename", "")).name.removesuffix(".so").removeprefix("lib")


def plugin_of(element: Element, place: Location | None) -> Plugin:
    """Return the plugin of an element that stands at a place."""
    parameters = tuple((child.tag, (child.text or "").strip()) for child in element)
    return Plugin(plugin_name(element), parameters, element.get("name", ""), place)
