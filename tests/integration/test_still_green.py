"""Scenarios that pass and were checked, which no rule may refuse, and those with a claim that is never judged."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import junitparser
import pytest

from sim_action.engines import installed
from sim_action.results.results_json import Results
from tests.integration.conftest import outcomes, sim_action
from tests.physics.robots import box_shape, collision, inertial, joint, link, robot

BURGER: Final = "robot: {model: turtlebot3_burger}\n"
WALL: Final = "world: {objects: [{name: wall, box: [0.1, 2, 0.5], pose: {x: 0.6}}]}\n"
HINGE: Final = 'lower="-1.5" upper="1.5" effort="{}" velocity="3"'
ARM_URDF: Final = robot(
    link("base", inertial(5.0, (0.1,) * 3) + collision(box_shape((0.2,) * 3))),
    link("upper", inertial(1.0, (0.01,) * 3, (0.2, 0, 0)) + collision(box_shape((0.3, 0.04, 0.04)), (0.2, 0, 0))),
    link("hand", inertial(0.2, (0.001,) * 3) + collision(box_shape((0.05,) * 3))),
    joint("shoulder", "revolute", "base", "upper", (0, 0, 0.3), limit=HINGE.format(50)),
    joint("wrist", "revolute", "upper", "hand", (0.4, 0, 0), axis=(1, 0, 0), limit=HINGE.format(5)),
)
ARM: Final = "robot: {model: arm.urdf, base: fixed, pose: {z: 0.5}}\n"
RAISED: Final = "robot: {model: arm.urdf, base: fixed, pose: {z: 0.5}, joints: {shoulder: 0.5}}\n"
OUT_AND_BACK: Final = "commands: {twist: [{linear: 0.5, for: 1 s}, {linear: -0.5, for: 1.5 s}, {linear: 0}]}\n"
PERSON: Final = (
    "world: {objects: [{name: person, cylinder: {radius: 0.2, height: 1.7}, pose: {x: 0.6},\n"
    "  path: [{at: 0.3 s, x: 0.6, y: 0}, {at: 1.3 s, x: 0.6, y: 1.5}]}]}\n"
)

GREEN: Final[Mapping[str, str]] = {
    "stands": BURGER + WALL + "expect: [upright, no_collision, stay_within: {x: [-1 cm, 1 cm], y: [-1 cm, 1 cm]}]\n"
    "time_limit: 0.5 s\n",
    "is at rest without commands": BURGER + "expect: [settled]\ntime_limit: 1.5 s\n",
    "is at its place without commands": BURGER + "expect: [{reach: {x: 0, y: 0}, for: 0.5 s}]\ntime_limit: 1 s\n",
    "falls and comes to rest": "robot: {model: turtlebot3_burger, pose: {z: 0.2}}\nphysics: {settle: 0 s}\n"
    "expect: [settled, upright]\ntime_limit: 3 s\n",
    "holds its place": BURGER + "commands: {twist: [{linear: 0}]}\nexpect:\n"
    "  - stay_within: {x: [-1 cm, 1 cm], y: [-1 cm, 1 cm]}\n"
    "  - max_speed: {linear: 1 cm/s, angular: 1 deg/s}\n"
    "  - not: {travel: {at_least: 1 cm}}\n"
    "time_limit: 1 s\n",
    "refuses to drive at a wall": BURGER + WALL + "commands: {twist: [{linear: 0}]}\n"
    "expect: [{clearance: {at_least: 20 cm}}, {travel: {at_most: 1 cm}}]\ntime_limit: 1 s\n",
    "raises a joint and holds it": ARM + "commands: {joints: [{at: 0 s, position: {shoulder: 0.5}}]}\n"
    "expect: [{joint: {name: shoulder, near: 0.5, tolerance: 1 deg}, for: 0.5 s}]\ntime_limit: 2 s\n",
    "holds a joint at its place": RAISED + "commands: {joints: [{at: 0 s, position: {shoulder: 0.5}}]}\n"
    "expect: [{joint_within: {position: {shoulder: [28 deg, 29 deg]}}}]\ntime_limit: 1 s\n",
    "holds a joint while another one moves": RAISED
    + "commands: {joints: [{at: 0.5 s, position: {wrist: 1, shoulder: 0.5}}]}\n"
    "expect: [{joint: {name: shoulder, near: 0.5, tolerance: 1 deg}, for: 0.5 s}]\ntime_limit: 2 s\n",
    "moves a joint away and back": ARM
    + "commands: {joints: [{at: 0.5 s, position: {shoulder: 0.5}}, {at: 1 s, position: {shoulder: 0}}]}\n"
    "expect:\n"
    "  - {joint: {name: shoulder, near: 0, tolerance: 1 deg}}\n"
    "  - {joint: {name: shoulder, near: 0, tolerance: 1 deg}, after: 1.2 s, for: 0.3 s}\n"
    "time_limit: 2 s\n",
    "drives out and back": BURGER
    + OUT_AND_BACK
    + "expect: [{reach: {x: 0.35, y: 0}, before: 2 s}, {reach: {x: 0, y: 0}, after: 1 s}, {reach: {x: 0, y: 0}}]\n"
    "time_limit: 4 s\n",
    "comes near a wall again": "robot: {model: turtlebot3_burger, pose: {yaw: 180 deg}}\n"
    + WALL
    + OUT_AND_BACK
    + "expect: [{clearance: {at_most: 66 cm, to: [wall]}}]\ntime_limit: 4 s\n",
    "waits, then drives a circle": BURGER
    + "commands: {twist: [{linear: 0, for: 0.5 s}, {linear: 0.2, angular: 3, for: 2.4 s}, {linear: 0}]}\n"
    "expect: [{reach: {x: 0, y: 0}}, settled: {for: 0.5 s}]\ntime_limit: 6 s\n",
    "parks": BURGER + "commands: {twist: [{linear: 0.4, for: 0.5 s}, {linear: 0}]}\n"
    "expect: [{settled: {for: 0.5 s}, after: 1.2 s}, {at_once: [settled, {travel: {at_least: 15 cm}}], for: 0.3 s}]\n"
    "time_limit: 4 s\n",
    "stands again after a push": "robot: {model: arm.urdf}\n"
    "world: {disturbances: [{at: 0.3 s, velocity: [0.3, 0, 0]}]}\n"
    "expect: [settled, upright, {stl: 'always[1 s, end] (speed < 0.02)'}]\ntime_limit: 3 s\n",
    "resists a push": "robot: {model: arm.urdf}\n"
    "world: {disturbances: [{at: 0.3 s, for: 0.1 s, force: [5, 0, 0]}]}\n"
    "expect: [upright, {max_speed: {linear: 5 cm/s}}, {stay_within: {x: [-1 cm, 1 cm]}}]\ntime_limit: 1 s\n",
    "waits for a person": BURGER + PERSON + "commands: {twist: [{linear: 0, for: 1.2 s}, {linear: 0.4}]}\n"
    "expect: [{reach: {x: 0.6, y: 0}}, no_collision, {clearance: {at_least: 5 cm}}]\ntime_limit: 4 s\n",
    "reads gravity": BURGER
    + "sensors: [{imu: {}, name: imu, link: base_footprint, rate: 20 Hz}]\ncommands: {twist: [{linear: 0.2}]}\n"
    "expect: [{sensor: {name: imu, reading: linear_acceleration_xyz, which: z, at_least: 5, at_most: 15}}]\n"
    "time_limit: 0.5 s\n",
}


@pytest.mark.parametrize("engine", installed())
def test_scenarios_that_are_right_pass(engine: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM_URDF)
    for number, (name, text) in enumerate(GREEN.items()):
        (tmp_path / f"{number}.sim.yml").write_text(f"name: {name}\n{text}")
    ran = sim_action(tmp_path, "run", "--no-report", "--jobs", "2", "--backend", engine)
    results = Results.read(tmp_path / "sim-results/results.json")
    outcomes = {outcome.name: outcome for outcome in results.outcomes}
    problems = {
        name: [(one.name, one.verdict.message) for one in outcome.expectations] + [*outcome.failures]
        for name, outcome in outcomes.items()
        if outcome.status != "passed" or outcome.warnings
    }
    assert not problems
    assert (ran.returncode, set(outcomes)) == (0, set(GREEN))
    judged = [expectation.verdict.judged for outcome in outcomes.values() for expectation in outcome.expectations]
    assert all(each is not None and each.moments > 0 for each in judged)


# The first reading comes at 1 s, after the window of the expectation has closed.
UNREAD = """\
name: range in front
robot: {model: turtlebot3_burger}
sensors: [{lidar: {rays: 10, range: 3.5 m}, name: scan, link: base_scan, rate: 1 Hz}]
expect:
  - sensor: {name: scan, reading: ranges, which: min, at_least: 0.2}
    name: free in front
    after: 0.2 s
    before: 0.6 s
  - upright
