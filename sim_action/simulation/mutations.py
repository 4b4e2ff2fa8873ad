"""The mutations of a run at its seams: altered commands, motors that are off, frozen sensors, a heavier robot."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final
from xml.etree import ElementTree as ET

from typing_extensions import override

from sim_action.commands import Controller
from sim_action.core.geometry import Twist, Vector3, scale
from sim_action.core.records import dataclass, field, replace
from sim_action.drives import DriveMotion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.scenario.mutation import Mutation
from sim_action.sensors import Measure, Sight
from sim_action.simulation.seams import Seams
from sim_action.state.command import Answer, Command, JointTargets, LinkWrench, commands_of, without_joints
from sim_action.state.joint_motion import JointMotion
from sim_action.world.scene import Scene


class MutantSeams(Seams):
    """The seams of a run with a mutation."""

    runs_on = True

    def __init__(self, mutation: Mutation, scene: Scene) -> None:
        """Prepare the mutation for a scene."""
        self._mutation = mutation
        self._robot = _Robot.of(scene)

    @override
    def scene(self, scene: Scene) -> Scene:
        factor = self._mutation.mass
        return scene if factor == 1 else replace(scene, model=heavier(scene.model, factor))

    @override
    def controller(self, controller: Controller) -> Controller:
        return replace(controller, command=_Altered(controller.command, self._answer))

    @override
    def motion(self, motion: DriveMotion | None) -> DriveMotion | None:
        joint = self._mutation.dead_joint
        return motion if motion is None or joint not in motion.joints else _WithoutMotor(motion, joint)

    @override
    def at_rest(self, targets: JointTargets) -> JointTargets:
        joint = self._mutation.dead_joint
        return targets.updated_by(JointTargets(effort={joint: 0.0})) if joint else targets

    @override
    def measure(self, sensor: str, measure: Measure) -> Measure:
        return _frozen(measure) if sensor == self._mutation.frozen_sensor else measure

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
        if mutation.mirrored:
            command = self._robot.mirrored(command)
        return without_motor(command, mutation.dead_joint) if isinstance(command, JointTargets) else command


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


class _WithoutMotor(DriveMotion):
    """A drive with the motor of one joint off."""

    def __init__(self, motion: DriveMotion, joint: str) -> None:
        self._motion, self._joint = motion, joint

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
        return [without_motor(targets, self._joint) for targets in self._motion.targets(twist, steps)]


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


def _frozen(measure: Measure) -> Measure:
    """Return the function of a sensor that repeats its first reading, with the time of the moment."""
    # Each kind of sensor has a record of its own.
    first: Any = None

    def frozen(sight: Sight) -> Any:
        nonlocal first
        # It measures in any case: its noise draws the same numbers.
        reading = measure(sight)
        if first is None:
            first = reading
        return replace(first, time=sight.time)

    return frozen


@dataclass(frozen=True, slots=True)
class _Robot:
    """The facts about a robot that altered commands need.

    Attributes:
        start: joint -> its position at the start, in rad (m if prismatic).
        limits: joint -> its limits.
        partners: joint -> the joint on the other side.
    """

    start: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    partners: Mapping[str, str] = field(default_factory=dict)

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
        if isinstance(command, Twist):
            return Twist(scale(command.linear_xyz, factor), scale(command.angular_xyz, factor))
        if isinstance(command, LinkWrench):
            force, torque = scale(command.force_xyz, factor), scale(command.torque_xyz, factor)
            return replace(command, force_xyz=force, torque_xyz=torque)
        return replace(
            command,
            position={name: self._farther(name, value, factor) for name, value in command.position.items()},
            velocity={name: factor * value for name, value in command.velocity.items()},
            effort={name: factor * value for name, value in command.effort.items()},
            motions=tuple(self._farther_motion(motion, factor) for motion in command.motions),
        )

    def _farther_motion(self, motion: JointMotion, factor: float) -> JointMotion:
        pairs = zip(motion.names, motion.curves, strict=True)
        curves = tuple(curve.scaled(factor, self.start.get(name, 0.0)) for name, curve in pairs)
        lower, upper = zip(*(self.limits.get(name, (-math.inf, math.inf)) for name in motion.names), strict=True)
        return replace(motion, curves=curves, lower=lower, upper=upper)

    def _farther(self, joint: str, position: float, factor: float) -> float:
        start = self.start.get(joint, 0.0)
        wanted = start + factor * (position - start)
        lower, upper = self.limits.get(joint, (wanted, wanted))
        # A target that was beyond a limit before stays as it is.
        return max(min(lower, position), min(max(upper, position), wanted))

    def mirrored(self, command: Command) -> Command:
        """Return a command with left and right swapped."""
        if isinstance(command, Twist):
            return Twist(_flipped(command.linear_xyz), _turned(command.angular_xyz))
        if isinstance(command, LinkWrench):
            force, torque = _flipped(command.force_xyz), _turned(command.torque_xyz)
            return replace(command, force_xyz=force, torque_xyz=torque, point_xyz=_flipped(command.point_xyz))
        return replace(
            command,
            position=self._swapped(command.position),
            velocity=self._swapped(command.velocity),
            effort=self._swapped(command.effort),
            max_effort=self._swapped(command.max_effort),
            motions=tuple(
                replace(motion, names=tuple(self.partners.get(name, name) for name in motion.names))
                for motion in command.motions
            ),
        )

    def _swapped(self, group: Mapping[str, float]) -> dict[str, float]:
        return {self.partners.get(name, name): value for name, value in group.items()}


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
    known = frozenset(names)
    found = {}
    for name in known:
        for side, other in (*_SIDES, *((right, left) for left, right in _SIDES)):
            pattern = _LETTER.format(side=side) if len(side) == 1 else side
            swap = rf"\g<1>{other}\g<2>" if len(side) == 1 else other
            partner = re.sub(pattern, swap, name, count=1)
            if partner != name and partner in known:
                found[name] = partner
                break
    return {name: partner for name, partner in found.items() if found.get(partner) == name}


def heavier(model: RobotModel, factor: float) -> RobotModel:
    """Return a robot whose links all have their mass and inertia multiplied; not for MJCF."""
    root = ET.fromstring(model.urdf)  # noqa: S314 - the loader wrote this text
    for element in (*root.iterfind("link/inertial/mass"), *root.iterfind("link/inertial/inertia")):
        for name, value in element.attrib.items():
            element.set(name, repr(factor * float(value)))
    links = tuple(link if link.mass is None else replace(link, mass=factor * link.mass) for link in model.links)
    return replace(model, links=links, urdf=ET.tostring(root, encoding="unicode"))
