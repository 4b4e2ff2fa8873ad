"""The models of the world, changes that nodes ask for, efforts on joints, and the current state for services.

Models, the robot and spawned bodies, are plain data from which a simulation can start. Services run in threads of their
own. This module does not import rospy.
"""

from __future__ import annotations

import math
import queue
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final, Self
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import ControllersFinished
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.records import dataclass, field, replace
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import Answer, JointTargets, commands_of
from sim_action.state.observation import JointState
from sim_action.world import Body, Disturbance, World

_MAX_ANSWER_S: Final = 30.0

States = Mapping[str, tuple[Pose, Twist]]
"""Name of a model or a link -> pose and twist, world frame."""


def description_of(text: str) -> Element:
    """Return the root of a description; of one that is not XML, an empty robot: the reader of models explains it."""
    try:
        return ET.fromstring(text)  # noqa: S314 - of the robot that is simulated
    except ET.ParseError:
        return Element("robot")


@dataclass(frozen=True, slots=True)
class SpawnedRobot:
    """The robot, as it was spawned; `root`: of its URDF or SDF, which is in a file, such as a world, or in a text.

    `pose`: of its base link, raised until the robot is on the ground. `joints`: positions in rad or m; the others are
    at home. `space`: namespace of plugins that state none. `number`: of its spawn; another spawn is another robot.
    """

    name: str
    root: Element
    pose: Pose
    joints: Mapping[str, float] = field(default_factory=dict)
    space: str = ""
    file: str | None = None
    text: str = ""
    number: int = 0


