"""Observations as JSON: the same bits, and nothing that JSON does not have."""

from __future__ import annotations

import base64
import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim_action.commands.json_protocol import AnswerError, observation_json, parse_answer, robot_json
from sim_action.commands.robot_description import RobotDescription
from sim_action.core.geometry import Pose, Twist
from sim_action.state.command import JointTargets, LinkWrench, commands_of, is_finite
from sim_action.state.observation import Contact, JointState, LinkState, Observation
from sim_action.state.readings import ContactReading, ImuReading, OdometryReading, Reading
from tests.traces import scene

SEEN = Observation(
    time=0.1 + 0.2,
    pose=Pose((1 / 3, -2.0, 1e-9), (0.0, 0.0, math.sin(0.5), math.cos(0.5))),
    twist=Twist((0.1, 0.0, -0.0), (0.0, 0.0, 2.0)),
    joints={"wheel": JointState(1.0, 2.0, 3.0)},
    contacts=(Contact(0.3, "base", "ground", (0.1, 0.2, 0.3), 9.81, depth=0.002),),
    sensors={"bumper": ContactReading(time=0.25, touching=True, force=1.5, bodies=("wall",))},
)


def through_json(seen: Observation) -> Any:
    return json.loads(json.dumps(observation_json(seen), allow_nan=False))


def test_everything_that_python_sees_is_there() -> None:
    assert through_json(SEEN) == {
        "time": 0.1 + 0.2,
        "pose": {
            "position_xyz": [1 / 3, -2.0, 1e-9],
            "orientation_xyzw": [0.0, 0.0, math.sin(0.5), math.cos(0.5)],
            "yaw": pytest.approx(1.0),
        },
        "twist": {"linear_xyz": [0.1, 0.0, -0.0], "angular_xyz": [0.0, 0.0, 2.0]},
        "joints": {"wheel": {"position": 1.0, "velocity": 2.0, "effort": 3.0}},
        "contacts": [
            {
                "link": "base",
                "body": "ground",
                "position_xyz": [0.1, 0.2, 0.3],
                "force": 9.81,
                "has_force": True,
                "depth": 0.002,
            }
        ],
        "sensors": {"bumper": {"time": 0.25, "touching": True, "force": 1.5, "bodies": ["wall"]}},
    }


def test_links_are_there_if_they_are_asked_for() -> None:
    state = LinkState(Pose((1.0, 2.0, 3.0)), Twist((4.0, 5.0, 6.0), (7.0, 8.0, 9.0)))
    seen = replace(SEEN, links={"tool0": state, "hand": state})
    assert "links" not in through_json(seen)
    assert json.loads(json.dumps(observation_json(seen, ("tool0",))))["links"] == {
        "tool0": {
            "pose": {"position_xyz": [1.0, 2.0, 3.0], "orientation_xyzw": [0.0, 0.0, 0.0, 1.0], "yaw": 0.0},
            "twist": {"linear_xyz": [4.0, 5.0, 6.0], "angular_xyz": [7.0, 8.0, 9.0]},
        }
    }


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_keep_their_bits(number: float) -> None:
    found = through_json(replace(SEEN, joints={"wheel": JointState(number, 0.0, 0.0)}))
    assert struct.pack("d", found["joints"]["wheel"]["position"]) == struct.pack("d", number)


def test_readings_have_the_fields_that_they_have_in_python() -> None:
    pose, twist = Pose((1.0, 2.0, 0.0)), Twist.planar(0.5)
    sensors: dict[str, Reading] = {
        "imu": ImuReading(0.1, (0.0, 0.0, 0.0, 1.0), (0.1, 0.2, 0.3), (0.0, 0.0, 9.81)),
        "odom": OdometryReading(0.2, pose, twist),
    }
    found = through_json(replace(SEEN, sensors=sensors))["sensors"]
    assert found["imu"] == {
        "time": 0.1,
        "orientation_xyzw": [0.0, 0.0, 0.0, 1.0],
        "angular_velocity_xyz": [0.1, 0.2, 0.3],
        "linear_acceleration_xyz": [0.0, 0.0, 9.81],
    }
    assert found["odom"]["pose"]["position_xyz"] == [1.0, 2.0, 0.0]
    assert found["odom"]["twist"]["linear_xyz"] == [0.5, 0.0, 0.0]


@dataclass(frozen=True)
class Whatever:
    """A reading of a kind that is still to come."""

    time: float
    value: Any

    def columns(self) -> Mapping[str, Any]:
        return {}


def told(value: Any) -> Any:
    return through_json(replace(SEEN, sensors={"s": Whatever(0.0, value)}))["sensors"]["s"]["value"]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (math.inf, None),
        (math.nan, None),
        ((1.0, -math.inf, "a"), [1.0, 0.0, "a"]),
        (np.array([0.5, np.inf, -np.inf, np.nan]), [0.5, None, 0.0, None]),
        (np.array([1, 2], dtype=np.int32), [1, 2]),
        (np.float32(0.5), 0.5),
        (np.bool_(True), True),
        (Pose((1.0, 2.0, 3.0)), {"position_xyz": [1.0, 2.0, 3.0], "orientation_xyzw": [0, 0, 0, 1.0], "yaw": 0.0}),
        (Twist((1.0, 2.0, 3.0)), {"linear_xyz": [1.0, 2.0, 3.0], "angular_xyz": [0.0, 0.0, 0.0]}),
        (None, None),
    ],
)
def test_readings_become_what_json_has(value: Any, expected: Any) -> None:
    assert told(value) == expected


