"""`sensor: {name: lidar, reading: ranges, which: min, at_least: 20 cm}`: bounds on sensor readings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import NO_READING, Assertion, Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Goal, Invariant, bounds_formula, check_bounds
from sim_action.assertions.temporal_logic import quoted
from sim_action.core import units
from sim_action.core.field_types import SensorQuantity
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import Dimension
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import as_written
from sim_action.sensors import sensor_named
from sim_action.state.observation import Observation
from sim_action.state.readings import DISTANCES, READING_COLUMNS, ReadingColumn, columns_of
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, SensorRecord
from sim_action.state.verdict import Judged, Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun, nothing_in_range
from sim_action.world.scene import Scene

Which = Literal["min", "max", "mean", "norm", "x", "y", "z", "w"]
_STATISTICS = ("min", "max", "mean")
_DIMENSIONS = tuple(column.dimension for columns in READING_COLUMNS.values() for column in columns.values())
_AXES: Final = "xyzw"
MORE_READINGS: Final = "raise the sensor's rate, or run for longer"  # the advice for a run with one reading


class SensorReading(Assertion):
    """All readings of a sensor are between `at_least` and `at_most`. With `once: true`, one such reading is enough.

    Every reading counts, at the sensor's own rate. The sensor is read even if no controller uses it. The readings are
    the columns of a trace: `ranges` of a lidar; `depth` and `rgb` of a camera; `force` and `touching` of a contact
    sensor; `linear_acceleration_xyz`, `angular_velocity_xyz` and `orientation_xyzw` of an IMU; `position_xyz`,
    `orientation_xyzw`, `linear_xyz` and `angular_xyz` of odometry. A mean ignores infinite ranges and depths.
    """

    key: ClassVar[str] = "sensor"
    reference: ClassVar[Reference] = Reference(
        "joints",
        "invariant; with `once`: goal",
        "Every reading was within the bounds. With `once`: a reading was outside the bounds, and a later one inside.",
        "A reading was outside the bounds. With `once`: no reading was inside, or only from the first one on.",
        NO_READING,
    )
    more_moments: ClassVar[str] = MORE_READINGS

    name: Annotated[str, Field(min_length=1, description="name of the sensor in the scenario")]
    reading: Annotated[str, Field(min_length=1, description="a column of its readings")]
    which: Annotated[
        Which | None,
        Field(description="for readings with several numbers: an axis, the norm of all axes, or a statistic"),
    ] = None
    at_least: Annotated[SensorQuantity | None, Field(description="an invariant; with 'once' a goal")] = None
    at_most: Annotated[SensorQuantity | None, Field(description="an invariant; with 'once' a goal")] = None
    once: Annotated[bool, Field(description="a goal: one reading within the bounds is enough")] = False

    @model_validator(mode="after")
    def _has_a_bound(self) -> Self:
        written = (as_written(self.at_least or 0.0), as_written(self.at_most or 0.0))
        check_bounds(self._magnitude(self.at_least), self._magnitude(self.at_most), "", written)
        return self

    def _magnitude(self, written: float | str | None) -> float | None:
        return None if written is None else units.parse(written, *_DIMENSIONS)

    is_goal: ClassVar[bool] = delegated("once")

    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        bounds = (("at least", self.at_least), ("at most", self.at_most))
        limits = ", ".join(f"{word} {as_written(value)}" for word, value in bounds if value is not None)
        return f"sensor {self.what} {'once ' if self.once else ''}{limits}"

    @property
    def what(self) -> str:
        """The reading as text, such as "min of lidar's ranges"."""
        return (f"{self.which} of " if self.which else "") + f"{self.name}'s {self.reading}"

    @property
    @override
    def channels(self) -> Channels:
        return Channels(sensors=frozenset({self.name}))

    @override
    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        if self.name not in kinds:
            yield ("name",), f"the scenario has no sensor '{self.name}'{did_you_mean(self.name, kinds)}"
            return
        columns = columns_of(kinds[self.name])
        if self.reading not in columns:
            hint = did_you_mean(self.reading, columns)
            yield ("reading",), f"a reading of '{self.name}' has no column '{self.reading}'{hint}"
            return
        column = columns[self.reading]
        if (trouble := why_not_picked(column, self.which)) is not None:
            yield ("which",) if self.which else ("reading",), trouble
        yield from self._unit_problems(column.dimension)

    def _unit_problems(self, dimension: Dimension) -> SpecProblems:
        for key, written in (("at_least", self.at_least), ("at_most", self.at_most)):
            try:
                units.parse(0.0 if written is None else written, dimension)
            except units.UnitError as error:
                yield (key,), str(error)

    @override
    def meaning(self, scene: Scene) -> str:
        quantity = ".".join((quoted(self.name), self.reading, *([self.which] if self.which else [])))
        least, most = (self._magnitude(bound) for bound in (self.at_least, self.at_most))
        if not self.once:
            return bounds_formula(quantity, least, most, goal=False)
        sides = ((">=", least), ("<=", most))
        both = " and ".join(f"{quantity} {relation} {bound!r}" for relation, bound in sides if bound is not None)
        return f"eventually ({both})"

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        """Yield bounds that no reading exceeds, and a minimum distance that is greater than the range of its sensor."""
        columns = (columns.get(self.reading) for columns in READING_COLUMNS.values())
        if any(column is not None and column.dimension == units.ANGULAR_SPEED for column in columns):
            for bound, written in (("at_least", self.at_least), ("at_most", self.at_most)):
                if (problem := units.beyond_a_turn(written, units.ANGULAR_SPEED.si)) is not None:
                    yield ClaimFinding("bare-angle", (bound,), problem)
        least, most = (self._magnitude(bound) for bound in (self.at_least, self.at_most))
        if (sensor := sensor_named(scene, self.name)) is None:
            return
        low, high = sensor.limits(self.reading, self.which)
        if (least is None or least <= low) and (most is None or most >= high) and not self.once:
            bound = "at_most" if self.at_least is None else "at_least"
            message = f"{self.what} is never outside {low:.6g} to {high:.6g}, so this checks nothing; change the limit"
            yield ClaimFinding("unreachable-limit", (bound,), message)
            return
        key = sensor.range_keys.get(self.reading)
        if self.once or self.which == "max" or least is None or key is None:
            return
        if least > (far := getattr(sensor, key)):
            reach, limit = units.display(far, "m"), units.display(least, "m")
            message = f"{self.name} sees {reach} far, so nothing between {reach} and {limit} is noticed"
            yield ClaimFinding("limit-beyond-range", ("at_least",), f"{message}; raise its '{key}'")

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a minimum distance that infinite readings met, and a limit of a force that was always 0."""
        verdict = run.verdict
        if self.reading == "force" and verdict.passed and not verdict.goal and verdict.measured == 0:
            message = f"{self.name} felt no contact in the whole run, so the limit was compared with 0 only"
            yield ClaimFinding("never-touched", (), f"{message}; let it touch something, or use no_collision")
        if self.reading not in DISTANCES or self.which == "max" or self._claims_empty(run.scene):
            return
        # The measured value is the least reading; an infinite one is None.
        if verdict.status == "passed" and not verdict.goal and verdict.measured is None:
            yield nothing_in_range(self.name)

    def _claims_empty(self, scene: Scene) -> bool:
        """Return True if the least allowed distance is the range of the sensor: nothing may be in range."""
        sensor = sensor_named(scene, self.name)
        far = getattr(sensor, sensor.range_keys[self.reading]) if sensor is not None else math.inf
        return self.at_least is not None and (self._magnitude(self.at_least) or 0.0) >= far

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        bounds = self._magnitude(self.at_least), self._magnitude(self.at_most)
        return SensorMonitor(self.name, self.reading, self.which, self.what, *bounds, once=self.once)


