"""Logs of ROS, each written by rosbags' own writers, whole and damaged."""

from __future__ import annotations

import random
import shutil
import sqlite3
import sys
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import yaml
from mcap.writer import IndexType
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from sim_action.commands.logs import Content, Recorded, Steering, Trajectory, rosbag
from sim_action.commands.logs.ros_messages import TWISTS, TYPES, MessageError, MessageSelection, MessageType
from sim_action.commands.logs.rosbag import files_of, path_problem, read_log
from sim_action.core.errors import RecordingError, RunError
from sim_action.core.geometry import Twist
from tests.commands.logs import bags
from tests.commands.logs.bags import (
    JOINTS,
    ROS1,
    ROS2,
    WRITERS,
    db3_file,
    drive,
    joint_state,
    joints,
    mcap_file,
    plain_mcap,
    ros1_bag,
    ros2_bag,
    stamped,
    twist,
)
from tests.fuzz.damage import damaged
from tests.soak import soaked

TimedContent = tuple[float, Content]
TWIST_MESSAGES = [(0.0, 0.2, 0.0), (0.1, 0.2, 0.5), (1.5, 0.0, 0.0)]
DRIVEN = [(time, Twist.planar(linear, angular)) for time, linear, angular in TWIST_MESSAGES]
in_every_format = pytest.mark.parametrize("log", list(WRITERS))


def written(folder: Path, log: str, entries: list[bags.Entry]) -> Path:
    return WRITERS[log](folder / log, entries)


def read(path: Path, topic: str = "/cmd_vel", type_name: str | None = None, **keys: Any) -> list[TimedContent]:
    rows = read_log(path, "monday", MessageSelection(topic, type_name, **keys)).rows
    return [((time_ns - rows[0][0]) / 1e9, content) for time_ns, content in rows]


def recorded_in(path: Path) -> Recorded:
    return read_log(path, "monday", MessageSelection("/cmd_vel"))


def log_file(path: Path, entries: list[bags.Entry]) -> Path:
    """Write a log in the format of its suffix; the name of a bag may say how it is compressed."""
    if path.suffix == ".bag":
        return ros1_bag(path, entries, path.stem.upper() if path.stem in ("bz2", "lz4") else None)
    return (db3_file if path.suffix == ".db3" else mcap_file)(path, entries)


def overwrite(path: Path, place: int, content: bytes) -> None:
    data = bytearray(path.read_bytes())
    data[place : place + len(content)] = content
    path.write_bytes(data)


def told(path: Path, topic: str = "/cmd_vel", type_name: str | None = None, **keys: Any) -> str:
    with pytest.raises(RecordingError) as raised:
        read(path, topic, type_name, **keys)
    assert str(raised.value).startswith("monday: ")
    return str(raised.value)


@in_every_format
@pytest.mark.parametrize("type_name", [bags.TWIST, bags.STAMPED])
def test_twists_of_one_topic_come_out_as_they_went_in(log: str, type_name: str, tmp_path: Path) -> None:
    entries = [*drive(TWIST_MESSAGES, type_name=type_name), *drive([(0.05, 9.0, 9.0)], "/other")]
    path = written(tmp_path, log, sorted(entries, key=lambda entry: entry[0]))
    assert read(path) == DRIVEN
    assert read(path, type_name=type_name) == read(path)


@in_every_format
def test_joints_come_out_as_they_went_in(log: str, tmp_path: Path) -> None:
    states = joints(
        (0.0, lambda store: joint_state(store, ["a", "b"], position=[1.0, 2.0])),
        (0.5, lambda store: joint_state(store, ["a"], velocity=[3.0])),
    )
    assert read(written(tmp_path, log, states), "/joint_states") == [
        (0.0, {("position", "a"): 1.0, ("position", "b"): 2.0}),
        (0.5, {("velocity", "a"): 3.0}),
    ]


@in_every_format
def test_a_topic_or_a_type_that_is_not_there_is_told_with_those_that_are(log: str, tmp_path: Path) -> None:
    path = written(tmp_path, log, drive(TWIST_MESSAGES))
    assert "no topic '/cmd_val'; did you mean '/cmd_vel'?" in told(path, "/cmd_val")
    other_type = told(path, type_name=bags.JOINTS)
    assert "'/cmd_vel' has the type geometry_msgs/msg/Twist, but the scenario requires" in other_type


