"""The source `replay`: what a scenario may say of a log, and what is told before and when it runs."""

from __future__ import annotations

import importlib.util
import math
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.commands import OpenLoop
from sim_action.commands.replay import ReplayCommands
from sim_action.core.errors import BadSource, RecordingError
from sim_action.core.geometry import Twist
from sim_action.core.workspace import Workspace
from sim_action.drives import recognise
from sim_action.scenario.loading import build_scene
from sim_action.simulation.controllers import Controls
from sim_action.state.command import Command, JointTargets
from sim_action.world.scene import Scene
from tests.commands.logs import bags
from tests.commands.logs.bags import drive, joint_state, joints, mcap_file, ros1_bag, ros2_bag
from tests.scenarios import LEAST, load, told
from tests.soak import examples
from tests.traces import scene

ROOT = Path(__file__).parents[2]
TWIST = "commands:\n  rate: 10 Hz\n  twist:\n    - {linear: 1.0}\n"
TWISTS = [(0.0, 0.2, 0.0), (0.5, 0.2, 0.5), (1.5, 0.0, 0.0)]
WHEELS_CSV = "time,velocity.wheel_left_joint,velocity.wheel_right_joint\n0,1,2\n1,3,4\n"


def spec(**data: Any) -> ReplayCommands:
    return ReplayCommands.model_validate(data)


def scene_in(folder: Path) -> Scene:
    found = scene()
    return Scene(found.robot, found.model, found.world, found.physics, Workspace(folder, folder))


def given_at(time: float, folder: Path, **data: Any) -> object:
    """Return the command that is in effect at a time in s."""
    source = spec(**data)
    controller = source.open(scene_in(folder))
    assert isinstance(controller, OpenLoop)
    rate = source.tick_rate(240.0)
    answers = [controller.command(n / rate) for n in range(1 + round(time * rate))]
    return next(answer for answer in reversed(answers) if answer is not None)


def scenario(**keys: object) -> str:
    return LEAST.replace(TWIST, "commands:\n" + "".join(f"  {key}: {value}\n" for key, value in keys.items()))


def told_at(folder: Path, text: str) -> tuple[str, str]:
    """Place and message of the one problem."""
    (found,) = told(folder, text)
    place, _, message = found.partition(": ")
    return place, message


def test_a_log_is_replayed_from_its_first_row(tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", [(100.0, 0.2, 0.0), (101.0, 0.3, 0.0)])
    assert given_at(0.0, tmp_path, replay="a.csv") == Twist.planar(0.2)
    assert given_at(1.0, tmp_path, replay="a.csv") == Twist.planar(0.3)
    assert given_at(0.0, tmp_path, replay="a.csv", start="1 s") == Twist.planar(0.3)
    assert given_at(1.5, tmp_path, replay="a.csv", timeout="0.4 s") == Twist()
    ros2_bag(tmp_path / "monday", [*drive(TWISTS), *drive([(2.0, 9.0, 9.0)], "/other")])
    assert given_at(0.5, tmp_path, replay="monday", topic="/cmd_vel") == Twist.planar(0.2, 0.5)
    assert given_at(0.0, tmp_path, replay="monday", topic="/other", type=bags.TWIST) == Twist.planar(9.0, 9.0)


def test_of_a_log_of_many_joints_those_that_are_named_move(tmp_path: Path) -> None:
    state = joints((0.0, lambda store: joint_state(store, ["wheel_left_joint", "strange"], velocity=[1.0, 2.0])))
    ros1_bag(tmp_path / "a.bag", state)
    log = {"replay": "a.bag", "topic": "/joint_states"}
    assert given_at(0.0, tmp_path, **log, only_joints=("wheel_left_joint",)) == JointTargets(
        velocity={"wheel_left_joint": 1.0}
    )
    with pytest.raises(RecordingError, match=r"^a\.bag: the model has no moving joint 'strange'.*in 'only_joints'"):
        given_at(0.0, tmp_path, **log)
    with pytest.raises(RecordingError, match=r"a\.bag: the log has no joint 'wheel_right_joint'; did you mean"):
        given_at(0.0, tmp_path, **log, only_joints=("wheel_right_joint",))


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("only_joints", ("wheel_left_joint",), "the log contains twists, not joints"),
        ("start", 2.0, "the log ends before that time, 1.5 s after its first command"),
        ("topic", "/odom", "the log has no topic '/odom'"),
        ("type", bags.JOINTS, "but the scenario requires sensor_msgs/msg/JointState"),
    ],
)
def test_what_a_log_does_not_hold_is_told_when_it_opens(key: str, value: object, message: str, tmp_path: Path) -> None:
    ros1_bag(tmp_path / "a.bag", drive(TWISTS))
    with pytest.raises(RecordingError) as raised:
        given_at(0.0, tmp_path, **{"replay": "a.bag", "topic": "/cmd_vel", key: value})
    assert str(raised.value).startswith("a.bag: ")
    assert message in str(raised.value)
    assert raised.value.key == key


