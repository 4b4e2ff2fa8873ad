"""`sensor: {name: lidar, reading: ranges, which: min, at_least: 20 cm}`: what a sensor must tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.bounds import check_bounds
from sim_action.assertions.joint_choice import as_written
from sim_action.core import units
from sim_action.core.field_types import SensorQuantity
from sim_action.core.messages import did_you_mean
from sim_action.core.units import Dimension
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.readings import READING_COLUMNS, ReadingColumn
from sim_action.state.trace_channels import Channels
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation

Which = Literal["min", "max", "mean", "norm", "x", "y", "z", "w"]

_STATISTICS = ("min", "max", "mean")
_DIMENSIONS = tuple(column.dimension for columns in READING_COLUMNS.values() for column in columns.values())


class SensorReading(Assertion):
    """What a sensor of the scenario tells stays within bounds, or with `once` comes within them.

    Every reading counts, at the sensor's own rate; it is read for this, whether or not a controller listens. What it
    has are the columns that a trace keeps: `ranges` of a lidar; `depth` and `rgb` of a camera; `force` and
    `touching` of a contact sensor; `linear_acceleration_xyz`, `angular_velocity_xyz` and `orientation_xyzw` of an IMU;
    `position_xyz`, `orientation_xyzw`, `linear_xyz` and `angular_xyz` of odometry. Ranges and depths that are infinite
    are not part of a mean.
    """

    key: ClassVar[str] = "sensor"

    name: Annotated[str, Field(min_length=1, description="of the sensor in the scenario")]
    reading: Annotated[str, Field(min_length=1, description="a column of its readings")]
    which: Annotated[
        Which | None,
        Field(description="of a reading of several numbers: an axis, the norm of all axes, or a statistic"),
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

    @property
    def title(self) -> str:
        """See Assertion.title."""
        bounds = (("at least", self.at_least), ("at most", self.at_most))
        wanted = ", ".join(f"{word} {as_written(value)}" for word, value in bounds if value is not None)
        return f"sensor {self.what} {'once ' if self.once else ''}{wanted}"

    @property
    def what(self) -> str:
        """Such as "min of lidar's ranges"."""
        return (f"{self.which} of " if self.which else "") + f"{self.name}'s {self.reading}"

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels(sensors=frozenset({self.name}))

    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        """See Assertion.sensor_problems."""
        if self.name not in kinds:
            yield ("name",), f"the scenario has no sensor '{self.name}'{did_you_mean(self.name, kinds)}"
            return
        columns = READING_COLUMNS[kinds[self.name]]
        if self.reading not in columns:
            hint = did_you_mean(self.reading, columns)
            yield ("reading",), f"a reading of '{self.name}' has no column '{self.reading}'{hint}"
            return
        column = columns[self.reading]
        if (trouble := _trouble(column, self.which)) is not None:
            yield ("which",) if self.which else ("reading",), trouble
        yield from self._unit_problems(column.dimension)

    def _unit_problems(self, dimension: Dimension) -> SpecProblems:
        for key, written in (("at_least", self.at_least), ("at_most", self.at_most)):
            try:
                units.parse(0.0 if written is None else written, dimension)
            except units.UnitError as error:
                yield (key,), str(error)

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.sensor_monitor import SensorMonitor

        bounds = self._magnitude(self.at_least), self._magnitude(self.at_most)
        return SensorMonitor(self.name, self.reading, self.which, self.what, *bounds, once=self.once)


def _trouble(column: ReadingColumn, which: str | None) -> str | None:
    """Why this cannot be picked from a column."""
    if column.is_single:
        return "it is a single number; leave 'which' out" if which else None
    allowed = (*column.axes, "norm", *_STATISTICS) if column.axes else _STATISTICS
    if which is None:
        return f"it has several numbers; say which, by 'which': {', '.join(allowed)}"
    return None if which in allowed else f"it has no '{which}'{did_you_mean(which, allowed)}"
