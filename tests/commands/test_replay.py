"""The source `replay`: what a scenario may say of a log, and what is told before and when it runs."""

from __future__ import annotations

import importlib.util
import io
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.commands import OpenLoop, replay
from sim_action.commands.logs import JointColumn, TimedCommand
from sim_action.commands.replay import (
    MAX_BYTES,
    MAX_COLUMNS,
    Header,
    HeaderError,
    Playback,
    ReplayCommands,
    read_csv,
    read_header,
)
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
    controller = spec(**data).open(scene_in(folder))
    assert isinstance(controller, OpenLoop)
    return controller.command(time)


def scenario(**keys: object) -> str:
    return LEAST.replace(TWIST, "commands:\n" + "".join(f"  {key}: {value}\n" for key, value in keys.items()))


def told_at(folder: Path, text: str) -> tuple[str, str]:
    """Place and message of the one problem."""
    (found,) = told(folder, text)
    place, _, message = found.partition(": ")
    return place, message


def test_csv_is_replayed_from_its_first_row(tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", [(100.0, 0.2, 0.0), (101.0, 0.3, 0.0)])
    assert given_at(0.0, tmp_path, replay="a.csv") == Twist.planar(0.2)
    assert given_at(1.0, tmp_path, replay="a.csv") == Twist.planar(0.3)
    assert given_at(0.0, tmp_path, replay="a.csv", start="1 s") == Twist.planar(0.3)
    assert given_at(1.5, tmp_path, replay="a.csv", timeout="0.4 s") == Twist()


def test_a_log_of_ros_is_replayed_by_its_topic(tmp_path: Path) -> None:
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
        ("start", 2.0, "the log ends before that time, 1.5 s after its first message"),
        ("topic", "/odom", "the log has no topic '/odom'"),
        ("type", bags.JOINTS, "but the scenario requires sensor_msgs/msg/JointState"),
    ],
)
def test_what_a_log_of_ros_does_not_hold_is_told_when_it_is_opened(
    key: str, value: object, message: str, tmp_path: Path
) -> None:
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
    ({"replay": "a.csv", "topic": "/cmd_vel"}, "9:3", "a CSV file has no topics; remove this key"),
    ({"replay": "a.csv", "type": bags.TWIST}, "9:3", "a CSV file has no topics; remove this key"),
    ({"replay": "a.csv", "start": "2 s"}, "9:3", "the log ends before that time, 1.5 s after its first row"),
    ({"replay": "a.csv", "only_joints": "[wheel_left_joint]"}, "9:3", "twists, not joints; remove this key"),
    ({"replay": "wheels.csv", "timeout": "1 s"}, "9:3", "this applies to twists only"),
    (
        {"replay": "wheels.csv", "only_joints": "[wheel_lift_joint]"},
        "9:3",
        "the log has no joint 'wheel_lift_joint'",
    ),
    ({"replay": "strange.csv"}, "8:3", "strange.csv: the model has no moving joint 'wheel_lift_joint'; did you mean"),
]


@pytest.mark.parametrize(("keys", "place", "message"), CSV_PROBLEMS)
def test_what_is_wrong_with_csv_is_told_at_load(
    keys: dict[str, object], place: str, message: str, tmp_path: Path
) -> None:
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
    ({"replay": "notes.txt"}, "is not a log that can be replayed (allowed: .csv, .bag, .db3, .mcap, the folder"),
    ({"replay": "folder", "topic": "/cmd_vel"}, "is a folder without metadata.yaml"),
    ({"replay": "a%2f.db3", "topic": "/cmd_vel"}, "rename it"),
    ({"replay": "a.bag", "topic": "/cmd_vel", "type": "geometry_msgs/Twist"}, "geometry_msgs/msg/Twist"),
    ({"replay": "a.bag", "topic": "/j", "type": bags.JOINTS, "timeout": 1}, "this applies to twists only"),
    ({"replay": "a.bag", "topic": "/cmd_vel", "type": bags.TWIST, "only_joints": "[a]"}, "twists, not joints"),
    ({"replay": "a.bag", "topic": "/j", "only_joints": "[wheel_lift_joint]"}, "the model has no moving joint"),
]


@pytest.mark.parametrize(("keys", "message"), ROS_PROBLEMS)
def test_what_can_be_told_of_a_log_of_ros_without_reading_it(
    keys: dict[str, object], message: str, tmp_path: Path
) -> None:
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
    assert "pip install '.[rosbags]'" in found
    assert "extras: rosbags" in found


