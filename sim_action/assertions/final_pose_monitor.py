"""Where the robot is, moment by moment: what the monitor of `final_pose` does."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from sim_action.assertions import State
from sim_action.assertions.nearest import Nearest
from sim_action.core import units
from sim_action.core.geometry import Pose
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.assertions.final_pose import FinalPose
    from sim_action.state.trace import FloatArray, Trace


@dataclass(frozen=True, slots=True)
class FinalPoseMonitor:
    """Knows the last moment, and how near the robot had come before.

    Attributes:
        origin: of the frame that the place is in.
        distance, yaw_error: m and rad, at the last moment; 0 where any is right.
        end: s of sim time.
    """

    is_momentary: ClassVar[bool] = True

    spec: FinalPose
    origin: Pose
    nearest: Nearest
    distance: float = 0.0
    yaw_error: float = 0.0
    end: float | None = None

    @property
    def state(self) -> State:
        """Where the robot is now says nothing of where it will be."""
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
        """See Drawn.signals."""
        name = f"distance to {self.spec.place_text}"
        yaw_error = None if self.spec.yaw is None else self._yaw_error(trace)
        curves = self.nearest.drawn(name, trace.time, self._distance(trace), yaw_error)
        return tuple(curve.at_end() for curve in (curves if self.spec.place else curves[1:]))

    def verdict(self) -> Verdict:
        """Of distance and heading, the one that is worse as a part of its tolerance."""
        spec = self.spec
        errors = [(self.distance, spec.tolerance, "m")] if spec.place else []
        errors += [] if spec.yaw is None else [(self.yaw_error, spec.yaw_tolerance, "rad")]
        error, limit, unit = max(errors, key=lambda error: error[0] / error[1])
        if self.end is None:
            return Verdict(False, None, limit, None, unit, None, "no moment to measure")
        passed = error <= limit
        message = f"ended {self._errors()} at {self.end:.2f} s{'' if passed else self._before()}"
        return Verdict(passed, error, limit, limit - error, unit, self.end, message)

    def _errors(self) -> str:
        near, _ = units.display_apart(self.distance, self.spec.tolerance, "m")
        off, _ = units.display_apart(self.yaw_error, self.spec.yaw_tolerance, "rad")
        where = [f"{near} from {self.spec.place_text}"] if self.spec.place else []
        return ", ".join(where + ([] if self.spec.yaw is None else [f"{off} off its heading"]))

    def _before(self) -> str:
        """Whether it went too far, or not far enough."""
        nearest = self.nearest
        if (nearest.distance, nearest.yaw_error) == (self.distance, self.yaw_error):
            return ""
        return f"; it was {'there' if nearest.state is State.HOLDS else 'nearest'} at {nearest.goal.time:.2f} s"

    def _distance(self, trace: Trace) -> FloatArray:
        """Over the axes that were given, in the frame of `origin`."""
        from_origin = trace.base_position_xyz - np.asarray(self.origin.position_xyz)
        cosine, sine = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        x, y, z = from_origin.T
        axes = {"x": cosine * x + sine * y, "y": cosine * y - sine * x, "z": z}
        squares = [(axes[axis] - value) ** 2 for axis, value in self.spec.place.items()]
        return np.asarray(np.sqrt(sum(squares, np.zeros(len(trace)))), dtype=np.float64)

    def _yaw_error(self, trace: Trace) -> FloatArray:
        return np.zeros(len(trace)) if self.spec.yaw is None else trace.yaw_error_to(self.origin.yaw + self.spec.yaw)