def test_a_bag_leads_to_no_file_outside_of_the_workspace(tmp_path: Path) -> None:
    inside = tmp_path / "workspace"
    inside.mkdir()
    folder = ros2_bag(inside / "monday", drive(TWISTS))
    (folder / "monday.db3").rename(tmp_path / "elsewhere.db3")
    (folder / "monday.db3").symlink_to(tmp_path / "elsewhere.db3")
    with pytest.raises(RecordingError, match=r"monday: .*monday\.db3' is outside the workspace"):
        given_at(0.0, inside, replay="monday", topic="/cmd_vel")


def test_until_the_first_command_its_joints_are_held_where_they_begin(tmp_path: Path) -> None:
    (tmp_path / "wheels.csv").write_text("time,position.wheel_left_joint,velocity.wheel_right_joint\n0,1,2\n")
    bags.csv_file(tmp_path / "base.csv", TWISTS)
    state = joints((0.0, lambda store: joint_state(store, ["wheel_left_joint"], position=[1.0])))
    ros1_bag(tmp_path / "a.bag", state)
    assert held(tmp_path, replay="wheels.csv") == JointTargets(
        position={"wheel_left_joint": 0.0}, velocity={"wheel_right_joint": 0.0}
    )
    assert held(tmp_path, replay="a.bag", topic="/joint_states") == JointTargets(position={"wheel_left_joint": 0.0})
    assert held(tmp_path, replay="base.csv") == JointTargets()


def held(folder: Path, **data: Any) -> JointTargets:
    controller = spec(**data).open(scene_in(folder))
    assert isinstance(controller, OpenLoop)
    return controller.holding


def test_a_log_is_csv_if_the_scenario_calls_it_so(tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "data.txt", TWISTS)
    (tmp_path / "link.csv").symlink_to("data.txt")
    assert load(tmp_path, scenario(replay="link.csv")).unchecked == ()
    assert given_at(0.0, tmp_path, replay="link.csv") == Twist.planar(0.2)


CSV_PROBLEMS = [
    ({"replay": "b.csv"}, "8:3", "'b.csv' does not exist"),
    ({"replay": "bad.csv"}, "8:3", "bad.csv:3: column 'linear': expected a finite number, found 'fast'"),
    ({"replay": "a.csv", "topic": "/cmd_vel"}, "8:3", "a.csv:1: the file has no columns of topic '/cmd_vel'"),
    ({"replay": "a.csv", "type": bags.TWIST}, "9:3", "this is for logs of ROS, not for a CSV file; remove this key"),
    ({"replay": "a.csv", "start": "2 s"}, "9:3", "the log ends before that time, 1.5 s after its first row"),
    ({"replay": "a.csv", "only_joints": "[wheel_left_joint]"}, "9:3", "twists, not joints; remove this key"),
    ({"replay": "wheels.csv", "timeout": "1 s"}, "9:3", "this applies to twists only"),
    ({"replay": "wheels.csv", "only_joints": "[wheel_lift_joint]"}, "9:3", "the log has no joint 'wheel_lift_joint'"),
    ({"replay": "strange.csv"}, "8:3", "strange.csv: the model has no moving joint 'wheel_lift_joint'; did you mean"),
]