def test_a_source_of_twists_needs_wheels_whatever_its_file(tmp_path: Path) -> None:
    bags.csv_file(tmp_path / "a.csv", TWISTS)
    (tmp_path / "wheels.csv").write_text(WHEELS_CSV)
    found = scene_in(tmp_path)
    assert spec(replay="a.csv").gives_twists(found)
    assert not spec(replay="wheels.csv").gives_twists(found)
    assert spec(replay="a.mcap", topic="/a", type=bags.STAMPED).gives_twists(found)
    assert not spec(replay="a.mcap", topic="/a").gives_twists(found)


def test_joints_are_known_of_csv_and_of_what_the_scenario_names(tmp_path: Path) -> None:
    (tmp_path / "wheels.csv").write_text(WHEELS_CSV)
    found = scene_in(tmp_path)
    assert spec(replay="wheels.csv").joints(found) == {"wheel_left_joint", "wheel_right_joint"}
    assert spec(replay="wheels.csv", only_joints=("wheel_left_joint",)).joints(found) == {"wheel_left_joint"}
    assert spec(replay="a.bag", only_joints=("wheel_left_joint",)).joints(found) == {"wheel_left_joint"}
    assert spec(replay="a.bag").joints(found) == frozenset()
    assert spec(replay="nowhere.csv").joints(found) == frozenset()


def test_a_log_and_twists_for_the_same_wheels_are_an_error_at_load(tmp_path: Path) -> None:
    (tmp_path / "wheels.csv").write_text(WHEELS_CSV)
    text = LEAST.replace(TWIST, "commands:\n  - replay: wheels.csv\n  - twist: [{linear: 1.0}]\n")
    _, found = told_at(tmp_path, text)
    assert "joint 'wheel_left_joint' is moved by commands.0 already" in found


def test_which_source_cannot_be_opened_is_told(tmp_path: Path) -> None:
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
        {"replay": "a.csv", "joints": ("a",)},
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
LOG: list[TimedCommand] = [(0.0, SLOW), (1.0, FAST), (2.0, SLOW)]


def played_at(
    times: list[float], log: list[TimedCommand], start: float = 0.0, timeout: float | None = None
) -> list[object]:
    playback = Playback(log, start, timeout)
    return [playback.command(time) for time in times]


def test_a_command_is_given_once_and_holds() -> None:
    assert played_at([0.0, 0.5, 1.0, 1.5, 2.0, 99.0], LOG) == [SLOW, None, FAST, None, SLOW, None]


def test_of_what_falls_between_two_ticks_the_last_is_given_at_the_later_one() -> None:
    assert played_at([0.0, 5.0], LOG) == [SLOW, SLOW]
    assert played_at([0.0, 1.9], LOG) == [SLOW, FAST]


def test_a_tick_on_a_moment_counts_whatever_the_rounding_of_either() -> None:
    log: list[TimedCommand] = [(n * 0.1, Twist.planar(float(n))) for n in range(30)]
    assert played_at([n / 10 for n in range(30)], log) == [Twist.planar(float(n)) for n in range(30)]


@pytest.mark.parametrize(("start", "first"), [(0.0, SLOW), (0.99, SLOW), (1.0, FAST), (1.5, FAST), (2.0, SLOW)])
def test_what_holds_at_the_start_is_given_first(start: float, first: Command) -> None:
    assert played_at([0.0], LOG, start) == [first]


def test_from_the_start_on_times_are_those_of_the_log() -> None:
    assert played_at([0.0, 0.4, 0.5, 1.5], LOG, 0.5) == [SLOW, None, FAST, SLOW]


def test_a_twist_that_is_too_old_stops_the_base_until_the_next() -> None:
    times = [0.0, 0.3, 0.4, 0.9, 1.0, 1.4]
    assert played_at(times, LOG, timeout=0.3) == [SLOW, None, Twist(), Twist(), FAST, Twist()]


def test_a_twist_may_be_too_old_at_the_start() -> None:
    assert played_at([0.0, 0.5], LOG, 0.5, timeout=0.3) == [Twist(), FAST]


def test_joints_that_a_later_row_does_not_name_keep_what_they_were_told_between_two_ticks() -> None:
    log: list[TimedCommand] = [
        (0.0, JointTargets(position={"a": 1.0, "b": 1.0})),
        (0.1, JointTargets(position={"a": 2.0})),
        (0.2, JointTargets(velocity={"b": 3.0})),
    ]
    assert played_at([0.05, 0.2], log) == [log[0][1], JointTargets(position={"a": 2.0}, velocity={"b": 3.0})]
    assert played_at([0.2], log) == [JointTargets(position={"a": 2.0}, velocity={"b": 3.0})]


