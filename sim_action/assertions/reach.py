"""`reach: {x: 2 m, y: 0}`: the robot comes to a point, and may have to face somewhere there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field

from sim_action import units
from sim_action.assertions import Assertion, Monitor, State
from sim_action.assertions.fold import Goal
from sim_action.observation import Observation
from sim_action.quantities import Metres, PositiveMetres, PositiveRadians, Radians
from sim_action.scene import Scene
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.trace import FloatArray, Trace


class Reach(Assertion):
    """A goal: the base link's origin is within `tolerance` of a point, and heads within `yaw_tolerance` of `yaw`."""

    key: ClassVar[str] = "reach"

    x: Annotated[Metres, Field(description="in the world frame")]
    y: Annotated[Metres, Field(description="in the world frame")]
    z: Annotated[Metres | None, Field(description="left out: any height")] = None
    yaw: Annotated[Radians | None, Field(description="left out: any heading")] = None
    tolerance: PositiveMetres = 0.05
    yaw_tolerance: PositiveRadians = math.radians(5)

    @property
    def title(self) -> str:
        """See Assertion.title."""
        heading = "" if self.yaw is None else f" facing {units.display(self.yaw, 'rad')}"
        return f"reach {self.place}{heading} within {units.display(self.tolerance, 'm')}"

    @property
    def place(self) -> str:
        """The point, for messages."""
        return f"({', '.join(f'{value:g}' for value in (self.x, self.y, self.z) if value is not None)})"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return ReachMonitor(self)


@dataclass(frozen=True, slots=True)
class ReachMonitor:
    """Folds the worse of both errors, as a part of its tolerance; keeps what they were at the best moment."""

    spec: Reach
    goal: Goal = Goal()
    distance: float = math.inf
    yaw_error: float = 0.0
    end: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.goal.state

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        distance, yaw_error = self._distance(trace), self._yaw_error(trace)
        margin = self.spec.tolerance - distance
        if yaw_error is not None:
            scale = self.spec.tolerance / self.spec.yaw_tolerance
            margin = margin.clip(max=(self.spec.yaw_tolerance - yaw_error) * scale)
        later = replace(self, goal=self.goal.observe(trace.time, margin), end=float(trace.time[-1]))
        if later.goal is self.goal:
            return later
        best = int((trace.time == later.goal.time).argmax())
        error = 0.0 if yaw_error is None else float(yaw_error[best])
        return replace(later, distance=float(distance[best]), yaw_error=error)

    def verdict(self) -> Verdict:
        """Measured and limit are distances; the margin also accounts for the heading."""
        spec, passed = self.spec, self.state is State.HOLDS
        if self.goal.time is None:
            return Verdict(False, None, spec.tolerance, None, "m", None, "no moment to measure")
        # Apart from the tolerances, which the title of the expectation shows beside the message.
        near, _ = units.display_apart(self.distance, spec.tolerance, "m")
        off, _ = units.display_apart(self.yaw_error, spec.yaw_tolerance, "rad")
        facing = "" if spec.yaw is None else f", {off} off its heading,"
        message = (
            f"came within {near} of {spec.place}{facing} in {self.goal.time:.2f} s"
            if passed
            else f"came no nearer than {near} to {spec.place}{facing} in {self.end:.1f} s; nearest at "
            f"{self.goal.time:.2f} s"
        )
        return Verdict(passed, self.distance, spec.tolerance, self.goal.margin, "m", self.goal.time, message)

    def _distance(self, trace: Trace) -> FloatArray:
        if self.spec.z is None:
            return trace.planar_distance_to(self.spec.x, self.spec.y)
        return trace.distance_to((self.spec.x, self.spec.y, self.spec.z))

    def _yaw_error(self, trace: Trace) -> FloatArray | None:
        return None if self.spec.yaw is None else trace.yaw_error_to(self.spec.yaw)
