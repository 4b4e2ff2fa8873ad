"""`odometry_error: {position: 5 cm, drift: 2 %}`: the error of the wheel odometry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import NO_READING, Assertion, Reference
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.bounds import Invariant, joined
from sim_action.assertions.sensor import MORE_READINGS
from sim_action.core import units
from sim_action.core.field_types import PositiveMetres, PositiveRadians, PositiveShare
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.state.golden_trajectory import wrapped
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace, yaw_angles
from sim_action.state.trace_records import Channels, SensorRecord
from sim_action.state.verdict import Judged, Signal, Verdict
from sim_action.world.claims import HEADINGS, Ceiling, Findings, JudgedRun
from sim_action.world.scene import Scene

_MIN_DISTANCE_M: Final = 1.0  # a shorter distance gives no meaningful drift

# Sim time is step / rate: two computations of the same time differ by rounding.
_SAME_TIME_S: Final = 1e-9
_NAMES: Final = {"position": "position error", "yaw": "heading error", "drift": "drift"}
_UNITS: Final = {"position": "m", "yaw": "rad", "drift": ""}


class OdometryError(Assertion):
    """The errors of the odometry sensor against the true pose never exceed `position`, `yaw` and `drift`.

    Each reading after t = 0 is compared with the true pose at the same time. The sensor is read even if no controller
    uses it. `drift` is the position error divided by the distance travelled since t = 0; the first metre counts as a
    full metre.
    """

    key: ClassVar[str] = "odometry_error"
    reference: ClassVar[Reference] = Reference(
        "joints",
        "invariant",
        "No reading differed from the true pose by more than the limits.",
        "A reading differed from the true pose by more than a limit.",
        NO_READING,
    )
    ceilings: ClassVar[tuple[Ceiling, ...]] = (Ceiling("yaw", "rad", HEADINGS),)
    more_moments: ClassVar[str] = MORE_READINGS

    position: Annotated[PositiveMetres | None, Field(description="maximum position error")] = None
    yaw: Annotated[PositiveRadians | None, Field(description="maximum heading error")] = None
    drift: Annotated[
        PositiveShare | None, Field(description="maximum position error as a share of the distance travelled")
    ] = None
    name: Annotated[str, Field(min_length=1, description="name of the sensor in the scenario")] = "odometry"

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if not self.limits:
            raise ValueError("give 'position', 'yaw', 'drift' or several of them")
        return self

    @property
    def limits(self) -> dict[str, float]:
        """The limits that are given, by the name of the error."""
        return {name: limit for name in _NAMES if (limit := getattr(self, name)) is not None}

    @property
    @override
    def title(self) -> str:
        texts = {
            name: units.display(limit, unit) if (unit := _UNITS[name]) else f"{100 * limit:.4g} %"
            for name, limit in self.limits.items()
        }
        return f"odometry_error {', '.join(f'{name} at most {limit}' for name, limit in texts.items())}"

    @property
    @override
    def channels(self) -> Channels:
        return Channels(sensors=frozenset({self.name}))

    @override
    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        odometers = [name for name, kind in kinds.items() if kind == "odometry"]
        if self.name in odometers:
            return
        if self.name in kinds:
            yield (
                ("name",),
                f"'{self.name}' is not odometry but '{kinds[self.name]}'{did_you_mean(self.name, odometers)}",
            )
        elif not odometers:
            yield (), "the scenario has no odometry; add it to sensors, such as sensors: [odometry]"
        else:
            yield ("name",), f"the scenario has no sensor '{self.name}'{did_you_mean(self.name, odometers)}"

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield an error of the position that is longer than the true way plus the way of the wheels."""
        if self.position is not None and run.verdict.passed:
            yield from run.beyond_drive(self.position / 2, "give a smaller limit", ("position",))

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        x, y, _ = start.pose.position_xyz
        folds = (Invariant(),) * len(self.limits)
        return OdometryMonitor(self.name, tuple(self.limits.items()), folds, (start.time, x, y, start.pose.yaw))


