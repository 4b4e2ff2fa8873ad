"""The scenarios and the controller of the documents do what their names say, on every engine."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action.engines import installed
from tests.integration.conftest import sim_action

ROOT = Path(__file__).parents[2]


def blocks(language: str, page: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


CONTROLLED = """\
name: burger stops half a metre in front of the wall
robot: {model: turtlebot3_burger}
world: {objects: [{name: wall, box: [0.1, 2.0, 0.5], pose: {x: 3.0}}]}
commands: {script: controller.py}
expect:
  - stops_before: {body: wall, gap: [49 cm, 51 cm]}
  - clearance: {at_least: 49 cm, to: [wall]}
duration: 15 s
time_limit: 15 s
"""


@pytest.mark.parametrize("engine", installed())
def test_scenarios_of_pages_pass(engine: str, tmp_path: Path) -> None:
    straight, stops = [text for text in blocks("yaml", "README.md") if "time_limit:" in text]
    first = blocks("yaml", "docs/scenario/index.md")[0]
    (tmp_path / "straight.sim.yml").write_text(straight)
    (tmp_path / "stops.sim.yml").write_text(stops)
    # It stays where it stopped, however long it runs.
    (tmp_path / "long.sim.yml").write_text(
        stops.replace("duration: 8 s", "duration: 20 s").replace("name: burger", "name: long", 1)
    )
    (tmp_path / "first.sim.yml").write_text(first)
    (tmp_path / "controller.py").write_text(blocks("python", "README.md")[0])
    (tmp_path / "controlled.sim.yml").write_text(CONTROLLED)

    ran = sim_action(tmp_path, "run", "--backend", engine, "--no-report", "-v", PATH="", COLUMNS="120")

    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "5 passed in " in ran.stdout  # without warnings