@pytest.mark.parametrize(("keys", "place", "message"), CSV_PROBLEMS)
def test_mistakes_in_csv_are_told_at_load(keys: dict[str, object], place: str, message: str, tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", TWISTS)
    (tmp_path / "bad.csv").write_text("time,linear\n0,1\n1,fast\n")
    (tmp_path / "wheels.csv").write_text(WHEELS_CSV)
    (tmp_path / "strange.csv").write_text("time,position.wheel_lift_joint\n0,1\n")
    problems = told(tmp_path, scenario(**keys).replace("commands:\n", "\n\n\ncommands:\n"))
    found = problems[0]
    assert found.startswith(f"{place}: commands.")
    assert message in found


ROS_PROBLEMS = [
    ({"replay": "a.bag"}, "needs a topic to replay, such as topic: /cmd_vel"),
    (
        {"replay": "notes.txt"},
        "is not a log that can be replayed (allowed: .csv, .bag, .bag.active, .db3, .mcap, .db3.zstd, .mcap.zstd",
    ),
    ({"replay": "folder", "topic": "/cmd_vel"}, "is a folder without metadata.yaml"),
    ({"replay": "a%2f.db3", "topic": "/cmd_vel"}, "rename it"),
    ({"replay": "a.bag", "topic": "/cmd_vel", "type": "geometry_msgs/Twist"}, "geometry_msgs/msg/Twist"),
    ({"replay": "a.bag", "topic": "/j", "type": bags.JOINTS, "timeout": 1}, "this applies to twists only"),
    ({"replay": "a.bag", "topic": "/cmd_vel", "type": bags.TWIST, "only_joints": "[a]"}, "twists, not joints"),
    ({"replay": "a.bag", "topic": "/j", "only_joints": "[wheel_lift_joint]"}, "the model has no moving joint"),
]


@pytest.mark.parametrize(("keys", "message"), ROS_PROBLEMS)
def test_what_is_told_of_a_log_without_reading_it(keys: dict[str, object], message: str, tmp_path: Path) -> None:
    for name in ("a.bag", "notes.txt", "a%2f.db3"):
        (tmp_path / name).write_bytes(b"not read")
    (tmp_path / "folder").mkdir()
    _, found = told_at(tmp_path, scenario(**keys))
    assert message in found


def test_without_rosbags_loading_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        "sim_action.commands.replay.find_spec", lambda name: None if name == "rosbags" else find_spec(name)
    )
    (tmp_path / "a.bag").write_bytes(b"not read")
    _, found = told_at(tmp_path, scenario(replay="a.bag", topic="/cmd_vel"))
    assert "pip install 'sim-action[rosbags]'" in found
    assert "extras: rosbags" in found


