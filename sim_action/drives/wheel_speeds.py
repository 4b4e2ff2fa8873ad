"""How fast wheels can turn, by the limits of their joints in the model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from sim_action.core import units
from sim_action.robot.robot_model import RobotModel

# As a share of a limit: speeds that are meant to be the limit differ from it by rounding.
_ROUNDING: Final = 1e-6


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
