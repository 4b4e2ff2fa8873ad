"""The services of gazebo_ros_api_plugin that read links, joints, models and physics."""

from __future__ import annotations

from threading import Event
from typing import Any, Final
from xml.etree import ElementTree as ET

import rospy
from gazebo_msgs.msg import LinkState, ODEPhysics
from gazebo_msgs.srv import (
    GetJointProperties,
    GetJointPropertiesResponse,
    GetLinkProperties,
    GetLinkState,
    GetModelProperties,
    GetPhysicsProperties,
)
from geometry_msgs.msg import Vector3

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.robot_model import JointType, Link, RobotModel
from sim_action.ros.ros1.node.current_state import CurrentState, link_state
from sim_action.ros.ros1.node.messages import pose_message, twist_message
from sim_action.ros.ros1.node.world_models import unknown_model_message

WORLD_FRAMES: Final = frozenset({"", "world", "map", "/map", "ground_plane"})

_TYPES: Final[dict[JointType, int]] = {
    "revolute": GetJointPropertiesResponse.REVOLUTE,
    "continuous": GetJointPropertiesResponse.CONTINUOUS,
    "prismatic": GetJointPropertiesResponse.PRISMATIC,
    "fixed": GetJointPropertiesResponse.FIXED,
}
_INERTIA_KEYS: Final = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
# The name of the one link of every body.
_BODY_LINK: Final = "link"


class QueryServices:
    """The query services, open as long as the node lives; `rate`: physics steps per second, in Hz."""

    def __init__(self, current: CurrentState, paused: Event, rate: float) -> None:
        self._current, self._paused, self._rate = current, paused, rate
        for name, kind, answer in (
            ("get_link_state", GetLinkState, lambda asked: _tried(self._link_state, asked)),
            ("get_link_properties", GetLinkProperties, lambda asked: _tried(self._link, asked.link_name)),
            ("get_joint_properties", GetJointProperties, lambda asked: _tried(self._joint, asked.joint_name)),
            ("get_model_properties", GetModelProperties, lambda asked: _tried(self._model, asked.model_name)),
            ("get_physics_properties", GetPhysicsProperties, self._physics),
        ):
            rospy.Service(f"/gazebo/{name}", kind, answer)

    def _link_state(self, asked: Any) -> dict[str, Any]:
        """Return the state of a link. Raises LookupError."""
        pose, twist = state_of(self._current, asked.link_name)
        frame = asked.reference_frame
        if frame not in WORLD_FRAMES:
            other = frame_of(self._current, frame)
            pose = geometry.compose(geometry.inverse(other), pose)
            back = geometry.conjugate(other.orientation_xyzw)
            twist = Twist(geometry.rotate(back, twist.linear_xyz), geometry.rotate(back, twist.angular_xyz))
        state = LinkState(asked.link_name, pose_message(pose), twist_message(twist), frame or "world")
        return {"link_state": state}

    def _link(self, name: str) -> dict[str, Any]:
        """Return the properties of a link. Raises LookupError."""
        model, short = robot_model(self._current), name.rpartition("::")[2]
        link = model.links_by_name.get(short)
        if link is None:
            raise LookupError(f"the robot has no link '{short}'{did_you_mean(short, model.links_by_name)}")
        turned, moments = _inertia(model, link)
        com = pose_message(Pose(link.centre_of_mass_xyz, turned))
        return {"com": com, "gravity_mode": True, "mass": link.mass or 0.0, **moments}

    def _joint(self, name: str) -> dict[str, Any]:
        """Return the properties of a joint. Raises LookupError."""
        joint = robot_joint(robot_model(self._current), name)
        found = robot_model(self._current).joints_by_name[joint]
        state = self._current.joints.get(joint)
        moving = {"position": [state.position], "rate": [state.velocity]} if state else {}
        return {"type": _TYPES[found.type], "damping": [], **moving}

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
                fixed = body.mass is None
                return {
                    "canonical_body_name": _BODY_LINK,
                    "body_names": [_BODY_LINK],
                    "geom_names": [_BODY_LINK],
                    "is_static": fixed,
                }
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


def robot_model(current: CurrentState) -> RobotModel:
    """Return the model of the robot. Raises LookupError."""
    if current.model is None or current.world_models.robot is None:
        raise LookupError("there is no robot")
    return current.model


def robot_joint(model: RobotModel, name: str) -> str:
    """Return a joint's name, without the name of its model. Raises LookupError."""
    short = name.rpartition("::")[2]
    if short not in model.joints_by_name:
        raise LookupError(f"the robot has no joint '{short}'{did_you_mean(short, model.joints_by_name)}")
    return short


def state_of(current: CurrentState, name: str) -> tuple[Pose, Twist]:
    """Return the state of `model::link`, or of a link of the robot by its own name. Raises LookupError."""
    model, separator, link = name.rpartition("::")
    robot = current.world_models.robot
    if separator and (robot is None or model != robot.name) and model in current.model_states:
        return current.model_states[model]
    described = robot_model(current)
    if (separator and robot is not None and model != robot.name) or link not in described.links_by_name:
        raise LookupError(f"there is no link '{name}'{did_you_mean(link, described.links_by_name)}")
    return link_state(described, current.base, current.joints, link)


def frame_of(current: CurrentState, name: str) -> Pose:
    """Return the pose of a model or of a link in the world. Raises LookupError."""
    return current.model_states[name][0] if name in current.model_states else state_of(current, name)[0]


def _inertia(model: RobotModel, link: Link) -> tuple[geometry.Quaternion, dict[str, float]]:
    """Return the rotation of the inertia axes in the link, and the moments about them, from the model's URDF."""
    root = ET.fromstring(model.urdf) if model.urdf else ET.Element("robot")  # noqa: S314 - written by ourselves
    inertial = next((each.find("inertial") for each in root.iter("link") if each.get("name") == link.name), None)
    stated = inertial.find("inertia") if inertial is not None else None
    origin = inertial.find("origin") if inertial is not None else None
    moments = {name: float(stated.get(name, 0.0)) if stated is not None else 0.0 for name in _INERTIA_KEYS}
    roll, pitch, yaw = map(float, (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split())
    return quaternion_from_rpy(roll, pitch, yaw), moments


def _tried(what: Any, asked: Any) -> dict[str, Any]:
    """Return the answer of a service, or the reason of its failure."""
    try:
        return {**what(asked), "success": True}
    except LookupError as error:
        return {"success": False, "status_message": str(error.args[0])}
