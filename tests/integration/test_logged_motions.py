"""A motion is the same in every form of a log, and a recording that is replayed is the same motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from sim_action.recording.export.csv_tum import CsvTable
from sim_action.recording.export.mcap_log import McapLog
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.trace import Trace
from tests.commands.logs import bags
from tests.commands.logs.bags import joint_state, joints, ros2_bag
from tests.integration.engines import on_every_engine
from tests.simulated import simulated
from tools.bench.robots import ROBOTS

pytestmark = pytest.mark.pybullet
WHEELS: Final = ("wheel_left_joint", "wheel_right_joint")
DURATION_S: Final = 4.0
WHEELBASE_M: Final = 0.325  # the distance of the axles of the racecar
TURNS: Final = ((24.0, 24.0), (12.0, 20.0), (-9.0, 15.0))
"""The angles in rad by which the wheels turn, from rest to rest."""


def state(turned: tuple[float, float], time: float) -> tuple[list[float], list[float]]:
    """Return positions and velocities of a motion with the least jerk."""
    s = min(max(time / DURATION_S, 0.0), 1.0)
    share, speed = s**3 * (10 + s * (6 * s - 15)), 30 * s**2 * (1 - s) ** 2 / DURATION_S
    return [share * turn for turn in turned], [speed * turn for turn in turned]


def run(folder: Path, engine: str, *commands: dict[str, Any], **keys: Any) -> SimulationRun:
    scenario = {
        "name": "it",
        "robot": {"model": "turtlebot3_burger"},
        "commands": list(commands),
        "expect": [{"upright": {"max_tilt": "20 deg"}}],
        "backend": engine,
        "time_limit": 5,
        **keys,
    }
    return simulated(folder, scenario, outside=True)


def as_joints(folder: Path, turned: tuple[float, float]) -> dict[str, Any]:
    position = dict(zip(WHEELS, turned, strict=True))
    return {"joints": [{"at": DURATION_S, "position": position}], "interpolation": "minimum_jerk"}


Form = Callable[[Path, tuple[float, float]], dict[str, Any]]


def write_csv(folder: Path, rows: Iterable[Iterable[float]], digits: int) -> dict[str, Any]:
    """Write rows of a time and the positions of both wheels; return the command that replays them."""
    lines = (",".join(f"{number:.{digits}f}" for number in row) for row in rows)
    header = ",".join(("time", *(f"position.{wheel}" for wheel in WHEELS)))
    (folder / "log.csv").write_text("\n".join([header, *lines, ""]))
    return {"replay": "log.csv"}


def times_at(rate: int) -> list[float]:
    return [n / rate for n in range(round(DURATION_S * rate) + 1)]


def as_csv(rate: int, digits: int) -> Form:
    def written(folder: Path, turned: tuple[float, float]) -> dict[str, Any]:
        return write_csv(folder, ([time, *state(turned, time)[0]] for time in times_at(rate)), digits)

    return written


def as_joint_states(rate: int) -> Form:
    def written(folder: Path, turned: tuple[float, float]) -> dict[str, Any]:
        def message(store: Typestore, time: float) -> Any:
            return joint_state(store, list(WHEELS), *state(turned, time))

        entries = joints(*((time, lambda store, at=time: message(store, at)) for time in times_at(rate)))
        ros2_bag(folder / "log", entries, StoragePlugin.MCAP)
        return {"replay": "log", "topic": "/joint_states"}

    return written


def as_trajectory(folder: Path, turned: tuple[float, float]) -> dict[str, Any]:
    type_name = "trajectory_msgs/msg/JointTrajectory"

    def message(store: Typestore) -> Any:
        point, duration = store.types[f"{type_name}Point"], store.types["builtin_interfaces/msg/Duration"]
        none = np.array([])
        points = [
            point(*map(np.array, state(turned, time)), none, none, duration(int(time), round(time % 1 * 1e9)))
            for time in times_at(4)[1:]
        ]
        return store.types[type_name](bags.header(store), list(WHEELS), points)

    ros2_bag(folder / "log", [(0.0, "/trajectory", type_name, message)])
    return {"replay": "log", "topic": "/trajectory"}


FORMS: Final[dict[str, Form]] = {
    **{f"csv {rate} Hz {digits}": as_csv(rate, digits) for rate, digits in ((10, 9), (30, 3), (240, 5))},
    "joint states 15 Hz": as_joint_states(15),
    "joint states 100 Hz": as_joint_states(100),
    "trajectory": as_trajectory,
}


def end(trace: Trace) -> tuple[float, float, float]:
    """Return x and y in m, and the yaw in rad, at the end of a run."""
    x, y, _ = trace.base_position_xyz[-1]
    *_, qz, qw = trace.base_orientation_xyzw[-1]
    return float(x), float(y), 2 * math.atan2(qz, qw)


@on_every_engine
@pytest.mark.parametrize("turned", [TURNS[0], *(pytest.param(turned, marks=pytest.mark.soak) for turned in TURNS[1:])])
def test_a_motion_ends_at_the_same_place_in_every_form(
    engine: str, turned: tuple[float, float], tmp_path: Path
) -> None:
    x, y, yaw = end(run(tmp_path, engine, as_joints(tmp_path, turned)).trace)
    for name, form in FORMS.items():
        folder = tmp_path / name
        folder.mkdir()
        there = end(run(folder, engine, form(folder, turned)).trace)
        assert math.dist(there[:2], (x, y)) < 2e-3, name
        assert abs(math.remainder(there[2] - yaw, 2 * math.pi)) < math.radians(0.5), name


@on_every_engine
@pytest.mark.parametrize(("rate", "accurate"), [(240, False), (100, False), (100, True)])
def test_jitter_of_a_recording_changes_no_motion(engine: str, rate: int, accurate: bool, tmp_path: Path) -> None:
    """Also where the times are as accurate as the positions, but irregular: then they are kept."""
    random, turned = np.random.default_rng(rate), TURNS[1]
    ends = []
    for jitter in (0.0, 1e-3):
        times = times_at(rate)
        stamps = (times + random.uniform(-jitter, jitter, len(times))).tolist()
        states = (state(turned, stamp if accurate else time)[0] for time, stamp in zip(times, stamps, strict=True))
        rows = ((stamp - stamps[0], *positions) for stamp, positions in zip(stamps, states, strict=True))
        ends.append(end(run(tmp_path, engine, write_csv(tmp_path, rows, 6)).trace))
    assert math.dist(*(there[:2] for there in ends)) < 2e-3
    assert abs(ends[1][2] - ends[0][2]) < math.radians(0.5)


@on_every_engine
def test_pulses_turn_by_the_same_angle_at_every_number_of_digits_and_with_jitter(engine: str, tmp_path: Path) -> None:
    jitter = np.random.default_rng(1).uniform(-1e-3, 1e-3, 90)
    yaws = []
    for digits, noise, keys in ((10, 0.0, {}), (6, 0.0, {"rate": "30 Hz"}), (3, 0.0, {}), (6, 1.0, {"rate": "30 Hz"})):
        times = [abs(n / 30 + noise * jitter[n]) for n in range(90)]
        rows = "".join(f"{time:.{digits}f},0,{float(n % 3 == 1)}\n" for n, time in enumerate(times))
        (tmp_path / "log.csv").write_text(f"time,linear,angular\n{rows}")
        yaws.append(end(run(tmp_path, engine, {"replay": "log.csv", **keys}).trace)[2])
    assert yaws == pytest.approx([yaws[0]] * len(yaws), abs=math.radians(0.5))
    assert yaws[0] > math.radians(10)


@on_every_engine
def test_a_recording_that_is_replayed_is_the_same_motion(engine: str, tmp_path: Path) -> None:
    twists = [{"linear": 0.2, "for": "3 s"}, {"linear": 0.15, "angular": 0.6, "for": "3 s"}, {"angular": -0.4}]
    keys = {"time_limit": 10, "trace": {"rate": 30}}
    first = run(tmp_path, engine, {"twist": twists}, **keys)
    loaded = load_scenario(tmp_path / "s.sim.yml")
    recorder = RunRecorder(loaded.scenario, recorded=True)
    scene = build_scene(loaded)
    simulate(loaded.scenario, scene, lambda _: None, recorder)
    for name, export in (("log.mcap", McapLog), ("log.csv", CsvTable)):
        with (tmp_path / name).open("wb") as file:
            export.write(RecordedRun(scene, first.trace, twists=recorder.twists()), file)
    logged = ({"topic": "/cmd_vel"}, {"topic": "/joint_states"}, {"replay": "log.csv"})
    for source in ({"replay": "log.mcap", **keys_of_log} for keys_of_log in logged):
        again = run(tmp_path, engine, source, **keys).trace
        differences = again.base_position_xyz - first.trace.base_position_xyz
        assert np.linalg.norm(differences, axis=1).max() < 1e-3, source


@on_every_engine
def test_a_car_turns_with_the_steering_angle_of_its_log(engine: str, tmp_path: Path) -> None:
    """The oracle is the bicycle: the yaw rate is the speed times the tangent of the angle, by the wheelbase."""
    type_name = "ackermann_msgs/msg/AckermannDriveStamped"
    names = ("steering_angle", "steering_angle_velocity", "speed", "acceleration", "jerk")
    car = "\n".join(f"float32 {name}" for name in names)
    store = get_typestore(Stores.ROS2_HUMBLE)
    head = f"std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n{'=' * 80}"
    text = f"{head}\nMSG: ackermann_msgs/AckermannDrive\n{car}"
    store.register(get_types_from_msg(text, type_name))
    drive = store.types["ackermann_msgs/msg/AckermannDrive"](0.2, 0.0, 0.5, 0.0, 0.0)
    message = store.types[type_name](bags.header(store), drive)
    with Writer(tmp_path / "log", version=9) as writer:
        connection = writer.add_connection("/drive", type_name, typestore=store)
        for n in range(80):
            writer.write(connection, bags.START + n * 50_000_000, store.serialize_cdr(message, type_name))
    known = next(known for known in ROBOTS if known.name == "racecar")
    keys = {"robot": {"model": known.path, **known.keys}, "time_limit": 4, "trace": {"rate": 60}}
    trace = run(tmp_path, engine, {"replay": "log", "topic": "/drive"}, **keys).trace
    turned = np.unwrap([2 * math.atan2(qz, qw) for *_, qz, qw in trace.base_orientation_xyzw])
    expected = 0.5 * math.tan(0.2) / WHEELBASE_M
    assert (turned[-1] - turned[120]) / (trace.time[-1] - trace.time[120]) == pytest.approx(expected, rel=0.05)