def test_a_header_of_twists() -> None:
    header = Header.of(["time", "angular"])
    assert header.holds_twists
    assert not header.joint_names


def test_a_header_of_joints_whose_names_may_have_dots() -> None:
    header = Header.of(["position.arm.elbow", "time", "velocity.wheel"])
    assert not header.holds_twists
    assert header.joint_names == {"arm.elbow", "wheel"}
    assert header.joints == (JointColumn("position", "arm.elbow"), None, JointColumn("velocity", "wheel"))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["time", "linaer"], "unknown column 'linaer'; did you mean 'linear'?"),
        (["time", "linear", "position."], "unknown column 'position.'"),
        (["time", "linear", ""], "unknown column ''"),
        (["time", "linear", "linear"], "2 columns have the name 'linear'"),
        (["time;linear;angular"], "separate columns by commas"),
        (["linear"], "the column 'time' is missing"),
        (["time"], "there is no command column besides 'time' (allowed: angular, effort.<joint>"),
        (["time", "linear", "position.a"], "'linear' commands the base, 'position.a' a joint"),
        (["time", *(f"position.{n}" for n in range(MAX_COLUMNS))], "1,001 columns; at most 1,000"),
    ],
)
def test_a_header_that_tells_nothing_to_replay_is_refused(columns: list[str], message: str) -> None:
    with pytest.raises(HeaderError) as raised:
        Header.of(columns)
    assert message in str(raised.value)


def log(folder: Path, text: str | bytes) -> Path:
    path = folder / "monday.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def moments(folder: Path, text: str | bytes) -> list[TimedCommand]:
    return list(read_csv(log(folder, text), "logs/monday.csv"))


def refusal(folder: Path, text: str | bytes) -> str:
    with pytest.raises(RecordingError) as raised:
        moments(folder, text)
    return str(raised.value)


def test_rows_become_twists_at_times_since_the_first(tmp_path: Path) -> None:
    assert moments(tmp_path, "time,linear,lateral,angular\n10,1,2,3\n10.5,-.5,+0,1e-1\n") == [
        (0.0, Twist.planar(1.0, 3.0, lateral=2.0)),
        (0.5, Twist.planar(-0.5, 0.1)),
    ]


def test_rows_become_targets_of_joints_each_by_the_first_kind_that_it_has(tmp_path: Path) -> None:
    text = "time,effort.elbow,velocity.wheel,position.elbow\n0,9,2,1\n"
    assert moments(tmp_path, text) == [(0.0, JointTargets(position={"elbow": 1.0}, velocity={"wheel": 2.0}))]


def test_what_editors_and_spreadsheets_add_is_no_matter(tmp_path: Path) -> None:
    text = b'\xef\xbb\xbf time , linear \r\n\r\n "0" , "1.5"\r\n'.replace(b' "', b'"').replace(b'" ', b'"')
    assert moments(tmp_path, text) == [(0.0, Twist.planar(1.5))]


def test_the_largest_of_numbers_are_numbers(tmp_path: Path) -> None:
    text = "time,linear,angular\n0,1.7e308,1.7e308\n"
    assert moments(tmp_path, text) == [(0.0, Twist.planar(1.7e308, 1.7e308))]


def test_columns_that_are_left_out_are_zero(tmp_path: Path) -> None:
    assert moments(tmp_path, "angular,time\n2,0\n") == [(0.0, Twist.planar(0.0, 2.0))]


def test_times_keep_their_last_digit_whenever_the_log_began(tmp_path: Path) -> None:
    text = "time,linear\n1700000000.123456789,0\n1700000000.223456789,0\n"
    assert [time for time, _ in moments(tmp_path, text)] == [0.0, 0.1]


