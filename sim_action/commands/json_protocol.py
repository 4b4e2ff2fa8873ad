"""The JSON messages of `process`: observations and the robot's description out, commands back.

Names and units are those of the Python API. Reading is strict: an answer that could have several meanings is an error.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final, NoReturn

from sim_action.commands.robot_description import JointDescription, RobotDescription
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.wording import did_you_mean, shown
from sim_action.state.command import WORLD_FRAME, Answer, Command, JointTargets, LinkWrench

if TYPE_CHECKING:
    from sim_action.state.observation import Contact, Observation


Json = dict[str, Any]

_TARGETS: Final = ("position", "velocity", "effort", "max_effort")

_WRENCH: Final = ("link", "force", "torque", "frame", "point")

_SPEEDS: Final = ("linear", "angular", "lateral")


def observation_json(observation: Observation, links: Collection[str] = ()) -> Json:
    """Return an observation as JSON values, with the state of some links; numbers keep all their bits."""
    found = {
        "time": observation.time,
        "pose": _pose(observation.pose),
        "twist": _twist(observation.twist),
        "joints": {name: state._asdict() for name, state in observation.joints.items()},
        "contacts": [_contact(contact) for contact in observation.contacts],
        "sensors": {name: _reading(reading) for name, reading in observation.sensors.items()},
    }
    if links:
        states = {name: observation.links[name] for name in links}
        found["links"] = {name: {"pose": _pose(at.pose), "twist": _twist(at.twist)} for name, at in states.items()}
    return found


def robot_json(robot: RobotDescription) -> Json:
    """Return the description of the robot as JSON values, without rate and seed."""
    return {
        "name": robot.name,
        "base": robot.base,
        "links": list(robot.links),
        "joints": {name: _joint(joint) for name, joint in robot.joints.items()},
    }


def _reading(reading: Any) -> Json:
    return {field.name: _value(getattr(reading, field.name)) for field in fields(reading)}


def _value(value: Any) -> Any:
    """Return a field of a reading as a JSON value. JSON has no infinities.

    Only distances can be infinite (ROS REP 117): inf means that nothing is in range, and becomes null; -inf means that
    something is too near to be measured, and becomes 0, which a sensor with a minimum range never measures.
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
    """Return a list for an array of one dimension, and the bytes for more dimensions, such as an image."""
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
        "has_force": contact.has_force,
        "depth": contact.depth,
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
    return value if value is not None and math.isfinite(value) else None


class AnswerError(ValueError):
    """A line is not a valid answer; in the message, "it" is the line."""


def parse_answer(line: bytes) -> Answer:
    """Return the command in an answer; None if the last command stays in effect. Raises AnswerError."""
    found = _object(_parsed_line(line))
    _check_keys(found, ("twist", *_TARGETS, "wrenches"), "it")
    commands: list[Command] = [_twist_command(found["twist"])] if "twist" in found else []
    if any(key in found for key in _TARGETS):
        position, velocity, effort, max_effort = (_numbers(found.get(key, {}), key) for key in _TARGETS)
        commands.append(JointTargets(position, velocity, effort, max_effort))
    if "wrenches" in found:
        commands += _wrench_commands(found["wrenches"])
    return tuple(commands) if len(commands) > 1 else next(iter(commands), None)


def is_empty_answer(line: bytes) -> bool:
    """Return True if an answer contains no command. Raises AnswerError."""
    return parse_answer(line) is None


def _parsed_line(line: bytes) -> Any:
    try:
        return json.loads(line, object_pairs_hook=_without_duplicates, parse_constant=_refuse_constant)
    except UnicodeDecodeError:
        raise AnswerError("it is not UTF-8 text") from None
    except json.JSONDecodeError as error:
        raise AnswerError(f"it is not JSON: {error.msg} (column {error.colno})") from None
    except RecursionError:
        raise AnswerError("it is nested too deeply") from None
    except AnswerError:
        raise
    except ValueError as error:  # such as an integer of thousands of digits
        raise AnswerError(f"it cannot be read: {error}") from None


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise AnswerError(f"it contains the key {shown(name)} twice")
        found[name] = value
    return found


def _refuse_constant(name: str) -> NoReturn:
    raise AnswerError(f"it contains {name}, which is neither JSON nor a valid target")


def _object(value: Any) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise AnswerError(f"it is {_found(value)}; expected an object, such as {{}}")
    return value


def _check_keys(found: Mapping[str, Any], allowed: Collection[str], where: str) -> None:
    for key in found:
        if key not in allowed:
            raise AnswerError(f"{where} contains the unknown key {shown(key)}{did_you_mean(key, allowed)}")


def _twist_command(value: Any) -> Twist:
    speeds = _numbers(value, "twist")
    _check_keys(speeds, _SPEEDS, "'twist'")
    return Twist.planar(speeds.get("linear", 0.0), speeds.get("angular", 0.0), lateral=speeds.get("lateral", 0.0))


def _wrench_commands(value: Any) -> Iterator[LinkWrench]:
    if not isinstance(value, list):
        raise AnswerError(f"'wrenches' is {_found(value)}; expected a list of objects")
    for index, wrench in enumerate(value):
        where = f"wrenches.{index}"
        if not isinstance(wrench, dict):
            raise AnswerError(f"'{where}' is {_found(wrench)}; expected an object with 'link' and 'force' or 'torque'")
        _check_keys(wrench, _WRENCH, f"'{where}'")
        if "link" not in wrench:
            raise AnswerError(f"'{where}' has no 'link'")
        vectors = (_vector(wrench.get(key, [0, 0, 0]), f"{where}.{key}") for key in ("force", "torque", "point"))
        force, torque, point = vectors
        link, frame = (_name(wrench.get(key, WORLD_FRAME), f"{where}.{key}") for key in ("link", "frame"))
        yield LinkWrench(link, force, torque, frame, point)


def _name(value: Any, where: str) -> str:
    if not isinstance(value, str):
        raise AnswerError(f"'{where}' is {_found(value)}; expected a name")
    return value


def _vector(value: Any, where: str) -> Vector3:
    if not isinstance(value, list) or len(value) != 3:
        raise AnswerError(f"'{where}' is {_found(value)}; expected a list of 3 numbers")
    x, y, z = (_number(number, f"'{where}.{index}'") for index, number in enumerate(value))
    return x, y, z


def _numbers(value: Any, where: str) -> dict[str, float]:
    if not isinstance(value, dict):
        raise AnswerError(f"'{where}' is {_found(value)}; expected an object of numbers by name")
    return {name: _number(number, f"'{where}.{name}'") for name, number in value.items()}


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise AnswerError(f"{where} is {_found(value)}; expected a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise AnswerError(f"{where} is too large")
    return number


def _found(value: Any) -> str:
    return "null" if value is None else "an object" if isinstance(value, dict) else shown(value)
