"""Which scenarios of which files are meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.discovery import file_name
from sim_action.core.errors import UsageError
from sim_action.core.workspace import Permissions
from sim_action.scenario.selection import Selection
from sim_action.scenario.suite import Suite
from tests.scenarios import LEAST

SHARED = LEAST.partition("\n")[2]


@pytest.fixture
def many(tmp_path: Path) -> Path:
    path = tmp_path / "many.sim.yml"
    entries = "  - {name: one}\n  - {name: push, variations: {robot.pose.x: [0, 1, 2]}}\n  - {name: two}\n"
    path.write_text(f"scenarios:\n{entries}{SHARED}")
    return path


def found(suite: Suite) -> list[tuple[str, int]]:
    return [(each.name, each.number) for each in suite.scenarios(Permissions())]


def test_scenarios_have_numbers_variations_counted(many: Path) -> None:
    every = [("one", 1), ("push[x=0]", 2), ("push[x=1]", 3), ("push[x=2]", 4), ("two", 5)]
    assert found(Suite([many])) == every
    assert found(Suite([many], selection=Selection(only=("push", "two")))) == every[1:]
    assert found(Suite([many], numbers={file_name(many): frozenset({1, 4})})) == [every[0], every[3]]


def test_a_file_of_which_nothing_is_selected_is_no_file(many: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.sim.yml"
    other.write_text(LEAST)
    suite = Suite([many, other], selection=Selection(only=("one",)))
    assert list(suite.read(Permissions())) == [many]


@pytest.mark.parametrize("number", [0, 6])
def test_a_number_that_no_scenario_has_is_told(many: Path, number: int) -> None:
    with pytest.raises(UsageError, match=rf"many\.sim\.yml::{number}: the file holds 5, counted from 1"):
        found(Suite([many], numbers={file_name(many): frozenset({1, number})}))


def test_a_file_that_cannot_be_read_is_one(tmp_path: Path) -> None:
    (tmp_path / "b.sim.yml").write_text("name: [")
    assert found(Suite([tmp_path / "b.sim.yml"])) == [("b.sim.yml", 1)]
