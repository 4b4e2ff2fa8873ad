"""Settings that several drives share: YAML keys, their checks, wheel speed limits and descriptions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Final

from pydantic import Field

from sim_action.core import units
from sim_action.core.field_types import PositiveMetres, PositiveNewtonMetres, Radians
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive
from sim_action.robot.model.robot_model import RobotModel

WheelRadius = Annotated[PositiveMetres | None, Field(description="radius of the wheels; default: read from the model")]

MotorTorque = Annotated[
    PositiveNewtonMetres | None, Field(description="torque limit of each wheel motor; default: the limit of its joint")
]

Heading = Annotated[
    Radians | None,
    Field(description="direction of forward from the base's x axis, positive to the left; default: that of the wheels"),
]

MIN_LENGTH_M: Final = 1e-6  # smaller wheels would need speeds that overflow
_MAX_LENGTH_M: Final = 1e3

# A joint with a range of this many rad counts as continuous: exporters write limits such as 1e9.
_CONTINUOUS_RANGE: Final = 1e5

_ROUNDING: Final = 1e-6  # relative tolerance: speeds equal to the limit differ from it by rounding
_MIN_SHOWN_DEG: Final = 0.05  # smaller headings come from rounded digits of pi in a file


class WheelSpeeds:
    """The speed limits of wheels. All wheels slow down by the same factor, so the curve keeps its shape.

    `notes`: a note on the first twist that exceeded a limit.
    """

    def __init__(self, model: RobotModel, wheels: Iterable[str]) -> None:
        limits = {name: model.joints_by_name[name].max_velocity for name in wheels}
        self._limits = {name: limit for name, limit in limits.items() if limit is not None}
        self.notes: tuple[str, ...] = ()

    def share(self, asked: Mapping[str, float]) -> float:
        """Return the factor for these speeds (joint -> rad/s) that keeps every wheel in its limit; at most 1.0."""
        return self._least(asked)[0]

    def told_share(self, twist: Mapping[str, float]) -> float:
        """Return the same factor for the speeds of a twist, and note a factor below 1."""
        share, name = self._least(twist)
        if name and not self.notes:
            found, most = units.display_apart(abs(twist[name]), self._limits[name], "rad/s")
            limit = f"a twist asked joint '{name}' for {found}, but its limit in the model is {most}"
            self.notes = (f"{limit}: all wheels were slowed by the same factor, so the curve is unchanged",)
        return share

    def _least(self, asked: Mapping[str, float]) -> tuple[float, str]:
        shares = ((limit / abs(asked[name]), name) for name, limit in self._limits.items() if asked[name])
        share, name = min(shares, default=(1.0, ""))
        return (share, name) if share < 1 - _ROUNDING else (1.0, "")


def why_no_wheel(model: RobotModel, name: str) -> str | None:
    """Return the reason why no wheel can turn about a joint, else None. Engines would ignore its limits at first."""
    if (trouble := model.why_not_driven(name)) is not None:
        return trouble
    joint = model.joints_by_name[name]
    if joint.type == "prismatic":
        return f"joint '{name}' slides: a wheel needs a 'continuous' joint"
    if joint.lower is None or joint.upper is None or not 0 <= joint.upper - joint.lower < _CONTINUOUS_RANGE:
        return None
    limits = f"{units.display(joint.lower, 'rad')} to {units.display(joint.upper, 'rad')}"
    return f"joint '{name}' has limits, {limits}: a wheel needs a 'continuous' joint"


def joint_problems(model: RobotModel, key: str, names: Sequence[str]) -> SpecProblems:
    """Yield joints that cannot turn a wheel, each with its place below the key of the drive."""
    for index, name in enumerate(names):
        if (trouble := why_no_wheel(model, name)) is not None:
            yield (key, index), trouble


def length_problems(drive: Drive, *keys: str) -> SpecProblems:
    """Yield stated lengths that are too small or too large."""
    for key in keys:
        length = getattr(drive, key) or 0
        if 0 < length < MIN_LENGTH_M:
            yield (key,), f"must be at least {MIN_LENGTH_M:g} m"
        elif length > _MAX_LENGTH_M:
            yield (key,), f"must be at most {_MAX_LENGTH_M:g} m"


def heading_text(heading: float) -> str:
    """Return a heading as text; empty for the base's x axis."""
    degrees = math.degrees(heading)
    return f", heading {degrees:.4g} deg from the base's x axis" if abs(degrees) >= _MIN_SHOWN_DEG else ""


def radius_text(radii: Sequence[float]) -> str:
    """Return wheel radii as text."""
    told = dict.fromkeys(f"{radius:.4g} m" for radius in radii)
    return f"wheel {'radius' if len(told) == 1 else 'radii'} {', '.join(told)}"


def torque_text(torque: float | None, model: RobotModel, names: Sequence[str]) -> str:
    """Return the torque limits of wheel motors as text; empty if there are none."""
    limits = [torque] if torque is not None else [model.joints_by_name[name].max_effort for name in names]
    told = dict.fromkeys(units.display(limit, "N m") for limit in limits if limit)
    return f", torque {' and '.join(told)}" if told else ""


def ramp_towards(wanted: float, value: float, most: float) -> float:
    """Return the value after one step towards `wanted`, changed by `most` at most."""
    # Called at every step of a ramp: comparisons are faster than `min` and `max`.
    change = wanted - value
    if change > most:
        change = most
    elif change < -most:
        change = -most
    return value + change
