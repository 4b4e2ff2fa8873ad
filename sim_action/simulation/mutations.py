"""The mutations of a run at its seams: altered commands and motors, faulty sensors, a heavier robot."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final
from xml.etree import ElementTree as ET

from typing_extensions import override

from sim_action.commands import Controller
from sim_action.core.geometry import Twist, Vector3, scale
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.drives import DriveMotion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.scenario.mutation import Mutation, Seams
from sim_action.sensors import Measure, Sight
from sim_action.simulation.faults import frozen
from sim_action.state.command import Answer, Command, JointTargets, LinkWrench, commands_of, without_joints
from sim_action.state.joint_motion import JointMotion
from sim_action.state.readings import biased_columns, shifted
from sim_action.world.scene import Scene

STALE_S: Final = 0.5
DRIFT_S: Final = 5.0  # the time in s after which a drifting sensor has the error of a biased one

BIASES: Final = {"m": 0.2, "m/s": 0.2, "rad/s": 0.2, "m/s^2": 1.0, "N": 10.0}
"""The error of a biased sensor by the SI unit of its numbers; 1 in other units."""


class MutantSeams(Seams):
    """The seams of a run with a mutation."""

    runs_on = True

    def __init__(self, mutation: Mutation, scene: Scene) -> None:
        """Prepare the mutation for a scene."""
        self._mutation = mutation
        self.looks_ahead = mutation.looks_ahead
        self._robot = _Robot.of(scene)
        self._kinds = {fitting.name: fitting.kind for fitting in scene.sensors}

    @override
    def scene(self, scene: Scene) -> Scene:
        factor = self._mutation.mass
        return scene if factor == 1 else replace(scene, model=heavier(scene.model, factor))

    @override
    def controller(self, controller: Controller) -> Controller:
        return replace(controller, command=_Altered(controller.command, self._answer))

    @override
    def motion(self, motion: DriveMotion | None) -> DriveMotion | None:
        mutation = self._mutation
        rewired = mutation.crossed_wheels or {mutation.dead_joint, mutation.reversed_joint}.intersection(
            () if motion is None else motion.joints
        )
        return _Rewired(motion, self._behind_drive) if motion is not None and rewired else motion

    @override
    def at_rest(self, targets: JointTargets) -> JointTargets:
        joint = self._mutation.dead_joint
        return targets.updated_by(JointTargets(effort={joint: 0.0})) if joint else targets

    @override
    def measure(self, sensor: str, measure: Measure) -> Measure:
        if sensor != self._mutation.sensor:
            return measure
        match self._mutation.reading:
            case "frozen":
                return frozen(measure)
            case "stale":
                return _stale(measure)
        return _shifted(measure, self._kinds[sensor], grows=self._mutation.reading == "drifting")

    def _answer(self, answer: Answer) -> Answer:
        """Return the answer of a controller as it reaches the robot."""
        if answer is None or self._mutation.silent:
            return None
        commands = tuple(map(self._command, commands_of(answer)))
        return commands if isinstance(answer, tuple) else commands[0]

    def _command(self, command: Command) -> Command:
        mutation = self._mutation
        if mutation.speed != 1:
            command = self._robot.faster(command, mutation.speed)
        if mutation.reversed and not isinstance(command, JointTargets):
            command = _scaled(command, *(-1.0 if part == mutation.reversed else 1.0 for part in ("linear", "angular")))
        if mutation.mirrored:
            command = self._robot.mirrored(command)
        return self._at_motors(command) if isinstance(command, JointTargets) else command

    def _behind_drive(self, targets: JointTargets) -> JointTargets:
        """Return the targets of a drive as they reach the motors."""
        return self._at_motors(self._robot.crossed(targets) if self._mutation.crossed_wheels else targets)

    def _at_motors(self, targets: JointTargets) -> JointTargets:
        if joint := self._mutation.reversed_joint:
            targets = self._robot.moved(targets, lambda name: -1.0 if name == joint else 1.0)
        return without_motor(targets, self._mutation.dead_joint)


class _Altered:
    """A controller's function with altered answers; the same answer becomes the same altered one."""

    def __init__(self, command: Callable[[Any], Answer], alter: Callable[[Answer], Answer]) -> None:
        self._command, self._alter = command, alter
        self._last: tuple[Answer, Answer] = (None, None)

    def __call__(self, moment: Any) -> Answer:
        answer = self._command(moment)
        altered = self._alter(answer)
        # A script may change its last command and return it again.
        if answer is not self._last[0] or altered != self._last[1]:
            self._last = answer, altered
        return self._last[1]