def test_of_csv_and_of_what_the_scenario_names_twists_and_joints_are_known(tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", TWISTS)
    (tmp_path / "wheels.csv").write_text(WHEELS_CSV)
    found = scene_in(tmp_path)
    assert spec(replay="a.csv").gives_twists(found)
    assert not spec(replay="wheels.csv").gives_twists(found)
    assert spec(replay="a.mcap", topic="/a", type=bags.STAMPED).gives_twists(found)
    assert not spec(replay="a.mcap", topic="/a").gives_twists(found)
    assert spec(replay="wheels.csv").joints(found) == {"wheel_left_joint", "wheel_right_joint"}
    assert spec(replay="wheels.csv", only_joints=("wheel_left_joint",)).joints(found) == {"wheel_left_joint"}
    assert spec(replay="a.bag", only_joints=("wheel_left_joint",)).joints(found) == {"wheel_left_joint"}
    assert spec(replay="a.bag").joints(found) == frozenset()
    assert spec(replay="nowhere.csv").joints(found) == frozenset()


def test_a_log_for_wheels_that_move_and_one_without_its_topic(tmp_path: Path) -> None:
    (tmp_path / "wheels.csv").write_text(WHEELS_CSV)
    text = LEAST.replace(TWIST, "commands:\n  - replay: wheels.csv\n  - twist: [{linear: 1.0}]\n")
    _, found = told_at(tmp_path, text)
    assert "joint 'wheel_left_joint' is moved by commands.0 already" in found
    mcap_file(tmp_path / "a.mcap", drive(TWISTS))
    text = LEAST.replace(TWIST, "commands:\n  - twist: [{linear: 1.0}]\n  - {replay: a.mcap, topic: /odom}\n")
    loaded = load(tmp_path, text)
    built = build_scene(loaded)
    drive_of = recognise(built.model)
    assert drive_of is not None
    with pytest.raises(BadSource, match="no topic '/odom'") as raised:
        Controls(loaded.scenario, built, drive_of.open(built.model, 240.0))
    assert (raised.value.index, raised.value.key) == (1, "topic")


@pytest.mark.parametrize(
    "data",
    [
        {"replay": ""},
        {"replay": "a.csv", "only_joints": ()},
        {"replay": "a.csv", "start": "-1 s"},
        {"replay": "a.csv", "timeout": 0},
        {"replay": "a.csv", "stamps": "wall"},
    ],
)
def test_keys_that_mean_nothing_are_refused(data: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        spec(**data)


def test_it_pickles_runs_no_code_and_ticks_at_its_own_rate() -> None:
    found = spec(replay="a.csv", only_joints=("a",), rate="50 Hz")
    assert pickle.loads(pickle.dumps(found)) == found
    assert not found.runs_user_code
    assert found.rate == 50.0


@pytest.mark.process
def test_loading_a_log_imports_neither_numpy_nor_rosbags(tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", TWISTS)
    ros1_bag(tmp_path / "a.bag", drive(TWISTS))
    for name, keys in (("csv", {"replay": "a.csv"}), ("ros", {"replay": "a.bag", "topic": "/cmd_vel"})):
        (tmp_path / f"{name}.sim.yml").write_text(scenario(**keys))
    script = (
        "import sys; from pathlib import Path; from sim_action.scenario.loading import load_scenario\n"
        "for path in sys.argv[1:]: load_scenario(Path(path))\n"
        "sys.exit(bool({'numpy', 'rosbags', 'pybullet', 'mujoco'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", script, "csv.sim.yml", "ros.sim.yml"]
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    ran = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


SLOW, FAST = Twist.planar(0.1), Twist.planar(0.9)
LOG = [(0.0, 0.1, 0.0), (1.0, 0.9, 0.0), (2.0, 0.1, 0.0)]


def played_at(folder: Path, times: list[float], rows: list[tuple[float, float, float]], **keys: Any) -> list[object]:
    bags.csv_file(folder / "log.csv", rows)
    controller = spec(replay="log.csv", **keys).open(scene_in(folder))
    return [controller.command(time) for time in times]  # type: ignore[arg-type]  # a log needs no observation


def test_a_row_acts_once_and_holds(tmp_path: Path) -> None:
    times = [0.0, 0.5, 1.0, 1.5, 2.0, 99.0]
    assert played_at(tmp_path, times, LOG) == [SLOW, None, FAST, None, SLOW, None]
    # With a rate, the last row between two ticks acts at the later one.
    rows = [(0.0, 0.1, 0.0), (0.06, 0.9, 0.0), (0.08, 0.1, 0.0)]
    assert played_at(tmp_path, [0.0, 0.1], rows, rate="10 Hz") == [SLOW, SLOW]


@pytest.mark.parametrize("rate", ["30 Hz", None])
@pytest.mark.parametrize("digits", range(2, 10))
def test_a_time_that_is_rounded_to_digits_belongs_to_its_tick(digits: int, rate: str | None, tmp_path: Path) -> None:
    rows = "".join(f"{n / 30:.{digits}f},{n}\n" for n in range(60))
    (tmp_path / "log.csv").write_text(f"time,linear\n{rows}")
    keys = {} if rate is None else {"rate": rate}
    controller = spec(replay="log.csv", **keys).open(scene_in(tmp_path))
    assert isinstance(controller, OpenLoop)
    ticks = 240 if rate is None else 30
    answers = [answer for n in range(2 * ticks) if (answer := controller.command(n / ticks))]
    assert answers == [Twist.planar(float(n)) for n in range(60)]
    if rate is None and digits > 2:
        due = [n for n in controller.due or () if controller.command(n / 240)]
        assert due == [8 * n for n in range(60)]


@pytest.mark.parametrize(("start", "first"), [(0.0, SLOW), (0.99, SLOW), (1.0, FAST), (1.5, FAST), (2.0, SLOW)])
def test_what_holds_at_the_start_is_given_first(start: float, first: Command, tmp_path: Path) -> None:
    assert played_at(tmp_path, [0.0], LOG, start=start) == [first]


def test_start_end_and_offset_cut_and_shift_a_log(tmp_path: Path) -> None:
    assert played_at(tmp_path, [0.0, 0.4, 0.5, 1.5], LOG, start=0.5) == [SLOW, None, FAST, SLOW]
    assert played_at(tmp_path, [0.0, 1.0, 2.0], LOG, end=1.5) == [SLOW, FAST, None]
    assert played_at(tmp_path, [0.0, 0.25, 1.25, 2.25], LOG, offset="250 ms") == [None, SLOW, FAST, SLOW]
    assert played_at(tmp_path, [0.0, 0.5], LOG, offset="-500 ms") == [SLOW, FAST]


def test_a_twist_that_is_too_old_stops_the_base_until_the_next(tmp_path: Path) -> None:
    times = [0.0, 0.3, 0.4, 0.9, 1.0, 1.4]
    stopping = played_at(tmp_path, times, LOG, timeout=0.3, rate="10 Hz")
    assert stopping == [SLOW, None, Twist(), None, FAST, Twist()]
    assert played_at(tmp_path, [0.0, 0.5], LOG, start=0.5, timeout=0.3) == [Twist(), FAST]


def notes(folder: Path, **keys: Any) -> list[str]:
    source = spec(**keys)
    controller = source.open(scene_in(folder))
    assert isinstance(controller, OpenLoop)
    rate = round(source.tick_rate(240.0))
    for n in range(1 + 3 * rate):
        controller.command(n / rate)
    return list(controller.notes(3.0))


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"rate": "10 Hz"}, "150 of 180 rows were not used: 145 replaced by a later one at a tick of 10 Hz, 5 after t"),
        ({"start": "1 s"}, "60 before t = 0"),
        ({"end": "1 s"}, "119 are after 'end'"),
        ({"offset": "2 s"}, "120 after the end of the run, at 3 s"),
        ({}, ""),
    ],
)
def test_rows_that_are_not_used_are_counted(keys: dict[str, Any], reason: str, tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", [(n / 60, n / 180, 0.0) for n in range(180)])
    found = notes(tmp_path, replay="a.csv", **keys)
    assert [reason in note for note in found] == ([True] if reason else [])


def curve(folder: Path, name: str, joint: str, **keys: Any) -> Any:
    controller = spec(replay=name, **keys).open(scene_in(folder))
    assert isinstance(controller, OpenLoop)
    answers = [controller.command(n / 240) for n in range(2400)]
    motions = [motion for answer in answers if isinstance(answer, JointTargets) for motion in answer.motions]
    (wanted,) = [curve for m in motions for name, curve in zip(m.names, m.curves, strict=True) if name == joint]
    return wanted


def test_positions_are_interpolated_and_hold_over_a_gap(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,position.wheel_left_joint\n0,0\n0.5,1\n3,2\n3.5,3\n")
    wheel = curve(tmp_path, "a.csv", "wheel_left_joint")
    assert 0.3 < wheel.at(0.25)[0] < 0.7
    assert wheel.at(2.9)[:2] == (1.0, 0.0)
    assert wheel.at(3.0)[0] == 2.0


@pytest.mark.parametrize("speed", [2.0, 0.0, 90.0])
def test_speeds_count_only_if_they_are_those_of_the_positions(speed: float, tmp_path: Path) -> None:
    rows = "".join(f"{n / 10},{n / 5},{speed}\n" for n in range(10))
    (tmp_path / "a.csv").write_text(f"time,position.wheel_left_joint,velocity.wheel_left_joint\n{rows}")
    position, velocity, _ = curve(tmp_path, "a.csv", "wheel_left_joint").at(0.25)
    assert (position, velocity) == pytest.approx((0.5, 2.0))
    ignored = "a.csv: velocities that do not fit the positions were not used: wheel_left_joint"
    assert notes(tmp_path, replay="a.csv") == ([] if speed == 2.0 else [ignored])


SLIDER = """<robot name="s"><link name="base"/><link name="cart"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-0.6" upper="0.6" effort="100" velocity="3"/></joint></robot>"""


RESTS = "".join(f"{n / 10},0.5,0\n" for n in range(9))


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (f"{RESTS}1,0.5,0\n1.4,0.55,0.1\n1.8,0.55,-0.1\n2.2,0.5,0\n", []),
        (
            f"{RESTS}1,0.5,0\n1.4,0.55,0.8\n1.8,0.55,-0.8\n2.2,0.5,0\n",
            ["its limits between two rows, at 1.5 s of the log"],
        ),
        ("0,0,\n0.5,0.61,\n1,0.7,\n1.5,0,\n", ["to 2 positions that it cannot reach, first at 0.5 s of the log"]),
        ("0,0,\n0.01,0.4,\n", ["commanded 60 m/s for joint 'slide'; it was clipped to 3 m/s, its velocity limit"]),
    ],
)
def test_what_a_joint_cannot_follow_is_noted_once_with_its_time(rows: str, expected: list[str], tmp_path: Path) -> None:
    (tmp_path / "slider.urdf").write_text(SLIDER)
    (tmp_path / "a.csv").write_text(f"time,position.slide,velocity.slide\n{rows}")
    text = LEAST.replace("turtlebot3_burger", "slider.urdf").replace(TWIST, "commands: {replay: a.csv}\n")
    controller = spec(replay="a.csv").open(build_scene(load(tmp_path, text)))
    assert isinstance(controller, OpenLoop)
    for n in range(960):
        controller.command(n / 240)
    found = list(controller.notes(math.inf))
    assert len(found) == len(expected)
    assert all(part in note for part, note in zip(expected, found, strict=True)), found


