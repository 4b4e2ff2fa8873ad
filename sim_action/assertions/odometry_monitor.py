"""The fold of what odometry tells against where the robot is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.assertions import State
from sim_action.assertions.fold import Invariant, joined
from sim_action.core import units
from sim_action.state.trace_records import SensorRecord
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import FloatArray, Trace

# In m: less of a way tells nothing of a drift.
_SHORTEST_WAY: Final = 1.0

# Sim time is step / rate: two ways to the same moment differ by rounding alone.
_SAME_TIME: Final = 1e-9

_NAMES: Final = {"position": "position error", "yaw": "heading error", "drift": "drift"}
_UNITS: Final = {"position": "m", "yaw": "rad", "drift": ""}


@dataclass(frozen=True, slots=True)
class OdometryMonitor:
    """Carries the truth of the last moment: a reading comes with the moments after it.

    Attributes:
        limits: of each error that is asked for, by its name.
        folds: of their margins.
        truth: (4,) sim time in s, x and y in m, yaw in rad.
        way: m on the ground up to then, since t = 0.
    """

    is_momentary: ClassVar[bool] = False

    sensor: str
    limits: tuple[tuple[str, float], ...]
    folds: tuple[Invariant, ...]
    truth: tuple[float, float, float, float]
    way: float = 0.0

    @classmethod
    def opened(cls, sensor: str, limits: Mapping[str, float | None], start: Observation) -> Self:
        """The fold before the first moment."""
        asked = tuple((name, limit) for name, limit in limits.items() if limit is not None)
        x, y, _ = start.pose.position_xyz
        return cls(sensor, asked, (Invariant(),) * len(asked), (start.time, x, y, start.pose.yaw))

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return joined(*(fold.state for fold in self.folds))

    def begin(self, trace: Trace) -> Self:
        """See Follower.begin: the robot makes its way, and nothing is judged."""
        return self._moved(trace, self._ways(self._truths(trace))) if len(trace) else self

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        record = trace.sensors.get(self.sensor)
        truths = self._truths(trace)
        ways = self._ways(truths)
        later = self._moved(trace, ways) if len(trace) else self
        if record is None or not len(record):
            return later
        errors = _errors(record, truths, ways)
        folds = zip(self.folds, self.limits, strict=True)
        return replace(
            later, folds=tuple(fold.observe(record.time, limit - errors[name]) for fold, (name, limit) in folds)
        )

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: at the sensor's own rate."""
        record, truths = trace.sensors.get(self.sensor), self._truths(trace)
        if record is None or not len(record):
            return ()
        errors = _errors(record, truths, self._ways(truths))
        return tuple(
            Signal(_NAMES[name], _UNITS[name], record.time, errors[name], upper=limit) for name, limit in self.limits
        )

    def _truths(self, trace: Trace) -> FloatArray:
        """(1 + T, 4): the last moment, and those that follow."""
        following = np.column_stack((trace.time, trace.base_position_xyz[:, :2], trace.yaw))
        truths: FloatArray = np.vstack((self.truth, following))
        return truths

    def _ways(self, truths: FloatArray) -> FloatArray:
        """(1 + T,) m made up to each moment: one sum, however the run is cut."""
        steps = np.hypot(*np.diff(truths[:, 1:3], axis=0).T)
        ways: FloatArray = np.cumsum(np.concatenate(([self.way], steps)))
        return ways

    def _moved(self, trace: Trace, ways: FloatArray) -> Self:
        time, x, y, yaw = self._truths(trace)[-1].tolist()
        return replace(self, truth=(time, x, y, yaw), way=float(ways[-1]))

    def verdict(self) -> Verdict:
        """The error that was too great first; else the one that came nearest to its limit."""
        told = [(fold, name, limit) for fold, (name, limit) in zip(self.folds, self.limits, strict=True)]
        read = [(fold.margin, fold.time, fold, name, limit) for fold, name, limit in told]
        known = [one for one in read if one[0] is not None and one[1] is not None]
        if not known:
            name, limit = self.limits[0]
            return Verdict(True, None, limit, None, _UNITS[name], None, f"{self.sensor}: nothing was read")
        broken = [one for one in known if one[2].state is State.BROKEN]
        margin, time, _, name, limit = (
            min(broken, key=lambda one: one[1] or 0.0)
            if broken
            else min(known, key=lambda one: (one[0] or 0.0) / one[4])
        )
        assert margin is not None, "it is known"
        error, allowed = _shown(limit - margin, limit, _UNITS[name])
        what = {"position": f"{error} off", "yaw": f"{error} off its heading", "drift": f"{error} of its way off"}[name]
        how = f"more than {allowed}" if broken else f"at the most, limit {allowed}"
        message = f"{self.sensor} was {what} at {time:.2f} s, {how}"
        return Verdict(not broken, limit - margin, limit, margin, _UNITS[name], time, message)


def _shown(error: float, limit: float, unit: str) -> tuple[str, str]:
    if unit:
        return units.display_apart(error, limit, unit)
    return units.display_apart(100 * error, 100 * limit, "%")


def _errors(record: SensorRecord, truths: FloatArray, ways: FloatArray) -> dict[str, FloatArray]:
    """(N,) of each reading, by name. A stored trace has fewer moments than readings: between them goes a line."""
    before, after, share = _around(record.time, truths[:, 0])
    (x, y), (to_x, to_y) = truths[before, 1:3].T, truths[after, 1:3].T
    yaw = truths[before, 3] + share * _turn(truths[after, 3] - truths[before, 3])
    way = ways[before] + share * (ways[after] - ways[before])
    told = record.columns["position_xyz"]
    position = np.hypot(told[:, 0] - x - share * (to_x - x), told[:, 1] - y - share * (to_y - y))
    qx, qy, qz, qw = record.columns["orientation_xyzw"].T
    told_yaw = np.arctan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
    return {
        "position": position,
        "yaw": np.abs(_turn(told_yaw - yaw)),
        "drift": position / np.maximum(way, _SHORTEST_WAY),
    }


def _around(wanted: FloatArray, time: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """(N,) the moment before each time, the one after it, and how much of the way it is between them.

    A time that is that of a moment is between it and itself: what is worked out then does not depend on its neighbours,
    which are others if the run is cut there.
    """
    last = len(time) - 1
    after = np.minimum(np.searchsorted(time, wanted - _SAME_TIME), last)
    before = np.where(time[after] > wanted + _SAME_TIME, np.maximum(after - 1, 0), after)
    span = time[after] - time[before]
    return before, after, np.where(span > 0, (wanted - time[before]) / np.where(span > 0, span, 1.0), 0.0)


def _turn(angle: FloatArray) -> FloatArray:
    """The same angles, in [-pi, pi)."""
    turned: FloatArray = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    return turned