"""
TIMES = "time_limit: 1 s\n"


def test_every_report_shows_that_it_was_not_exercised(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(UNREAD + TIMES)
    output = tmp_path / "outputs.txt"
    run = sim_action(tmp_path, "run", "--verbose", GITHUB_ACTIONS="true", GITHUB_OUTPUT=str(output))
    assert run.returncode == 1, run.stdout + run.stderr
    assert "1 not exercised" in run.stdout
    assert "::error file=a.sim.yml,line=5" in run.stdout
    assert "not-exercised<<" in output.read_text()
    (suite,) = junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml"))
    assert (suite.tests, suite.failures, suite.errors) == (2, 0, 1)
    ((error,),) = (case.result for case in suite if case.result)
    assert (type(error), error.type) == (junitparser.Error, "not_exercised")
    (outcome,) = outcomes(tmp_path)
    assert outcome["status"] == "not_exercised"
    unread, upright = (expected["verdict"]["judged"] for expected in outcome["expectations"])
    assert unread == {"moments": 0, "first": None, "last": None}
    assert upright["moments"] >= 240
    assert f"judged at {upright['moments']} moments, 0.00 s to 1.00 s" in run.stdout
    assert "Not exercised: something was never checked" in (tmp_path / "sim-results/report.html").read_text()


@pytest.mark.parametrize(
    ("own", "project", "options", "code"),
    [
        ("unexercised: warn\n", "", (), 0),
        ("", 'unexercised = "warn"', (), 0),
        ("unexercised: error\n", 'unexercised = "warn"', ("--unexercised", "warn"), 1),
    ],
)
def test_it_can_be_accepted_knowingly(
    own: str, project: str, options: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / "a.sim.yml").write_text(UNREAD + own + TIMES)
    if project:
        (tmp_path / "pyproject.toml").write_text(f"[tool.sim-action]\n{project}\n")
    run = sim_action(tmp_path, "run", *options)
    assert run.returncode == code, run.stdout + run.stderr
    assert ("1 passed, 1 warning" if code == 0 else "1 not exercised") in run.stdout


# The robot never drives as far as the premise asks.
WARNS = """\
name: warns
robot: {model: turtlebot3_burger}
commands: {twist: [{linear: 0.5, for: 1 s}]}
expect:
  - stl: "always (x > 5 m implies yaw < 1 rad)"
    name: straight
time_limit: 1 s
"""
RULE = "premise-never-held"


def test_a_strict_run_fails_by_the_rule_of_a_warning(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(WARNS)
    run = sim_action(tmp_path, "run", "--strict", GITHUB_ACTIONS="true")
    assert run.returncode == 1, run.stdout + run.stderr
    assert f"::error file=a.sim.yml,line=5,col=5,title=warns%3A {RULE}::" in run.stdout
    (suite,) = junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml"))
    assert (suite.tests, suite.failures, suite.errors) == (2, 1, 0)
    ((failure,),) = (case.result for case in suite if case.result)
    assert (type(failure), failure.type) == (junitparser.Failure, RULE)
    (outcome,) = outcomes(tmp_path)
    assert (outcome["status"], outcome["strict"], outcome["warnings"][0]["rule"]) == ("failed", True, RULE)


def test_a_strict_check_fails_by_what_is_known_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(WARNS.replace("for: 1 s", "for: 1000 s"))
    assert sim_action(tmp_path, "validate").returncode == 0
    run = sim_action(tmp_path, "validate", "--strict")
    assert (run.returncode, "error:" in run.stdout, "[segment-beyond-run]" in run.stdout) == (1, True, True)
