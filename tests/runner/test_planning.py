"""What each call is to run: everything once, whatever is wrong with some of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.discovery import file_name
from sim_action.core.workspace import Permissions
from sim_action.runner.planning import Planned, PlanRequest, planned, source_of
from sim_action.scenario.source import Refused
from sim_action.scenario.suite import Suite
from tests.scenarios import LEAST

SHARED = LEAST.partition("\n")[2]
FILES = {
    "a.sim.yml": f"scenarios:\n  - {{name: one}}\n  - {{name: two, time_limit: no}}\n  - {{name: three}}\n{SHARED}",
    "b.sim.yml": f"name: push\nvariations: {{robot.pose.x: [0, 1, 2, 3, 4]}}\n{SHARED}",
    "c.sim.yml": f"name: broken\nvariations: {{robot.pose.x: [0, 1, far, 3]}}\n{SHARED}",
    "d.sim.yml": "name: [",
    "e.sim.yml": LEAST,
}
PUSHES = [f"push[x={x}]" for x in range(5)]
NAMES = ["one", "two", "three", *PUSHES, "broken", "d.sim.yml", "burger drives straight"]


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return [tmp_path / name for name in FILES]


def plan(suite: Suite, shard: str | None = None) -> Planned:
    return planned(PlanRequest(suite, Permissions(), shard, None, None))


def names(found: Planned) -> list[str]:
    return [source_of(each).name for each in found.plans]


def test_without_shards_it_is_everything(files: list[Path]) -> None:
    found = plan(Suite(files, ("nope*",)))
    assert names(found) == NAMES
    assert [source_of(each).name for each in found.plans if isinstance(each, Refused)] == ["two", "broken", "d.sim.yml"]
    assert (found.shard, list(found.empty)) == (None, ["nope*"])


@pytest.mark.parametrize("count", [1, 2, 3, 20])
def test_shards_have_every_scenario_once_by_its_place_in_the_list_alone(files: list[Path], count: int) -> None:
    parts = [plan(Suite(files, ("nope*",)), f"{index}/{count}") for index in range(1, count + 1)]
    assert [names(part) for part in parts] == [NAMES[index::count] for index in range(count)]
    assert {part.shard.total for part in parts if part.shard} == {len(NAMES) + 1}
    assert [list(part.empty) for part in parts] == [["nope*"]] + [[]] * (count - 1)


def test_numbers_leave_scenarios_of_other_numbers_to_others(files: list[Path]) -> None:
    def some(path: Path, *numbers: int) -> list[str]:
        return names(plan(Suite([path], numbers={file_name(path): frozenset(numbers)})))

    assert some(files[0], 1, 2) == ["one", "two"]
    assert some(files[1], 2, 4) == ["push[x=1]", "push[x=3]"]
    # What stops all variations is told by whoever has the first.
    assert some(files[2], 1, 2) == ["broken"]
    assert some(files[2], 3, 4) == []


def test_shards_share_what_was_read_for_variations(files: list[Path]) -> None:
    found = plan(Suite(files[:2]), "1/2")
    models = [each[0].model for each in found.plans if not isinstance(each, Refused)]
    assert len(models) == 4
    assert all(model is models[0] is not None for model in models)