@in_every_format
def test_a_message_that_no_robot_can_be_told_is_named(log: str, tmp_path: Path) -> None:
    path = written(tmp_path, log, drive([*TWIST_MESSAGES, (2.0, float("nan"), 0.0)]))
    assert told(path) == "monday: message 4 of '/cmd_vel': linear.x is nan, which is not finite"


def test_types_that_tell_no_robot_where_to_go_are_told(tmp_path: Path) -> None:
    point = ROS1.types["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
    path = ros1_bag(tmp_path / "a.bag", [(0.0, "/point", "geometry_msgs/msg/Point", lambda _: point)])
    assert "'/point' has the type geometry_msgs/msg/Point, which is not supported; did you mean" in told(path, "/point")


def test_the_files_of_a_bag_may_come_in_any_order(tmp_path: Path) -> None:
    folder = ros2_bag(tmp_path / "later", drive(TWIST_MESSAGES[1:]))
    shutil.copy(ros2_bag(tmp_path / "earlier", drive(TWIST_MESSAGES[:1])) / "earlier.db3", folder)
    metadata = (folder / "metadata.yaml").read_text()
    listed = "relative_file_paths:\n  - later.db3\n"
    assert listed in metadata
    (folder / "metadata.yaml").write_text(metadata.replace(listed, f"{listed}  - earlier.db3\n"))
    assert read(folder) == DRIVEN


FALLING = "message {} of '{}': its time of receipt is {} s earlier than that of the message before; split the log there"


@in_every_format
def test_a_log_whose_clock_was_reset_is_refused(log: str, tmp_path: Path) -> None:
    times = (0.0, 0.02, 5.0, 0.01, 4.0)
    path = written(tmp_path, log, drive([(time, index, 0.0) for index, time in enumerate(times)]))
    assert FALLING.format(4, "/cmd_vel", 4.99) in told(path)


def test_the_files_of_a_bag_whose_times_overlap_are_refused(tmp_path: Path) -> None:
    folder = ros2_bag(tmp_path / "one", entries_at((0.0, 1.0), (3.0, 2.0)))
    shutil.copy(ros2_bag(tmp_path / "two", entries_at((1.0, 3.0), (4.0, 4.0))) / "two.db3", folder)
    (folder / "metadata.yaml").unlink()
    assert FALLING.format(3, "/j", 2) in told(folder, "/j")


def test_a_topic_of_several_types_and_what_is_no_cdr_are_refused(tmp_path: Path) -> None:
    with Writer(tmp_path / "several", version=9) as writer:
        for type_name in (bags.TWIST, bags.STAMPED):
            writer.add_connection("/cmd_vel", type_name, typestore=ROS2)
    assert "'/cmd_vel' has messages of several types" in told(tmp_path / "several")
    with Writer(tmp_path / "bag", version=9) as writer:
        writer.add_connection("/cmd_vel", bags.TWIST, typestore=ROS2, serialization_format="json")
    for path in (tmp_path / "bag", tmp_path / "bag/bag.db3"):
        assert "'/cmd_vel' is encoded as 'json'; only cdr and ros1 are supported" in told(path)


def test_definitions_in_a_log_become_no_code_and_must_be_those_of_ros(tmp_path: Path) -> None:
    path = mcap_file(tmp_path / "a.mcap", drive(TWIST_MESSAGES))
    data = path.read_bytes()
    assert b"float64 x" in data
    path.write_bytes(data.replace(b"float64 x", b"float32 {"))
    assert "cannot be read" in told(path)
    path.write_bytes(data.replace(b"float64 x", b"float32 x"))
    assert "differs from the one of ROS" in told(path)
    path = ros1_bag(tmp_path / "a.bag", drive(TWIST_MESSAGES))
    digest = ROS1.generate_msgdef(bags.TWIST)[1].encode()
    data = path.read_bytes()
    assert digest in data
    path.write_bytes(data.replace(digest, b"0" * len(digest)))
    assert "differs from the one of ROS (digest 000" in told(path)


def test_files_of_a_bag_and_paths_that_are_no_log(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / "bag", drive(TWIST_MESSAGES))
    assert list(files_of(path, "monday")) == ["metadata.yaml", "bag.db3"]
    assert "without metadata.yaml" in str(path_problem(tmp_path))
    assert "is not a log that can be replayed" in str(path_problem(tmp_path / "a.txt"))
    assert "rename it" in str(path_problem(tmp_path / "a%2f.db3"))
    assert path_problem(tmp_path / "a.bag") is None


@pytest.mark.parametrize("text", ["", "[", "rosbag2_bagfile_information: 3", "a: b", "!!python/object:os.system x"])
def test_metadata_that_say_nothing_are_an_error(text: str, tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / "bag", drive(TWIST_MESSAGES))
    (path / "metadata.yaml").write_text(text)
    with pytest.raises(RecordingError, match=r"^monday: "):
        list(files_of(path, "monday"))
    told(path)


def test_without_rosbags_it_is_told_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = mcap_file(tmp_path / "a.mcap", drive(TWIST_MESSAGES))
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    assert "pip install 'sim-action[rosbags]'" in told(path)


@in_every_format
def test_a_log_without_a_message_is_an_error(log: str, tmp_path: Path) -> None:
    assert "monday: " in told(written(tmp_path, log, []))


def test_a_topic_has_at_most_as_many_messages_as_a_table_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    others = drive([(0.05 * number, 9.0, 9.0) for number in range(9)], "/other")
    path = written(tmp_path, "monday.bag", sorted([*drive(TWIST_MESSAGES), *others], key=lambda entry: entry[0]))
    monkeypatch.setattr("sim_action.commands.logs.rosbag.MAX_ROWS", len(TWIST_MESSAGES))
    assert len(read(path)) == len(TWIST_MESSAGES)
    monkeypatch.setattr("sim_action.commands.logs.rosbag.MAX_ROWS", len(TWIST_MESSAGES) - 1)
    limit = f"the log has more than {len(TWIST_MESSAGES) - 1} messages of '/cmd_vel': keep only the part to replay"
    assert limit in told(path)


@in_every_format
def test_damaged_logs_are_logs_or_an_error_for_people(log: str, tmp_path: Path) -> None:
    whole = written(tmp_path, log, drive(TWIST_MESSAGES))
    draw = random.Random(log)
    for trial in range(20):
        path = tmp_path / f"{trial}-{log}"
        (shutil.copytree if whole.is_dir() else shutil.copy)(whole, path)
        victims = sorted(path.iterdir()) if path.is_dir() else [path]
        victim = draw.choice(victims)
        victim.write_bytes(damaged(victim.read_bytes(), draw))
        try:
            moments = read(path)
        except RecordingError as error:
            assert str(error).startswith("monday: ")  # noqa: PT017 - either is right
            assert str(error).isprintable()  # noqa: PT017 - as above
        except RunError as error:
            assert isinstance(error.__context__, MemoryError)  # noqa: PT017 - as above
        else:
            assert moments


both_generations = pytest.mark.parametrize("store", [ROS1, ROS2], ids=["ros1", "ros2"])


def content_of(message: Any, **keys: Any) -> Content | None:
    name = message.__msgtype__
    return TYPES[name].content(message, MessageSelection("/topic", **keys))


def test_every_type_that_a_scenario_can_name_is_read() -> None:
    assert set(get_args(MessageType)) == set(TYPES)
    assert set(TYPES) > TWISTS


@both_generations
def test_twists_with_and_without_a_stamp(store: Typestore) -> None:
    assert content_of(twist(store, 1.0, 2.0)) == Twist.planar(1.0, 2.0)
    assert content_of(stamped(store, 1.0, 2.0)) == Twist.planar(1.0, 2.0)


@both_generations
def test_a_joint_state_has_the_numbers_that_are_not_nan(store: Typestore) -> None:
    nan = float("nan")
    message = joint_state(store, ["a", "b"], position=[1, nan], velocity=[3, 4], effort=[nan] * 2)
    assert content_of(message) == {("position", "a"): 1.0, ("velocity", "a"): 3.0, ("velocity", "b"): 4.0}
    assert content_of(joint_state(store, ["a"], effort=[5])) == {("effort", "a"): 5.0}
    assert content_of(joint_state(store, ["a"], position=[nan])) is None
    assert content_of(joint_state(store, ["a"])) is None


def array(*numbers: float) -> Any:
    types = ROS2.types
    layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
    return types["std_msgs/msg/Float64MultiArray"](layout, np.array(numbers))


DURATION = "builtin_interfaces/msg/Duration"


def trajectory(names: list[str], *points: tuple[float, list[float]]) -> Any:
    types = ROS2.types
    point, none = types["trajectory_msgs/msg/JointTrajectoryPoint"], np.array([])
    made = [
        point(np.array(positions), none, none, none, types[DURATION](int(time), int(time % 1 * 1e9)))
        for time, positions in points
    ]
    return types["trajectory_msgs/msg/JointTrajectory"](bags.header(ROS2), names, made)


def test_arrays_and_trajectories_are_of_the_joints_that_the_scenario_names() -> None:
    found = content_of(array(1.0, float("nan")), joints=("a", "b"), interface="velocity")
    assert found == {("velocity", "a"): 1.0}
    found = content_of(trajectory(["a", "b"], (0.5, [1.0, 2.0]), (1.0, [3.0, 4.0])))
    assert isinstance(found, Trajectory)
    assert [(point.time, point.positions) for point in found.points] == [(0.5, (1.0, 2.0)), (1.0, (3.0, 4.0))]


@pytest.mark.parametrize(
    ("message", "what"),
    [
        (twist(ROS2, float("nan"), 0.0), "linear.x is nan, which is not finite"),
        (joint_state(ROS2, ["a"], position=[float("inf")]), "the position of joint 'a' is inf, which is not finite"),
        (joint_state(ROS2, ["a", "b"], position=[1.0]), "2 names, but 1 numbers in 'position'"),
        (joint_state(ROS2, ["a"], position=[1.0], effort=[1.0, 2.0]), "1 names, but 2 numbers in 'effort'"),
        (joint_state(ROS2, ["a", "a"], position=[1.0, 2.0]), "names a joint twice"),
        (array(1.0), "it has 1 numbers for 0 joints"),
        (trajectory(["a"], (1.0, [1.0]), (1.0, [2.0])), r"points\[1\] is at 1 s, not later than the point before"),
        (trajectory(["a", "b"], (1.0, [1.0])), r"points\[0\] has 1 positions for 2 joints"),
    ],
)
def test_a_message_that_no_robot_can_be_told_is_refused(message: Any, what: str) -> None:
    with pytest.raises(MessageError, match=what):
        content_of(message)


def test_a_car_is_steered(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    name = "ackermann_msgs/msg/AckermannDrive"
    numbers = ("steering_angle", "steering_angle_velocity", "speed", "acceleration", "jerk")
    store.register(get_types_from_msg("".join(f"float32 {number}\n" for number in numbers), name))
    message = store.types[name](0.5, 0.0, 1.5, 0.0, 0.0)
    with Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/drive", name, typestore=store)
        writer.write(connection, 1, store.serialize_cdr(message, name))
    assert read(tmp_path / "bag", "/drive") == [(0.0, Steering(1.5, 0.5))]


def state_at(seconds: float, velocity: float) -> Any:
    message = joint_state(ROS2, ["a"], velocity=[velocity])
    message.header.stamp = ROS2.types["builtin_interfaces/msg/Time"](int(seconds), round(seconds % 1 * 1e9))
    return message


def entries_at(*moments: tuple[float, float]) -> list[bags.Entry]:
    return [(received, "/j", JOINTS, lambda _, at=stamp: state_at(at, 1.0)) for received, stamp in moments]


def test_times_are_those_of_receipt_of_the_header_or_of_the_clock(tmp_path: Path) -> None:
    clock = "rosgraph_msgs/msg/Clock"

    def tick(seconds: int) -> Any:
        return ROS2.types[clock](ROS2.types["builtin_interfaces/msg/Time"](seconds, 0))

    clocks: list[bags.Entry] = [(t, "/clock", clock, lambda _, s=s: tick(s)) for t, s in ((0.0, 10), (4.0, 12))]
    path = ros2_bag(tmp_path / "bag", [clocks[0], *entries_at((1.0, 5.0), (3.0, 8.5)), clocks[1]])
    times = {stamps: [time for time, _ in read(path, "/j", stamps=stamps)] for stamps in ("receipt", "header", "clock")}
    assert times == {"receipt": [0.0, 2.0], "header": [0.0, 3.5], "clock": [0.0, 1.0]}


@pytest.mark.parametrize(
    "options",
    [
        *({"use_chunking": False}, {"use_chunking": False, "use_statistics": False}, {}),
        *({"index_types": index} for index in (IndexType.CHUNK, IndexType.MESSAGE, IndexType.NONE)),
    ],
)
def test_messages_of_mcap_are_those_of_their_times(options: dict[str, Any], tmp_path: Path) -> None:
    moments = [(0.04, 9.0), (0.0, 5.0), (0.06, 9.5), (0.02, 7.0)]
    path = plain_mcap(tmp_path / "a.mcap", entries_at(*moments), chunk_size=200, **options)
    times = {stamps: [time for time, _ in read(path, "/j", stamps=stamps)] for stamps in ("receipt", "header")}
    assert times == {"receipt": [0.0, 0.02, 0.04, 0.06], "header": [0.0, 2.0, 4.0, 4.5]}
    path = plain_mcap(tmp_path / "reset.mcap", entries_at((0.0, 1.0), *moments, (9.0, 9.6), (0.5, 9.7)), **options)
    for stamps in ("receipt", "header"):
        assert FALLING.format(7, "/j", 8.5) in told(path, "/j", stamps=stamps)


@pytest.mark.parametrize(
    ("moments", "stamps", "message"),
    [
        ([(0.0, 5.0), (1.0, 4.0)], "header", "message 2 of '/j': its header.stamp is 1 s earlier"),
        ([(0.0, 0.0)], "header", "message 1 of '/j': its header.stamp is 0"),
        ([(0.0, 5.0)], "clock", "the log has no topic '/clock'"),
    ],
)
def test_stamps_that_cannot_be_used_are_refused(
    moments: list[tuple[float, float]], stamps: str, message: str, tmp_path: Path
) -> None:
    path = ros2_bag(tmp_path / "bag", [*entries_at(*moments), *drive([(9.0, 0.2, 0.0)])])
    assert message in told(path, "/j", stamps=stamps)
    assert "have no header; remove this key" in told(path, stamps="header")


DAMAGED = "is unfinished or damaged: the messages before the damage were read"


def test_an_mcap_that_is_cut_off_is_read_up_to_its_end(tmp_path: Path) -> None:
    path = mcap_file(tmp_path / "b.mcap", drive(TWIST_MESSAGES), CompressionMode.STORAGE)
    path.write_bytes(path.read_bytes()[:200])  # without a whole message
    assert f"no readable topic '/cmd_vel': b.mcap {DAMAGED}" in told(path)
    path = mcap_file(tmp_path / "a.mcap", drive([(n / 10, n / 100, 0.1) for n in range(300)]))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 4])
    recorded = recorded_in(path)
    assert 10 < len(recorded.rows) < 250
    assert recorded.rows[5][1] == Twist.planar(0.05, 0.1)
    assert recorded.notes == (f"a.mcap {DAMAGED} ('mcap recover' repairs it)",)


