"""When sensors are read, and who gets to know; on real engines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.engines import installed
from sim_action.scenario.loading import build_scene
from sim_action.sensors import ReadingLog
from sim_action.simulation.loop import SimulationRun
from sim_action.simulation.sensors import Sensing
from sim_action.state.trace import Trace
from tests.integration.engines import running
from tests.scenarios import LEAST, load, told
from tests.simulated import simulated

SENSORS = "sensors:\n  - contact\n  - {contact: {}, name: left, link: wheel_left_link, rate: 16 Hz, trace: true}\n"
SCRIPT = """\
from sim_action import Twist

def control(observation):
    read = observation.sensors
    assert set(read) == {"contact", "left"}
    assert read["contact"].time == round(observation.time * 10 + 1e-6) / 10
    assert observation.time - read["left"].time < 1 / 16
    assert read["left"].touching and read["left"].bodies == ("ground",)
    return Twist.planar(0.2)
"""
LISTENING = LEAST.replace("  twist:\n    - {linear: 1.0}\n", "  script: ctl.py\n").replace("1.5 m", "10 cm")


def run(folder: Path, text: str, engine: str) -> SimulationRun:
    (folder / "ctl.py").write_text(SCRIPT)
    return simulated(folder, f"{text}backend: {engine}\n")


@pytest.mark.parametrize("engine", installed())
def test_controllers_get_the_latest_reading_and_the_trace_what_it_wants(engine: str, tmp_path: Path) -> None:
    trace = run(tmp_path, LISTENING + SENSORS, engine).trace
    (record,) = trace.sensors.values()
    assert record.kind == "contact"
    assert record.time.tolist() == [tick / 16 for tick in range(len(record))]
    assert trace.time[-1] - 1 / 16 <= record.time[-1] <= trace.time[-1]
    assert record.columns["touching"].all()
    assert (record.columns["force"] > 0).all()


@pytest.mark.parametrize("engine", installed())
def test_to_sense_changes_nothing(engine: str, tmp_path: Path) -> None:
    assert run(tmp_path, LEAST + SENSORS, engine).digest == run(tmp_path, LEAST, engine).digest


@pytest.mark.parametrize("commands", ["", "commands: {twist: [{linear: 0.2}]}\n"])
def test_odometry_tells_which_wheels_it_reads_whether_anybody_drives_them(commands: str, tmp_path: Path) -> None:
    text = LEAST[: LEAST.index("commands")] + commands + "expect: [upright]\ntime_limit: 0.1 s\n"
    notes = run(tmp_path, text + "sensors: [{odometry: {}, trace: true}]\n", installed()[0]).notes
    (about,) = (note for note in notes if note.startswith("recognised: "))
    assert "left wheel_left_joint; right wheel_right_joint; wheel radius 0.033 m" in about


def test_a_lidar_that_nothing_places_above_the_ground_has_a_note(tmp_path: Path) -> None:
    sensors = "[{lidar: {}}, {name: up, lidar: {}, pose: {z: 10 cm}}, {name: on, lidar: {}, link: base_scan}]"
    notes = run(tmp_path, f"{LEAST}sensors: {sensors}\n", installed()[0]).notes
    note = "sensor 'lidar' has no link, so it is at the origin of 'base_footprint', as low as the robot's lowest point"
    assert [each for each in notes if "has no link" in each] == [f"{note}; state its link or pose"]


@pytest.mark.parametrize(
    ("sensors", "problem"),
    [
        ("[{contact: {}, rate: 7000}]", "11:25: sensors.0.rate: 7000 Hz does not divide physics.rate, 240 Hz; near"),
        ("[contact, contact]", "11:20: sensors.1: a second sensor named 'contact'; give each a 'name' of its own"),
        ("[{contact: {}, link: base_lnk}]", "11:25: sensors.0.link: the robot has no link 'base_lnk'; did you mean"),
        ("[{contact: {range: 1}}]", "11:22: sensors.0.contact.range: unknown key"),
        ("[contct]", "11:11: sensors.0.contct: unknown sensor 'contct'; did you mean 'contact'?"),
        ("[{contact: {}, pose: {u: 1}}]", "11:32: sensors.0.pose.u: unknown key"),
        ("contact", "11:1: sensors: expected a list"),
        (
            "[{contact: {}, latency: 31 s}]",
            "11:25: sensors.0.latency: 31 s is not shorter than time_limit (30 s), so no reading after",
        ),
        (
            "[{contact: {}, jitter: 30 s}]",
            "11:25: sensors.0.jitter: the delay can be 30 s, which is not shorter than t",
        ),
        ("[{contact: {}, dropouts: 1}]", "11:25: sensors.0.dropouts: must be less than 1, found 1"),
        ("[{contact: {latency: 1}}]", "11:22: sensors.0.contact.latency: unknown key"),
    ],
)
def test_what_cannot_be_is_told_on_its_line(sensors: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, f"{LEAST}sensors: {sensors}\n")
    assert found.startswith(problem)


@pytest.mark.parametrize("engine", installed())
def test_which_readings_are_stored_seen_and_replayed(engine: str, tmp_path: Path) -> None:
    loaded = load(tmp_path, f"{LEAST}{SENSORS}backend: {engine}\n")
    scene = build_scene(loaded)
    more = replace(loaded.scenario.sensors[0], name="of its own", rate=80.0)
    logs: dict[str, ReadingLog] = {}
    with running(engine, scene) as backend:
        # A sensor that only an assertion reads is not stored.
        sensing = Sensing(loaded.scenario, scene, backend, heard=False, judged={"contact"})
        sensing.read(0)
        told = Trace.of_observation(backend.observe(0, contacts=False))
        told = replace(told, sensors=sensing.collect())
        assert set(told.sensors) == {"contact", "left"}
        assert set(sensing.stored(told).sensors) == {"left"}
        # A controller may look at more than the scenario has; it is the controller's alone.
        sensing = Sensing(loaded.scenario, scene, backend, heard=True, more=[more])
        assert sensing.next_tick(0, 100) == 3
        sensing.read(0)
        assert set(sensing.look(0).sensors) == {"contact", "left", "of its own"}
        assert set(sensing.collect()) == {"left"}
        # A replay has the readings of all open sensors; nothing reads the other one.
        Sensing(loaded.scenario, scene, backend, heard=False, logs=logs).read(0)
    assert list(logs) == ["left"]
    assert [reading.time for reading in logs["left"].readings] == [0.0]


def test_a_delay_that_no_controller_meets_has_a_note(tmp_path: Path) -> None:
    late = SENSORS.replace("rate: 16 Hz", "rate: 16 Hz, latency: 1 ms")
    notes = [run(tmp_path, text + late, installed()[0]).notes for text in (LEAST, LISTENING.replace("10 cm", "1 cm"))]
    said = "sensor 'left' has a delay, but no controller reads sensors"
    assert [said in each for each in notes] == [True, False]