@dataclass(frozen=True, slots=True)
class OdometryMonitor(Monitor):
    """The fold of odometry errors. It keeps the true pose of the last step, because readings follow later."""

    sensor: str
    limits: tuple[tuple[str, float], ...]
    folds: tuple[Invariant, ...]
    true_pose: tuple[float, float, float, float]  # (4,) the last step: sim time in s, x and y in m, yaw in rad
    way: float = 0.0  # distance travelled on the ground since t = 0, in m
    readings: Judged = Judged()

    @property
    @override
    def state(self) -> State:
        return joined(*(fold.state for fold in self.folds))

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. The distance travelled counts; errors do not."""
        return self._moved(trace, self._ways(self._truths(trace))) if len(trace) else self

    @override
    def observe(self, trace: Trace) -> Self:
        record = trace.sensors.get(self.sensor)
        truths = self._truths(trace)
        ways = self._ways(truths)
        later = self._moved(trace, ways) if len(trace) else self
        if record is None or not len(record):
            return later
        errors = _errors(record, truths, ways)
        # The odometry starts at the true pose: its error at t = 0 says nothing.
        readings = self.readings.followed_by(record.time[record.time > _SAME_TIME_S])
        folds = zip(self.folds, self.limits, strict=True)
        return replace(
            later,
            folds=tuple(fold.observe(record.time, limit - errors[name]) for fold, (name, limit) in folds),
            readings=readings,
        )

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. The curves have the rate of the sensor."""
        record = trace.sensors.get(self.sensor)
        truths = self._truths(trace)
        if record is None or not len(record):
            return ()
        errors = _errors(record, truths, self._ways(truths))
        return tuple(
            Signal(_NAMES[name], _UNITS[name], record.time, errors[name], upper=limit) for name, limit in self.limits
        )

    def _truths(self, trace: Trace) -> FloatArray:
        """Return (1 + T, 4): the last step before and the steps of the trace."""
        following = np.column_stack((trace.time, trace.base_position_xyz[:, :2], trace.yaw))
        truths: FloatArray = np.vstack((self.true_pose, following))
        return truths

    def _ways(self, truths: FloatArray) -> FloatArray:
        """Return (1 + T,) m travelled up to each step; one running sum, so that block sizes do not matter."""
        steps = np.hypot(*np.diff(truths[:, 1:3], axis=0).T)
        ways: FloatArray = np.cumsum(np.concatenate(([self.way], steps)))
        return ways

    def _moved(self, trace: Trace, ways: FloatArray) -> Self:
        time, x, y, yaw = self._truths(trace)[-1].tolist()
        return replace(self, true_pose=(time, x, y, yaw), way=float(ways[-1]))

    def verdict(self) -> Verdict:
        """Return the verdict on the limit that broke first, else on the smallest relative margin."""
        folds = [(fold, name, limit) for fold, (name, limit) in zip(self.folds, self.limits, strict=True)]
        read = [(fold.margin, fold.time, fold, name, limit) for fold, name, limit in folds]
        measured = [one for one in read if one[0] is not None and one[1] is not None]
        if not measured or not self.readings.moments:
            name, limit = self.limits[0]
            after = " after t = 0" if measured else ""
            message = f"{self.sensor} gave no reading{after} in this time; raise its 'rate', or check for longer"
            return Verdict(False, None, limit, None, _UNITS[name], None, message, judged=Judged())
        broken = [one for one in measured if one[2].state is State.BROKEN]
        margin, time, _, name, limit = (
            min(broken, key=lambda one: one[1] or 0.0)
            if broken
            else min(measured, key=lambda one: (one[0] or 0.0) / one[4])
        )
        assert margin is not None, "it is known"
        error, allowed = _shown(limit - margin, limit, _UNITS[name])
        what = {
            "position": f"{error} off",
            "yaw": f"{error} off its heading",
            "drift": f"off by {error} of the distance travelled",
        }[name]
        how = f"more than {allowed}" if broken else f"the largest error; limit {allowed}"
        message = f"{self.sensor} was {what} at {time:.2f} s, {how}"
        margins = limit - margin, limit, margin
        return Verdict(not broken, *margins, _UNITS[name], time, message, judged=self.readings)


def _shown(error: float, limit: float, unit: str) -> tuple[str, str]:
    if unit:
        return units.display_apart(error, limit, unit)
    return units.display_apart(100 * error, 100 * limit, "%")


def _errors(record: SensorRecord, truths: FloatArray, ways: FloatArray) -> dict[str, FloatArray]:
    """Return (N,) errors of the readings, by name. The true pose is interpolated between the steps of the trace."""
    before, after, share = _around(record.time, truths[:, 0])
    (x, y), (to_x, to_y) = truths[before, 1:3].T, truths[after, 1:3].T
    yaw = truths[before, 3] + share * wrapped(truths[after, 3] - truths[before, 3])
    way = ways[before] + share * (ways[after] - ways[before])
    reported = record.columns["position_xyz"]
    position = np.hypot(reported[:, 0] - x - share * (to_x - x), reported[:, 1] - y - share * (to_y - y))
    reported_yaw = yaw_angles(record.columns["orientation_xyzw"])
    return {
        "position": position,
        "yaw": np.abs(wrapped(reported_yaw - yaw)),
        "drift": position / np.maximum(way, _MIN_DISTANCE_M),
    }


def _around(moments: FloatArray, time: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return the steps around each of (N,) times, twice a step of equal time, and the place between in [0, 1]."""
    last = len(time) - 1
    after = np.minimum(np.searchsorted(time, moments - _SAME_TIME_S), last)
    before = np.where(time[after] > moments + _SAME_TIME_S, np.maximum(after - 1, 0), after)
    span = time[after] - time[before]
    return before, after, np.where(span > 0, (moments - time[before]) / np.where(span > 0, span, 1.0), 0.0)
