"""What is made from the code is what the code makes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from sim_action.loading import load_scenario

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_tables_and_schema_are_fresh() -> None:
    checked = subprocess.run(
        [sys.executable, "docs/generate.py", "--check"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert checked.returncode == 0, checked.stderr


def test_every_scenario_of_the_readme_loads(tmp_path: Path) -> None:
    scenarios = [text for text in blocks("yaml") if "time_limit:" in text]
    assert len(scenarios) == 2
    for text in scenarios:
        path = tmp_path / "readme.sim.yml"
        path.write_text(text)
        load_scenario(path)


def test_the_readmes_least_scenario_is_the_example() -> None:
    example = (ROOT / "examples/turtlebot3/straight_line.sim.yml").read_text()
    assert example in blocks("yaml")[0]


def test_the_readmes_controller_is_valid(tmp_path: Path) -> None:
    (tmp_path / "controller.py").write_text(blocks("python")[0])
    path = tmp_path / "readme.sim.yml"
    path.write_text(
        "name: n\nrobot: {model: turtlebot3_burger}\ncommands: {script: controller.py}\n"
        "expect: [no_collision]\ntime_limit: 1 s\n"
    )
    load_scenario(path)


def test_files_that_the_readme_names_are_there() -> None:
    for name in re.findall(r"`((?:docs|tests|examples|sim_action|bench)/[\w./-]*)`", README):
        assert (ROOT / name).exists(), name
