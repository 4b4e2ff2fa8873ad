"""`run --record`: what runs on both engines leave for other tools, among things that move."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from PIL import Image

from sim_action.cli.main import call
from sim_action.core.errors import ExitCode
from sim_action.recording.export import EXPORTS
from sim_action.recording.export.csv_tum import CsvTable
from sim_action.recording.replay.replay_data import read_replay
from sim_action.state.trace_storage import load_trace
from tests.recording.export.logs import read_file

SCENARIO = """\
name: drives at a wall
robot: {model: turtlebot3_burger}
world:
  objects:
    - {name: wall, box: [0.1, 2.0, 0.5], pose: {x: 0.6}}
    - {name: ball, sphere: {radius: 10 cm}, mass: 100 g, pose: {x: 1.5, y: 1.0, z: 1.0}}
    - {name: cart, box: [0.2, 0.2, 0.2], path: [{at: 0 s, y: 2}, {at: 1 s, y: 3}]}
sensors:
  - {lidar: {rays: 8, range: 3.5 m}, link: base_scan, rate: 5 Hz, trace: true}
  - {imu: {}, trace: true}
commands: {rate: 10 Hz, twist: [{linear: 1.0, for: 1 s}, {linear: 0.5}]}
expect: [{travel: {at_least: 0.2 m}}]
duration: 2 s
time_limit: 3 s
"""
FAILING = """\
name: breaks off
robot: {model: turtlebot3_burger}
commands: [{script: breaks.py, rate: 10 Hz}]
expect: [{travel: {at_least: 1 m}}]
time_limit: 3 s
"""
SCRIPT = """\
from sim_action import Twist

def control(observation):
    if observation.time > 1:
        raise ValueError("enough")
    return Twist.planar(0.5)
"""


def outcome() -> dict[str, Any]:
    (found,) = json.loads(Path("sim-results/results.json").read_text())["outcomes"]
    return dict(found)


def last_moment(replay: str) -> float:
    frames = read_replay(Path("sim-results") / replay).frames
    return float(frames.time.decoded(frames.count)[-1])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    return tmp_path


@pytest.mark.parametrize("engine", [pytest.param("pybullet", marks=pytest.mark.pybullet), "mujoco"])
def test_all_formats_tell_of_the_same_run(engine: str, folder: Path) -> None:
    (folder / "a.sim.yml").write_text(SCENARIO)
    formats = ["--record=mcap,csv", "--record", "tum", "--record=gif", "--record=mp4"]
    assert call(["run", "--quiet", "--backend", engine, *formats, "a.sim.yml"]) == ExitCode.PASSED
    stored = outcome()
    assert stored["recordings"] == [
        f"recordings/drives-at-a-wall.{name}" for name in ("mcap", "csv", "tum", "gif", "mp4")
    ]
    files = {name: folder / f"sim-results/recordings/drives-at-a-wall.{name}" for name in EXPORTS}
    trace = load_trace(folder / "sim-results" / stored["trace"])
    assert not trace.contacts, "nobody asked for them"
    assert stored["replay"] == "replays/drives-at-a-wall.json.gz"
    assert read_replay(folder / "sim-results" / stored["replay"]).scene.robot == "turtlebot3_burger"
    assert last_moment(stored["replay"]) == stored["sim_time"]
    way = np.loadtxt(files["tum"])
    assert len(way) == 61
    assert way[-1, :4].tolist() == pytest.approx([2.0, *trace.base_position_xyz[-1]], abs=1e-6)
    table = np.genfromtxt(files["csv"], delimiter=",", names=True, deletechars="", replace_space=" ")
    np.testing.assert_allclose(table["x [m]"], way[:, 1], atol=1e-6)
    assert table["z of ball [m]"][0] > 0.9
    assert table["z of ball [m]"][-1] == pytest.approx(0.1, abs=0.02)
    assert table["y of cart [m]"][-1] == pytest.approx(3.0, abs=0.01)
    log = read_file(files["mcap"])
    odometry = [told.message.pose.pose.position.x for told in log["/odom"]]
    np.testing.assert_allclose(odometry, way[:, 1], atol=1e-9)
    assert [told.message.linear.x for told in log["/cmd_vel"]] == [1.0] * 10 + [0.5] * 10
    assert len(log["/scan"]) == 10
    assert len(log["/scan"][0].message.ranges) == 8
    assert min(log["/scan"][-1].message.ranges) < 0.3
    touched = {marker.ns for told in log["/contacts"] for marker in told.message.markers}
    assert any(name.endswith(" / wall") for name in touched)
    moved = {transform.child_frame_id for transform in log["/tf"][0].message.transforms}
    assert {"base_footprint", "ball", "cart", "wheel_left_link"} <= moved
    assert "wall" in {transform.child_frame_id for transform in log["/tf_static"][0].message.transforms}
    with Image.open(files["gif"]) as image:
        assert getattr(image, "n_frames", 1) == 21
    container: Any = av.open(files["mp4"])
    with container:
        assert sum(1 for _ in container.decode(video=0)) == 41


WRENCHES = """\
name: pushes
robot: {model: turtlebot3_burger, pose: {yaw: 90 deg}}
commands:
  - wrench: {link: base_scan, force: [0, 0.1 N, 0], point: [0, 0.1, 0], at: 0.1 s, for: 0.2 s}
  - wrench: {link: base_scan, torque: [0, 0, 0.5 N m], frame: base_scan, at: 0.2 s, for: 0.2 s}
  - wrench: {force: [0, 0, 1 N], frame: base}
