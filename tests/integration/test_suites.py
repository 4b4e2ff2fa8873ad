"""Files of several scenarios, variations and selections, from the command line to the reports."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from sim_action.engines import installed, named_version
from sim_action.state.trace_storage import load_trace
from tests.integration.conftest import outcomes
from tests.integration.test_examples import sim_action

SHARED = """\
robot: {model: turtlebot3_burger}
commands: {twist: [{linear: 0.5}]}
expect: [{travel: {at_least: 0.2 m}}]
time_limit: 2 s
"""
PUSH = f"""\
name: push
tags: [wet]
variations:
  world.ground.friction: [0.001, 0.9]
  robot.pose.yaw: {{normal: [0 deg, 20 deg], samples: 2}}
{SHARED}"""


def told(folder: Path) -> list[tuple[str, str]]:
    return [(outcome["name"], outcome["status"]) for outcome in outcomes(folder)]


def junit(folder: Path) -> ET.Element:
    (suite,) = ET.parse(folder / "sim-results/junit.xml").getroot()
    return suite


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "push.sim.yml").write_text(PUSH)
    (tmp_path / "many.sim.yml").write_text(
        f"scenarios:\n  - {{name: one, tags: [dry]}}\n  - {{name: two, time_limit: no}}\n  - {{name: three}}\n{SHARED}"
    )
    return tmp_path


def test_an_invalid_scenario_does_not_lose_the_others_of_its_file(folder: Path) -> None:
    ran = sim_action(folder, "run", "many.sim.yml")
    assert ran.returncode == 2
    assert told(folder) == [("one", "passed"), ("two", "error"), ("three", "passed")]
    assert [outcome["line"] for outcome in outcomes(folder)] == [2, 3, 4]
    assert "many.sim.yml:3:17" in ran.stdout
    validated = sim_action(folder, "validate", "many.sim.yml")
    assert validated.returncode == 2
    assert "2 valid, 1 invalid" in validated.stderr


def test_variations_are_one_suite_whose_values_make_the_same_scenario_alone(folder: Path) -> None:
    ran = sim_action(folder, "run", "push.sim.yml")
    assert ran.returncode == 1
    engine = named_version(installed()[0])
    assert f"push  push.sim.yml  {engine}  2 of 4 passed; worst: [friction=0.001,yaw=" in ran.stdout
    assert [junit(folder).get(key) for key in ("name", "tests", "failures")] == ["push", "4", "2"]
    last = outcomes(folder)[-1]
    friction, yaw = (varied["value"] for varied in last["variation"])
    assert [varied["key"] for varied in last["variation"]] == ["world.ground.friction", "robot.pose.yaw"]
    alone = PUSH.partition("variations")[0] + SHARED.replace(
        "burger}", f"burger, pose: {{yaw: {yaw}}}}}\nworld: {{ground: {{friction: {friction}}}}}"
    )
    (folder / "push.sim.yml").write_text(alone)
    sim_action(folder, "run", "push.sim.yml")
    assert outcomes(folder)[0]["digest"] == last["digest"]


NOISY = """\
name: noisy
robot: {model: turtlebot3_burger}
world: {objects: [{name: wall, box: [0.1, 20, 1], pose: {x: 2}}]}
sensors:
  - {lidar: {rays: 50, range: 3 m, noise: 2 cm}, link: base_scan, trace: true}
  - {imu: {gyro_bias: 1 deg/s}, trace: true}
commands: {script: random_walk.py}
variations:
  wall_limit: {uniform: [50 s, 60 s], samples: 2}
  memory_limit: [3 GiB, 4 GiB]
expect: [upright]
duration: 0.5 s
time_limit: 1 s
"""
RANDOM_WALK = """\
import random
import numpy
from sim_action import Twist


class Controller:
    def reset(self, robot):
        self.robot = robot

    def step(self, seen):
        return Twist.planar(self.robot.random.random(), random.random() + numpy.random.random())
