"""The example nodes of ROS 2 and those of the page: they drive in lock-step, so that every run has the same digest."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
import yaml

from sim_action.state.trace_storage import load_trace
from tests.integration.conftest import ACTION
from tests.integration.test_documents import blocks
from tests.ros.ros2.nodes import needs_ros2, outcomes, run
from tests.soak import soaked

pytestmark = needs_ros2
EXAMPLES: Final = ACTION / "examples/ros2"
# One node, a chain of two with timers, and a loop closed by a lidar: all with topics of the same names.
LOOPS: Final = ("mover", "planner_and_smoother", "wall_follower")
PAGE: Final = "docs/ros2/index.md"
TICK_S: Final = 1 / 120


def beginnings(folder: Path, pace: str = "lockstep") -> None:
    """Write the loops of the examples into a repository: only their beginnings."""
    (folder / ".git").mkdir()
    shutil.copytree(EXAMPLES / "src", folder / "src")
    for name in LOOPS:
        found: dict[str, Any] = yaml.safe_load((EXAMPLES / f"simulation/{name}.sim.yml").read_text())
        found["commands"]["ros2"]["pace"] = pace
        ends = {"name": name, "expect": [{"travel": {"at_least": 0.02}}], "duration": 0.6, "time_limit": 0.6}
        (folder / f"{name}.sim.yml").write_text(yaml.safe_dump(found | ends, sort_keys=False))


@pytest.mark.parametrize("runs", soaked([1, 20], short=[1]))
def test_every_run_has_the_same_digest_alone_and_next_to_others(runs: int, tmp_path: Path) -> None:
    beginnings(tmp_path)
    alone, together = (
        outcomes(tmp_path, ".", "--no-report", "--jobs", jobs, "--repeat", str(runs)) for jobs in ("1", "3")
    )
    for name in LOOPS:
        found = alone[name], together[name]
        assert [(each["status"], each["warnings"]) for each in found] == [("passed", [])] * 2, found
        assert {each["digest"] for each in found} == {found[0]["digest"]}
        repeats = {"count": runs, "agreed": runs, "digests": 1, "replay": None} if runs > 1 else None
        assert [each["repeats"] for each in found] == [repeats] * 2


@pytest.mark.soak
def test_without_lock_step_runs_have_several_digests(tmp_path: Path) -> None:
    beginnings(tmp_path, pace="realtime")
    found = outcomes(tmp_path, ".", "--no-report", "--jobs", "1", "--repeat", "20")
    assert all(found[name]["repeats"]["digests"] > 1 for name in LOOPS), found


PROGRAM: Final = """\
import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node

SPEEDS = [(0.4, 0.0), (0.1, 0.5)]


class Program(Node):
    def __init__(self):
        super().__init__("program")
        self.left = list(SPEEDS)
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_timer(0.5, self.on_timer)

    def on_timer(self):
        if self.left:
            twist = Twist()
            twist.linear.x, twist.angular.z = self.left.pop(0)
            self.publisher.publish(twist)


rclpy.init()
rclpy.spin(Program())
"""
TWIST: Final = "twist: [{for: 0.5}, {linear: 0.4, for: 0.5}, {linear: 0.1, angular: 0.5}]"


def test_nodes_and_the_same_commands_as_twist_agree_within_one_tick(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    for name, source in (("nodes", "ros2: {nodes: [./program.py]}"), ("steps", TWIST)):
        head = f"name: {name}\nrobot: {{model: turtlebot3_burger}}\ncommands: {{{source}, rate: 120 Hz}}\n"
        ends = "expect:\n  - travel: {at_least: 0.2 m}\nduration: 2 s\ntime_limit: 2 s\n"
        (tmp_path / f"{name}.sim.yml").write_text(head + ends)
    found = outcomes(tmp_path, ".", "--no-report")
    traces = {name: load_trace(tmp_path / "sim-results" / outcome["trace"]) for name, outcome in found.items()}
    time, steps = traces["nodes"].time, traces["steps"]
    for driven, stated in (
        (traces["nodes"].base_position_xyz[:, 0], steps.base_position_xyz[:, 0]),
        (traces["nodes"].yaw, steps.yaw),
    ):
        assert driven[-1] > 0.2
        assert np.all(driven <= np.interp(time + TICK_S, steps.time, stated) + 1e-3)
        assert np.all(driven >= np.interp(time - TICK_S, steps.time, stated) - 1e-3)


@pytest.mark.soak
def test_the_page_leads_from_a_failing_run_to_the_example(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    node, fix = blocks("python", PAGE)[:2]
    (old,) = (line for line in node.splitlines() if line.partition("=")[0] == fix.partition("=")[0])
    assert node.replace(f"{old}\n", fix) == (EXAMPLES / "first_steps/mover.py").read_text()
    shutil.copy(EXAMPLES / "first_steps/mover.sim.yml", tmp_path)
    (tmp_path / "mover.py").write_text(node)
    failed = run(tmp_path, ".", "--backend", "pybullet", "--no-report")
    shown = failed.stdout.splitlines()
    assert (failed.returncode, [line for line in blocks("text", PAGE)[0].splitlines() if line not in shown]) == (1, [])
