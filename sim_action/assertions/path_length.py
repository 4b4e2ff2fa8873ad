"""`path_length: {at_most: 3 m}`: the distance that the robot travels along its path."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Bounds
from sim_action.assertions.travel import LengthBounds
from sim_action.core.geometry import Vector3
from sim_action.state.verdict import Signal
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict


class PathLength(LengthBounds):
    """The length of the driven path reaches `at_least`, or never exceeds `at_most`.

    It is the length of the path of the base link in space since `after`, summed over every physics step.
    """

    key: ClassVar[str] = "path_length"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        bounds = Bounds("covered", "m", self.at_least, self.at_most)
        return PathLengthMonitor(bounds, start.pose.position_xyz)


@dataclass(frozen=True, slots=True)
class PathLengthMonitor:
    """The fold of the arc length so far, and the last position."""

    is_momentary: ClassVar[bool] = False

    bounds: Bounds
    position_xyz: Vector3
    length: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.bounds.state

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        return self.bounds.is_decided

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin. The path before the window does not count."""
        return replace(self, position_xyz=_last_position(trace)) if len(trace) else self

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        lengths = trace.arc_length_from(self.position_xyz, self.length)
        bounds = self.bounds.observe(trace.time, lengths)
        return replace(self, bounds=bounds, position_xyz=_last_position(trace), length=float(lengths[-1]))

    def truth(self, trace: Trace) -> Truth:
        """See ConditionMonitor.truth."""
        return self.bounds.truth(trace.time, trace.arc_length_from(self.position_xyz, self.length))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See PlottableMonitor.signals."""
        lengths = trace.arc_length_from(self.position_xyz, self.length)
        return (self.bounds.drawn("path length", trace.time, lengths),)

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        return self.bounds.verdict()


def _last_position(trace: Trace) -> Vector3:
    x, y, z = trace.base_position_xyz[-1].tolist()
    return (x, y, z)
