"""A run that has ended, read from its results."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.results.earlier_run import read_run
from tests.outcomes import gate_results, outcome, planned_gate, results, runs_of_gate, stored


def test_each_outcome_has_the_folder_of_its_files(tmp_path: Path) -> None:
    for index in (1, 2):
        stored(tmp_path / f"{index}", results(outcome(f"{index}.sim.yml"), shard=(index, 2, 2)))
    found = read_run(str(tmp_path))
    assert [each.file for each in found.outcomes] == ["1.sim.yml", "2.sim.yml"]
    assert [found.folders[id(each)] for each in found.outcomes] == [tmp_path / "1", tmp_path / "2"]


def test_a_gate_is_judged_and_has_no_files(tmp_path: Path) -> None:
    planned = planned_gate(runs=3)
    stored(tmp_path / "old", gate_results(planned, *runs_of_gate(planned, passed=3)))
    found = read_run(str(tmp_path / "old"))
    assert [each.statistics is not None for each in found.outcomes] == [True, False, False, False]
    assert [id(each) in found.folders for each in found.outcomes] == [False, True, True, True]


def test_what_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no results\.json found at .*; name a results file or its folder"):
        read_run(str(tmp_path / "none"))
    (tmp_path / "results.json").write_text("{}")
    with pytest.raises(UsageError, match="is not a valid results file"):
        read_run(str(tmp_path))


def test_a_gate_without_a_place_is_told(tmp_path: Path) -> None:
    planned = planned_gate(runs=3)
    path = gate_results(planned, *runs_of_gate(planned, passed=3)).write(tmp_path)
    written = json.loads(path.read_text())
    written["gates"][0]["line"] = 0
    path.write_text(json.dumps(written))
    with pytest.raises(UsageError, match=r"is not a valid results file: gates\.0\.line: "):
        read_run(str(tmp_path))
