"""Faults that occur during a run: `faults: [{motor: wheel_left_joint, at: 3 s, off: true}]`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Final, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from sim_action.core.field_types import FrozenModel, Name, NonNegativeSeconds, PositiveSeconds, PositiveShare
from sim_action.core.geometry import Twist
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive, recognise
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.sensors import MountedSensor

FaultKind = Literal["off", "stuck", "weak", "frozen", "silent"]

_KINDS: Final[dict[str, tuple[FaultKind, ...]]] = {"motor": ("off", "stuck", "weak"), "sensor": ("frozen", "silent")}

# A key without a value counts, so that `{motor: elbow, at: 3 s, off}` can be written.
_Flag = Annotated[Literal[True] | None, BeforeValidator(lambda value: True if value is None else value)]


class Fault(FrozenModel):
    """A motor or a sensor that fails at a time, until the end of the run or for some time.

    A motor that is off exerts nothing, and its joint moves freely. A stuck one holds its joint where it is. A weak one
    has a share of its effort limit. A frozen sensor repeats its last reading, a silent one gives none.
    """

    motor: Annotated[Name | None, Field(description="joint whose motor fails")] = None
    sensor: Annotated[Name | None, Field(description="name of the sensor that fails, instead of a motor")] = None
    at: Annotated[NonNegativeSeconds, Field(description="sim time at which it begins")]
    duration: Annotated[
        PositiveSeconds | None, Field(alias="for", description="its duration; default: until the end of the run")
    ] = None
    off: Annotated[_Flag, Field(description="the motor exerts nothing")] = None
    stuck: Annotated[_Flag, Field(description="the joint stays where it is")] = None
    weak: Annotated[
        Annotated[PositiveShare, Field(lt=1)] | None,
        Field(description="the share that is left of the motor's effort limit, such as 50 %"),
    ] = None
    frozen: Annotated[_Flag, Field(description="the sensor repeats its last reading")] = None
    silent: Annotated[_Flag, Field(description="the sensor gives no readings")] = None

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
    def title(self) -> str:
        """The fault in words."""
        what = f"motor of joint '{self.motor}'" if self.motor else f"sensor '{self.sensor}'"
        how = f"at {self.weak:.0%} of its effort" if self.weak is not None else self.kind
        until = "on" if self.duration is None else f"to {self.end:g} s"
        return f"{what} is {how} from {self.at:g} s {until}"

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
    """Yield faults of missing motors or sensors, of such that cannot fail in this way, and with bad times.

    :param drive: that the scenario states.
    :param limit: of sim time, in s.
    """
    for index, fault in enumerate(faults):
        path = ("faults", index)
        if fault.at >= limit:
            yield (*path, "at"), f"{fault.at:g} s is not earlier than time_limit ({limit:g} s)"
        for before in faults[:index]:
            if before.target == fault.target and max(before.at, fault.at) < min(before.end, fault.end):
                yield path, f"two faults of '{fault.target}' overlap in time; give the first one an end with 'for'"
        if fault.sensor is not None:
            names = [mounted.name for mounted in sensors]
            if fault.sensor not in names:
                yield (*path, "sensor"), f"there is no sensor '{fault.sensor}'{did_you_mean(fault.sensor, names)}"
            elif fault.silent and not fault.at:
                yield (*path, "at"), "a sensor has a reading at 0 s: it can be silent from a later time on"
        elif (problem := scene.model.why_not_driven(fault.target)) is not None:
            yield (*path, "motor"), problem
        else:
            yield from ((path, problem) for problem in _motor_problems(fault, scene, drive))


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
