"""Where forward is for wheels, and where they are and which way they turn, seen that way.

Forward is the base's x axis (REP 103) unless the wheels roll another way: r2d2 of `pybullet_data` rolls along its y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives.wheels import Wheel

# Of a unit vector: from here on, an axle is not level, or does not lie across the heading.
_NO_AXLE: Final = 0.5
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Rolling:
    """A wheel as its drive sees it.

    Attributes:
        joint: the joint that turns it.
        ahead, left: m, of the base's origin.
        turns: 1 if it rolls forward when its joint turns forward, -1 if its axis points the other way.
    """

    joint: str
    ahead: float
    left: float
    turns: float


def heading_of(wheels: Sequence[Wheel], left: Sequence[Wheel] = (), right: Sequence[Wheel] = ()) -> float:
    """Which way wheels roll, in rad from the base's x axis: with `left` on their left, or else the nearer to x."""
    x, y = _along_axles(wheels)
    length = math.hypot(x, y)
    if length < _ROUNDING:
        return 0.0
    x, y = x / length, y / length
    to_left = _lateral(x, y, left) - _lateral(x, y, right) if left and right else 0.0
    has_sides = abs(to_left) > _ROUNDING
    is_backward = to_left < 0 if has_sides else x < -_ROUNDING or (x <= _ROUNDING and y < 0)
    return (math.atan2(-y, -x) if is_backward else math.atan2(y, x)) + 0.0


def turned_forward(wheels: Sequence[Wheel]) -> float | None:
    """Which way wheels roll while all their joints turn forward, in rad as `heading_of`; None if against each other."""
    x = sum(wheel.axis_xyz[1] for wheel in wheels)
    y = -sum(wheel.axis_xyz[0] for wheel in wheels)
    # Rounded, as it is told to be pasted.
    return round(math.atan2(y, x), 9) + 0.0 if math.hypot(x, y) > _NO_AXLE * len(wheels) else None


def rolling(wheel: Wheel, heading: float) -> Rolling:
    """A wheel, seen in the direction in which its drive goes."""
    cosine, sine = math.cos(heading), math.sin(heading)
    x, y, _ = wheel.position_xyz
    turns = math.copysign(1.0, _rolls_along(wheel, heading))
    return Rolling(wheel.joint, cosine * x + sine * y, cosine * y - sine * x, turns)


def along(heading: float, ahead: float, left: float) -> tuple[float, float]:
    """What is so far ahead and to the left, along the axes of the base."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return cosine * ahead - sine * left, sine * ahead + cosine * left


def axle_problems(wheel: Wheel, heading: float) -> SpecProblems:
    """A joint that would not roll a wheel forward."""
    if abs(wheel.axis_xyz[2]) > _NO_AXLE:
        yield (), f"joint '{wheel.joint}' turns about an upright axis in the model: it rolls nothing"
    elif abs(_rolls_along(wheel, heading)) < _NO_AXLE:
        yield (), f"the wheel at '{wheel.joint}' rolls across the others; 'heading' says where forward is"


def _rolls_along(wheel: Wheel, heading: float) -> float:
    x, y, _ = wheel.axis_xyz
    # A wheel that turns about y rolls along x.
    return math.cos(heading) * y - math.sin(heading) * x


def _along_axles(wheels: Sequence[Wheel]) -> tuple[float, float]:
    """The sum of the directions in which wheels roll, all turned the way of the first."""
    first_x, first_y = wheels[0].axis_xyz[1], -wheels[0].axis_xyz[0]
    total_x = total_y = 0.0
    for wheel in wheels:
        x, y = wheel.axis_xyz[1], -wheel.axis_xyz[0]
        way = math.copysign(1.0, x * first_x + y * first_y)
        total_x, total_y = total_x + way * x, total_y + way * y
    return total_x, total_y


def _lateral(x: float, y: float, wheels: Sequence[Wheel]) -> float:
    """How far left of the direction (x, y) wheels are in the mean, in m."""
    return sum(x * wheel.position_xyz[1] - y * wheel.position_xyz[0] for wheel in wheels) / len(wheels)