expect: [upright]
duration: 0.5 s
time_limit: 1 s
"""


def test_wrenches_are_recorded_in_the_frame_of_their_link(folder: Path) -> None:
    (folder / "a.sim.yml").write_text(WRENCHES)
    assert call(["run", "--quiet", "--no-report", "--record", "mcap", "a.sim.yml"]) == ExitCode.PASSED
    assert outcome()["replay"] is None
    assert not (folder / "sim-results/replays").exists()
    log = read_file(folder / "sim-results/recordings/pushes.mcap")
    told = [(each.time, each.message) for each in log["/wrench/base_scan"]]
    assert {message.header.frame_id for _, message in told} == {"base_scan"}
    found = {time / 1e9: message.wrench for time, message in told}
    # The y axis of the world is the x axis of the robot, to within the turn that the wrenches give it.
    expected = {0.1: (0.1, -0.01), 0.2: (0.1, 0.49), 0.3: (0.0, 0.5), 0.4: (0.0, 0.0)}
    # Between them are the moments at which the link has turned.
    assert [min(found), max(found)] == pytest.approx([0.1, 0.4])
    for at, (ahead, turning) in expected.items():
        wrench = next(wrench for moment, wrench in found.items() if moment == pytest.approx(at))
        assert (wrench.force.x, wrench.torque.z) == pytest.approx((ahead, turning), abs=2e-3)
    assert [each.message.wrench.force.z for each in log["/wrench/base_footprint"]][-1] == 1.0


def test_a_run_without_a_verdict_leaves_what_there_is_of_it_and_nothing_of_an_earlier_run(folder: Path) -> None:
    (folder / "a.sim.yml").write_text(FAILING)
    (folder / "breaks.py").write_text(SCRIPT)
    assert call(["run", "--quiet", "--record", "csv,mcap", "a.sim.yml"]) == ExitCode.FAILED
    stored = outcome()
    assert (stored["status"], stored["trace"]) == ("error", "traces/breaks-off.npz")
    assert stored["recordings"] == ["recordings/breaks-off.csv", "recordings/breaks-off.mcap"]
    assert last_moment(stored["replay"]) == pytest.approx(1.1, abs=0.1)
    log = read_file(folder / "sim-results/recordings/breaks-off.mcap")
    assert log["/clock"][-1].time == pytest.approx(1.1e9, abs=0.05e9)
    assert len(log["/cmd_vel"]) == 11
    (folder / "breaks.py").write_text("import os\n\ndef control(observation):\n    os._exit(7)\n")
    assert call(["run", "--quiet", "a.sim.yml"]) == ExitCode.FAILED
    assert (outcome()["trace"], outcome()["replay"]) == (None, None)


def _forever(_run: object, _file: object) -> None:
    time.sleep(3600)


@pytest.mark.skipif(sys.platform != "linux", reason="what is put in place of a format is there in copies of us alone")
def test_a_verdict_stands_though_to_record_it_takes_too_long(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CsvTable, "write", _forever)
    (folder / "a.sim.yml").write_text(f"{WRENCHES}wall_limit: 20 s\n")
    assert call(["run", "--quiet", "--record", "tum,csv,mp4", "a.sim.yml"]) == ExitCode.PASSED
    stored = outcome()
    assert stored["status"] == "passed"
    assert stored["recordings"] == ["recordings/pushes.tum"]
    assert stored["notes"][-1] == "the recordings were cut off: wall limit"
