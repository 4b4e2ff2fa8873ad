"""The fold of a robot's way against a path."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Final, Self

import numpy as np

from sim_action.assertions import State
from sim_action.assertions.fold import Goal, Invariant, joined
from sim_action.assertions.reference_path import Foot, Point, ReferencePath
from sim_action.core import units
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray, Trace

# How far along the path the robot may have come at most, as a share of what it moved and was away: as far as a corner
# that it cuts leads.
_PER_DISTANCE: Final = 2.0


@dataclass(frozen=True, slots=True)
class PathLimits:
    """What is asked, in m; None: nothing. `end` is the tolerance of the last point."""

    max_error: float | None = None
    rms: float | None = None
    end: float | None = None


@dataclass(frozen=True, slots=True)
class Progress:
    """How far along its path something has come.

    Attributes:
        place: where it is, in m.
        foot: where on the path that is.
    """

    path: ReferencePath
    place: Point
    foot: Foot

    @classmethod
    def at_start(cls, path: ReferencePath, place: Point) -> Self:
        """Before the first step."""
        return cls(path, place, Foot(0.0, math.dist(place, path.points[0])))

    def to(self, place: Point) -> Self:
        """After a step to a place."""
        along, distance = self.foot
        ahead = _PER_DISTANCE * (distance + math.dist(place, self.place))
        return type(self)(self.path, place, self.path.foot(place, along, min(along + ahead, self.path.length)))

    @property
    def remaining(self) -> float:
        """How far it is to the end in m: along the path, or straight if that is more."""
        return max(self.path.length - self.foot.along, math.dist(self.place, self.path.points[-1]))


@dataclass(frozen=True, slots=True)
class PathMonitor:
    """Follows the robot along its path until it has come to the end, if that is asked.

    Attributes:
        worst: the greatest error, at which `worst_along` m of the path were behind it.
        squares, moments: sum of the squares of all errors, in m^2, and how many they are.
        end: sim time in s of the last moment seen.
    """

    is_momentary: ClassVar[bool] = False

    limits: PathLimits
    progress: Progress
    goal: Goal = Goal()
    worst: Invariant = Invariant()
    worst_along: float = 0.0
    squares: float = 0.0
    moments: int = 0
    end: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        if self.limits.end is None:
            return self.worst.state
        # Once the end is reached, no moment comes that could mend the mean.
        is_over = self.goal.state is State.HOLDS and self.limits.rms is not None and self.mean_error > self.limits.rms
        return joined(self.worst.state, State.BROKEN if is_over else self.goal.state)

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""
        return self.state is State.BROKEN or self.goal.state is State.HOLDS

    def begin(self, trace: Trace) -> Self:
        """See Follower.begin: the robot moves on along the path, and is not judged."""
        progress = self.progress
        for x, y in trace.base_position_xyz[:, :2].tolist():
            progress = progress.to((x, y))
        return replace(self, progress=progress)

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if self.goal.state is State.HOLDS or not len(trace):
            return self
        way = self._way(trace)
        time, errors = trace.time[: len(way)], np.array([one.foot.distance for one in way])
        squares = self.squares
        for error in errors.tolist():
            squares += error * error
        later = replace(self, progress=way[-1], squares=squares, moments=self.moments + len(way), end=float(time[-1]))
        if self.limits.max_error is not None:
            later = later.with_worst(self.worst.observe(time, self.limits.max_error - errors), time, way)
        if self.limits.end is not None:
            remaining = np.array([one.remaining for one in way])
            later = replace(later, goal=self.goal.observe(time, self.limits.end - remaining))
        return later

    def with_worst(self, worst: Invariant, time: FloatArray, way: list[Progress]) -> Self:
        """The fold with the greatest error so far, which may be one of these moments."""
        if worst is self.worst:
            return self
        return replace(self, worst=worst, worst_along=way[int((time == worst.time).argmax())].foot.along)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: up to the moment at which the end is reached."""
        way, limits = self._way(trace), self.limits
        time, errors = trace.time[: len(way)], np.array([one.foot.distance for one in way])
        curves = [Signal("distance from the path", "m", time, errors, upper=limits.max_error)]
        if limits.end is not None:
            remaining = np.array([one.remaining for one in way])
            curves.append(Signal("distance to the end of the path", "m", time, remaining, upper=limits.end))
        if limits.rms is not None:
            moments = self.moments + np.arange(1, len(way) + 1)
            means = np.sqrt((self.squares + np.cumsum(errors * errors)) / moments)
            curves.append(Signal("RMS distance from the path", "m", time, means, upper=limits.rms).at_end())
        return tuple(curves)

    def verdict(self) -> Verdict:
        """What failed decides: an error that was too great, an end not reached, the mean; else what was asked first."""
        limits = self.limits
        if not self.moments:
            return Verdict(
                False, None, limits.max_error or limits.rms or limits.end, None, "m", None, "no moment to measure"
            )
        if limits.max_error is not None and self.worst.state is State.BROKEN:
            return self._of_error(limits.max_error)
        if limits.end is not None and self.goal.state is State.PENDING:
            return self._of_end(limits.end)
        if limits.rms is not None and (limits.max_error is None or self.mean_error > limits.rms):
            return self._of_mean(limits.rms)
        if limits.max_error is not None:
            return self._of_error(limits.max_error)
        return self._of_end(limits.end or 0.0)

    @property
    def mean_error(self) -> float:
        """The root mean square of the error so far, in m."""
        return math.sqrt(self.squares / self.moments)

    def _of_error(self, limit: float) -> Verdict:
        margin, time, passed = self.worst.margin, self.worst.time, self.worst.state is State.HOLDS
        assert margin is not None, "there were moments"
        error, allowed = units.display_apart(limit - margin, limit, "m")
        where = f"{error} off the path at {time:.2f} s, {units.display(self.worst_along, 'm')} along it"
        message = f"at most {where}, limit {allowed}" if passed else f"{where}, more than {allowed}"
        return Verdict(passed, limit - margin, limit, margin, "m", time, message)

    def _of_mean(self, limit: float) -> Verdict:
        passed = self.mean_error <= limit
        error, allowed = units.display_apart(self.mean_error, limit, "m")
        message = f"{error} off the path in the root mean square, {'limit' if passed else 'more than'} {allowed}"
        return Verdict(passed, self.mean_error, limit, limit - self.mean_error, "m", self.end, message)

    def _of_end(self, limit: float) -> Verdict:
        margin, time, passed = self.goal.margin, self.goal.time, self.goal.state is State.HOLDS
        assert margin is not None, "there were moments"
        length = units.display(self.progress.path.length, "m")
        short, _ = units.display_apart(limit - margin, limit, "m")
        message = (
            f"came to the end of the path, within {short}, in {time:.2f} s"
            if passed
            else f"came no nearer than {short} to the end of the path of {length}, by way of it, in {self.end:.1f} s; "
            f"nearest at {time:.2f} s"
        )
        return Verdict(passed, limit - margin, limit, margin, "m", time, message)

    def _way(self, trace: Trace) -> list[Progress]:
        """Of each moment, up to the one at which the end is reached."""
        progress, way = self.progress, []
        end = -math.inf if self.limits.end is None else self.limits.end
        for x, y in trace.base_position_xyz[:, :2].tolist():
            progress = progress.to((x, y))
            way.append(progress)
            if progress.remaining <= end:
                break
        return way
