"""Replays as a run leaves them: beside its trace, named by its outcome, and only if they are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sim_action.recording.replay.replay_data import read_replay
from tests.integration.conftest import outcomes, sim_action

DRIVES = """\
name: burger drives on
robot: {model: turtlebot3_burger}
world: {objects: [{name: wall, box: [0.1, 1, 1], pose: {x: 2}}]}
commands: {rate: 10 Hz, twist: [{linear: 0.5}]}
expect: [{travel: {at_least: 30 cm}}]
time_limit: 5 s
"""
SCRIPT = """\
def control(observation):
    if observation.time > 0.4:
        raise ValueError("enough")
    return Twist.planar(0.5)
"""


def outcome(folder: Path) -> dict[str, Any]:
    found: list[dict[str, Any]] = outcomes(folder)
    assert len(found) == 1
    return found[0]


def test_a_run_leaves_a_replay_that_its_outcome_names(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(DRIVES)
    assert sim_action(tmp_path, "run", "a.sim.yml").returncode == 0
    assert outcome(tmp_path)["replay"] == "replays/burger-drives-on.json.gz"
    replay = read_replay(tmp_path / "sim-results/replays/burger-drives-on.json.gz")
    assert replay.scene.robot == "turtlebot3_burger"
    assert replay.frames.time.decoded(replay.frames.count)[-1] == outcome(tmp_path)["sim_time"]


def test_without_a_report_there_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(DRIVES)
    assert sim_action(tmp_path, "run", "a.sim.yml", "--no-report").returncode == 0
    assert outcome(tmp_path)["replay"] is None
    assert not (tmp_path / "sim-results/replays").exists()


def test_what_a_failing_script_did_until_then_is_kept(tmp_path: Path) -> None:
    (tmp_path / "steer.py").write_text("from sim_action import Twist\n" + SCRIPT)
    (tmp_path / "a.sim.yml").write_text(DRIVES.replace("twist: [{linear: 0.5}]", "script: steer.py"))
    assert sim_action(tmp_path, "run", "a.sim.yml").returncode == 1
    made = outcome(tmp_path)
    assert made["status"] == "error"
    assert made["trace"] == "traces/burger-drives-on.npz"
    replay = read_replay(tmp_path / "sim-results" / made["replay"])
    assert 0.4 <= replay.frames.time.decoded(replay.frames.count)[-1] <= 0.6


def test_what_an_earlier_run_has_left_is_not_this_ones(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(DRIVES)
    sim_action(tmp_path, "run", "a.sim.yml")
    (tmp_path / "steer.py").write_text("import os\nos._exit(7)\n")
    (tmp_path / "a.sim.yml").write_text(DRIVES.replace("twist: [{linear: 0.5}]", "script: steer.py"))
    sim_action(tmp_path, "run", "a.sim.yml")
    assert (outcome(tmp_path)["trace"], outcome(tmp_path)["replay"]) == (None, None)
