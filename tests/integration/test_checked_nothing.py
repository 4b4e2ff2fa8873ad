"""Scenarios that once passed although nothing was checked. All run in one call; each has its line in `CASES`.

A script that sets the pose of the robot is in test_jumps.py, the noise of samples in test_suites.py, launch files of
ROS 1 without a node or a world in test_ros1_launches.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

import pytest

from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.conftest import sim_action

BURGER: Final = "robot: {model: turtlebot3_burger}\n"
WALL: Final = "world: {objects: [{name: wall, box: [0.1, 2, 0.5], pose: {x: 0.6}}]}\n"
SCAN: Final = "sensors: [{lidar: {rays: 8, range: 2 m}, name: scan, link: base_scan, rate: 2 Hz}]\n"


class Case(NamedTuple):
    """A scenario without its name, its status, and for each expectation its status and words of its message.

    A scenario that is refused has no expectations; `refused` is in its message.
    """

    text: str
    status: str
    expected: tuple[tuple[str, str], ...] = ()
    refused: str = ""


ONLY_BEFORE: Final = "was already true at t = 0, and never became true again"

CASES: Final[Mapping[str, Case]] = {
    "tilt in degrees without a unit": Case(
        "robot: {model: turtlebot3_burger, pose: {pitch: 170 deg, z: 0.4}}\n"
        "expect: [{upright: {max_tilt: 30}}]\ntime_limit: 1 s\n",
        "error",
        refused="expect.0.upright.max_tilt: 30 without a unit is in rad, and more than one turn; write '30 deg'",
    ),
    "tilt that nothing exceeds": Case(
        BURGER + "expect: [{upright: {max_tilt: 180 deg}}]\ntime_limit: 1 s\n",
        "error",
        refused="a limit of 180 deg cannot be exceeded",
    ),
    "interval of a formula beyond the end": Case(
        BURGER + "commands: {twist: [{linear: 0.3}]}\n"
        "expect: [{stl: 'always[3 s, 4 s] (speed > 9 m/s)'}]\ntime_limit: 2 s\n",
        "error",
        refused="must see 4 s, and time_limit is 2 s",
    ),
    "inner interval beyond the end": Case(
        BURGER + "commands: {twist: [{angular: 1}]}\n"
        "expect: [{stl: 'eventually always[0 s, 1 s] abs(yaw - 30 deg) < 2 deg'}]\ntime_limit: 0.9 s\n",
        "error",
        refused="must see 1 s, and time_limit is 0.9 s",
    ),
    "inner interval up to the end": Case(
        BURGER + "commands: {twist: [{angular: 0.5}]}\n"
        "expect: [{stl: 'eventually always[0 s, 0.5 s] abs(yaw - 40 deg) < 2 deg'}]\ntime_limit: 1.7 s\n",
        "failed",
        (("failed", ""),),
    ),
    "goal before an interval": Case(
        BURGER + "commands: {twist: [{linear: 0.3}]}\n"
        "expect: [{travel: {at_least: 5 cm}}, {stl: 'always[1 s, 1.5 s] (speed < 0.05)'}]\ntime_limit: 3 s\n",
        "failed",
        (("passed", ""), ("failed", "at 1.00 s")),
    ),
    "readings after the window": Case(
        BURGER + SCAN + "commands: {twist: [{linear: 0.1}]}\n"
        "expect: [{sensor: {name: scan, reading: ranges, which: max, at_most: 0.1}, after: 0.1 s, before: 0.4 s}]\n"
        "time_limit: 1 s\n",
        "not_exercised",
        (("not_exercised", "scan gave no reading in this time; raise its 'rate'"),),
    ),
    "odometry without a reading": Case(
        BURGER + "sensors: [{odometry: {radius_error: 0.3}, rate: 1 Hz}]\ncommands: {twist: [{linear: 0.3}]}\n"
        "expect: [{odometry_error: {position: 1 mm}, after: 0.2 s}]\ntime_limit: 0.9 s\n",
        "not_exercised",
        (("not_exercised", "odometry gave no reading in this time"),),
    ),
    "goals at the start": Case(
        BURGER + WALL + SCAN + "commands: {twist: [{linear: 0, for: 1 s}, {linear: 0.5}]}\n"
        "expect:\n"
        "  - reach: {x: 0, y: 0}\n"
        "  - settled\n"
        "  - stops_before: {body: wall, gap: [20 cm, 1 m]}\n"
        "  - clearance: {at_most: 1 m, to: [wall]}\n"
        "  - joint: {name: wheel_left_joint, near: 0, tolerance: 5 deg}\n"
        "  - sensor: {name: scan, reading: ranges, which: min, at_most: 1.5, once: true}\n"
        "  - at_once: [{clearance: {at_most: 1 m}}, upright]\n"
        "time_limit: 1.5 s\n",
        "failed",
        tuple(("failed", ONLY_BEFORE) for _ in range(7)),
    ),
    "goals at the start of a robot that must stay": Case(
        BURGER + WALL + "commands: {twist: [{linear: 0}]}\n"
        "expect: [{stops_before: {body: wall, gap: [20 cm, 1 m]}}, {clearance: {at_most: 1 m}}]\ntime_limit: 1.2 s\n",
        "failed",
        (("failed", ONLY_BEFORE), ("failed", ONLY_BEFORE)),
    ),
    "home before leaving it": Case(
        BURGER + "commands: {twist: [{linear: 0.4, for: 1 s}, {linear: 0.4}]}\n"
        "expect: [{reach: {x: 0, y: 0}}]\ntime_limit: 2 s\n",
        "failed",
        (("failed", f"{ONLY_BEFORE}; came no closer than 0.05"),),
    ),
    "two places, one after the other": Case(
        BURGER + "commands: {twist: [{linear: 0.5}]}\n"
        "expect: [{all_of: [{reach: {x: 0.2, y: 0}}, {reach: {x: 0.5, y: 0}}]}]\ntime_limit: 3 s\n",
        "passed",
        (("passed", "all 2 hold"),),
    ),
    "two places at once": Case(
        BURGER + "commands: {twist: [{linear: 0.5}]}\n"
        "expect: [{at_once: [{reach: {x: 0.2, y: 0}}, {reach: {x: 0.5, y: 0}}]}]\ntime_limit: 2 s\n",
        "failed",
        (("failed", "at most 1 of 2 were true at the same moment"),),
    ),
    "warnings alone": Case(
        BURGER + "commands: {twist: [{linear: 0.3}]}\n"
        "expect: [{travel: {at_least: 50 m}, severity: warning}]\ntime_limit: 1 s\n",
        "error",
        refused="every expectation has severity: warning",
    ),
    "on its back": Case(
        "robot: {model: turtlebot3_burger, pose: {roll: 180 deg, z: 0.3}}\n"
        "expect: [{upright: {max_tilt: 20 deg}}]\ntime_limit: 1 s\n",
        "failed",
        (("failed", "at 0.00 s, more than 20 deg"),),
    ),
    "window after the end": Case(
        BURGER + "expect: [upright, {no_collision: {}, after: 3 s}]\ntime_limit: 1 s\n", "error", refused="time_limit"
    ),
}


def run(folder: Path, texts: Mapping[str, str], engine: str) -> tuple[int, dict[str, Outcome]]:
    """Run all scenarios in one call; return the exit code, and name -> outcome."""
    for number, (name, text) in enumerate(texts.items()):
        (folder / f"{number}.sim.yml").write_text(f"name: {name}\n{text}")
    ran = sim_action(folder, "run", "--no-report", "--jobs", "2", "--backend", engine)
    results = folder / "sim-results/results.json"
    assert results.exists(), ran.stdout + ran.stderr
    return ran.returncode, {outcome.name: outcome for outcome in Results.read(results).outcomes}


@pytest.mark.parametrize("engine", installed())
def test_scenarios_that_check_nothing_do_not_pass(engine: str, tmp_path: Path) -> None:
    code, outcomes = run(tmp_path, {name: case.text for name, case in CASES.items()}, engine)
    assert code == 2
    found = {name: (one.status, [each.status for each in one.expectations]) for name, one in outcomes.items()}
    assert found == {name: (case.status, [status for status, _ in case.expected]) for name, case in CASES.items()}
    for name, case in CASES.items():
        outcome = outcomes[name]
        assert case.refused in " ".join(failure.message for failure in outcome.failures), name
        for expectation, (_, words) in zip(outcome.expectations, case.expected, strict=True):
            verdict = expectation.verdict
            assert words in verdict.message, name
            # A verdict says at how many moments it was judged, and none passes without any.
            assert verdict.judged, name
            assert verdict.judged.moments > 0 or not verdict.passed, name