@pytest.mark.parametrize(
    "image",
    [
        np.arange(24, dtype=np.uint8).reshape(2, 4, 3),
        np.arange(24, dtype=np.uint8).reshape(2, 4, 3)[:, ::2],
        np.arange(6, dtype=">f4").reshape(2, 3),
    ],
    ids=["plain", "a view with gaps", "big-endian"],
)
def test_an_image_is_its_bytes_row_by_row(image: NDArray[Any]) -> None:
    found = told(image)
    assert found["type"] == image.dtype.name
    kind = np.dtype(found["type"]).newbyteorder("<")
    again = np.frombuffer(base64.b64decode(found["base64"]), dtype=kind).reshape(found["shape"])
    assert (again == image).all()


def test_a_robot_is_told_without_infinities() -> None:
    there = scene()
    joints = tuple(replace(joint, lower=-math.inf, upper=1.5) for joint in there.model.joints)
    robot = RobotDescription.of(replace(there, model=replace(there.model, joints=joints)), 20.0, "p")
    found = json.loads(json.dumps(robot_json(robot), allow_nan=False))
    assert (found["name"], found["base"]) == ("turtlebot3_burger", "base_footprint")
    assert "wheel_left_link" in found["links"]
    assert found["joints"]["wheel_left_joint"] == {
        "type": "continuous",
        "moves": True,
        "lower": None,
        "upper": 1.5,
        "max_effort": robot.joints["wheel_left_joint"].max_effort,
        "max_velocity": robot.joints["wheel_left_joint"].max_velocity,
        "mimics": None,
    }


MANY = '"{}":1'