@pytest.mark.parametrize("rate", [300, 470, 490, 500, 1000, 5000])
def test_a_log_that_is_faster_than_the_physics_keeps_its_motion(rate: int, tmp_path: Path) -> None:
    rows = "".join(f"{n / rate:.6f},{math.sin(3 * n / rate):.6f}\n" for n in range(2 * rate + 1))
    (tmp_path / "a.csv").write_text(f"time,position.wheel_left_joint\n{rows}")
    wheel = curve(tmp_path, "a.csv", "wheel_left_joint")
    for time in (0.123, 0.5, 1.0, 1.777):
        assert wheel.at(time)[:2] == pytest.approx((math.sin(3 * time), 3 * math.cos(3 * time)), abs=0.02)


@pytest.mark.parametrize("first", ["", "1"])
def test_speeds_that_some_rows_lack_are_compared_too(first: str, tmp_path: Path) -> None:
    rows = "".join(f"{n / 10},{n / 5},{90.0 if n else first}\n" for n in range(10))
    (tmp_path / "a.csv").write_text(f"time,position.wheel_left_joint,velocity.wheel_left_joint\n{rows}")
    assert curve(tmp_path, "a.csv", "wheel_left_joint").at(0.25)[1] == pytest.approx(2.0)


@pytest.mark.parametrize(("lowest", "wraps"), [(-math.pi, True), (0.0, True), (-9.0, False)])
@pytest.mark.parametrize("speed", [7.0, -7.0])
def test_angles_of_a_continuous_joint_go_on(lowest: float, wraps: bool, speed: float, tmp_path: Path) -> None:
    angles = [speed * n / 20 for n in range(61)]
    values = [(angle - lowest) % math.tau + lowest for angle in angles]
    rows = "".join(f"{n / 20:.3f},{value:.4f}\n" for n, value in enumerate(values))
    (tmp_path / "a.csv").write_text(f"time,position.wheel_left_joint\n{rows}")
    wheel = curve(tmp_path, "a.csv", "wheel_left_joint")
    turned = [wheel.at(n / 20)[0] - wheel.at(0.0)[0] for n in range(61)]
    assert (turned == pytest.approx(angles, abs=1e-3)) == wraps
    assert any("wrap at" in note for note in notes(tmp_path, replay="a.csv")) == wraps


