"""The record of a node's episodes, and a replay that cannot be written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from sim_action.assertions.upright import Upright
from sim_action.ros.ros1.launch_request import REPLAY_FILE, TRACE_FILE
from sim_action.ros.ros1.node.episode_record import EpisodeRecord
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.observation import JointState
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
