"""Logs of ROS, each written by rosbags' own writers, whole and damaged."""

from __future__ import annotations

import random
import shutil
import sys
from pathlib import Path
from typing import Any, get_args

import pytest
from rosbags.rosbag2 import CompressionMode, Writer
from rosbags.typesys.store import Typestore

from sim_action.commands.logs import TimedCommand
from sim_action.commands.logs.rosbag import (
    TWISTS,
    TYPES,
    MessageError,
    MessageType,
    command_of,
    files_of,
    path_problem,
    read_commands,
)
from sim_action.core.errors import RecordingError, RunError
from sim_action.core.geometry import Twist
from sim_action.state.command import JointTargets
from tests.commands.logs import bags
from tests.commands.logs.bags import (
    JOINTS,
    ROS1,
    ROS2,
    STAMPED,
    TWIST,
    WRITERS,
    drive,
    joint_state,
    joints,
    mcap_file,
    ros1_bag,
    ros2_bag,
    stamped,
    twist,
)

TWIST_MESSAGES = [(0.0, 0.2, 0.0), (0.1, 0.2, 0.5), (1.5, 0.0, 0.0)]
in_every_format = pytest.mark.parametrize("log", list(WRITERS))


def written(folder: Path, log: str, entries: list[bags.Entry]) -> Path:
    return WRITERS[log](folder / log, entries)


def read(path: Path, topic: str = "/cmd_vel", type_name: str | None = None) -> list[TimedCommand]:
    return read_commands(path, "monday", topic, type_name)


def told(path: Path, topic: str = "/cmd_vel", type_name: str | None = None) -> str:
    with pytest.raises(RecordingError) as raised:
        read(path, topic, type_name)
    assert str(raised.value).startswith("monday: ")
    return str(raised.value)


@in_every_format
@pytest.mark.parametrize("type_name", [bags.TWIST, bags.STAMPED])
def test_twists_of_one_topic_come_out_as_they_went_in(log: str, type_name: str, tmp_path: Path) -> None:
    entries = [*drive(TWIST_MESSAGES, type_name=type_name), *drive([(0.05, 9.0, 9.0)], "/other")]
    path = written(tmp_path, log, sorted(entries, key=lambda entry: entry[0]))
    assert read(path) == [(time, Twist.planar(linear, angular)) for time, linear, angular in TWIST_MESSAGES]
    assert read(path, type_name=type_name) == read(path)


@in_every_format
def test_joints_come_out_as_they_went_in(log: str, tmp_path: Path) -> None:
    states = joints(
        (0.0, lambda store: joint_state(store, ["a", "b"], position=[1.0, 2.0])),
        (0.5, lambda store: joint_state(store, ["a"], velocity=[3.0])),
    )
    assert read(written(tmp_path, log, states), "/joint_states") == [
        (0.0, JointTargets(position={"a": 1.0, "b": 2.0})),
        (0.5, JointTargets(velocity={"a": 3.0})),
    ]


@in_every_format
def test_a_topic_or_a_type_that_is_not_there_is_told_with_those_that_are(log: str, tmp_path: Path) -> None:
    path = written(tmp_path, log, drive(TWIST_MESSAGES))
    assert "no topic '/cmd_val'; did you mean '/cmd_vel'?" in told(path, "/cmd_val")
    assert "'/cmd_vel' has the type geometry_msgs/msg/Twist, but the scenario requires" in told(
        path, type_name=bags.JOINTS
    )


@in_every_format
def test_a_message_that_no_robot_can_be_told_is_named(log: str, tmp_path: Path) -> None:
    path = written(tmp_path, log, drive([*TWIST_MESSAGES, (2.0, float("nan"), 0.0)]))
    assert told(path) == "monday: message 4 of '/cmd_vel': it contains a value that is not finite"