@pytest.mark.parametrize(
    ("line", "command"),
    [
        (b"{}", None),
        (b"null", None),
        (b" {} \r", None),
        (b'{"twist": {"linear": 0.2}}', Twist.planar(0.2)),
        (b'{"twist": {"linear": 1, "angular": -2, "lateral": 3e-1}}', Twist.planar(1.0, -2.0, lateral=0.3)),
        (b'{"twist": {}}', Twist()),
        (b'{"position": {"a": 1}}', JointTargets(position={"a": 1.0})),
        (
            b'{"velocity": {"a": 1}, "effort": {"b": 2}, "max_effort": {"a": 3}}',
            JointTargets(velocity={"a": 1.0}, effort={"b": 2.0}, max_effort={"a": 3.0}),
        ),
        ('{"position": {"gelenk_für_öl": 1}}'.encode(), JointTargets(position={"gelenk_für_öl": 1.0})),
        (b'{"velocity": {}}', JointTargets()),
        (
            b'{"position": {"a": 1}, "twist": {"linear": 0.2}, "max_effort": {"a": 3}}',
            (Twist.planar(0.2), JointTargets(position={"a": 1.0}, max_effort={"a": 3.0})),
        ),
        (b'{"wrenches": []}', None),
        (b'{"wrenches": [{"link": "rotor", "force": [0, 0, 9.81]}]}', LinkWrench("rotor", (0.0, 0.0, 9.81))),
        (
            b'{"wrenches": [{"link": "a", "torque": [0, 0, 1], "frame": "base"}, {"link": "b", "point": [1, 2, 3]}]}',
            (LinkWrench("a", torque_xyz=(0.0, 0.0, 1.0), frame="base"), LinkWrench("b", point_xyz=(1.0, 2.0, 3.0))),
        ),
        (
            b'{"effort": {"j": 1}, "wrenches": [{"link": "a", "force": [1, 0, 0], "frame": "a"}]}',
            (JointTargets(effort={"j": 1.0}), LinkWrench("a", (1.0, 0.0, 0.0), frame="a")),
        ),
    ],
)
def test_what_an_answer_means(line: bytes, command: object) -> None:
    assert parse_answer(line) == command


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"", "is not JSON: Expecting value (column 1)"),
        (b"hello", "is not JSON: Expecting value (column 1)"),
        (b"{} {}", "is not JSON: Extra data (column 4)"),
        (b"{'twist': 1}", "is not JSON: Expecting property name"),
        (b"\xff{}", "is not UTF-8 text"),
        (b"[" * 100_000, "is nested too deep"),
        (b"1.0", "it is 1.0; expected an object, such as {}"),
        (b"[1, 2]", "it is a list of 2; expected an object"),
        (b'"forward"', "it is 'forward'; expected an object"),
        (b"true", "it is true; expected an object"),
        (b'{"twits": {}}', "it contains the unknown key 'twits'; did you mean 'twist'?"),
        (b'{"twist": {"liner": 1}}', "'twist' contains the unknown key 'liner'; did you mean 'linear'?"),
        (
            b'{"twist": {}, "x": 1}',
            "it contains the unknown key 'x' (allowed: effort, max_effort, position, twist, velocity, wrenches)",
        ),
        (b'{"twist": {"linear": 1, "linear": 2}}', "contains the key 'linear' twice"),
        (b'{"a": 1, "b": 1, "b": 1, "a": 1}', "contains the key 'b' twice"),
        # As many keys as a line may have: to compare each with all others would take minutes.
        (
            f"{{{','.join(map(MANY.format, range(90_000)))},{MANY.format(89_999)}}}".encode(),
            "contains the key '89999' twice",
        ),
        (b'{"twist": 1}', "'twist' is 1; expected an object of numbers by name"),
        (b'{"twist": null}', "'twist' is null; expected an object of numbers by name"),
        (b'{"position": [1, 2]}', "'position' is a list of 2; expected an object of numbers by name"),
        (b'{"position": {"a": "1"}}', "'position.a' is '1'; expected a number"),
        (b'{"position": {"a": true}}', "'position.a' is true; expected a number"),
        (b'{"position": {"a": null}}', "'position.a' is null; expected a number"),
        (b'{"position": {"a": {}}}', "'position.a' is an object; expected a number"),
        (b'{"wrenches": {"link": "a"}}', "'wrenches' is an object; expected a list of objects"),
        (b'{"wrenches": ["a"]}', "'wrenches.0' is 'a'; expected an object with 'link' and 'force' or 'torque'"),
        (b'{"wrenches": [{"force": [0, 0, 1]}]}', "'wrenches.0' has no 'link'"),
        (
            b'{"wrenches": [{"link": "a"}, {"link": "b", "forces": 1}]}',
            "'wrenches.1' contains the unknown key 'forces'",
        ),
        (b'{"wrenches": [{"link": 1}]}', "'wrenches.0.link' is 1; expected a name"),
        (b'{"wrenches": [{"link": "a", "frame": null}]}', "'wrenches.0.frame' is null; expected a name"),
        (b'{"wrenches": [{"link": "a", "force": 9.81}]}', "'wrenches.0.force' is 9.81; expected a list of 3 numbers"),
        (
            b'{"wrenches": [{"link": "a", "torque": [1, 2]}]}',
            "'wrenches.0.torque' is a list of 2; expected a list of 3",
        ),
        (b'{"wrenches": [{"link": "a", "point": [1, "2", 3]}]}', "'wrenches.0.point.1' is '2'; expected a number"),
        (b'{"twist": {"linear": NaN}}', "contains NaN, which is neither JSON nor a valid target"),
        (b'{"twist": {"linear": -Infinity}}', "contains -Infinity, which is neither JSON nor"),
        (b'{"twist": {"linear": 1e999}}', "'twist.linear' is too large"),
        (b'{"twist": {"linear": 1' + b"0" * 400 + b"}}", "'twist.linear' is too large"),
        (b'{"twist": {"linear": 1' + b"0" * 5000 + b"}}", "cannot be read: "),
    ],
)
def test_why_an_answer_is_none(line: bytes, why: str) -> None:
    with pytest.raises(AnswerError) as raised:
        parse_answer(line)
    assert why in str(raised.value)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text() | st.sampled_from(["twist", "linear", "effort"]), inner),
)


speeds = st.dictionaries(st.sampled_from(["linear", "lateral", "angular"]), st.floats() | st.integers())
targets = st.dictionaries(st.text(), st.floats() | st.integers())
answers = st.fixed_dictionaries(
    {}, optional={"twist": speeds, "position": targets, "velocity": targets, "effort": targets}
)


@given((json_values | answers).map(lambda value: json.dumps(value).encode()) | st.binary())
@example(b'{"twist": {"linear": 1e308}}')
def test_whatever_is_answered_is_a_command_or_an_error(line: bytes) -> None:
    try:
        answer = parse_answer(line)
    except AnswerError:
        return
    assert all(is_finite(command) for command in commands_of(answer))


numbers = st.floats(allow_nan=False, allow_infinity=False)


@given(st.dictionaries(st.text(), numbers), st.dictionaries(st.text(), numbers))
def test_targets_come_through_as_they_are(position: dict[str, float], effort: dict[str, float]) -> None:
    line = json.dumps({"position": position, "effort": effort}).encode()
    assert parse_answer(line) == JointTargets(position=position, effort=effort)


@given(numbers, numbers, numbers)
def test_twists_come_through_as_they_are(linear: float, angular: float, lateral: float) -> None:
    speeds: dict[str, Any] = {"linear": linear, "angular": angular, "lateral": lateral}
    command = parse_answer(json.dumps({"twist": speeds}).encode())
    assert command == Twist.planar(linear, angular, lateral=lateral)
    assert isinstance(command, Twist)
    assert math.copysign(1, command.linear_xyz[0]) == math.copysign(1, linear)
