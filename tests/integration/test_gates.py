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


def gates(folder: Path) -> list[str]:
    """The outcomes of the gates, as they are written."""
    found: list[dict[str, Any]] = json.loads((folder / "results.json").read_text())["outcomes"]
    return [json.dumps(outcome) for outcome in found if outcome["statistics"] is not None]


def statuses(folder: Path) -> list[str]:
    found: list[dict[str, Any]] = json.loads((folder / "results.json").read_text())["outcomes"]
    return [outcome["status"] for outcome in found]


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where both scenarios ran in one call, with one job."""
    folder = tmp_path_factory.mktemp("gates")
    (folder / "slip.sim.yml").write_text(SCENARIO)
    (folder / "early.sim.yml").write_text(EARLY)
    ran = sim_action(folder, "run", ".", "-j", "1", "--output-dir", "whole")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return folder


def test_a_gate_passes_although_a_run_fails(workspace: Path) -> None:
    early, slip = (json.loads(text) for text in gates(workspace / "whole"))
    assert (slip["status"], slip["statistics"]["runs"]) == ("passed", 7)
    assert slip["statistics"]["failed"] > 0
    assert (early["status"], early["statistics"]["decision"]) == ("passed", "accepted")
    assert statuses(workspace / "whole").count("skipped") > 0


def test_the_number_of_jobs_changes_no_gate(workspace: Path) -> None:
    sim_action(workspace, "run", ".", "-j", "3", "--output-dir", "jobs")
    assert gates(workspace / "jobs") == gates(workspace / "whole")


def test_the_number_of_shards_changes_no_gate(workspace: Path) -> None:
    for index in (1, 2, 3):
        part = f"shards/{index}"
        ran = sim_action(workspace, "run", "slip.sim.yml", "--shard", f"{index}/3", "--output-dir", part)
        assert ran.returncode == 0, ran.stdout
        assert gates(workspace / part) == []
    merged = sim_action(workspace, "merge", "shards", "--output-dir", "merged")
    assert merged.returncode == 0, merged.stdout
    assert gates(workspace / "merged") == gates(workspace / "whole")[1:]


def test_runs_that_are_selected_by_number_are_a_part(workspace: Path) -> None:
    """As `sim-action matrix` deals them to the shards of a workflow."""
    dealt = json.loads(sim_action(workspace, "matrix", "slip.sim.yml", "--shards", "2").stdout)["include"]
    for each in dealt:
        ran = sim_action(workspace, "run", each["scenario"], "--output-dir", f"dealt/{each['index']}")
        assert ran.returncode == 0, ran.stdout
        assert gates(workspace / f"dealt/{each['index']}") == []
    merged = sim_action(workspace, "merge", "dealt", "--scenarios", "slip.sim.yml", "--output-dir", "dealt/whole")
    assert merged.returncode == 0, merged.stdout
    assert gates(workspace / "dealt/whole") == gates(workspace / "whole")[1:]


def test_a_run_that_fails_ends_no_others_with_fail_fast(workspace: Path) -> None:
    ran = sim_action(workspace, "run", "slip.sim.yml", "--fail-fast", "-j", "1", "--output-dir", "fast")
    assert ran.returncode == 0, ran.stdout
    assert gates(workspace / "fast") == gates(workspace / "whole")[1:]


def test_resumed_runs_give_the_same_gate(workspace: Path) -> None:
    sim_action(workspace, "run", "slip.sim.yml", "--output-dir", "resumed")
    before = gates(workspace / "resumed")
    resumed = sim_action(workspace, "run", "slip.sim.yml", "--output-dir", "resumed", "--resume")
    assert resumed.returncode == 0
    assert "taken over" in resumed.stdout + resumed.stderr
    assert gates(workspace / "resumed") == before


def test_a_selected_run_counts_by_itself(workspace: Path) -> None:
    found = json.loads((workspace / "whole/results.json").read_text())["outcomes"]
    failed = next(outcome["name"] for outcome in found if outcome["status"] == "failed")
    ran = sim_action(workspace, "run", "slip.sim.yml", "--only", failed, "--output-dir", "one")
    assert ran.returncode == 1
    assert "the gate of 'slip' is not judged: 1 run of 7 are selected" in ran.stdout + ran.stderr
    assert statuses(workspace / "one") == ["failed"]


def test_a_gate_is_planned_without_a_run(workspace: Path) -> None:
    few = SCENARIO.replace("at_least: 50 %, confidence: 75 %}", "at_least: 90 %}").replace("slip", "few")
    (workspace / "few.yml").write_text(few)
    ran = sim_action(workspace, "run", "few.yml", "slip.sim.yml", "--plan-gate", "--output-dir", "whole")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "7 runs, too few" in ran.stdout
    assert "A robot that is 97 % good passes with P >= 0.8 at 76 runs." in ran.stdout
    assert " runs, about 1 s." in ran.stdout


def test_a_list_names_the_gates_beside_its_lines(workspace: Path) -> None:
    ran = sim_action(workspace, "run", "slip.sim.yml", "--list")
    assert len(ran.stdout.splitlines()) == 7
    assert all(line.split("\t")[1] == "slip.sim.yml:1" for line in ran.stdout.splitlines())
    (line,) = ran.stderr.splitlines()
    assert line.startswith("sim-action: gate slip: at least 50 % pass with 75 % confidence; 50 % quantile of")
    assert line.endswith(", 7 runs")