class _Rewired(DriveMotion):
    """A drive whose targets reach the motors altered."""

    def __init__(self, motion: DriveMotion, alter: Callable[[JointTargets], JointTargets]) -> None:
        self._motion, self._alter = motion, alter

    @property
    @override
    def joints(self) -> frozenset[str]:
        return self._motion.joints

    @property
    @override
    def released(self) -> JointTargets:
        return self._motion.released

    @property
    @override
    def notes(self) -> tuple[str, ...]:
        return self._motion.notes

    @override
    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        return [self._alter(targets) for targets in self._motion.targets(twist, steps)]


def without_motor(targets: JointTargets, joint: str) -> JointTargets:
    """Return targets with which the motor of a joint exerts nothing, if they name the joint."""
    if joint not in targets.names():
        return targets

    def others(group: Mapping[str, float]) -> dict[str, float]:
        return {name: value for name, value in group.items() if name != joint}

    return replace(
        targets,
        position=others(targets.position),
        velocity=others(targets.velocity),
        effort={**others(targets.effort), joint: 0.0},
        max_effort=others(targets.max_effort),
        motions=without_joints(targets.motions, {joint}),
    )


def _stale(measure: Measure) -> Measure:
    """Return the function of a sensor whose readings are old by STALE_S, with the time of the moment."""
    readings = deque[Any]()

    def stale(sight: Sight) -> Any:
        readings.append(measure(sight))
        while len(readings) > 1 and readings[1].time <= sight.time - STALE_S + TIME_EPSILON_S:
            readings.popleft()
        return replace(readings[0], time=sight.time)

    return stale


def _shifted(measure: Measure, kind: str, *, grows: bool) -> Measure:
    """Return the function of a sensor that adds an error to all numbers; it grows with time, or is constant."""
    biases = {name: BIASES.get(column.dimension.si, 1.0) for name, column in biased_columns(kind).items()}

    def shifted_by(sight: Sight) -> Any:
        share = sight.time / DRIFT_S if grows else 1.0
        return shifted(measure(sight), kind, {name: share * bias for name, bias in biases.items()})

    return shifted_by


@dataclass(frozen=True, slots=True)
class _Robot:
    """The facts about a robot that altered commands need."""

    # joint -> its position at the start, in rad (m if prismatic)
    start: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # joint -> its limits
    partners: Mapping[str, str] = field(default_factory=dict)  # joint -> the joint on the other side

    @classmethod
    def of(cls, scene: Scene) -> _Robot:
        """Return the facts about the robot of a scene."""
        joints = scene.model.moving_joints
        limits = {
            joint.name: (joint.lower, joint.upper)
            for joint in joints
            if joint.lower is not None and joint.upper is not None
        }
        return cls(scene.joint_positions, limits, partners(joint.name for joint in joints))

    def faster(self, command: Command, factor: float) -> Command:
        """Return a command with all speeds, efforts and forces multiplied, and the way of joints from their start."""
        return self.moved(command, lambda _: factor) if isinstance(command, JointTargets) else _scaled(command, factor)

    def moved(self, targets: JointTargets, factor_of: Callable[[str], float]) -> JointTargets:
        """Return targets with speeds, efforts and the way from the start multiplied by the factor of each joint."""
        return replace(
            targets,
            position={name: self._farther(name, value, factor_of(name)) for name, value in targets.position.items()},
            velocity={name: factor_of(name) * value for name, value in targets.velocity.items()},
            effort={name: factor_of(name) * value for name, value in targets.effort.items()},
            motions=tuple(self._farther_motion(motion, factor_of) for motion in targets.motions),
        )

    def _farther_motion(self, motion: JointMotion, factor_of: Callable[[str], float]) -> JointMotion:
        pairs = zip(motion.names, motion.curves, strict=True)
        curves = tuple(curve.scaled(factor_of(name), self.start.get(name, 0.0)) for name, curve in pairs)
        lower, upper = zip(*(self.limits.get(name, (-math.inf, math.inf)) for name in motion.names), strict=True)
        return replace(motion, curves=curves, lower=lower, upper=upper)

    def _farther(self, joint: str, position: float, factor: float) -> float:
        start = self.start.get(joint, 0.0)
        target = start + factor * (position - start)
        lower, upper = self.limits.get(joint, (target, target))
        # A target that was beyond a limit before stays as it is.
        return max(min(lower, position), min(max(upper, position), target))

    def mirrored(self, command: Command) -> Command:
        """Return a command with left and right swapped."""
        if isinstance(command, Twist):
            return Twist(_flipped(command.linear_xyz), _turned(command.angular_xyz))
        if isinstance(command, LinkWrench):
            force = _flipped(command.force_xyz)
            torque = _turned(command.torque_xyz)
            return replace(command, force_xyz=force, torque_xyz=torque, point_xyz=_flipped(command.point_xyz))
        return self.crossed(command)

    def crossed(self, targets: JointTargets) -> JointTargets:
        """Return targets with the joints of both sides swapped."""
        return replace(
            targets,
            position=self._swapped(targets.position),
            velocity=self._swapped(targets.velocity),
            effort=self._swapped(targets.effort),
            max_effort=self._swapped(targets.max_effort),
            motions=tuple(
                replace(motion, names=tuple(self.partners.get(name, name) for name in motion.names))
                for motion in targets.motions
            ),
        )

    def _swapped(self, group: Mapping[str, float]) -> dict[str, float]:
        return {self.partners.get(name, name): value for name, value in group.items()}


