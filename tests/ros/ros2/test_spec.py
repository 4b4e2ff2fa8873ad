"""The nodes that a scenario lists, and robots whose nodes share one graph of ROS 2."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from sim_action.ros.ros2.spec import RobotTopicName, Ros2NodeSpec
from tests.scenarios import load, problems

NODE: TypeAdapter[Ros2NodeSpec] = TypeAdapter(Ros2NodeSpec)


ONE_TYPE = "a list of a parameter has values of one type"
NO_PROGRAM = "a node needs a 'package' and an 'executable', or a 'file'"


def refusal(value: Any) -> str:
    with pytest.raises(ValidationError) as caught:
        NODE.validate_python(value)
    return caught.value.errors()[0]["msg"].removeprefix("Value error, ")


@pytest.mark.parametrize(
    ("short", "full"),
    [
        ("my_robot/mover", {"package": "my_robot", "executable": "mover"}),
        ("my_robot/mover.py", {"package": "my_robot", "executable": "mover.py"}),
        ("./mover.py", {"file": "./mover.py"}),
        ("../nodes/mover", {"file": "../nodes/mover"}),
        ("/opt/mover", {"file": "/opt/mover"}),
    ],
)
def test_a_node_in_short_is_an_executable_or_a_file(short: str, full: dict[str, str]) -> None:
    node = NODE.validate_python(short)
    assert node == NODE.validate_python(full)
    assert node.program == short
    assert node.called == "mover"


@pytest.mark.parametrize(
    ("short", "hint"),
    [("mover", ""), ("a/b/c", ""), *((name, f"; did you mean './{name}'?") for name in ("mover.py", "a/b/c.py"))],
)
def test_a_node_in_short_has_two_parts(short: str, hint: str) -> None:
    message = refusal(short)
    assert message.startswith("the short form of a node is package/executable, or a file such as ./mover.py, found ")
    assert message.endswith(f"'{short}'{hint}")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, NO_PROGRAM),
        ({"package": "p"}, f"{NO_PROGRAM}; add 'executable'"),
        ({"executable": "e"}, f"{NO_PROGRAM}; add 'package'"),
        ({"file": "./f", "package": "p"}, "a node has either a 'file', or a 'package' and an 'executable'; remove one"),
    ],
)
def test_a_node_has_one_program(given: dict[str, str], message: str) -> None:
    assert refusal(given).startswith(message)


def test_all_keys_of_a_node_are_read() -> None:
    given = {
        "package": "p",
        "executable": "e",
        "name": "left",
        "namespace": "/robot1/arm",
        "args": "--fast 'a b'",
        "parameters": {"speed": 0.5, "gains": (1.0, 2.0), "nested": {"on": True, "names": ()}},
        "remap": {"cmd_vel": "/diff/cmd_vel", "~/state": "state"},
        "required": True,
    }
    node = NODE.validate_python(given)
    assert node.called == "left"
    assert node.arguments == ("--fast", "a b")
    assert node.parameters == {"speed": 0.5, "gains": [1.0, 2.0], "nested": {"on": True, "names": []}}


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("name", "my node", "the name of a node has letters, digits and '_' and starts with no digit, found 'my node'"),
        ("name", "/mover", "the name of a node has letters"),
        ("namespace", "a//b", "a namespace has letters, digits and '_' between its '/', such as /robot1, found 'a//b'"),
        ("remap", {"cmd-vel": "x"}, "a name in ROS 2 has letters, digits and '_' between its '/'"),
        ("remap", {"cmd_vel": "/1"}, "a name in ROS 2 has letters"),
        ("remap", {"clock": "/x"}, "each node has a clock of its own, so /clock cannot be remapped"),
        ("remap", {"/clock": "/x"}, "each node has a clock of its own"),
        ("args", "'open", "cannot be split into arguments: no closing quotation"),
        ("parameters", {"a": {"b": None}}, "'a.b' has no value; remove it, or give it one"),
        ("parameters", {"a": (1, 2.0)}, f"{ONE_TYPE}: bool, integer, float or text; 'a'"),
        ("parameters", {"a": ((1,), (2,))}, ONE_TYPE),
        ("parameters", {"": 1}, "a parameter needs a name, found ''"),
        ("parameters", {"a": {"": 1}}, "a parameter needs a name"),
        ("parameters", {"a": 2**63}, "an integer has 64 bits in ROS 2; 'a' has 9223372036854775808"),
        ("parameters", {"a": (1, -(2**64))}, "an integer has 64 bits in ROS 2; 'a' has -18446744073709551616"),
        ("name", "a" * 248, "a name in ROS 2 has at most 247 characters, this one has 248"),
        ("namespace", "a" * 248, "a name in ROS 2 has at most 247 characters"),
        ("remap", {"cmd_vel": "/" + "a" * 247}, "a name in ROS 2 has at most 247 characters"),
    ],
)
def test_what_ros_cannot_read_is_refused(key: str, value: object, message: str) -> None:
    assert refusal({"package": "p", "executable": "e", key: value}).startswith(message)


def test_the_schema_has_both_forms_and_topics_of_the_robot_are_not_private_to_a_node() -> None:
    short, full = NODE.json_schema()["anyOf"]
    assert short["type"] == "string"
    assert set(full["properties"]) >= {"package", "executable", "file"}
    names: TypeAdapter[str] = TypeAdapter(RobotTopicName)
    assert names.validate_python("base/cmd_vel") == "base/cmd_vel"
    with pytest.raises(ValidationError, match="a name in ROS 2 has letters, digits and '_' between its '/'"):
        names.validate_python("~/cmd_vel")


TEXT = """\
name: two robots
robot: {{model: turtlebot3_burger}}
world:
  actors:
    - name: second
      model: turtlebot3_burger
      pose: {{x: 1}}
      commands: {second}
commands: {first}
expect: [no_collision]
time_limit: 1 s
"""
LAUNCH = "launch: [p, a.launch.py]"


def drive(keys: str, more: str = "") -> str:
    return f"{{ros2: {{{keys}, nodes: [./drive.py]}}{more}}}"


FIRST = "{ros2: {nodes: [./drive.py]}}"


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (FIRST, drive("namespace: robot2"), ""),
        ("{twist: [{linear: 1}]}", FIRST, ""),
        (FIRST, FIRST, "have the same topics and frames; state another one, such as 'namespace: robot2'"),
        (drive("namespace: /a"), drive("namespace: a"), "two robots with the namespace '/a' have"),
        (
            FIRST,
            drive("namespace: b, pace: realtime"),
            "one lock-step: 'pace' must be 'lockstep', as for the first one, not 'realtime'",
        ),
        (FIRST, drive("namespace: b", ", rate: 50 Hz"), "as for the first one, not 50 Hz"),
        (FIRST, f"{{ros2: {{{LAUNCH}}}}}", "a launch file drives only the robot under test; list the 'nodes'"),
        (FIRST, drive("namespace: 2b"), "a namespace has letters, digits and '_'"),
        (f"{{ros2: {{namespace: b, {LAUNCH}}}}}", "{twist: [{linear: 1}]}", "a launch file states the namesp"),
    ],
)
def test_robots_with_nodes_need_namespaces(tmp_path: Path, first: str, second: str, message: str) -> None:
    (tmp_path / "drive.py").write_text("")
    text = TEXT.format(first=first, second=second)
    if not message:
        load(tmp_path, text)
    else:
        assert message in "\n".join(map(str, problems(tmp_path, text)))