def test_a_log_without_metadata_is_read_with_a_note(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / "bag", drive(TWIST_MESSAGES))
    (path / "metadata.yaml").unlink()
    recorded = recorded_in(path)
    assert len(recorded.rows) == 3
    assert "its recorder was killed" in recorded.notes[0]


def test_a_database_whose_recorder_was_killed_is_read_with_its_journal(tmp_path: Path) -> None:
    path = db3_file(tmp_path / "a.db3", drive(TWIST_MESSAGES))
    database = sqlite3.connect(path)
    database.execute("PRAGMA journal_mode=WAL")
    copies = "SELECT topic_id, timestamp + 2000000000, data FROM messages"
    database.execute(f"INSERT INTO messages (topic_id, timestamp, data) {copies}")
    database.commit()
    killed = tmp_path / "killed"
    killed.mkdir()
    for file in tmp_path.glob("a.db3*"):
        if file.is_file():
            shutil.copy(file, killed)
    database.close()
    recorded = recorded_in(killed / "a.db3")
    assert len(recorded.rows) == 6
    assert "was not closed by its recorder" in recorded.notes[0]


@pytest.mark.parametrize(
    ("log", "share"),
    [
        *(("a.bag", share) for share in (0.3, 0.6, 0.95)),
        ("lz4.bag", 0.3),
        ("bz2.bag", 0.95),
        ("monday.bag.active", 0.6),
        *(("a.db3", share) for share in (0.3, 0.61, 0.95)),
    ],
)
def test_a_log_that_is_cut_off_is_read_before_the_damage(log: str, share: float, tmp_path: Path) -> None:
    (tmp_path / "whole").mkdir()
    entries = drive([(n / 10, n / 10_000, 0.1) for n in range(2000)])
    path = log_file(tmp_path / "whole" / log.removesuffix(".active"), entries)
    data = path.read_bytes()
    (tmp_path / log).write_bytes(data[: int(len(data) * share)])
    recorded = recorded_in(tmp_path / log)
    assert recorded.rows == recorded_in(path).rows[: len(recorded.rows)]
    assert share - 0.2 < len(recorded.rows) / 2000
    assert recorded.notes == (f"{log} {DAMAGED}",)


