"""What is made from the code is what the code makes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from docs.reference import example
from docs.robots import without_figures
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.core.registry import Table
from sim_action.drives import DRIVES
from sim_action.robot.findings import RULES
from sim_action.scenario.loading import load_scenario
from sim_action.sensors import SENSORS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
REFERENCE = (ROOT / "docs/scenario.md").read_text(encoding="utf-8")
FAMILIES: dict[str, Table[Any]] = {"drives": DRIVES, "commands": COMMANDS, "sensors": SENSORS, "assertions": ASSERTIONS}
ROBOTS = (ROOT / "docs/robots.md").read_text(encoding="utf-8")


def blocks(language: str, page: str = README) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def test_tables_and_schema_are_fresh() -> None:
    checked = subprocess.run(
        [sys.executable, "-m", "docs.generate", "--check"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert checked.returncode == 0, checked.stderr


@pytest.mark.pybullet
def test_the_table_of_robots_is_fresh_but_for_its_figures() -> None:
    checked = subprocess.run(
        [sys.executable, "-m", "docs.robots", "--check"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert checked.returncode == 0, checked.stderr


ROW = "| husky<br>`husky.urdf` | none | 44 kg | 10, 4 move | none | {} |\n"


@pytest.mark.parametrize("figures", ["52 / 49 | 1.07", "1234 / 1 | 1234.00"])
def test_figures_of_time_may_differ(figures: str) -> None:
    assert without_figures(ROW.format(figures)) == ROW.format("# / # | #")


@pytest.mark.parametrize("figures", [" | ", "52 / 49 | ", " | 1.07", "52 | 1.07", "a / b | 1.07", "52 / 49 | 1"])
def test_figures_of_time_must_be_there(figures: str) -> None:
    assert without_figures(ROW.format(figures)) != ROW.format("# / # | #")


def test_what_was_found_of_a_robot_is_explained() -> None:
    head, _, explained = ROBOTS.partition("## What to do about a finding")
    _, _, found = head.partition("<!-- generated: robots -->")
    table, _, _ = found.partition("<!-- end -->")
    rules = set(re.findall(r"[`\[]([a-z]+(?:-[a-z]+)+)[`\]]", table))
    assert {"bad-xml", "zero-mass"} <= rules <= set(RULES)
    assert rules <= set(re.findall(r"^\| `([a-z-]+)` \|", explained, re.MULTILINE)) <= set(RULES)


def test_every_scenario_of_the_readme_loads(tmp_path: Path) -> None:
    scenarios = [text for text in blocks("yaml") if "time_limit:" in text]
    assert len(scenarios) == 2
    for text in scenarios:
        path = tmp_path / "readme.sim.yml"
        path.write_text(text)
        load_scenario(path)


@pytest.mark.parametrize(("family", "key"), [(family, key) for family, table in FAMILIES.items() for key in table])
def test_each_section_of_the_reference_has_an_example_of_it(family: str, key: str) -> None:
    path = example(family, key)
    scenario = load_scenario(path).scenario
    named: dict[str, list[type]] = {
        "drives": [type(scenario.robot.drive)],
        "commands": [type(source) for source in scenario.commands],
        "sensors": [type(mounted.sensor) for mounted in scenario.sensors],
        "assertions": [type(expected.assertion) for expected in scenario.expect],
    }
    assert FAMILIES[family].load(key) in named[family]
    assert path.read_text(encoding="utf-8") in REFERENCE


def test_the_first_scenario_of_the_reference_loads(tmp_path: Path) -> None:
    (tmp_path / "first.sim.yml").write_text(blocks("yaml", REFERENCE)[0])
    load_scenario(tmp_path / "first.sim.yml")


def test_links_within_the_reference_lead_somewhere() -> None:
    heads = re.findall(r"^#+ (.+)$", REFERENCE, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}
    assert set(re.findall(r"\(#([\w-]+)\)", REFERENCE)) <= anchors
    for name in re.findall(r"\(\.\./([\w/.-]+)\)", REFERENCE):
        assert (ROOT / name).exists(), name


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
