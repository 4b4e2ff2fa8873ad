"""What a controller in another process gets to see, as values that JSON has: names and units are those of Python."""

from __future__ import annotations

import base64
import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from sim_action.commands.robot_description import JointDescription, RobotDescription
from sim_action.core.geometry import Pose, Twist

if TYPE_CHECKING:
    from sim_action.state.observation import Contact, Observation

Json = dict[str, Any]


def observation_json(observation: Observation) -> Json:
    """An observation; numbers are written so that reading them gives the same bits."""
    return {
        "time": observation.time,
        "pose": _pose(observation.pose),
        "twist": _twist(observation.twist),
        "joints": {name: state._asdict() for name, state in observation.joints.items()},
        "contacts": [_contact(contact) for contact in observation.contacts],
        "sensors": {name: _reading(reading) for name, reading in observation.sensors.items()},
    }


def robot_json(robot: RobotDescription) -> Json:
    """What there is to know of the robot, but for how it is asked."""
    return {
        "name": robot.name,
        "base": robot.base,
        "links": list(robot.links),
        "joints": {name: _joint(joint) for name, joint in robot.joints.items()},
    }


def _reading(reading: Any) -> Json:
    """All readings are dataclasses: field by field."""
    return {field.name: _value(getattr(reading, field.name)) for field in fields(reading)}


def _value(value: Any) -> Any:
    """What a field of a reading is in JSON, which has no infinities.

    Of a distance (what else could be infinite?), inf says that nothing is there, and becomes null; -inf that something
    is too near to be measured (ROS REP 117), and becomes 0, which is never measured where there is a nearest.
    """
    match value:
        case Pose():
            return _pose(value)
        case Twist():
            return _twist(value)
        case float():
            return value if math.isfinite(value) else 0.0 if value == -math.inf else None
        case tuple() | list():
            return [_value(item) for item in value]
        case _ if hasattr(value, "__array_interface__"):
            return _array(value)
        case _:
            return value


def _array(array: Any) -> Any:
    """A row of numbers is a list; what has more dimensions, such as an image, is its bytes."""
    if array.ndim <= 1:
        return _value(array.tolist())
    data = array.astype(array.dtype.newbyteorder("<"), order="C", copy=False).tobytes()
    return {"shape": list(array.shape), "type": array.dtype.name, "base64": base64.b64encode(data).decode("ascii")}


def _pose(pose: Pose) -> Json:
    return {
        "position_xyz": list(pose.position_xyz),
        "orientation_xyzw": list(pose.orientation_xyzw),
        "yaw": pose.yaw,
    }


def _twist(twist: Twist) -> Json:
    return {"linear_xyz": list(twist.linear_xyz), "angular_xyz": list(twist.angular_xyz)}


def _contact(contact: Contact) -> Json:
    return {
        "link": contact.link,
        "body": contact.body,
        "position_xyz": list(contact.position_xyz),
        "force": contact.force,
    }


def _joint(joint: JointDescription) -> Json:
    return {
        "type": joint.type,
        "moves": joint.moves,
        "lower": _limit(joint.lower),
        "upper": _limit(joint.upper),
        "max_effort": _limit(joint.max_effort),
        "max_velocity": _limit(joint.max_velocity),
        "mimics": joint.mimics,
    }


def _limit(value: float | None) -> float | None:
    """JSON has no infinity; what limits nothing is no limit."""
    return value if value is not None and math.isfinite(value) else None