def test_two_commands_at_the_same_time_stay_in_their_order(tmp_path: Path) -> None:
    assert moments(tmp_path, "time,linear\n0,1\n0,2\n") == [(0.0, Twist.planar(1.0)), (0.0, Twist.planar(2.0))]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "logs/monday.csv: the file is empty"),
        ("\n\n", "logs/monday.csv: the file is empty"),
        ("\ntime,linaer\n", "logs/monday.csv:2: unknown column 'linaer'; did you mean 'linear'?"),
        ("time,linear\n", "logs/monday.csv: there is no row after the header"),
        ("time,linear\n0,1\n\n1,fast\n", "logs/monday.csv:4: column 'linear': expected a finite number, found 'fast'"),
        ("time,linear\n0,nan\n", "logs/monday.csv:2: column 'linear': expected a finite number, found 'nan'"),
        ("time,linear\n0,1e999\n", "expected a finite number, found '1e999'"),
        ("time,linear\ninf,1\n", "column 'time': expected a finite number, found 'inf'"),
        ("time,linear\n0,\n", "column 'linear': expected a finite number, found ''"),
        ('time,linear\n0,"1,2"\n', "column 'linear': expected a finite number, found '1,2'"),
        ("time,linear\n0,1_0\n", "column 'linear': expected a finite number, found '1_0'"),
        ("time,linear\n0,٣\n", "column 'linear': expected a finite number"),
        (f"time,linear\n0,{'9' * 50_000}\n", "column 'linear': expected a finite number"),
        (
            "time,linear\n0,1\n2,1\n1.5,1\n",
            "logs/monday.csv:4: column 'time': '1.5' is earlier than the previous row, 2",
        ),
        ("time,linear\n0,1,2\n", "logs/monday.csv:2: 3 cells, but the header has 2 columns"),
        ('time,linear\n0,"1\n', "logs/monday.csv:2: not valid CSV"),
        (f"time,{'x' * 200_000}\n", "not valid CSV: field larger than field limit"),
        (b"time,linear\n0,\xff\n", "logs/monday.csv: not UTF-8 text"),
        (b"time,linear\n0,1\x00\n", "logs/monday.csv:2:"),
        ("time,linear\n0,\x1b[31m1\n", r"found '\x1b[31m1'"),
    ],
)
def test_a_log_that_cannot_be_replayed_is_told_with_its_place(text: str | bytes, message: str, tmp_path: Path) -> None:
    found = refusal(tmp_path, text)
    assert message in found
    assert found.isprintable()
    assert len(found) < 2_500


def test_a_gigantic_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "monday.csv"
    with path.open("wb") as file:
        file.write(b"time,linear\n0,1\n")
        file.truncate(MAX_BYTES * 1_000)
    with pytest.raises(RecordingError, match="the file has 25000 MB; at most 25 MB of CSV are allowed"):
        read_header(path, "monday.csv")


def test_more_rows_than_any_log_has_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay, "MAX_ROWS", 3)
    assert len(moments(tmp_path, "time,linear\n" + "0,0\n" * 3)) == 3
    assert refusal(tmp_path, "time,linear\n" + "0,0\n" * 4).startswith(
        "logs/monday.csv:5: the log has more than 3 rows"
    )


def test_what_is_no_file_holds_nobody_up(tmp_path: Path) -> None:
    pipe = tmp_path / "monday.csv"
    os.mkfifo(pipe)
    with pytest.raises(RecordingError, match=r"monday\.csv: the file cannot be read: it is not a regular file"):
        read_header(pipe, "monday.csv")


NUMBERS = st.floats(-1e6, 1e6)
ROWS = st.lists(st.tuples(st.floats(0, 1e9), NUMBERS, NUMBERS), min_size=1).map(sorted)


@given(ROWS)
def test_what_is_written_is_what_is_read(rows: list[tuple[float, float, float]]) -> None:
    text = "time,linear,angular\n" + "".join(f"{time!r},{linear!r},{angular!r}\n" for time, linear, angular in rows)
    found = list(in_memory(text.encode()))
    assert [command for _, command in found] == [Twist.planar(linear, angular) for _, linear, angular in rows]
    assert [time for time, _ in found] == pytest.approx([time - rows[0][0] for time, _, _ in rows], abs=1e-6)


@st.composite
def files(draw: st.DrawFn) -> bytes:
    """Return anything, or a log in which a few characters may be missing, or others."""
    if draw(st.sampled_from((True, False, False))):
        return draw(st.binary() | st.text(alphabet="time,linear0123456789.-+eE\n\"' ;").map(str.encode))
    rows = draw(st.lists(st.tuples(st.integers(0, 9), st.integers(-9, 9)), min_size=1, max_size=5).map(sorted))
    text = "time,linear\n" + "".join(f"{time},{linear}\n" for time, linear in rows)
    start = draw(st.integers(0, len(text)))
    end = start + draw(st.sampled_from((0, 0, 1, 5)))
    return (text[:start] + draw(st.sampled_from(("", "", "0", "-", ".5", "\n", '"', " ", ","))) + text[end:]).encode()


@given(files())
def test_whatever_a_file_holds_it_is_a_log_or_an_error_for_people(data: bytes) -> None:
    try:
        found = list(in_memory(data))
    except RecordingError as error:
        assert str(error).startswith("any.csv")  # noqa: PT017 - either is right
    else:
        assert found


def in_memory(data: bytes) -> list[TimedCommand]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replay, "open_regular", lambda *_, **__: io.BytesIO(data))
        return list(read_csv(Path("any.csv"), "any.csv"))
