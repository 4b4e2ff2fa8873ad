"""`final_pose: {x: 2 m, y: 0, yaw: 90 deg}`: the pose of the robot at the end of the run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.goals import ClosestApproach
from sim_action.core import units
from sim_action.core.field_types import Metres, PositiveMetres, PositiveRadians, Radians
from sim_action.core.geometry import Pose
from sim_action.state.verdict import Mark, Signal, Verdict, goal, line
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import FloatArray, Trace


class FinalPose(Assertion):
    """At the end of the run, the base link is at `x`, `y`, `z` with the heading `yaw`, within tolerances.

    The pose is checked at the end of the run, or at `before` if that is earlier. It neither ends a run nor prolongs it.
    A run ends at its `duration`, or as soon as all goals of the scenario are met; the robot may still be moving then.
    To let it stop first, add `settled` or a `duration`. Any of `x`, `y`, `z` and `yaw` may be omitted; then it is not
    checked.
    """

    key: ClassVar[str] = "final_pose"

    x: Annotated[Metres | None, Field(description="default: any")] = None
    y: Annotated[Metres | None, Field(description="default: any")] = None
    z: Annotated[Metres | None, Field(description="default: any")] = None
    yaw: Annotated[Radians | None, Field(description="default: any heading")] = None
    tolerance: Annotated[PositiveMetres, Field(description="maximum distance from the place")] = 0.05
    yaw_tolerance: PositiveRadians = math.radians(5)
    relative: Annotated[
        bool, Field(description="relative to the start pose (x ahead, y to the left); else in the world frame")
    ] = False

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        if not self.place and self.yaw is None:
            raise ValueError("give at least one of 'x', 'y', 'z' and 'yaw'")
        return self

    @property
    def place(self) -> dict[str, float]:
        """The given coordinates, by axis."""
        given = {"x": self.x, "y": self.y, "z": self.z}
        return {axis: value for axis, value in given.items() if value is not None}

    @property
    def place_text(self) -> str:
        """The place as text, such as "(2, 0)" or "x = 2 m"; empty if no coordinate is given."""
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
        nearest = ClosestApproach("came", self.place_text, "m", self.tolerance, self.yaw_tolerance)
        return FinalPoseMonitor(self, start.pose if self.relative else Pose(), nearest)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks. Returns the place, or a line if only x or y is given."""
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


@dataclass(frozen=True, slots=True)
class FinalPoseMonitor:
    """The monitor of the pose at the last step, and of the closest approach before it.

    Attributes:
        origin: pose of the frame of the place, in the world.
        distance, yaw_error: errors at the last step in m and rad; 0 where nothing is required.
        end: sim time of the last step, in s.
    """

    is_momentary: ClassVar[bool] = True

    spec: FinalPose
    origin: Pose
    nearest: ClosestApproach
    distance: float = 0.0
    yaw_error: float = 0.0
    end: float | None = None

    @property
    def state(self) -> State:
        """See Monitor.state. It stays open until the end, because the pose may still change."""
        return State.HOLDS

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        distance, yaw_error = self._distance(trace), self._yaw_error(trace)
        return replace(
            self,
            nearest=self.nearest.observe(trace.time, distance, yaw_error),
            distance=float(distance[-1]),
            yaw_error=float(yaw_error[-1]),
            end=float(trace.time[-1]),
        )

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See PlottableMonitor.signals."""
        name = f"distance to {self.spec.place_text}"
        yaw_error = None if self.spec.yaw is None else self._yaw_error(trace)
        curves = self.nearest.drawn(name, trace.time, self._distance(trace), yaw_error)
        return tuple(curve.at_end() for curve in (curves if self.spec.place else curves[1:]))

    def verdict(self) -> Verdict:
        """Return the verdict on distance or heading, whichever is worse relative to its tolerance."""
        spec = self.spec
        errors = [(self.distance, spec.tolerance, "m")] if spec.place else []
        errors += [] if spec.yaw is None else [(self.yaw_error, spec.yaw_tolerance, "rad")]
        error, limit, unit = max(errors, key=lambda error: error[0] / error[1])
        if self.end is None:
            return Verdict(False, None, limit, None, unit, None, "no physics step to measure")
        passed = error <= limit
        message = f"ended {self._errors()} at {self.end:.2f} s{'' if passed else self._before()}"
        return Verdict(passed, error, limit, limit - error, unit, self.end, message)

    def _errors(self) -> str:
        near, _ = units.display_apart(self.distance, self.spec.tolerance, "m")
        off, _ = units.display_apart(self.yaw_error, self.spec.yaw_tolerance, "rad")
        where = [f"{near} from {self.spec.place_text}"] if self.spec.place else []
        return ", ".join(where + ([] if self.spec.yaw is None else [f"{off} off its heading"]))

    def _before(self) -> str:
        """Return the part of the message on the closest approach: overshoot or shortfall."""
        nearest = self.nearest
        if (nearest.distance, nearest.yaw_error) == (self.distance, self.yaw_error):
            return ""
        return (
            f"; it was {'within tolerance' if nearest.state is State.HOLDS else 'closest'} at {nearest.goal.time:.2f} s"
        )

    def _distance(self, trace: Trace) -> FloatArray:
        """Return (T,) m, over the given axes, in the frame of `origin`."""
        import numpy as np

        from_origin = trace.base_position_xyz - np.asarray(self.origin.position_xyz)
        cosine, sine = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        x, y, z = from_origin.T
        axes = {"x": cosine * x + sine * y, "y": cosine * y - sine * x, "z": z}
        squares = [(axes[axis] - value) ** 2 for axis, value in self.spec.place.items()]
        return np.asarray(np.sqrt(sum(squares, np.zeros(len(trace)))), dtype=np.float64)

    def _yaw_error(self, trace: Trace) -> FloatArray:
        import numpy as np

        return np.zeros(len(trace)) if self.spec.yaw is None else trace.yaw_error_to(self.origin.yaw + self.spec.yaw)
