"""`reach: {x: 2 m, y: 0}`: the robot reaches a point, optionally with a heading."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.goals import ClosestApproach
from sim_action.core import units
from sim_action.core.field_types import Metres, PositiveMetres, PositiveRadians, Radians
from sim_action.state.verdict import Mark, Signal, goal
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import FloatArray, Trace
    from sim_action.state.verdict import Verdict


class Reach(Assertion):
    """The origin of the base link comes within `tolerance` of the point `x`, `y`, `z`.

    With `yaw`, the heading must be within `yaw_tolerance` of `yaw` at the same moment. Reaching the point is a goal.
    """

    key: ClassVar[str] = "reach"

    x: Annotated[Metres, Field(description="in the world frame")]
    y: Annotated[Metres, Field(description="in the world frame")]
    z: Annotated[Metres | None, Field(description="default: any height")] = None
    yaw: Annotated[Radians | None, Field(description="default: any heading")] = None
    tolerance: PositiveMetres = 0.05
    yaw_tolerance: PositiveRadians = math.radians(5)

    @property
    def is_goal(self) -> bool:
        """See Assertion.is_goal."""
        return True

    @property
    def has_truth(self) -> bool:
        """See Assertion.has_truth."""
        return True

    @property
    def title(self) -> str:
        """See Assertion.title."""
        heading = "" if self.yaw is None else f" facing {units.display(self.yaw, 'rad')}"
        return f"reach {self.place}{heading} within {units.display(self.tolerance, 'm')}"

    @property
    def place(self) -> str:
        """The point as text."""
        return f"({', '.join(f'{value:g}' for value in (self.x, self.y, self.z) if value is not None)})"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        nearest = ClosestApproach("came", self.place, "m", self.tolerance, self.yaw_tolerance)
        return ReachMonitor(self, nearest)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks."""
        return tuple(goal(self.x, self.y, self.z, self.tolerance, self.yaw))


@dataclass(frozen=True, slots=True)
class ReachMonitor:
    """The monitor of the distance from the point."""

    is_momentary: ClassVar[bool] = True

    spec: Reach
    nearest: ClosestApproach

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.nearest.state

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, nearest=self.nearest.observe(trace.time, *self._errors(trace)))

    def truth(self, trace: Trace) -> Truth:
        """See ConditionMonitor.truth."""
        return self.nearest.truth(trace.time, *self._errors(trace))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See PlottableMonitor.signals."""
        return self.nearest.drawn(f"distance to {self.spec.place}", trace.time, *self._errors(trace))

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        return self.nearest.verdict()

    def _errors(self, trace: Trace) -> tuple[FloatArray, FloatArray | None]:
        """Return (T,) m and (T,) rad; None instead of the heading error if no heading is required."""
        return self._distance(trace), None if self.spec.yaw is None else trace.yaw_error_to(self.spec.yaw)

    def _distance(self, trace: Trace) -> FloatArray:
        if self.spec.z is None:
            return trace.planar_distance_to(self.spec.x, self.spec.y)
        return trace.distance_to((self.spec.x, self.spec.y, self.spec.z))
