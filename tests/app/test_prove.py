"""The use case `prove` without runs: an interruption before anything ran."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import Mock

import pytest

from sim_action.app.prove import ProveRequest, proof_of, prove_scenarios
from sim_action.core.errors import ExitCode
from sim_action.core.permissions import Permissions
from sim_action.runner.run_plan import PlanRequest
from sim_action.scenario.selection import Selection, find_suite
from tests.scenarios import LEAST


def request(folder: Path) -> ProveRequest:
    suite = find_suite([str(folder)], Selection())
    return ProveRequest(PlanRequest(suite, Permissions(outside=True), None, None, None), 1, quiet=True)


def test_an_interruption_leaves_no_findings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.sim.yml").write_text(LEAST)
    interruption = Mock(happened=True)
    assert proof_of(request(tmp_path), interruption) is None
    assert prove_scenarios(request(tmp_path), interruption) == ExitCode.INTERRUPTED
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("interrupted: no scenario is proven") == 1


def test_without_scenarios_there_is_nothing_to_prove(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert prove_scenarios(request(tmp_path), Mock(happened=False)) == ExitCode.NO_SCENARIO
    assert capsys.readouterr().out == "0 expectations check nothing, 0 notice something\n"