@pytest.mark.parametrize("jump_s", [0.01, 0.1])
@pytest.mark.parametrize("values", [(0, 0, 1, 1), (0, 0, 0, 1, 1, 1), (1, 1, 0), (0, 1, 1, 1)])
def test_rows_that_jump_move_nothing_before_and_after(jump_s: float, values: tuple[float, ...], tmp_path: Path) -> None:
    times, clock = [], 0.0
    for before, value in zip((values[0], *values), values, strict=False):
        clock += jump_s if before != value else 0.5
        times.append(clock - 0.5)
    rows = "".join(f"{time},{value}\n" for time, value in zip(times, values, strict=True))
    (tmp_path / "a.csv").write_text(f"time,position.wheel_left_joint\n{rows}")
    wheel = curve(tmp_path, "a.csv", "wheel_left_joint")
    positions = [wheel.at(n / 200)[0] for n in range(600)]
    assert min(positions) >= -1e-9
    assert max(positions) <= 1 + 1e-9


def test_two_topics_of_a_log_keep_their_distance(tmp_path: Path) -> None:
    left = joints((3.0, lambda store: joint_state(store, ["wheel_left_joint"], velocity=[1.0])), topic="/left")
    right = joints((0.0, lambda store: joint_state(store, ["wheel_right_joint"], velocity=[2.0])), topic="/right")
    mcap_file(tmp_path / "a.mcap", [*right, *left])
    bags.csv_file(tmp_path / "later.csv", [(bags.START / 1e9 + 5, 0.1, 0.0)])
    sources = [
        spec(replay="a.mcap", topic="/left"),
        spec(replay="./a.mcap", topic="/right", clock="shared"),
        spec(replay="later.csv", clock="shared"),
    ]
    controllers = [source.among(sources).open(scene_in(tmp_path)) for source in sources]
    begun = [next(n for n in range(9999) if controller.command(n / 240)) for controller in controllers]  # type: ignore[arg-type]
    assert begun == [720, 0, 1200]
    alone = spec(replay="a.mcap", topic="/left").open(scene_in(tmp_path))
    assert alone.command(0.0)  # type: ignore[arg-type]


