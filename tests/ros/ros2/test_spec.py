"""Robots whose nodes share one graph of ROS 2: what cannot be together is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenarios import load, problems

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
FIRST = "{ros2: {nodes: [./drive.py]}}"


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (FIRST, "{ros2: {namespace: robot2, nodes: [./drive.py]}}", ""),
        ("{twist: [{linear: 1}]}", FIRST, ""),
        (FIRST, FIRST, "have the same topics and frames; state another one, such as 'namespace: robot2'"),
        (
            FIRST.replace("nodes", "namespace: /a, nodes"),
            FIRST.replace("nodes", "namespace: a, nodes"),
            "two robots with the namespace '/a' have",
        ),
        (
            FIRST,
            "{ros2: {namespace: b, nodes: [./drive.py], pace: realtime}}",
            "one lock-step: 'pace' must be 'lockstep', as for the first one, not 'realtime'",
        ),
        (FIRST, "{ros2: {namespace: b, nodes: [./drive.py]}, rate: 50 Hz}", "as for the first one, not 50 Hz"),
        (
            FIRST,
            "{ros2: {launch: [p, a.launch.py]}}",
            "a launch file drives only the robot under test; list the 'nodes'",
        ),
        (FIRST, "{ros2: {namespace: 2b, nodes: [./drive.py]}}", "a namespace has letters, digits and '_'"),
        (
            "{ros2: {namespace: b, launch: [p, a.launch.py]}}",
            "{twist: [{linear: 1}]}",
            "a launch file states the namesp",
        ),
    ],
)
def test_robots_with_nodes_need_namespaces(tmp_path: Path, first: str, second: str, message: str) -> None:
    (tmp_path / "drive.py").write_text("")
    text = TEXT.format(first=first, second=second)
    if not message:
        load(tmp_path, text)
    else:
        assert message in "\n".join(map(str, problems(tmp_path, text)))