def _scaled(command: Twist | LinkWrench, linear: float, angular: float | None = None) -> Twist | LinkWrench:
    """Return a command whose linear part is multiplied, and whose angular part is, too, or by another factor."""
    angular = linear if angular is None else angular
    if isinstance(command, Twist):
        return Twist(scale(command.linear_xyz, linear), scale(command.angular_xyz, angular))
    force, torque = scale(command.force_xyz, linear), scale(command.torque_xyz, angular)
    return replace(command, force_xyz=force, torque_xyz=torque)


def _flipped(vector: Vector3) -> Vector3:
    x, y, z = vector
    return (x, 0.0 - y, z)


def _turned(vector: Vector3) -> Vector3:
    x, y, z = vector
    return (0.0 - x, y, 0.0 - z)


_SIDES: Final = (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"), ("l", "r"), ("L", "R"))
# A side of one letter is a word of its own, also with front, middle or rear: FL_hip, rear_l, fl.
_LETTER: Final = r"(?<![A-Za-z])([fmbrhFMBRH]?){side}([fmbhFMBH]?)(?![A-Za-z])"


def partners(names: Iterable[str]) -> dict[str, str]:
    """Return joint -> the joint on the other side, for joints with "left" or "right", or "l" or "r", in their names."""
    joint_names = frozenset(names)
    candidates = {}
    for name in joint_names:
        for side, other in (*_SIDES, *((right, left) for left, right in _SIDES)):
            pattern = _LETTER.format(side=side) if len(side) == 1 else side
            swap = rf"\g<1>{other}\g<2>" if len(side) == 1 else other
            partner = re.sub(pattern, swap, name, count=1)
            if partner != name and partner in joint_names:
                candidates[name] = partner
                break
    return {name: partner for name, partner in candidates.items() if candidates.get(partner) == name}


def heavier(model: RobotModel, factor: float) -> RobotModel:
    """Return a robot whose links all have their mass and inertia multiplied."""
    links = tuple(
        replace(link, mass=link.mass and factor * link.mass, inertial=link.inertial and link.inertial.scaled(factor))
        for link in model.links
    )
    if model.mjcf is not None:
        return replace(model, links=links, mjcf=replace(model.mjcf, heaviness=factor))
    root = ET.fromstring(model.urdf)  # noqa: S314 - the loader wrote this text
    for element in (*root.iterfind("link/inertial/mass"), *root.iterfind("link/inertial/inertia")):
        for name, value in element.attrib.items():
            element.set(name, repr(factor * float(value)))
    return replace(model, links=links, urdf=ET.tostring(root, encoding="unicode"))
