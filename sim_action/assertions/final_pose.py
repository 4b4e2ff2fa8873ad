"""`final_pose: {x: 2 m, y: 0, yaw: 90 deg}`: where the robot is when the run is over."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.nearest import Nearest
from sim_action.core import units
from sim_action.core.field_types import Metres, PositiveMetres, PositiveRadians, Radians
from sim_action.core.geometry import Pose
from sim_action.state.verdict import Mark, goal, line
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class FinalPose(Assertion):
    """Where the base link is, and heads, when the run is over; or at `before`, if that is earlier.

    It neither ends a run nor keeps it going: a run is over at its `duration`, or once all goals of the scenario are
    met, where that is when the robot passes by. Ask for `settled`, or give a `duration`, to let it stop first. What is
    left out of `x`, `y`, `z` and `yaw` is free.
    """

    key: ClassVar[str] = "final_pose"

    x: Annotated[Metres | None, Field(description="left out: any")] = None
    y: Annotated[Metres | None, Field(description="left out: any")] = None
    z: Annotated[Metres | None, Field(description="left out: any")] = None
    yaw: Annotated[Radians | None, Field(description="left out: any heading")] = None
    tolerance: Annotated[PositiveMetres, Field(description="distance from the place")] = 0.05
    yaw_tolerance: PositiveRadians = math.radians(5)
    relative: Annotated[
        bool, Field(description="to where it stood at first, x being ahead and y to the left; else in the world frame")
    ] = False

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        if not self.place and self.yaw is None:
            raise ValueError("give at least one of 'x', 'y', 'z' and 'yaw'")
        return self

    @property
    def place(self) -> dict[str, float]:
        """Axis -> coordinate, of those that were given."""
        given = {"x": self.x, "y": self.y, "z": self.z}
        return {axis: value for axis, value in given.items() if value is not None}

    @property
    def place_text(self) -> str:
        """Such as "(2, 0)", or "x = 2 m"; empty if it may be anywhere."""
        if "x" in self.place and "y" in self.place:
            return f"({', '.join(f'{value:g}' for value in self.place.values())})"
        return ", ".join(f"{axis} = {units.display(value, 'm')}" for axis, value in self.place.items())

    @property
    def title(self) -> str:
        """See Assertion.title."""
        facing = "" if self.yaw is None else f"facing {units.display(self.yaw, 'rad')}"
        within = f"within {units.display(self.tolerance, 'm')}" if self.place else ""
        parts = (self.key, self.place_text, facing, within, "from the start" if self.relative else "")
        return " ".join(filter(None, parts))

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.final_pose_monitor import FinalPoseMonitor

        nearest = Nearest("came", self.place_text, "m", self.tolerance, self.yaw_tolerance)
        return FinalPoseMonitor(self, start.pose if self.relative else Pose(), nearest)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks: the place, or a line if it has only x or y."""
        origin = start.pose if self.relative else Pose()
        begin_x, begin_y, _ = start.pose.position_xyz
        if self.x is None or self.y is None:
            axes = {} if self.relative else {"x": self.x, "y": self.y}
            return tuple(line(axis, at, (begin_x, begin_y)) for axis, at in axes.items() if at is not None)
        cosine, sine = math.cos(origin.yaw), math.sin(origin.yaw)
        x, y, z = origin.position_xyz
        x, y = x + cosine * self.x - sine * self.y, y + sine * self.x + cosine * self.y
        yaw = None if self.yaw is None else origin.yaw + self.yaw
        return tuple(goal(x, y, None if self.z is None else z + self.z, self.tolerance, yaw))
