"""Scenario texts, and what loading makes of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, Problem
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import read_document
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import load_all, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.expansion import expanded

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

COMMANDS = LEAST[LEAST.index("commands:") : LEAST.index("expect:")]
"""Those of the least scenario."""

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


def expecting(*entries: str) -> str:
    """The least scenario with other expectations; the first begins in line 9."""
    return LEAST.replace("  - travel: {at_least: 1.5 m}\n", "".join(f"  - {entry}\n" for entry in entries))


def driving(
    name: str, commands: str = "{twist: [{linear: 0.5}]}", *, at_least: str = "0.1 m", time_limit: str = "5 s"
) -> str:
    """The burger travels: one key in each line."""
    head = f"name: {name}\nrobot: {{model: turtlebot3_burger}}\ncommands: {commands}\n"
    return f"{head}expect: [{{travel: {{at_least: {at_least}}}}}]\ntime_limit: {time_limit}\n"


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
    refused = problems(folder, text)
    file = str(folder / "s.sim.yml")
    assert {problem.location.file for problem in refused} == {file}
    return [str(problem).removeprefix(f"{file}:") for problem in refused]


def runs(more: str, folder: Path = Path(), seed: int | None = None, least: str = LEAST) -> tuple[Source, ...]:
    """The runs of the least scenario with more keys, which is called 'push'; its file is not written."""
    folder = folder.absolute()
    document = read_document("s.sim.yml", least + more)
    return expanded(Source(folder / "s.sim.yml", Workspace(folder, folder), document, "push"), seed)


def refused_runs(more: str, folder: Path = Path()) -> list[str]:
    """Such as "12:3: variations: ...": why the runs of the least scenario with more keys are refused."""
    with pytest.raises(InvalidScenario) as raised:
        runs(more, folder)
    return [str(problem).removeprefix("s.sim.yml:") for problem in raised.value.problems]


def load_runs(folder: Path, text: str) -> list[LoadedScenario | Refused]:
    """What loading makes of all runs of a file."""
    path = folder / "s.sim.yml"
    path.write_text(text)
    return load_all(read_file(path, Permissions()), Permissions())


def load_refused(folder: Path, text: str) -> Refused:
    """What loading makes of a file that is refused as a whole."""
    (refused,) = load_runs(folder, text)
    assert isinstance(refused, Refused)
    return refused
