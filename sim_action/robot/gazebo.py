"""What <gazebo> tags say that counts here: how links touch, and plugins (classic.gazebosim.org, "URDF in Gazebo").

All else in them passes unread. Numbers stand in them as text, or as an attribute `value`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePath
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import Plugin, Surface
from sim_action.robot.values import is_expression, number

NUMBERS: Final = ("mu1", "mu2", "kp", "kd")
"""Tags of a link that are read."""

# There the lesser of two coefficients counts, here their product: on a ground of 1, the same once 1 is the most.
_MOST_FRICTION: Final = 1.0


def surface(document: ModelDocument, link: Element) -> Surface:
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


def plugins(document: ModelDocument) -> tuple[Plugin, ...]:
    """All that the model asks a simulator to load."""
    return tuple(map(_plugin, document.elements("gazebo/plugin")))


def _number(tag: Element, name: str) -> float | None:
    text = number_text(tag, name)
    return None if text is None or is_expression(text) else float(text)


def _plugin(element: Element) -> Plugin:
    file = PurePath(element.get("filename", "")).name.removesuffix(".so").removeprefix("lib")
    return Plugin(file, tuple((child.tag, (child.text or "").strip()) for child in element))
