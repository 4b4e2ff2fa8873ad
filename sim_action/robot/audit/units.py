"""Angles and ways that are far beyond what they can be in rad and m: in degrees and millimetres, most often."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from sim_action.core import geometry
from sim_action.robot.audit.shapes import LARGEST
from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import Finding
from sim_action.robot.values import number, vector

_TURN: Final = 6.3
"""In rad: 360 deg, rounded up as people do."""

_LIMITS: Final = {
    "revolute": ((20.0, 720.0), "rad, and a whole turn is 6.28 rad: is this in degrees"),
    "prismatic": ((LARGEST, 10_000.0), "m: is this in millimetres"),
}
"""Kind -> limits that no robot has in rad or m, and what to say; what is beyond stands for none."""


def angles(document: ModelDocument) -> Iterator[Finding]:
    """Nobody turns a part by more than a whole turn."""
    for origin in document.elements("joint/origin", "link/collision/origin", "link/inertial/origin"):
        largest = max(map(abs, vector(origin, "rpy", geometry.ZERO)))
        if largest > _TURN:
            message = f"an <origin> turned by {largest:g} rad, more than a whole turn: is this in degrees?"
            yield document.finding("odd-angle", origin, message)


def limits(document: ModelDocument) -> Iterator[Finding]:
    """Joints turn a few times, and slide as far as a house is long."""
    for joint in document.elements("joint"):
        limit, kind = joint.find("limit"), joint.attrib["type"]
        if limit is None or kind not in _LIMITS:
            continue
        (least, most), unit = _LIMITS[kind]
        farthest = max(abs(number(limit, name) or 0.0) for name in ("lower", "upper"))
        if least < farthest <= most:
            message = f"{kind} joint '{joint.attrib['name']}' goes as far as {farthest:g} {unit}?"
            yield document.finding("odd-limits", limit, message)
