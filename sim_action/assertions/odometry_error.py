"""`odometry_error: {position: 5 cm, drift: 2 %}`: how far the robot is from where its wheels say that it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.goals import Invariant, joined
from sim_action.core import units
from sim_action.core.field_types import PositiveMetres, PositiveRadians, PositiveShare
from sim_action.core.messages import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.observation import Observation
    from sim_action.state.trace import FloatArray, Trace
    from sim_action.state.trace_records import SensorRecord


# In m: less of a way tells nothing of a drift.
_SHORTEST_WAY: Final = 1.0

# Sim time is step / rate: two ways to the same moment differ by rounding alone.
_SAME_TIME: Final = 1e-9
_NAMES: Final = {"position": "position error", "yaw": "heading error", "drift": "drift"}
_UNITS: Final = {"position": "m", "yaw": "rad", "drift": ""}


class OdometryError(Assertion):
    """An invariant: the odometry sensor's pose is as near to where the base really is as is asked, on the ground.

    Each of its readings is held against the truth at the same moment; it is read for this, whether or not a
    controller listens. `drift` is the error in position as a share of the way that the robot has made since it began,
    of which the first metre counts as a whole one.
    """

    key: ClassVar[str] = "odometry_error"

    position: Annotated[PositiveMetres | None, Field(description="the most that it may be off")] = None
    yaw: Annotated[PositiveRadians | None, Field(description="the most that its heading may be off")] = None
    drift: Annotated[PositiveShare | None, Field(description="the most that it may be off, of the way made")] = None
    name: Annotated[str, Field(min_length=1, description="of the sensor in the scenario")] = "odometry"

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if self.position is None and self.yaw is None and self.drift is None:
            raise ValueError("give 'position', 'yaw', 'drift' or several of them")
        return self

    @property
    def title(self) -> str:
        """See Assertion.title."""
        drift = None if self.drift is None else _percent(self.drift)
        told = (
            ("position", None if self.position is None else units.display(self.position, "m")),
            ("yaw", None if self.yaw is None else units.display(self.yaw, "rad")),
            ("drift", drift),
        )
        return f"odometry_error {', '.join(f'{name} at most {limit}' for name, limit in told if limit is not None)}"

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels(sensors=frozenset({self.name}))

    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        """See Assertion.sensor_problems."""
        odometers = [name for name, kind in kinds.items() if kind == "odometry"]
        if self.name in odometers:
            return
        if self.name in kinds:
            yield (
                ("name",),
                f"'{self.name}' is no odometry but '{kinds[self.name]}'{did_you_mean(self.name, odometers)}",
            )
        elif not odometers:
            yield (), "the scenario has no odometry; put it below sensors, such as sensors: [odometry]"
        else:
            yield ("name",), f"the scenario has no sensor '{self.name}'{did_you_mean(self.name, odometers)}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return OdometryMonitor.opened(
            self.name, {"position": self.position, "yaw": self.yaw, "drift": self.drift}, start
        )


def _percent(share: float) -> str:
    """As people read it."""
    return f"{100 * share:.4g} %"


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
        """See CumulativeMonitor.begin: the robot makes its way, and nothing is judged."""
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
        """See PlottableMonitor.signals: at the sensor's own rate."""
        record, truths = trace.sensors.get(self.sensor), self._truths(trace)
        if record is None or not len(record):
            return ()
        errors = _errors(record, truths, self._ways(truths))
        return tuple(
            Signal(_NAMES[name], _UNITS[name], record.time, errors[name], upper=limit) for name, limit in self.limits
        )

    def _truths(self, trace: Trace) -> FloatArray:
        """(1 + T, 4): the last moment, and those that follow."""
        import numpy as np

        following = np.column_stack((trace.time, trace.base_position_xyz[:, :2], trace.yaw))
        truths: FloatArray = np.vstack((self.truth, following))
        return truths

    def _ways(self, truths: FloatArray) -> FloatArray:
        """(1 + T,) m made up to each moment: one sum, however the run is cut."""
        import numpy as np

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
    import numpy as np

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
    import numpy as np

    last = len(time) - 1
    after = np.minimum(np.searchsorted(time, wanted - _SAME_TIME), last)
    before = np.where(time[after] > wanted + _SAME_TIME, np.maximum(after - 1, 0), after)
    span = time[after] - time[before]
    return before, after, np.where(span > 0, (wanted - time[before]) / np.where(span > 0, span, 1.0), 0.0)


def _turn(angle: FloatArray) -> FloatArray:
    """The same angles, in [-pi, pi)."""
    import numpy as np

    turned: FloatArray = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    return turned