"""


def noise(outcome: dict[str, Any], folder: Path) -> tuple[bytes, ...]:
    trace = load_trace(folder / "sim-results" / outcome["trace"])
    parts = [trace.sensors["lidar"].columns["ranges"][:1], trace.sensors["imu"].columns["angular_velocity_xyz"][:1]]
    return tuple(part.tobytes() for part in (*parts, trace.state))


def test_samples_share_no_random_numbers_and_are_repeated_by_name(tmp_path: Path) -> None:
    (tmp_path / "noisy.sim.yml").write_text(NOISY)
    (tmp_path / "random_walk.py").write_text(RANDOM_WALK)
    sim_action(tmp_path, "run", "noisy.sim.yml", "--seed", "5")
    found = outcomes(tmp_path)
    assert [outcome["status"] for outcome in found] == ["passed"] * 4
    for kind in zip(*(noise(outcome, tmp_path) for outcome in found[::2]), strict=True):
        assert len(set(kind)) == 2
    # Nothing that varies here changes the motion. Both values of the list meet the same samples.
    seeds = [outcome["digest"] for outcome in found]
    assert seeds[::2] == seeds[1::2]
    assert {outcome["scenario_seed"] for outcome in found} == {5}
    for selection in (["--only", found[2]["name"]], ["--shard", "2/2"]):
        sim_action(tmp_path, "run", "noisy.sim.yml", "--seed", "5", *selection)
        digests = {outcome["name"]: outcome["digest"] for outcome in found}
        again = outcomes(tmp_path)
        assert again
        assert all(outcome["digest"] == digests[outcome["name"]] for outcome in again)


CAREFUL = """\
name: careful
robot: {model: turtlebot3_burger}
commands: {twist: [{linear: 0}]}
variations: {commands.twist.0.linear: [0, 0.3]}
expect: [{stl: always (speed > 0.1 m/s implies tilt < 10 deg)}]
duration: 0.5 s
time_limit: 1 s
"""


def test_a_premise_that_held_in_one_variation_is_no_warning_also_after_a_merge(tmp_path: Path) -> None:
    (tmp_path / "careful.sim.yml").write_text(CAREFUL)
    ran = sim_action(tmp_path, "run", "careful.sim.yml")
    assert [outcome["warnings"] for outcome in outcomes(tmp_path)] == [[], []]
    assert "2 passed in" in ran.stdout
    alone = sim_action(tmp_path, "run", "careful.sim.yml", "--shard", "1/2", "--output-dir", "first")
    assert "the premise 'speed > 0.1 m/s' never held" in alone.stdout
    assert "careful.sim.yml:5:11" in alone.stdout
    sim_action(tmp_path, "run", "careful.sim.yml", "--shard", "2/2", "--output-dir", "second")
    merged = sim_action(tmp_path, "merge", "first", "second")
    assert merged.returncode == 0
    assert [outcome["warnings"] for outcome in outcomes(tmp_path)] == [[], []]


@pytest.mark.skipif(len(installed()) < 2, reason="there is one engine")
def test_each_variation_is_compared_on_all_engines(folder: Path) -> None:
    sim_action(folder, "run", "push.sim.yml", "--backend", "all", "--only", "push[friction=0.9*")
    found = outcomes(folder)
    assert [outcome["name"].rpartition(" ")[2] for outcome in found] == ["[pybullet]", "[mujoco]"] * 2
    assert {outcome["group"] for outcome in found} == {"push"}
    compared = ["agreement" in {claim["assertion"] for claim in outcome["expectations"]} for outcome in found]
    assert compared == [False, True] * 2
    names = [case.get("name") or "" for case in junit(folder)]
    assert len(set(names)) == len(names)


def test_nothing_is_begun_after_the_first_failure(folder: Path) -> None:
    (folder / "many.sim.yml").unlink()
    ran = sim_action(folder, "run", "--fail-fast", "--jobs", "1")
    assert ran.returncode == 1
    assert [status for _, status in told(folder)] == ["failed", "skipped", "skipped", "skipped"]
    assert "1 failed, 3 not run" in ran.stdout
    assert [junit(folder).get(key) for key in ("tests", "failures", "skipped")] == ["4", "1", "3"]
    merged = sim_action(folder, "merge", "sim-results", "--output-dir", "merged")
    assert merged.returncode == 1


def test_with_an_invalid_scenario_nothing_is_begun_at_all(folder: Path) -> None:
    ran = sim_action(folder, "run", "--fail-fast", "many.sim.yml")
    assert ran.returncode == 2
    assert [status for _, status in told(folder)] == ["skipped", "error", "skipped"]


def test_a_xacro_of_a_base_is_evaluated_with_what_each_scenario_says(tmp_path: Path) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/box.xacro").write_text(
        '<robot name="box" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="mass" default="1"/>'
        '<link name="l"><inertial><mass value="$(arg mass)"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
        '</inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link></robot>'
    )
    (tmp_path / "lib/box.base.yml").write_text("robot: {model: box.xacro}\nexpect: [upright]\ntime_limit: 0.1 s\n")
    (tmp_path / "a.sim.yml").write_text(
        "extends: lib/box.base.yml\nname: a\nvariations: {robot.args.mass: [1, heavy]}\n"
    )
    sim_action(tmp_path, "run", "a.sim.yml")
    found = outcomes(tmp_path)
    assert [outcome["status"] for outcome in found] == ["passed", "error"]
    assert "heavy" in json.dumps(found[1]["failures"])


def test_a_draw_out_of_bounds_is_an_error_of_that_variation(folder: Path) -> None:
    drawn = "{world.ground.friction: {uniform: [-0.3, 0.9], samples: 4}}"
    (folder / "push.sim.yml").write_text(f"name: push\nvariations: {drawn}\n{SHARED}")
    validated = sim_action(folder, "validate", "push.sim.yml")
    assert validated.returncode == 2
    assert "1 valid, 0 invalid, 1 variation invalid (3 runs with all variations)" in validated.stderr
    ran = sim_action(folder, "run", "push.sim.yml")
    assert ran.returncode == 2
    assert sorted(status for _, status in told(folder)) == ["error", "passed", "passed", "passed"]
    assert "3 of 4 passed; worst: [friction=-" in ran.stdout
    assert "(drawn from uniform: [-0.3, 0.9]; choose bounds within the allowed range)" in ran.stdout
    assert (junit(folder).get("tests"), junit(folder).get("errors")) == ("4", "1")


def test_a_sweep_that_passes_says_how_near_it_came(folder: Path) -> None:
    text = f"name: push\nvariations: {{commands.twist.0.linear: [0.3, 0.5]}}\n{SHARED}"
    (folder / "push.sim.yml").write_text(text.replace("expect: [", "expect: [{max_speed: {linear: 1 m/s}}, "))
    ran = sim_action(folder, "run", "push.sim.yml")
    assert ran.returncode == 0
    worst = r"push  push\.sim\.yml  \S+ \S+  2 of 2 passed; worst: \[linear=0\.5\], margin 0\.\d+ m/s \("
    assert re.search(worst, ran.stdout)
    properties = {each.get("name"): each.get("value") or "" for each in junit(folder).iter("property")}
    assert properties["worst"].startswith("[linear=0.5], margin 0.")
    goals = {each["assertion"]: each["verdict"]["goal"] for each in outcomes(folder)[0]["expectations"]}
    assert goals == {"max_speed": False, "travel": True}