def test_times_in_another_unit_are_found_before_the_run(tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", [(0, 0.1, 0.0), (5000, 0.0, 0.0)])
    (warning,) = load(tmp_path, scenario(replay="a.csv")).warnings
    assert "second row of a.csv is at 5000 s, but the run ends at" in warning.message


CELLS = st.none() | st.floats(-9, 9).map(lambda number: round(number, 3))
JOINT_ROWS = st.lists(st.tuples(st.floats(0, 5), CELLS, CELLS, st.floats(-9, 9)), min_size=1, max_size=8).map(
    lambda rows: sorted(rows, key=lambda row: row[0])
)


@settings(examples(60), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(JOINT_ROWS, st.floats(-3, 3), st.sampled_from(["240 Hz", "10 Hz"]))
def test_any_rows_give_finite_targets(tmp_path: Path, rows: list[tuple[float, ...]], offset: float, rate: str) -> None:
    header = "time,position.wheel_left_joint,velocity.wheel_left_joint,velocity.wheel_right_joint"
    lines = [",".join("" if cell is None else repr(cell) for cell in row) for row in rows]
    (tmp_path / "a.csv").write_text("\n".join([header, *lines, ""]))
    controller = spec(replay="a.csv", offset=offset, rate=rate).open(scene_in(tmp_path))
    assert isinstance(controller, OpenLoop)
    frequency = float(rate.partition(" ")[0])
    for n in range(round(9 * frequency)):
        answer = controller.command(n / frequency)
        if answer is not None:
            assert isinstance(answer, JointTargets)
            curves = [curve for motion in answer.motions for curve in motion.curves]
            states = [number for curve in curves for time in (0.0, 1.234, 5.0) for number in curve.at(time)]
            assert all(map(math.isfinite, [*answer.velocity.values(), *states]))
    assert all(
        any(part in note for part in ("were not used", "its velocity limit", "wrap at"))
        for note in controller.notes(math.inf)
    )
