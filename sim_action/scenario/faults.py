"""Faults that occur during a run: `faults: [{motor: wheel_left_joint, at: 3 s, off: true}]`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Final, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from sim_action.core import field_types, units
from sim_action.core.geometry import Twist
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.drives import Drive, recognise
from sim_action.state.readings import ReadingColumn
from sim_action.state.timeline import TimeMark, late_problems
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.sensors import MountedSensor

FaultKind = Literal["off", "stuck", "weak", "frozen", "silent", "biased"]

_KINDS: Final[dict[str, tuple[FaultKind, ...]]] = {
    "motor": ("off", "stuck", "weak"),
    "sensor": ("frozen", "silent", "biased"),
}

_OF_THE_WORLD: Final = {
    "payload": "world: {disturbances: [{payload: 2 kg, link: NAME, at: 3 s}]}, negative if it is taken from the link",
    "force": "world: {disturbances: [{force: [10 N, 0, 0], link: NAME, at: 3 s, for: 0.1 s}]}",
    "patch": "world: {patches: [{x: 1 m, size: [1 m, 1 m], friction: 0.05, appears: 3 s}]}",
}

# A key without a value counts, so that `{motor: elbow, at: 3 s, off}` can be written.
_Flag = Annotated[Literal[True] | None, BeforeValidator(lambda value: True if value is None else value)]


_Bias = field_types.SensorQuantity | tuple[field_types.SensorQuantity, ...]


def _error_of(written: object, column: ReadingColumn) -> float | tuple[float, ...]:
    """Return the error of a column in SI units. Raise ValueError."""
    if not isinstance(written, tuple):
        return units.parse(written, column.dimension)
    if len(written) != len(column.axes):
        axes = f" or {len(column.axes)} ({', '.join(column.axes)})" if column.axes else ""
        raise ValueError(f"expected one number{axes}, found {len(written)}")
    return tuple(units.parse(value, column.dimension) for value in written)


def _fits(written: object, column: ReadingColumn) -> bool:
    try:
        _error_of(written, column)
    except ValueError:
        return False
    return True


def _as_text(bias: object) -> str:
    if isinstance(bias, dict):
        return ", ".join(f"{_as_text(value)} in {name}" for name, value in bias.items())
    return f"({', '.join(map(str, bias))})" if isinstance(bias, tuple) else str(bias)


class Fault(field_types.FrozenModel):
    """A motor or a sensor that fails at a time, until the end of the run or for some time.

    A motor that is off exerts nothing, and its joint moves freely. A stuck one holds its joint where it is. A weak one
    has a share of its effort limit. A frozen sensor repeats its last reading, a silent one gives none. A biased one
    adds a constant error.
    """

    motor: Annotated[field_types.Name | None, Field(description="joint whose motor fails")] = None
    sensor: Annotated[
        field_types.Name | None, Field(description="name of the sensor that fails, instead of a motor")
    ] = None
    at: Annotated[field_types.NonNegativeSeconds, Field(description="sim time at which it begins")]
    duration: Annotated[
        field_types.PositiveSeconds | None,
        Field(alias="for", description="its duration; default: until the end of the run"),
    ] = None
    off: Annotated[_Flag, Field(description="the motor exerts nothing")] = None
    stuck: Annotated[_Flag, Field(description="the joint stays where it is")] = None
    weak: Annotated[
        Annotated[field_types.PositiveShare, Field(lt=1)] | None,
        Field(description="the share that is left of the motor's effort limit, such as 50 %"),
    ] = None
    frozen: Annotated[_Flag, Field(description="the sensor repeats its last reading")] = None
    silent: Annotated[_Flag, Field(description="the sensor gives no readings")] = None

    biased: Annotated[
        _Bias | dict[str, _Bias] | None,
        Field(
            description="the error that the sensor adds, such as 5 cm, or a map of columns of its readings to errors"
        ),
    ] = None

    @property
    def kind(self) -> FaultKind:
        """The way in which it fails."""
        kinds: tuple[FaultKind, ...] = (*_KINDS["motor"], *_KINDS["sensor"])
        return next(kind for kind in kinds if self.__dict__[kind] is not None)

    @property
    def target(self) -> str:
        """The name of the joint or the sensor."""
        return self.motor or self.sensor or ""

    @property
    def end(self) -> float:
        """The end in s of sim time; infinite without one."""
        return math.inf if self.duration is None else self.at + self.duration

    @property
    def words(self) -> str:
        """The fault in words, without its times."""
        what = f"motor of joint '{self.motor}'" if self.motor else f"sensor '{self.sensor}'"
        how = f"at {self.weak:.0%} of its effort" if self.weak is not None else self.kind
        how = f"biased by {_as_text(self.biased)}" if self.biased is not None else how
        return f"{what} is {how}"

    @property
    def time_mark(self) -> TimeMark:
        """The mark of the timeline."""
        return TimeMark(self.at, None if self.duration is None else self.end, self.words)

    def offsets(self, kind: str) -> dict[str, float | tuple[float, ...]]:
        """Return the errors of a biased sensor of a kind by column, in SI units. Raise ValueError."""
        # Few scenarios bias a sensor, and it needs numpy.
        from sim_action.state.readings import biased_columns

        columns = biased_columns(kind)
        written = self.biased
        if not columns or written is None:
            raise ValueError("the readings of this sensor are no measured values, so they cannot be biased")
        if not isinstance(written, dict):
            meant = [name for name, column in columns.items() if _fits(written, column)] or list(columns)
            if len(meant) > 1:
                raise ValueError(f"a reading has {', '.join(meant)}; say which one, as in {{{meant[0]}: ...}}")
            written = {meant[0]: written}
        for name in written:
            if name not in columns:
                raise ValueError(f"no readings '{name}' that can be biased{did_you_mean(name, columns)}")
        offsets = {name: _error_of(value, columns[name]) for name, value in written.items()}
        if not any(any(offset) if isinstance(offset, tuple) else offset for offset in offsets.values()):
            raise ValueError("an error of 0 changes nothing")
        return offsets

    @model_validator(mode="before")
    @classmethod
    def _is_of_the_robot(cls, written: object) -> object:
        if isinstance(written, dict) and (key := next((key for key in _OF_THE_WORLD if key in written), None)):
            raise ValueError(f"'{key}' is no fault of a motor or a sensor; write it as {_OF_THE_WORLD[key]}")
        return written

    @model_validator(mode="after")
    def _is_one_fault(self) -> Self:
        if (self.motor is None) == (self.sensor is None):
            raise ValueError("name either a 'motor' or a 'sensor'")
        whose = "motor" if self.motor else "sensor"
        stated = [kind for kinds in _KINDS.values() for kind in kinds if self.__dict__[kind] is not None]
        if len(stated) != 1 or stated[0] not in _KINDS[whose]:
            raise ValueError(f"a {whose} needs exactly one of {', '.join(map(repr, _KINDS[whose]))}")
        return self


def fault_problems(
    faults: Sequence[Fault], scene: Scene, drive: Drive | None, sensors: Sequence[MountedSensor], limit: float
) -> SpecProblems:
    """Yield faults that motors or sensors lack, cannot have, or at bad times; `limit`: of sim time, in s."""
    for index, fault in enumerate(faults):
        path = ("faults", index)
        yield from late_problems((*path, "at"), fault.at, limit)
        for before in faults[:index]:
            if before.target == fault.target and max(before.at, fault.at) < min(before.end, fault.end):
                yield path, f"two faults of '{fault.target}' overlap in time; give the first one an end with 'for'"
        if fault.sensor is not None:
            yield from (((*path, key), problem) for key, problem in _sensor_problems(fault, sensors))
        elif (problem := scene.model.why_not_driven(fault.target)) is not None:
            yield (*path, "motor"), problem
        else:
            yield from ((path, problem) for problem in _motor_problems(fault, scene, drive))


def _sensor_problems(fault: Fault, sensors: Sequence[MountedSensor]) -> Iterator[tuple[str, str]]:
    """Yield keys and problems."""
    kinds = {mounted.name: mounted.sensor.key for mounted in sensors}
    if fault.target not in kinds:
        yield "sensor", f"there is no sensor '{fault.target}'{did_you_mean(fault.target, kinds)}"
    elif fault.silent and not fault.at:
        yield "at", "a sensor has a reading at 0 s: it can be silent from a later time on"
    elif fault.biased is not None:
        try:
            fault.offsets(kinds[fault.target])
        except ValueError as error:
            yield "biased", str(error)


def _motor_problems(fault: Fault, scene: Scene, drive: Drive | None) -> list[str]:
    joint, limit = fault.target, scene.model.joints_by_name[fault.target].max_effort
    drive = drive or recognise(scene.model)
    motion = None if drive is None else drive.open(scene.model, scene.physics.rate, scene.world.weight)
    if motion is not None and joint in motion.joints:
        targets = motion.targets(Twist(), 1)[0]
        if targets.base is not None:
            return [f"the drive moves the robot by a force on its base, so a fault of joint '{joint}' changes nothing"]
        limit = targets.max_effort.get(joint, limit)
    if fault.weak is not None and not limit:
        return [f"the motor of joint '{joint}' has no effort limit, so a share of it limits nothing: state one"]
    return []
