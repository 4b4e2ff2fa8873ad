"""The use case `prove`: interruptions, and the files that it writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from sim_action.app import prove
from sim_action.app.prove import ProveRequest, prove_scenarios
from sim_action.core.errors import ExitCode
from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.core.records import replace
from sim_action.reports import ReportRequest
from sim_action.runner.child_outcome import interrupted
from sim_action.runner.process_pool import Pool
from sim_action.runner.run_plan import PlanRequest, Runs
from sim_action.scenario.selection import Selection, find_suite
from tests.scenarios import LEAST


def request(folder: Path) -> ProveRequest:
    suite = find_suite([str(folder)], Selection())
    reports = ReportRequest(folder / "results", None, junit_strict=False, verbosity="quiet", silenced=frozenset())
    plan = PlanRequest(suite, Permissions(outside=True), None, None, None)
    return ProveRequest(plan, reports, 1, json=folder / "proof.json")


def test_an_interruption_leaves_no_findings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.sim.yml").write_text(LEAST)
    interruption = Mock(happened=True)
    assert prove_scenarios(request(tmp_path), interruption) == ExitCode.INTERRUPTED
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("interrupted: no scenario is proven") == 1
    assert not (tmp_path / "proof.json").exists()
    assert not (tmp_path / "results/report.html").exists()


def test_without_scenarios_there_is_nothing_to_prove(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert prove_scenarios(request(tmp_path), Mock(happened=False)) == ExitCode.NO_SCENARIO
    assert capsys.readouterr().out == "0 expectations check nothing, 0 notice something\n"


@pytest.mark.process
def test_the_cost_is_told_before_the_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.sim.yml").write_text(LEAST)
    asked = request(tmp_path)
    asked = replace(asked, only=("silenced", "swapped"), reports=replace(asked.reports, verbosity="normal"))
    prove_scenarios(asked, Mock(happened=False))
    told = capsys.readouterr().err
    assert "2 mutants of 1 scenario, about " in told
    assert "; then up to 7 runs for each mutant that survives, to try expectations\n" in told


class _InterruptedAfter(Interruption):
    """An interruption that comes once a number of runs has ended."""

    def __init__(self, runs: int) -> None:
        super().__init__()
        self.left = runs

    def pool(self, runs: Runs, *arguments: Any) -> Mock:
        """Return a pool that runs the scenarios which are left before the interruption."""
        scenarios = runs.scenarios
        run = scenarios[: self.left]
        self.left -= len(run)
        outcomes = Pool(replace(runs, scenarios=run), *arguments).outcomes() if run else []
        self.happened = len(run) < len(scenarios)
        return Mock(**{"outcomes.return_value": [*outcomes, *map(interrupted, scenarios[len(run) :])]})


@pytest.mark.process
def test_an_interruption_keeps_the_findings_so_far(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.sim.yml").write_text(LEAST)
    with _InterruptedAfter(3) as interruption:
        monkeypatch.setattr(prove, "Pool", interruption.pool)
        assert prove_scenarios(request(tmp_path), interruption) == ExitCode.INTERRUPTED
    found = json.loads((tmp_path / "proof.json").read_text())
    (scenario,) = found["scenarios"]
    assert found["interrupted"]
    assert len(scenario["mutants"]) == 2
    assert scenario["unfinished"] > 0
    assert {each["finding"] for each in scenario["expectations"]} <= {"notices", "unknown"}
    assert "interrupted before " in capsys.readouterr().out
    assert "interrupted before " in (tmp_path / "results/report.html").read_text()
