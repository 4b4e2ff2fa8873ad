"""Scenario texts, and what loading makes of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, Problem
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario

LEAST = """\
name: burger drives straight
robot:
  model: turtlebot3_burger
commands:
  rate: 10 Hz
  twist:
    - {linear: 1.0}
expect:
  - travel: {at_least: 1.5 m}
time_limit: 30 s
"""

FULL = """\
version: 1
name: burger stops before the wall
robot:
  model: turtlebot3_burger
  base: free
  pose: {x: 0, y: 0, yaw: 0 deg}
  joints: {wheel_left_joint: 0}
  drive: {diff: {left: [wheel_left_joint], right: [wheel_right_joint], acceleration: 1.0}}
world:
  ground: {friction: 1.0}
  objects:
    - {name: wall, box: [0.1, 2.0, 0.5], pose: {x: 3.0}}
    - {name: ball, sphere: {radius: 5 cm}, mass: 100 g, pose: {y: 2, z: 1}}
physics: {rate: 240 Hz}
commands:
  - twist:
      - {linear: 1.0, for: 2 s}
      - {linear: 0.2}
    rate: 10 Hz
expect:
  - travel: {at_least: 1.5 m}
    before: 10 s
  - no_collision
  - upright: {max_tilt: 20 deg}
    name: stays up
    after: 1 s
    severity: warning
  - joint: {name: wheel_left_joint, reading: velocity, at_most: 100}
duration: 5 s
time_limit: 30 s
wall_limit: 60 s
trace: {rate: 20 Hz}
"""


def load(folder: Path, text: str | bytes) -> LoadedScenario:
    path = folder / "s.sim.yml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_scenario(path)


def problems(folder: Path, text: str | bytes) -> list[Problem]:
    with pytest.raises(InvalidScenario) as raised:
        load(folder, text)
    return list(raised.value.problems)


def told(folder: Path, text: str | bytes) -> list[str]:
    """Such as "3:1: robot.model: expected text": problems without the file, which is checked."""
    found = problems(folder, text)
    file = str(folder / "s.sim.yml")
    assert {problem.location.file for problem in found} == {file}
    return [str(problem).removeprefix(f"{file}:") for problem in found]
