"""Keys that several drives have."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Final

from pydantic import Field

from sim_action.core import units
from sim_action.core.field_types import PositiveMetres, PositiveNewtonMetres, Radians
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive
from sim_action.robot.robot_model import RobotModel

WheelRadius = Annotated[PositiveMetres | None, Field(description="of a wheel; left out: read from the model")]

MotorTorque = Annotated[
    PositiveNewtonMetres | None, Field(description="limit of a wheel's motor; left out: the joint's own limit")
]

Heading = Annotated[
    Radians | None,
    Field(description="of forward, from the base's x axis to the left; left out: as the wheels in the model roll"),
]

LEAST_LENGTH: Final = 1e-6
"""In m. Wheels of less would be asked to turn at speeds that are no numbers."""

_MOST_LENGTH: Final = 1e3

# In rad, from one limit to the other: exporters write such as 1e9 for what turns for ever.
_FOR_EVER: Final = 1e5

# As a share of a limit: speeds that are meant to be the limit differ from it by rounding.
_ROUNDING: Final = 1e-6

# In degrees: a file's digits of pi are off by less.
_PLAIN: Final = 0.05


class WheelSpeeds:
    """Holds the wheels of a drive to what their motors can, all by the same share: the curve stays as it was asked for.

    Attributes:
        notes: for people; the first time that a twist asked for more.
    """

    def __init__(self, model: RobotModel, wheels: Iterable[str]) -> None:
        limits = {name: model.joints_by_name[name].max_velocity for name in wheels}
        self._limits = {name: limit for name, limit in limits.items() if limit is not None}
        self.notes: tuple[str, ...] = ()

    def share(self, asked: Mapping[str, float]) -> float:
        """The part of these speeds (joint -> rad/s) that every wheel can turn at; 1.0: all of it."""
        return self._least(asked)[0]

    def told_share(self, twist: Mapping[str, float]) -> float:
        """The same, of what a twist asks for, which is noted."""
        share, name = self._least(twist)
        if name and not self.notes:
            found, most = units.display_apart(abs(twist[name]), self._limits[name], "rad/s")
            limit = f"a twist asked joint '{name}' for {found}, and its limit in the model is {most}"
            self.notes = (f"{limit}: all wheels were slowed alike, and took the same curve",)
        return share

    def _least(self, asked: Mapping[str, float]) -> tuple[float, str]:
        """The share, and the wheel that has the least of all; no name if all can turn as fast as that."""
        shares = ((limit / abs(asked[name]), name) for name, limit in self._limits.items() if asked[name])
        share, name = min(shares, default=(1.0, ""))
        return (share, name) if share < 1 - _ROUNDING else (1.0, "")


def why_no_wheel(model: RobotModel, name: str) -> str | None:
    """What to say of a joint that no wheel turns about: engines drive it through its limits, for a while."""
    if (trouble := model.why_not_driven(name)) is not None:
        return trouble
    joint = model.joints_by_name[name]
    if joint.type == "prismatic":
        return f"joint '{name}' slides: a wheel turns about a joint that is 'continuous'"
    if joint.lower is None or joint.upper is None or not 0 <= joint.upper - joint.lower < _FOR_EVER:
        return None
    limits = f"{units.display(joint.lower, 'rad')} to {units.display(joint.upper, 'rad')}"
    return f"joint '{name}' has limits, {limits}: a wheel turns for ever, about a joint that is 'continuous'"


def joint_problems(model: RobotModel, key: str, names: Sequence[str]) -> SpecProblems:
    """Joints that cannot turn a wheel, each at its place below the drive's key."""
    for index, name in enumerate(names):
        if (trouble := why_no_wheel(model, name)) is not None:
            yield (key, index), trouble


def length_problems(drive: Drive, *keys: str) -> SpecProblems:
    """Lengths of a drive that are stated, and that nothing has."""
    for key in keys:
        length = getattr(drive, key) or 0
        if 0 < length < LEAST_LENGTH:
            yield (key,), f"must be at least {LEAST_LENGTH:g} m"
        elif length > _MOST_LENGTH:
            yield (key,), f"must be at most {_MOST_LENGTH:g} m"


def heading_text(heading: float) -> str:
    """What to say of a heading; nothing of one along the base's x axis."""
    degrees = math.degrees(heading)
    return f", heading {degrees:.4g} deg from the base's x axis" if abs(degrees) >= _PLAIN else ""


def radius_text(radii: Sequence[float]) -> str:
    """The radius of wheels in words, or their radii."""
    told = dict.fromkeys(f"{radius:.4g} m" for radius in radii)
    return f"wheel {'radius' if len(told) == 1 else 'radii'} {', '.join(told)}"


def torque_text(torque: float | None, model: RobotModel, names: Sequence[str]) -> str:
    """The limit of the motors of wheels in words; nothing without one."""
    limits = [torque] if torque is not None else [model.joints_by_name[name].max_effort for name in names]
    told = dict.fromkeys(units.display(limit, "N m") for limit in limits if limit)
    return f", torque {' and '.join(told)}" if told else ""


def remarked(figures: str, remarks: Sequence[str]) -> str:
    """A drive in words, with what has to be told of how a plugin's words were taken."""
    return "; ".join((figures, *remarks))


def ramp_towards(wanted: float, value: float, most: float) -> float:
    """The value after a step in which it changes by `most` at the most, on its way to what is wanted."""
    return value + max(-most, min(most, wanted - value))