def test_types_that_tell_no_robot_where_to_go_are_told(tmp_path: Path) -> None:
    point = ROS1.types["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
    path = ros1_bag(tmp_path / "a.bag", [(0.0, "/point", "geometry_msgs/msg/Point", lambda _: point)])
    assert "'/point' has the type geometry_msgs/msg/Point, which is not supported; did you mean" in told(path, "/point")


def test_a_type_of_the_same_name_with_other_fields_is_refused(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path / "a.bag", drive(TWIST_MESSAGES))
    digest = ROS1.generate_msgdef(bags.TWIST)[1].encode()
    data = path.read_bytes()
    assert digest in data
    path.write_bytes(data.replace(digest, b"0" * len(digest)))
    assert "differs from the one of ROS (digest 000" in told(path)


def test_the_files_of_a_bag_may_come_in_any_order(tmp_path: Path) -> None:
    folder = ros2_bag(tmp_path / "later", drive(TWIST_MESSAGES[1:]))
    shutil.copy(ros2_bag(tmp_path / "earlier", drive(TWIST_MESSAGES[:1])) / "earlier.db3", folder)
    metadata = (folder / "metadata.yaml").read_text()
    listed = "relative_file_paths:\n  - later.db3\n"
    assert listed in metadata
    (folder / "metadata.yaml").write_text(metadata.replace(listed, f"{listed}  - earlier.db3\n"))
    assert read(folder) == [(time, Twist.planar(linear, angular)) for time, linear, angular in TWIST_MESSAGES]


def test_a_topic_of_several_types_is_refused(tmp_path: Path) -> None:
    with Writer(tmp_path / "bag", version=9) as writer:
        for type_name in (bags.TWIST, bags.STAMPED):
            writer.add_connection("/cmd_vel", type_name, typestore=ROS2)
    assert "'/cmd_vel' has messages of several types" in told(tmp_path / "bag")


def test_what_is_no_cdr_is_refused(tmp_path: Path) -> None:
    with Writer(tmp_path / "bag", version=9) as writer:
        writer.add_connection("/cmd_vel", bags.TWIST, typestore=ROS2, serialization_format="json")
    assert "json" in told(tmp_path / "bag")
    assert "'/cmd_vel' is encoded as 'json'; only cdr is supported" in told(tmp_path / "bag/bag.db3")


def test_definitions_in_a_log_become_no_code(tmp_path: Path) -> None:
    path = mcap_file(tmp_path / "a.mcap", drive(TWIST_MESSAGES))
    data = path.read_bytes()
    assert b"float64 x" in data
    path.write_bytes(data.replace(b"float64 x", b"float32 {"))
    assert read(path)[0] == (0.0, Twist.planar(0.2))


def test_a_bag_whose_files_would_have_to_be_unpacked_is_refused(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / "bag", drive(TWIST_MESSAGES), compression=CompressionMode.FILE)
    with pytest.raises(RecordingError, match="compressed as a whole"):
        list(files_of(path, "monday"))


def test_the_files_of_a_bag_are_those_that_its_metadata_name(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / "bag", drive(TWIST_MESSAGES))
    assert list(files_of(path, "monday")) == ["metadata.yaml", "bag.db3"]


@pytest.mark.parametrize("text", ["", "[", "rosbag2_bagfile_information: 3", "a: b", "!!python/object:os.system x"])
def test_metadata_that_say_nothing_are_an_error(text: str, tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / "bag", drive(TWIST_MESSAGES))
    (path / "metadata.yaml").write_text(text)
    with pytest.raises(RecordingError, match=r"^monday: "):
        list(files_of(path, "monday"))
    told(path)


def test_paths_that_no_log_can_be_read_from(tmp_path: Path) -> None:
    assert "without metadata.yaml" in str(path_problem(tmp_path))
    assert "is not a log that can be replayed" in str(path_problem(tmp_path / "a.txt"))
    assert "rename it" in str(path_problem(tmp_path / "a%2f.db3"))
    assert path_problem(tmp_path / "a.bag") is None


def test_without_rosbags_it_is_told_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = mcap_file(tmp_path / "a.mcap", drive(TWIST_MESSAGES))
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    assert "pip install '.[rosbags]'" in told(path)


@in_every_format
def test_a_log_without_a_message_is_an_error(log: str, tmp_path: Path) -> None:
    assert "monday: " in told(written(tmp_path, log, []))


@in_every_format
def test_damaged_logs_are_logs_or_an_error_for_people(log: str, tmp_path: Path) -> None:
    whole = written(tmp_path, log, drive(TWIST_MESSAGES))
    draw = random.Random(log)
    for trial in range(60):
        path = tmp_path / f"{trial}-{log}"
        (shutil.copytree if whole.is_dir() else shutil.copy)(whole, path)
        victims = sorted(path.iterdir()) if path.is_dir() else [path]
        damage(draw.choice(victims), draw)
        try:
            moments = read(path)
        except RecordingError as error:
            assert str(error).startswith("monday: ")  # noqa: PT017 - either is right
            assert str(error).isprintable()  # noqa: PT017 - as above
        except RunError as error:
            assert isinstance(error.__context__, MemoryError)  # noqa: PT017 - as above
        else:
            assert moments


def damage(path: Path, draw: random.Random) -> None:
    data = bytearray(path.read_bytes())
    match draw.randrange(3):
        case 0:
            del data[draw.randrange(len(data)) :]
        case 1:
            place = draw.randrange(len(data))
            del data[place : place + draw.randrange(1, 64)]
        case _:
            for _ in range(draw.randrange(1, 8)):
                data[draw.randrange(len(data))] = draw.choice((0, 255, draw.randrange(256)))
    path.write_bytes(data)


both_generations = pytest.mark.parametrize("store", [ROS1, ROS2], ids=["ros1", "ros2"])


def test_every_type_that_a_scenario_can_name_is_read() -> None:
    assert set(get_args(MessageType)) == set(TYPES)
    assert set(TYPES) > TWISTS


@both_generations
def test_twists_with_and_without_a_stamp(store: Typestore) -> None:
    assert command_of(TWIST, twist(store, 1.0, 2.0)) == Twist.planar(1.0, 2.0)
    assert command_of(STAMPED, stamped(store, 1.0, 2.0)) == Twist.planar(1.0, 2.0)


@both_generations
def test_a_joint_state_says_where_to_go_and_else_how_fast(store: Typestore) -> None:
    message = joint_state(store, ["a", "b"], position=[1, 2], velocity=[3, 4], effort=[float("nan")] * 2)
    assert command_of(JOINTS, message) == JointTargets(position={"a": 1.0, "b": 2.0})
    assert command_of(JOINTS, joint_state(store, ["a"], velocity=[3], effort=[5])) == JointTargets(velocity={"a": 3.0})
    assert command_of(JOINTS, joint_state(store, ["a"], effort=[5])) == JointTargets(effort={"a": 5.0})


@pytest.mark.parametrize(
    ("message", "what"),
    [
        (twist(ROS2, float("nan"), 0.0), "not finite"),
        (joint_state(ROS2, ["a"], position=[float("inf")]), "not finite"),
        (joint_state(ROS2, ["a", "b"], position=[1.0]), "2 names, but 1 numbers in 'position'"),
        (joint_state(ROS2, ["a"], position=[1.0], effort=[1.0, 2.0]), "1 names, but 2 numbers in 'effort'"),
        (joint_state(ROS2, ["a"]), "no position, velocity or effort"),
        (joint_state(ROS2, ["a", "a"], position=[1.0, 2.0]), "names a joint twice"),
    ],
)
def test_a_message_that_no_robot_can_be_told_is_refused(message: Any, what: str) -> None:
    type_name = message.__msgtype__
    with pytest.raises(MessageError, match=what):
        command_of(type_name, message)
