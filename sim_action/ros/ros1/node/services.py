"""The services of gazebo_ros_api_plugin: they spawn, delete, set, push and read models, links, joints and physics."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from threading import Event
from typing import Any, Final
from xml.etree.ElementTree import Element

import rospy
from gazebo_msgs.msg import LinkState, ModelState, ODEPhysics
from gazebo_msgs.srv import (
    ApplyBodyWrench,
    ApplyJointEffort,
    BodyRequest,
    DeleteModel,
    GetJointProperties,
    GetJointPropertiesResponse,
    GetLinkProperties,
    GetLinkState,
    GetModelProperties,
    GetModelState,
    GetPhysicsProperties,
    GetWorldProperties,
    JointRequest,
    SetLinkState,
    SetModelConfiguration,
    SetModelState,
    SetPhysicsProperties,
    SpawnModel,
)
from geometry_msgs.msg import Vector3
from std_srvs.srv import Empty

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.core.records import replace
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.kinematics import LinkStates
from sim_action.robot.model.robot_model import MOMENTS, Inertial, Joint, JointType, RobotModel
from sim_action.ros.robot_topics import in_frame_of
from sim_action.ros.ros1.gazebo_worlds import BadWorld, body_of, flat_robot
from sim_action.ros.ros1.node.message_classes import header, pose_message, pose_of, twist_message, twist_of
from sim_action.ros.ros1.node.world_models import (
    Alter,
    ChangeQueue,
    CurrentState,
    JointEfforts,
    SpawnedRobot,
    WorldModels,
    description_of,
    refuse_unknown,
    unknown_model_message,
)
from sim_action.world import Disturbance, World
from sim_action.world.world_files.losses import Loss

WORLD_FRAMES: Final = frozenset({"", "world", "map", "/map", "ground_plane"})

_TYPES: Final[dict[JointType, int]] = {
    "revolute": GetJointPropertiesResponse.REVOLUTE,
    "continuous": GetJointPropertiesResponse.CONTINUOUS,
    "prismatic": GetJointPropertiesResponse.PRISMATIC,
    "fixed": GetJointPropertiesResponse.FIXED,
}
_BODY_LINK: Final = "link"  # the name of the one link of every body
_FOREVER_S: Final = 1e5


class GazeboServices:
    """The services, open as long as the node lives; `rate`: physics steps per second, in Hz."""

    def __init__(
        self, current: CurrentState, changes: ChangeQueue, paused: Event, efforts: JointEfforts, rate: float
    ) -> None:
        self._current, self._changes, self._paused, self._efforts = current, changes, paused, efforts
        self._rate, self._numbers = rate, count(1)
        self.losses: list[Loss] = []
        for name, kind, answer in (
            ("spawn_urdf_model", SpawnModel, self._spawn),
            ("spawn_sdf_model", SpawnModel, self._spawn),
            ("delete_model", DeleteModel, self._delete),
            ("set_model_state", SetModelState, lambda asked: self._set_state(asked.model_state)),
            ("set_link_state", SetLinkState, lambda asked: self._set_link(asked.link_state)),
            ("set_physics_properties", SetPhysicsProperties, self._set_physics),
            ("set_model_configuration", SetModelConfiguration, self._set_joints),
            ("get_model_state", GetModelState, self._get_state),
            ("get_world_properties", GetWorldProperties, self._properties),
            ("get_link_state", GetLinkState, lambda asked: _tried(self._link_state, asked)),
            ("get_link_properties", GetLinkProperties, lambda asked: _tried(self._link, asked.link_name)),
            ("get_joint_properties", GetJointProperties, lambda asked: _tried(self._joint, asked.joint_name)),
            ("get_model_properties", GetModelProperties, lambda asked: _tried(self._model, asked.model_name)),
            ("get_physics_properties", GetPhysicsProperties, self._physics),
            ("reset_world", Empty, lambda _: self._reset(restarts=False)),
            ("reset_simulation", Empty, lambda _: self._reset(restarts=True)),
            ("pause_physics", Empty, lambda _: _done(paused.set)),
            ("unpause_physics", Empty, lambda _: _done(paused.clear)),
            ("apply_body_wrench", ApplyBodyWrench, self._press),
            ("clear_body_wrenches", BodyRequest, self._release),
            ("apply_joint_effort", ApplyJointEffort, self._turn),
            ("clear_joint_forces", JointRequest, lambda asked: _done(efforts.clear, _short(asked.joint_name))),
        ):
            rospy.Service(f"~{name}", kind, answer)
        rospy.Subscriber("~set_model_state", ModelState, self._set_state, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("~set_link_state", LinkState, self._set_link, queue_size=1, tcp_nodelay=True)

    def _spawn(self, request: Any) -> tuple[bool, str]:
        name = request.model_name

        def alter(models: WorldModels) -> WorldModels:
            if name in models.names:
                raise ValueError(f"a model '{name}' already exists")
            pose = self._in_world(pose_of(request.initial_pose), request.reference_frame)
            root = description_of(text := request.model_xml)
            if is_robot(root):
                if models.robot is not None:
                    raise ValueError(f"only one robot is supported, and '{models.robot.name}' already exists")
                number, space, root = next(self._numbers), request.robot_namespace, flat_robot(root, text)
                return replace(models, robot=SpawnedRobot(name, root, pose, space=space, text=text, number=number))
            try:
                body, losses = body_of(name, text, pose)
            except BadWorld as error:
                raise ValueError(f"'{name}' cannot be spawned: {error}") from None
            self.losses += losses
            return models.with_body(body)

        return self._answer(alter, f"'{name}' is spawned")

    def _delete(self, request: Any) -> tuple[bool, str]:
        name = request.model_name

        def alter(models: WorldModels) -> WorldModels:
            refuse_unknown(name, models)
            return models.without(name)

        return self._answer(alter, f"'{name}' is deleted")

    def _set_state(self, state: Any) -> tuple[bool, str]:
        name, velocity = state.model_name, twist_of(state.twist).linear_xyz

        def alter(models: WorldModels) -> WorldModels:
            refuse_unknown(name, models)
            moved = models.moved({name: self._in_world(pose_of(state.pose), state.reference_frame)})
            return moved.with_velocity(name, velocity) if any(velocity) and models.can_move(name) else moved

        return self._answer(alter, f"the state of '{name}' is set")

    def _set_link(self, state: Any) -> tuple[bool, str]:
        model, separator, link = state.link_name.rpartition("::")
        robot, described = self._current.world_models.robot, self._current.model
        is_robots = robot is not None and model in ("", robot.name)
        if is_robots and described is not None and link != described.root:
            return (
                False,
                f"only the base link '{described.root}' of the robot can be set; joints are moved by other services",
            )
        named = robot.name if robot is not None and not separator else model
        return self._set_state(ModelState(named, state.pose, state.twist, state.reference_frame))

    def _set_physics(self, request: Any) -> tuple[bool, str]:
        gravity = (request.gravity.x, request.gravity.y, request.gravity.z)

        def alter(models: WorldModels) -> WorldModels:
            valid = World.model_validate({"gravity": gravity}).gravity
            return replace(models, world=models.world.model_copy(update={"gravity": valid}))

        if gravity == self._current.world_models.world.gravity_xyz:
            return True, "gravity is unchanged; the engine and its steps cannot be changed"
        return self._answer(alter, "gravity is set; the engine and its steps cannot be changed")

    def _set_joints(self, request: Any) -> tuple[bool, str]:
        positions = dict(zip(request.joint_names, request.joint_positions, strict=False))

        def alter(models: WorldModels) -> WorldModels:
            robot = models.robot
            if robot is None or robot.name != request.model_name:
                raise ValueError(f"there is no robot '{request.model_name}'")
            return replace(models, robot=replace(robot, joints={**robot.joints, **positions}))

        return self._answer(alter, f"the joints of '{request.model_name}' are set")

    def _reset(self, *, restarts: bool) -> tuple[()]:
        self._efforts.clear_all()
        self._changes.request(WorldModels.at_spawn_poses, restarts_time=restarts)
        return ()

    def _get_state(self, request: Any) -> Any:
        states, other = self._current.model_states, request.relative_entity_name
        if request.model_name not in states:
            why = unknown_model_message(request.model_name, self._current.world_models)
            return {"success": False, "status_message": why}
        pose, twist = states[request.model_name]
        if other not in WORLD_FRAMES:
            try:
                pose = geometry.compose(geometry.inverse(self._frame_of(other)), pose)
            except LookupError:
                return {"success": False, "status_message": f"there is no model or link '{other}'"}
        return {
            "header": header(self._current.time, other or "world"),
            "pose": pose_message(pose),
            "twist": twist_message(twist),
            "success": True,
            "status_message": "",
        }

    def _properties(self, _: Any) -> Any:
        current = self._current
        return {"sim_time": current.time, "model_names": list(current.world_models.names), "success": True}

    def _in_world(self, pose: Pose, frame: str) -> Pose:
        """Return a pose in the world frame. Raises ValueError for an unknown frame."""
        try:
            return pose if frame in WORLD_FRAMES else geometry.compose(self._frame_of(frame), pose)
        except LookupError:
            raise ValueError(f"there is no frame '{frame}'; a frame is a model, or a link of the robot") from None

    def _answer(self, alter: Alter, done: str) -> tuple[bool, str]:
        refused = self._changes.request(alter)
        return refused is None, refused or done

    def _link_state(self, asked: Any) -> dict[str, Any]:
        """Return the state of a link. Raises LookupError."""
        pose, twist = self._state_of(asked.link_name)
        frame = asked.reference_frame
        if frame not in WORLD_FRAMES:
            other = self._frame_of(frame)
            pose = geometry.compose(geometry.inverse(other), pose)
            twist = in_frame_of(other, twist)
        state = LinkState(asked.link_name, pose_message(pose), twist_message(twist), frame or "world")
        return {"link_state": state}

    def _link(self, name: str) -> dict[str, Any]:
        """Return the properties of a link. Raises LookupError."""
        model, short = self._robot, _short(name)
        link = model.links_by_name.get(short)
        if link is None:
            raise LookupError(f"the robot has no link '{short}'{did_you_mean(short, model.links_by_name)}")
        inertial = link.inertial or Inertial(0.0, Pose(link.centre_of_mass_xyz), (0.0,) * 6)
        moments = dict(zip(MOMENTS, inertial.moments, strict=True))
        return {"com": pose_message(inertial.pose), "gravity_mode": True, "mass": link.mass or 0.0, **moments}

    def _joint(self, name: str) -> dict[str, Any]:
        """Return the properties of a joint. Raises LookupError."""
        joint = self._robot_joint(name)
        state = self._current.joints.get(joint.name)
        moving = {"position": [state.position], "rate": [state.velocity]} if state else {}
        return {"type": _TYPES[joint.type], "damping": [], **moving}

    def _model(self, name: str) -> dict[str, Any]:
        """Return the properties of a model. Raises LookupError."""
        models, model = self._current.world_models, self._current.model
        if models.robot is not None and models.robot.name == name and model is not None:
            geoms = [f"{link.name}_collision" for link in model.links if link.collisions]
            return {
                "canonical_body_name": model.root,
                "body_names": [link.name for link in model.links],
                "geom_names": geoms,
                "joint_names": [joint.name for joint in model.joints],
            }
        for body in models.world.objects:
            if body.name == name:
                names = {"body_names": [_BODY_LINK], "geom_names": [_BODY_LINK]}
                return {"canonical_body_name": _BODY_LINK, "is_static": body.mass is None, **names}
        raise LookupError(unknown_model_message(name, models))

    def _physics(self, _: Any) -> dict[str, Any]:
        return {
            "time_step": 1 / self._rate,
            "pause": self._paused.is_set(),
            "max_update_rate": 0.0,
            "gravity": Vector3(*self._current.world_models.world.gravity_xyz),
            "ode_config": ODEPhysics(),
            "success": True,
            "status_message": "the engine is not ODE: ode_config has no meaning here",
        }

    def _press(self, request: Any) -> tuple[bool, str]:
        model, _, link = request.body_name.partition("::")
        force, torque, point = request.wrench.force, request.wrench.torque, request.reference_point
        seconds = request.duration.to_sec()

        def alter(models: WorldModels) -> WorldModels:
            refuse_unknown(model, models)
            robot = models.robot
            is_robot = robot is not None and robot.name == model
            described = self._current.model
            if is_robot and link and link not in (described.links_by_name if described else ()):
                raise ValueError(f"there is no link '{link}' in '{model}'")
            if seconds == 0:
                raise ValueError("a wrench needs a duration; a negative duration means forever")
            begins = max(0.0, request.start_time.to_sec() - self._current.time)
            disturbance = Disturbance.model_validate(
                {
                    "at": begins,
                    "for": seconds if seconds > 0 else _FOREVER_S,
                    **({"link": link or None} if is_robot else {"body": model}),
                    "force": (force.x, force.y, force.z),
                    "torque": (torque.x, torque.y, torque.z),
                    **({"point": (point.x, point.y, point.z)} if any((point.x, point.y, point.z)) else {}),
                }
            )
            return models.with_disturbance(disturbance)

        return self._answer(alter, "the wrench is applied")

    def _release(self, request: Any) -> tuple[()]:
        model, _, link = request.body_name.partition("::")

        def alter(models: WorldModels) -> WorldModels:
            robot = models.robot
            of_robot = robot is not None and robot.name == model
            return models.without_wrench(None if of_robot else model, link if of_robot else "")

        self._changes.request(alter)
        return ()

    def _turn(self, request: Any) -> tuple[bool, str]:
        seconds = request.duration.to_sec()
        try:
            joint = self._robot_joint(request.joint_name)
        except LookupError as error:
            return False, str(error.args[0])
        if seconds == 0:
            return False, "an effort needs a duration; a negative duration means forever"
        begins = max(self._current.time, request.start_time.to_sec())
        self._efforts.apply(joint.name, request.effort, begins, seconds)
        return True, "the effort is applied"

    @property
    def _robot(self) -> RobotModel:
        """The model of the robot. Raises LookupError."""
        if self._current.model is None or self._current.world_models.robot is None:
            raise LookupError("there is no robot")
        return self._current.model

    def _robot_joint(self, name: str) -> Joint:
        """Return a joint by its name, with or without the name of its model. Raises LookupError."""
        short, joints = _short(name), self._robot.joints_by_name
        if short not in joints:
            raise LookupError(f"the robot has no joint '{short}'{did_you_mean(short, joints)}")
        return joints[short]

    def _state_of(self, name: str) -> tuple[Pose, Twist]:
        """Return the state of `model::link`, or of a link of the robot by its own name. Raises LookupError."""
        model, separator, link = name.rpartition("::")
        robot, states = self._current.world_models.robot, self._current.model_states
        if separator and (robot is None or model != robot.name) and model in states:
            return states[model]
        described = self._robot
        if (separator and robot is not None and model != robot.name) or link not in described.links_by_name:
            raise LookupError(f"there is no link '{name}'{did_you_mean(link, described.links_by_name)}")
        return LinkStates(described, *self._current.base, self._current.joints)[link]

    def _frame_of(self, name: str) -> Pose:
        """Return the pose of a model or of a link in the world. Raises LookupError."""
        states = self._current.model_states
        return states[name][0] if name in states else self._state_of(name)[0]


def _done(change: Callable[..., None], *arguments: str) -> tuple[()]:
    change(*arguments)
    return ()


def _short(name: str) -> str:
    return name.rpartition("::")[2]


def _tried(what: Any, asked: Any) -> dict[str, Any]:
    """Return the answer of a service, or the reason of its failure."""
    try:
        return {**what(asked), "success": True}
    except LookupError as error:
        return {"success": False, "status_message": str(error.args[0])}


def is_robot(root: Element) -> bool:
    """Return True for a model with joints or plugins; any other model is a body of the world."""
    return root.tag == "robot" or any(True for tag in ("joint", "plugin") for _ in root.iter(tag))
