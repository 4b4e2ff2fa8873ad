"""The record of a node's episodes, and a replay that cannot be written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from sim_action.assertions.upright import Upright
from sim_action.ros.ros1.launch_request import REPLAY_FILE, TRACE_FILE
from sim_action.ros.ros1.node.episode_record import EpisodeRecord
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.observation import JointState
from sim_action.world.claims import ClaimFinding
from tests import traces


def test_a_replay_that_cannot_be_written_is_a_note_beside_the_trace(tmp_path: Path) -> None:
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())), filmed=True)
    footage.begin(replace(traces.START, joints=dict.fromkeys(traces.WHEELS, JointState(0, 0, 0))))
    footage.add(traces.trace([0.1, 0.2]), judged={}, is_last=True)
    episode: Any = SimpleNamespace(scene=traces.scene(), footage=footage)
    record = EpisodeRecord()
    record.begin(episode)
    (tmp_path / REPLAY_FILE).mkdir()
    record.store(tmp_path)
    assert (tmp_path / TRACE_FILE).is_file()
    (note,) = record.notes
    assert note.startswith("no replay was written: ")


STILL, SILENT = "never-moved", "silent-controller"


@pytest.mark.parametrize(
    ("runs", "first_command", "found"),
    [
        ([(1.0, [STILL])], 0.5, [STILL]),
        ([(1.0, [SILENT])], 0.5, [SILENT]),
        # No node is asked to command anything.
        ([(1.0, [SILENT])], None, []),
        # It moved before or after the world changed.
        ([(1.0, [STILL]), (1.0, [])], 0.5, []),
        ([(1.0, []), (1.0, [STILL])], 0.5, []),
        ([(1.0, [STILL]), (1.0, [SILENT, STILL])], 0.5, [STILL]),
        # It ended before its first step.
        ([(0.0, []), (1.0, [STILL])], 0.5, [STILL]),
        # Rules about keys of a scenario, which a launch has not.
        ([(1.0, ["event-never-began", "drive-never-commanded"])], 0.5, []),
        ([], 0.5, []),
    ],
)
def test_findings_count_if_all_runs_have_them(
    runs: list[tuple[float, list[str]]], first_command: float | None, found: list[str]
) -> None:
    record = EpisodeRecord()
    for seconds, rules in runs:
        episode: Any = SimpleNamespace(bridge=SimpleNamespace(first_command=first_command), footage=footage())
        findings = tuple(ClaimFinding(rule, ("commands",), f"about {rule}") for rule in rules)
        run: Any = SimpleNamespace(
            engine="e", notes=(), model_notes=(), digest="d", sim_time=seconds, findings=findings
        )
        record.end(episode, run)
    assert list(record.claims) == found
    assert record.claims.get(STILL, "about never-moved") == "about never-moved"
    assert record.claims.get(SILENT, "the nodes sent").startswith("the nodes sent")


def footage() -> Any:
    return SimpleNamespace(start=None)