@pytest.mark.parametrize("log", soaked(["a.mcap", "a.bag", "bz2.bag", "lz4.bag"], ["a.mcap", "lz4.bag"]))
def test_a_hole_in_a_log_with_a_good_index_is_counted(log: str, tmp_path: Path) -> None:
    path = log_file(tmp_path / log, drive([(n / 10, n / 10_000, 0.1) for n in range(20_000)]))
    whole = recorded_in(path).rows
    overwrite(path, path.stat().st_size * 2 // 5, bytes(4096))
    recorded = recorded_in(path)
    lost = len(whole) - len(recorded.rows)
    assert 0 < lost < len(whole)
    assert set(recorded.rows) < set(whole)
    (note,) = recorded.notes
    assert note == f"{log} is damaged in the middle: {lost} messages of '/cmd_vel' are lost, the others were read"


@pytest.mark.parametrize("index", [IndexType.CHUNK, IndexType.NONE])
@pytest.mark.parametrize("damaged", ["name of the compression", "records"])
def test_a_damaged_chunk_without_an_index_is_noted(index: IndexType, damaged: str, tmp_path: Path) -> None:
    entries = drive([(n / 10, n / 10_000, 0.1) for n in range(200)])
    path = plain_mcap(tmp_path / "a.mcap", entries, chunk_size=600, index_types=index)
    whole = recorded_in(path).rows
    data = path.read_bytes()
    place = data.index(b"lz4", len(data) // 3) + (0 if damaged == "name of the compression" else 60)
    overwrite(path, place, bytes(3))
    recorded = recorded_in(path)
    assert recorded.rows == whole[: len(recorded.rows)]
    assert 0 < len(recorded.rows) < len(whole) == 200
    assert recorded.notes == (f"a.mcap {DAMAGED} ('mcap recover' repairs it)",)


def test_a_library_without_the_index_tells_the_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = mcap_file(tmp_path / "a.mcap", drive([(n / 10, n / 10_000, 0.1) for n in range(20_000)]))
    overwrite(path, path.stat().st_size * 2 // 5, bytes(4096))
    monkeypatch.setattr(rosbag, "_is_readable", lambda reader, _: reader.no_such_attribute)
    with pytest.raises(RecordingError, match="monday: the log cannot be read: ") as raised:
        recorded_in(path)
    assert "no_such_attribute" not in str(raised.value)


def test_a_database_with_a_page_of_rubbish_is_read_before_it(tmp_path: Path) -> None:
    path = db3_file(tmp_path / "a.db3", drive([(n / 10, 0.1, 0.1) for n in range(2000)]))
    overwrite(path, path.stat().st_size // 2, b"\xff" * 8192)
    recorded = recorded_in(path)
    assert 500 < len(recorded.rows) < 1500
    assert recorded.notes == (f"a.db3 {DAMAGED}",)


@pytest.mark.parametrize("log", ["a.bag", "a.db3"])
def test_a_log_without_a_readable_message_is_an_error(log: str, tmp_path: Path) -> None:
    path = log_file(tmp_path / log, drive(TWIST_MESSAGES))
    path.write_bytes(path.read_bytes()[:60])
    assert f"no readable topic '/cmd_vel': {log} {DAMAGED}" in told(path)
    # A length of 4 GB is not read.
    path.write_bytes(path.read_bytes()[:13] + b"\xff" * 500)
    assert "no readable topic" in told(path)
    path.write_bytes(b"rubbish" * 100)
    assert "no readable topic" in told(path) or "does not begin as a rosbag does" in told(path)


VERSIONS = {"foxy": 4, "galactic": 4, "humble": 5, "iron": 7, "jazzy": 9, "kilted": 9}


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP], ids=["sqlite3", "mcap"])
@pytest.mark.parametrize("compression", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize("distro", VERSIONS)
def test_logs_of_every_distribution_are_read(
    distro: str, compression: CompressionMode, storage: StoragePlugin, tmp_path: Path
) -> None:
    """The metadata of each distribution, as far as the versions of rosbag2 differ."""
    path = ros2_bag(tmp_path / "bag", drive(TWIST_MESSAGES), storage, compression)
    information = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    information["version"] = VERSIONS[distro]
    information.pop("ros_distro")
    information.pop("custom_data")
    for topic in information["topics_with_message_count"]:
        metadata = topic["topic_metadata"]
        metadata.pop("type_description_hash")
        metadata["offered_qos_profiles"] = "- history: 3\n  depth: 0\n  reliability: 1\n  durability: 2"
    if VERSIONS[distro] < 5:
        information.pop("files")
        names = information["relative_file_paths"]
        information["relative_file_paths"] = [f"bag/{name}" for name in names] if distro == "foxy" else names
    (path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))
    assert read(path) == DRIVEN