def why_not_picked(column: ReadingColumn, which: str | None) -> str | None:
    """Return the problem with the choice of `which` for a column, else None."""
    if column.is_single:
        return "the reading is a single number; remove 'which'" if which else None
    allowed = (*column.axes, "norm", *_STATISTICS) if column.axes else _STATISTICS
    if which is None:
        return f"the reading has several numbers; select one with 'which': {', '.join(allowed)}"
    return None if which in allowed else f"the reading has no '{which}'{did_you_mean(which, allowed)}"


@dataclass(frozen=True, slots=True)
class SensorMonitor(Monitor):
    """The fold of the margin to the closer of both bounds."""

    is_momentary = True
    is_sampled = True

    sensor: str  # sensor, reading, which: the value that is read
    reading: str
    which: str | None
    what: str  # the same as text
    at_least: float | None
    at_most: float | None
    once: bool  # True if one reading within the bounds is enough
    fold: Goal | Invariant | None = None
    value: float = 0.0  # the reading at the deciding time
    unit: str = ""  # SI symbol; empty before the first reading
    readings: Judged = Judged()  # the readings that were judged

    state: ClassVar[State] = delegated("_fold.state")

    is_goal: ClassVar[bool] = delegated("once")

    @property
    def _fold(self) -> Goal | Invariant:
        return self.fold or (Goal() if self.once else Invariant())

    @override
    def observe(self, trace: Trace) -> Self:
        record = trace.sensors.get(self.sensor)
        if record is None or not len(record):
            return self
        values = picked(record.columns[self.reading], self.which)
        fold = self._fold.observe(record.time, self._margin(values))
        readings = self.readings.followed_by(record.time)
        if fold is self._fold:
            return replace(self, readings=readings)
        value = float(values[int((record.time == fold.time).argmax())])
        return replace(self, fold=fold, value=value, unit=self._unit_of(record), readings=readings)

    def _margin(self, values: FloatArray) -> FloatArray:
        margin = np.full(len(values), math.inf)
        # A missing bound is not an infinite one, because the value may be infinite too.
        if self.at_least is not None:
            margin = np.minimum(margin, values - self.at_least)
        if self.at_most is not None:
            margin = np.minimum(margin, self.at_most - values)
        return margin

    def truth(self, trace: Trace) -> Truth:
        """See Monitor.truth. The moments are the readings."""
        record = trace.sensors.get(self.sensor)
        if record is None or not len(record):
            return Truth(np.empty(0), np.empty(0, dtype=bool))
        return Truth(record.time, self._margin(picked(record.columns[self.reading], self.which)) >= 0)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. The curve has the sensor's rate; infinite readings are left out."""
        record = trace.sensors.get(self.sensor)
        if record is None or not len(record):
            return ()
        values = picked(record.columns[self.reading], self.which)
        finite = np.where(np.isfinite(values), values, np.nan)
        return (Signal(self.what, self._unit_of(record), record.time, finite, self.at_least, self.at_most),)

    def _unit_of(self, record: SensorRecord) -> str:
        return columns_of(record.kind)[self.reading].dimension.si

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` is the reading at the deciding time; None if it is infinite."""
        fold, passed = self._fold, self.state is State.HOLDS
        limit, side = self._nearer_bound()
        if fold.time is None or fold.margin is None:
            message = f"{self.sensor} gave no reading in this time; raise its 'rate', or check for longer"
            return Verdict(False, None, limit, None, self.unit, None, message, judged=Judged())
        value, bound = units.display_apart(self.value, limit, self.unit)
        holds = f"{self.what} was {value} at {fold.time:.2f} s"
        message = {
            (True, True): holds,
            (True, False): f"{holds}, the closest value; never within bounds: {side} {bound}",
            (False, True): f"{holds}, {'lowest' if side == 'at least' else 'highest'}; {side} {bound}",
            (False, False): f"{holds}, {'less' if side == 'at least' else 'more'} than {bound}",
        }[self.once, passed]
        measured, margin = (number if math.isfinite(number) else None for number in (self.value, fold.margin))
        return Verdict(passed, measured, limit, margin, self.unit, fold.time, message, judged=self.readings)

    def _nearer_bound(self) -> tuple[float, str]:
        """Return the bound that the value is closer to, or exceeds by more."""
        if self.at_most is None or (
            self.at_least is not None and self.value - self.at_least < self.at_most - self.value
        ):
            assert self.at_least is not None, "one of both is given"
            return self.at_least, "at least"
        return self.at_most, "at most"


def picked(column: Any, which: str | None) -> FloatArray:
    """Return (N,) one number per reading, from a column (N,) or (N, ...)."""
    values = np.asarray(column, dtype=np.float64)
    if which is None:
        return values
    rows = values.reshape(len(values), -1)
    if which in _AXES:
        return rows[:, _AXES.index(which)]
    if which == "norm":
        return np.asarray(np.sqrt((rows * rows).sum(axis=1)), dtype=np.float64)
    if which == "mean":
        return np.array([_mean(row[finite]) for row, finite in zip(rows, np.isfinite(rows), strict=True)])
    return np.asarray(rows.min(axis=1) if which == "min" else rows.max(axis=1), dtype=np.float64)


def _mean(finite: FloatArray) -> float:
    return float(finite.mean()) if len(finite) else math.inf