@dataclass(frozen=True, slots=True)
class WorldModels:
    """All models of the world; `robot` None: not spawned yet; `spawn_poses`: first poses of models that have moved."""

    world: World
    robot: SpawnedRobot | None = None
    spawn_poses: Mapping[str, Pose] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all models, the ground first, as in Gazebo."""
        bodies = tuple(body.name for body in self.world.objects)
        return ("ground_plane", *bodies, *([self.robot.name] if self.robot else []))

    def with_body(self, body: Body) -> Self:
        """Return the models with a new body, which replaces a model of the same name."""
        others = self.without(body.name)
        return others.with_world(objects=(*others.world.objects, body))

    def without(self, name: str) -> Self:
        """Return the models without one."""
        spawn_poses = {model: pose for model, pose in self.spawn_poses.items() if model != name}
        if self.robot is not None and self.robot.name == name:
            return replace(self, robot=None, spawn_poses=spawn_poses)
        others = tuple(body for body in self.world.objects if body.name != name)
        return replace(self.with_world(objects=others), spawn_poses=spawn_poses)

    def moved(self, poses: Mapping[str, Pose], joints: Mapping[str, float] | None = None) -> Self:
        """Return the models with new poses of some; `joints`: joint positions of the robot."""
        objects = tuple(
            body.model_copy(update={"pose": Placement.of(poses[body.name])}) if body.name in poses else body
            for body in self.world.objects
        )
        spawn_poses = {body.name: _pose_of(body.pose) for body in self.world.objects}
        robot = self.robot
        if robot is not None:
            spawn_poses[robot.name] = robot.pose
            at = poses.get(robot.name, robot.pose)
            robot = replace(robot, pose=at, joints=robot.joints if joints is None else joints)
        return replace(self.with_world(objects=objects), robot=robot, spawn_poses={**spawn_poses, **self.spawn_poses})

    def can_move(self, name: str) -> bool:
        """Return True if a model has a mass: the robot, and some bodies."""
        return all(body.mass is not None for body in self.world.objects if body.name == name)

    def with_velocity(self, name: str, velocity_xyz: Vector3) -> Self:
        """Return the models with a start velocity of one, in m/s, world frame."""
        is_robot = self.robot is not None and self.robot.name == name
        push = Disturbance.model_validate({"at": 0.0, "velocity": velocity_xyz, **({} if is_robot else {"body": name})})
        return self.with_disturbance(push)

    def with_disturbance(self, push: Disturbance) -> Self:
        """Return the models with one more disturbance."""
        return self.with_world(disturbances=(*self.world.disturbances, push))

    def with_world(self, **changes: Any) -> Self:
        """Return the models with other keys of the world."""
        return replace(self, world=self.world.model_copy(update=changes))

    def without_wrench(self, body: str | None, link: str) -> Self:
        """Return the models without the wrenches on a body; body None: on a link of the robot, "" its base link."""
        left = tuple(
            disturbance
            for disturbance in self.world.disturbances
            if (disturbance.body, disturbance.link or "") != (body, "" if body else link)
        )
        return self.with_world(disturbances=left)

    def after(self, seconds: float) -> Self:
        """Return the models after a time in s, with the remaining part of each disturbance."""
        left = (_push_after(push, seconds) for push in self.world.disturbances if push.end > seconds)
        return self.with_world(disturbances=tuple(left))

    def at_spawn_poses(self) -> Self:
        """Return the models at their first poses, without disturbances."""
        return self.moved(self.spawn_poses, {}).with_world(disturbances=())


def _push_after(push: Disturbance, seconds: float) -> Disturbance:
    begins = max(0.0, push.at - seconds)
    return push.model_copy(update={"at": begins, "duration": push.end - seconds - begins})


def _pose_of(placement: Placement) -> Pose:
    return Pose((placement.x, placement.y, placement.z or 0.0), placement.orientation_xyzw)


def refuse_unknown(name: str, models: WorldModels) -> None:
    """Raise ValueError if there is no such model, or it is the ground."""
    if name not in models.names[1:]:
        raise ValueError(unknown_model_message(name, models))


def unknown_model_message(name: str, models: WorldModels) -> str:
    """Return the message for an unknown model."""
    return f"there is no model '{name}'; the models are {', '.join(models.names)}"


Alter = Callable[[WorldModels], WorldModels]
"""Function from models to changed models. Raises ValueError with the message for the caller of the service."""


class WorldChanged(ControllersFinished):
    """The world changed: the episode ends, and the next one starts from the current state."""


@dataclass()
class Change:
    """One requested change, until it is answered; `refusal`: the reason why it was not made."""

    alter: Alter
    restarts_time: bool = False
    refusal: str | None = None
    done: threading.Event = field(default_factory=threading.Event)


class ChangeQueue:
    """The requested changes of all services. Each service handler waits in a thread of its own."""

    def __init__(self) -> None:
        self._waiting = queue.SimpleQueue[Change]()

    def request(self, alter: Alter, *, restarts_time: bool = False) -> str | None:
        """Request a change and wait for it; return the reason if it was refused."""
        change = Change(alter, restarts_time)
        self._waiting.put(change)
        if not change.done.wait(_MAX_ANSWER_S):
            return "the simulation does not answer"
        return change.refusal

    def has_pending(self) -> bool:
        """Return True if a change is waiting."""
        return not self._waiting.empty()

    def apply(self, models: WorldModels) -> tuple[WorldModels, bool]:
        """Return the models after all waiting changes, and True if sim time restarts."""
        restarts = False
        while not self._waiting.empty():
            change = self._waiting.get()
            try:
                models = change.alter(models)
                restarts = restarts or change.restarts_time
            except ValueError as error:
                change.refusal = str(error)
            change.done.set()
        return models, restarts


@dataclass(frozen=True, slots=True)
class JointEffort:
    """N m (or N) on a joint, between two sim times in s."""

    joint: str
    value: float
    begins: float
    ends: float


class JointEfforts:
    """The efforts that services apply to the joints of the robot; efforts on one joint add up."""

    def __init__(self) -> None:
        self._efforts: tuple[JointEffort, ...] = ()
        self._moved: frozenset[str] = frozenset()

    def apply(self, joint: str, value: float, begins: float, seconds: float) -> None:
        """Apply an effort; `seconds` negative: forever."""
        ends = math.inf if seconds < 0 else begins + seconds
        self._efforts = (*self._efforts, JointEffort(joint, value, begins, ends))

    def clear(self, joint: str) -> None:
        """End all efforts on a joint."""
        self._efforts = tuple(effort for effort in self._efforts if effort.joint != joint)

    def clear_all(self) -> None:
        """End all efforts, when the robot is deleted."""
        self._efforts, self._moved = (), frozenset()

    def added_to(self, answer: Answer, seconds: float, wheels: frozenset[str]) -> Answer:
        """Return the commands with efforts instead of others to their joints, except to `wheels` that a twist turns."""
        if not self._efforts and not self._moved:
            return answer
        commands = commands_of(answer)
        is_driven = any(isinstance(command, Twist) for command in commands)
        sums: dict[str, float] = {}
        for effort in self._efforts:
            if effort.begins <= seconds < effort.ends and not (is_driven and effort.joint in wheels):
                sums[effort.joint] = sums.get(effort.joint, 0.0) + effort.value
        self._efforts = tuple(effort for effort in self._efforts if seconds < effort.ends)
        let_go = JointTargets(effort=dict.fromkeys(self._moved - sums.keys() - (wheels if is_driven else set()), 0.0))
        self._moved = frozenset(sums)
        return (let_go, *commands, JointTargets(effort=sums))


@dataclass()
class CurrentState:
    """The current state. Only the loop changes it, while all nodes wait. Poses and twists are in the world frame.

    `time`, `began`: s of sim time now, and at the start of the episode. `started`: s of wall time at the start of the
    clock; None: not yet. `model_states`: without the ground.
    """

    world_models: WorldModels
    time: float = 0.0
    began: float = 0.0
    started: float | None = None
    model_states: States = field(default_factory=dict)
    model: RobotModel | None = None
    base: tuple[Pose, Twist] = (Pose(), Twist())
    joints: dict[str, JointState] = field(default_factory=dict)

    def models_now(self) -> WorldModels:
        """Return the models where they are now."""
        positions = {name: joint.position for name, joint in self.joints.items()}
        moved = self.world_models.moved({name: pose for name, (pose, _) in self.model_states.items()}, positions)
        return moved.after(self.time - self.began)


@dataclass(frozen=True, slots=True)
class ModelFrame:
    """The frame of a robot's model, which Gazebo reports; `base`: pose of the base link in it."""

    base: Pose

    def pose(self, base: Pose) -> Pose:
        """Return the pose of the model, from the pose of its base link."""
        return geometry.compose(base, geometry.inverse(self.base))

    def twist(self, base: Pose, twist: Twist) -> Twist:
        """Return the twist of the model's origin, from the twist of its base link; world frame."""
        arm = geometry.subtract(self.pose(base).position_xyz, base.position_xyz)
        return Twist(geometry.add(twist.linear_xyz, geometry.cross(twist.angular_xyz, arm)), twist.angular_xyz)

    def base_pose(self, pose: Pose) -> Pose:
        """Return the pose of the base link, from the pose of the model."""
        return geometry.compose(pose, self.base)
