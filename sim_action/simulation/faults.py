"""The faults of motors and sensors that a scenario states, at the seams of its run."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from typing_extensions import override

from sim_action.commands import Controller
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S, first_step
from sim_action.drives import DriveMotion
from sim_action.drives.wheels import held_joints
from sim_action.engines.engine import UNLIMITED_EFFORT
from sim_action.scenario.faults import Fault
from sim_action.scenario.mutation import Seams
from sim_action.sensors import Measure, Sight
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation
from sim_action.state.readings import shifted
from sim_action.state.timeline import waits
from sim_action.world.scene import Scene

Targets = list[JointTargets | None]


@dataclass(slots=True)
class _Motor:
    """A motor that fails. Attributes: physics steps; `asked`: the last targets for its joint, as if nothing failed."""

    fault: Fault
    first: int
    last: float
    asked: JointTargets
    stuck_at: float = 0.0


class FaultSeams(Seams):
    """The seams of a run whose motors and sensors fail at times; `inner`: its mutation's seams, if there is one."""

    def __init__(self, faults: Sequence[Fault], scene: Scene, inner: Seams) -> None:
        """Prepare the faults for a scene."""
        self._faults, self._inner, self._model = faults, inner, scene.model
        self.runs_on, self.looks_ahead = inner.runs_on, inner.looks_ahead
        self._kinds = {fitting.name: fitting.kind for fitting in scene.sensors}
        self._rate, held = scene.physics.rate, held_joints(scene.model)
        self._motors = [
            _Motor(
                fault,
                first_step(fault.at, self._rate),
                math.inf if fault.duration is None else first_step(fault.end, self._rate),
                JointTargets({fault.target: scene.joint_positions[fault.target]})
                if fault.target in held
                else JointTargets(effort={fault.target: 0.0}),
            )
            for fault in faults
            if fault.motor
        ]

    @override
    def scene(self, scene: Scene) -> Scene:
        return self._inner.scene(scene)

    @override
    def controller(self, controller: Controller) -> Controller:
        return self._inner.controller(controller)

    @override
    def motion(self, motion: DriveMotion | None) -> DriveMotion | None:
        return self._inner.motion(motion)

    @override
    def at_rest(self, targets: JointTargets) -> JointTargets:
        resting = self._inner.at_rest(targets)
        for motor in self._motors:
            motor.asked = _only(resting, motor.fault.target) or motor.asked
        return resting

    @override
    def follow(self, faults: Sequence[Fault]) -> None:
        self._faults = faults
        rate, motors = self._rate, (fault for fault in faults if fault.motor)
        for motor, fault in zip(self._motors, motors, strict=True):
            motor.first, motor.last = first_step(fault.at, rate), first_step(fault.end, rate)

    @override
    def until(self, step: int, until: int) -> int:
        changes = (change for motor in self._motors for change in (motor.first, motor.last) if change > step)
        return int(min([until, *changes]))

    @override
    def targets(self, step: int, planned: Targets, look: Callable[[int], Observation]) -> Targets:
        for motor in self._motors:
            planned = self._of_motor(motor, step, planned, look)
        return planned

    def _of_motor(self, motor: _Motor, step: int, planned: Targets, look: Callable[[int], Observation]) -> Targets:
        """Return targets of steps in which the fault neither begins nor ends, except at the first of them."""
        name, acts = motor.fault.target, motor.first <= step < motor.last
        if step == motor.first and motor.fault.stuck:
            motor.stuck_at = look(step).joints[name].position
        changed: Targets = []
        for index, row in enumerate(planned):
            asked = None if row is None else _only(row, name)
            motor.asked = asked or motor.asked
            begins = index == 0 and step in {motor.first, motor.last}
            if not (acts and asked) and not begins:
                changed.append(row)
                continue
            own = self._failing(motor) if acts else motor.asked
            changed.append(own if row is None else row.updated_by(own))
        return changed

    def _failing(self, motor: _Motor) -> JointTargets:
        """Return the targets of a joint whose motor fails."""
        name, asked, share = motor.fault.target, motor.asked, motor.fault.weak
        if share is None:
            held = JointTargets({name: motor.stuck_at}, max_effort={name: UNLIMITED_EFFORT})
            return held if motor.fault.stuck else JointTargets(effort={name: 0.0})
        limit = self._model.joints_by_name[name].max_effort or UNLIMITED_EFFORT
        most = share * asked.max_effort.get(name, limit)
        effort = {joint: max(-most, min(most, value)) for joint, value in asked.effort.items()}
        return replace(asked, effort=effort, max_effort={} if effort else {name: most})

    @override
    def measure(self, sensor: str, measure: Measure) -> Measure:
        measure = self._inner.measure(sensor, measure)
        for index, fault in enumerate(self._faults):
            acts = partial(self._acts, index)
            if fault.sensor == sensor and fault.frozen:
                measure = frozen(measure, acts)
            if fault.sensor == sensor and fault.biased is not None:
                measure = _biased(measure, fault, self._kinds[sensor], acts)
        return measure

    def _acts(self, index: int, time: float) -> bool:
        return _acts(self._faults[index], time)

    @override
    def delivers(self, sensor: str, time: float) -> bool:
        return not any(fault.silent and fault.sensor == sensor and _acts(fault, time) for fault in self._faults)

    @property
    @override
    def notes(self) -> tuple[str, ...]:
        begun = (fault for fault in self._faults if not waits(fault.at))
        return tuple(f"fault: {fault.time_mark.title}" for fault in begun)


def _acts(fault: Fault, time: float) -> bool:
    return fault.at - TIME_EPSILON_S <= time < fault.end - TIME_EPSILON_S


def _only(targets: JointTargets, joint: str) -> JointTargets | None:
    """Return the targets of one joint; None if there are none."""

    def own(group: Mapping[str, float]) -> dict[str, float]:
        return {joint: group[joint]} if joint in group else {}

    position, velocity, effort = own(targets.position), own(targets.velocity), own(targets.effort)
    return JointTargets(position, velocity, effort, own(targets.max_effort)) if position or velocity or effort else None


def frozen(measure: Measure, is_frozen: Callable[[float], bool] = lambda _: True) -> Measure:
    """Return the function of a sensor that repeats its last reading at times that `is_frozen` returns True for."""
    # Each kind of sensor has a record of its own.
    last: Any = None

    def repeated(sight: Sight) -> Any:
        nonlocal last
        # It measures in any case: its noise draws the same numbers.
        reading = measure(sight)
        if last is None or not is_frozen(sight.time):
            last = reading
        return replace(last, time=sight.time)

    return repeated


def _biased(measure: Measure, fault: Fault, kind: str, acts: Callable[[float], bool]) -> Measure:
    """Return the function of a sensor that adds an error to its readings at the sim times in s at which `acts`."""
    offsets = fault.offsets(kind)

    def biased(sight: Sight) -> Any:
        reading = measure(sight)
        return shifted(reading, kind, offsets) if acts(sight.time) else reading

    return biased
