"""Gates in whole calls: any number of jobs and shards gives the same gates, byte for byte."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import sim_action

SCENARIO = """\
name: slip
robot: {model: turtlebot3_burger}
commands: {rate: 10 Hz, twist: [{linear: 0.2}]}
expect: [{travel: {at_least: 10 cm}}]
time_limit: 1 s
variations:
  world.ground.friction: {uniform: [0.001, 0.5]}
gate:
  passes: {at_least: 50 %, confidence: 75 %}
  quantile: {of: travel.measured, q: 50 %, at_least: 1 cm, confidence: 75 %}
  runs: 7
"""
EARLY = SCENARIO.partition("gate:")[0] + "gate: {stop_early: {reject: 20 %, accept: 80 %, confidence: 75 %}, runs: 7}\n"
"""One run decides it."""


def outcomes(folder: Path) -> list[dict[str, Any]]:
    return list(json.loads((folder / "results.json").read_text())["outcomes"])


def gates(folder: Path) -> list[str]:
    """The outcomes of the gates, as they are written."""
    return [json.dumps(outcome) for outcome in outcomes(folder) if outcome["statistics"] is not None]


def statuses(folder: Path) -> list[str]:
    return [outcome["status"] for outcome in outcomes(folder)]


def ran(folder: Path, *arguments: str, code: int = 0) -> str:
    """What the command line prints on both streams."""
    ended = sim_action(folder, *arguments)
    assert ended.returncode == code, ended.stdout + ended.stderr
    return ended.stdout + ended.stderr


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where both scenarios ran in one call, with one job."""
    folder = tmp_path_factory.mktemp("gates")
    (folder / "slip.sim.yml").write_text(SCENARIO)
    (folder / "early.sim.yml").write_text(EARLY)
    ran(folder, "run", ".", "-j", "1", "--output-dir", "whole")
    return folder


def test_a_gate_passes_although_a_run_fails(workspace: Path) -> None:
    early, slip = (json.loads(text) for text in gates(workspace / "whole"))
    assert (slip["status"], slip["statistics"]["runs"]) == ("passed", 7)
    assert slip["statistics"]["failed"] > 0
    assert (early["status"], early["statistics"]["decision"]) == ("passed", "accepted")
    assert statuses(workspace / "whole").count("skipped") > 0


def test_the_number_of_jobs_changes_no_gate(workspace: Path) -> None:
    ran(workspace, "run", ".", "-j", "3", "--output-dir", "jobs")
    assert gates(workspace / "jobs") == gates(workspace / "whole")


def test_the_number_of_shards_changes_no_gate(workspace: Path) -> None:
    for index in (1, 2, 3):
        part = f"shards/{index}"
        ran(workspace, "run", "slip.sim.yml", "--shard", f"{index}/3", "--output-dir", part)
        assert gates(workspace / part) == []
    ran(workspace, "merge", "shards", "--output-dir", "merged")
    assert gates(workspace / "merged") == gates(workspace / "whole")[1:]


def test_runs_that_are_selected_by_number_are_a_part(workspace: Path) -> None:
    """As `sim-action matrix` deals them to the shards of a workflow."""
    dealt = json.loads(sim_action(workspace, "matrix", "slip.sim.yml", "--shards", "2").stdout)["include"]
    for shard in dealt:
        part = f"dealt/{shard['index']}"
        ran(workspace, "run", shard["scenario"], "--output-dir", part)
        assert gates(workspace / part) == []
    ran(workspace, "merge", "dealt", "--scenarios", "slip.sim.yml", "--output-dir", "dealt/whole")
    assert gates(workspace / "dealt/whole") == gates(workspace / "whole")[1:]


def test_a_run_that_fails_ends_no_others_with_fail_fast_and_resumed_runs_give_the_same_gate(workspace: Path) -> None:
    ran(workspace, "run", "slip.sim.yml", "--fail-fast", "-j", "1", "--output-dir", "fast")
    assert gates(workspace / "fast") == gates(workspace / "whole")[1:]
    assert "taken over" in ran(workspace, "run", "slip.sim.yml", "--output-dir", "fast", "--resume")
    assert gates(workspace / "fast") == gates(workspace / "whole")[1:]


def test_a_selected_run_counts_by_itself(workspace: Path) -> None:
    failed = next(outcome["name"] for outcome in outcomes(workspace / "whole") if outcome["status"] == "failed")
    printed = ran(workspace, "run", "slip.sim.yml", "--only", failed, "--output-dir", "one", code=1)
    assert "the gate of 'slip' is not judged: 1 run of 7 are selected" in printed
    assert statuses(workspace / "one") == ["failed"]


def test_a_gate_is_planned_without_a_run(workspace: Path) -> None:
    few = SCENARIO.replace("at_least: 50 %, confidence: 75 %}", "at_least: 90 %}").replace("slip", "few")
    (workspace / "few.yml").write_text(few)
    planned = sim_action(workspace, "run", "few.yml", "slip.sim.yml", "--plan-gate", "--output-dir", "whole")
    assert (planned.returncode, planned.stderr) == (0, "")
    assert "7 runs, too few" in planned.stdout
    assert "A robot that is 97 % good passes with P >= 0.8 at 76 runs." in planned.stdout
    assert " runs, about 1 s." in planned.stdout


def test_a_list_names_the_gates_beside_its_lines(workspace: Path) -> None:
    listed = sim_action(workspace, "run", "slip.sim.yml", "--list")
    assert [line.split("\t")[1] for line in listed.stdout.splitlines()] == ["slip.sim.yml:1"] * 7
    (line,) = listed.stderr.splitlines()
    assert line.startswith("sim-action: gate slip: at least 50 % pass with 75 % confidence; 50 % quantile of")
    assert line.endswith(", 7 runs")
