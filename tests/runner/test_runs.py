"""The runs of a call: their files, and those that gates which stop early no longer need."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from unittest.mock import Mock

import pytest

from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import read_document
from sim_action.results.events import Finished
from sim_action.results.outcome import Status
from sim_action.runner.child_outcome import unjudged
from sim_action.runner.job import Job
from sim_action.runner.runs import EarlyStop
from sim_action.scenario.loading import checked
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Source
from sim_action.scenario.variations.expansion import expanded
from tests.scenarios import LEAST

GATE = "stop_early: {reject: 20 %, accept: 80 %, confidence: 90 %}"


def loaded(folder: Path, gate: str, runs: int = 12, file: str = "s.sim.yml") -> list[LoadedScenario]:
    text = f"{LEAST}variations: {{robot.pose.x: {{uniform: [0 m, 1 m]}}}}\ngate: {{{gate}, runs: {runs}}}\n"
    source = Source(folder / file, Workspace(folder, folder), read_document(file, text), "push")
    return [checked(each, Permissions()) for each in expanded(source, None)]


def end(stop: EarlyStop, runs: Sequence[LoadedScenario], place: int, status: Status) -> None:
    stop(Finished(place, unjudged(runs[place]).model_copy(update={"status": status})))


@pytest.mark.parametrize("status", ["passed", "failed"])
def test_runs_after_the_decision_are_needless(tmp_path: Path, status: Status) -> None:
    runs = loaded(tmp_path, GATE)
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(2):
        assert not stop.is_needless(11)
        end(stop, runs, place, status)
    assert all(stop.is_needless(place) for place in range(2, 12))


def test_a_run_that_is_still_missing_hides_later_ones(tmp_path: Path) -> None:
    runs = loaded(tmp_path, GATE)
    stop = EarlyStop(runs, range(len(runs)))
    for place in (1, 2, 3):
        end(stop, runs, place, "passed")
    assert not stop.is_needless(11)
    end(stop, runs, 0, "passed")
    assert stop.is_needless(11)


def test_runs_of_other_gates_and_of_none_are_needed(tmp_path: Path) -> None:
    runs = loaded(tmp_path, "passes: {at_least: 50 %}")
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(8):
        end(stop, runs, place, "passed")
    assert not any(stop.is_needless(place) for place in range(20))


def test_a_part_of_a_gate_is_not_decided(tmp_path: Path) -> None:
    runs = loaded(tmp_path, GATE)[::2]
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(6):
        end(stop, runs, place, "passed")
    assert not stop.is_needless(5)


def test_a_run_that_was_skipped_is_no_result(tmp_path: Path) -> None:
    runs = loaded(tmp_path, GATE)
    stop = EarlyStop(runs, range(len(runs)))
    end(stop, runs, 0, "skipped")
    for place in range(1, 6):
        end(stop, runs, place, "passed")
    assert not stop.is_needless(11)


def test_gates_of_one_name_in_two_files_are_two_gates(tmp_path: Path) -> None:
    runs = loaded(tmp_path, GATE, file="a.sim.yml") + loaded(tmp_path, GATE, file="b.sim.yml")
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(2):
        end(stop, runs, place, "passed")
    assert [stop.is_needless(place) for place in (11, 12, 23)] == [True, False, False]


@pytest.mark.parametrize(
    ("path", "name"), [("/out/traces/a.npz", "traces/a.npz"), ("/elsewhere/a.npz", "../elsewhere/a.npz")]
)
def test_a_file_is_named_from_the_folder_of_the_results(path: str, name: str) -> None:
    assert Job(Mock(), Path(path), Path("/out")).trace_name == name
