"""Logs of ROS, written by rosbags' own writers: the commands of a drive in every format, and messages of any kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

Twists = Sequence[tuple[float, float, float]]  # time in s, linear in m/s, angular in rad/s
TWIST: Final = "geometry_msgs/msg/Twist"
STAMPED: Final = "geometry_msgs/msg/TwistStamped"
JOINTS: Final = "sensor_msgs/msg/JointState"
START: Final = 1_700_000_000_123_456_789  # when logs begin, in ns: no float holds it
ROS1: Final = get_typestore(Stores.ROS1_NOETIC)
ROS2: Final = get_typestore(Stores.ROS2_HUMBLE)
Entry = tuple[float, str, str, Any]  # time in s since the log began, topic, type, and what makes the message


def twist(store: Typestore, linear: float, angular: float) -> Any:
    vector = store.types["geometry_msgs/msg/Vector3"]
    return store.types[TWIST](vector(linear, 0.0, 0.0), vector(0.0, 0.0, angular))


def stamped(store: Typestore, linear: float, angular: float) -> Any:
    return store.types[STAMPED](header(store), twist(store, linear, angular))


def header(store: Typestore) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](0, 0)
    of = store.types["std_msgs/msg/Header"]
    return of(0, stamp, "") if store is ROS1 else of(stamp, "")


def joint_state(
    store: Typestore,
    names: list[str],
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> Any:
    groups = (np.array(group, dtype=np.float64) for group in (position, velocity, effort))
    return store.types[JOINTS](header(store), names, *groups)


def _write(writer: Any, entries: Iterable[Entry], store: Typestore, serialized: Callable[[Any, str], Any]) -> None:
    with writer:
        connections: dict[str, Any] = {}
        for time, topic, type_name, make in entries:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=store)
            writer.write(connections[topic], START + round(time * 1e9), serialized(make(store), type_name))


def ros1_bag(path: Path, entries: Iterable[Entry], compression: str | None = None) -> Path:
    writer = Writer1(path)
    if compression:
        writer.set_compression(Writer1.CompressionFormat[compression])
    _write(writer, entries, ROS1, ROS1.serialize_ros1)
    return path


def ros2_bag(
    path: Path,
    entries: Iterable[Entry],
    storage: StoragePlugin = StoragePlugin.SQLITE3,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    writer = Writer2(path, version=9, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    _write(writer, entries, ROS2, ROS2.serialize_cdr)
    return path


def mcap_file(path: Path, entries: Iterable[Entry], compression: CompressionMode = CompressionMode.NONE) -> Path:
    folder = ros2_bag(path.with_name(f"{path.name}-folder"), entries, StoragePlugin.MCAP, compression)
    (written,) = folder.glob("*.mcap")
    return written.rename(path)


def db3_file(path: Path, entries: Iterable[Entry]) -> Path:
    folder = ros2_bag(path.with_name(f"{path.name}-folder"), entries)
    (written,) = folder.glob("*.db3")
    return written.rename(path)


def csv_file(path: Path, twists: Twists) -> Path:
    rows = "".join(f"{time!r},{linear!r},{angular!r}\n" for time, linear, angular in twists)
    path.write_text(f"time,linear,angular\n{rows}", encoding="utf-8")
    return path


def drive(twists: Twists, topic: str = "/cmd_vel", type_name: str = TWIST) -> list[Entry]:
    make = twist if type_name == TWIST else stamped
    return [(time, topic, type_name, _of(make, linear, angular)) for time, linear, angular in twists]


def _of(make: Callable[..., Any], *numbers: Any) -> Callable[[Typestore], Any]:
    return lambda store: make(store, *numbers)


def joints(*states: tuple[float, Callable[[Typestore], Any]], topic: str = "/joint_states") -> list[Entry]:
    return [(time, topic, JOINTS, make) for time, make in states]


def packed(path: Path, entries: Iterable[Entry], storage: StoragePlugin, suffix: str) -> Path:
    """Return a single file of a log whose files are compressed."""
    folder = ros2_bag(path.with_name(f"{path.name}-folder"), entries, storage, CompressionMode.FILE)
    (written,) = folder.glob(f"*{suffix}")
    return written.rename(path)


def ros1_mcap(path: Path, entries: Iterable[Entry]) -> Path:
    """Write MCAP with messages of ROS 1, as `mcap convert` does."""
    return plain_mcap(path, entries, ROS1)


def plain_mcap(path: Path, entries: Iterable[Entry], store: Typestore = ROS2, **options: Any) -> Path:
    """Write MCAP with the writer of the package mcap. Entries stay in their order."""
    profile, encoding, serialize = (
        ("ros1", "ros1", ROS1.serialize_ros1) if store is ROS1 else ("ros2", "cdr", store.serialize_cdr)
    )
    with path.open("wb") as file:
        writer: Any = McapWriter(file, compression=CompressionType.LZ4, **options)
        writer.start(profile=profile)
        channels: dict[str, int] = {}
        for time, topic, type_name, make in entries:
            if topic not in channels:
                text = store.generate_msgdef(type_name, ros_version=int(profile[-1]))[0].encode()
                name = type_name.replace("/msg/", "/") if store is ROS1 else type_name
                schema = writer.register_schema(name, f"{profile}msg", text)
                channels[topic] = writer.register_channel(topic, encoding, schema)
            moment = START + round(time * 1e9)
            writer.add_message(channels[topic], moment, bytes(serialize(make(store), type_name)), moment)
        writer.finish()
    return path


WRITERS: Final[dict[str, Callable[[Path, Iterable[Entry]], Path]]] = {
    "monday.bag": ros1_bag,
    "bz2.bag": lambda path, entries: ros1_bag(path, entries, "BZ2"),
    "lz4.bag": lambda path, entries: ros1_bag(path, entries, "LZ4"),
    "sqlite": ros2_bag,
    "sqlite-messages": lambda path, entries: ros2_bag(path, entries, compression=CompressionMode.MESSAGE),
    "sqlite-files": lambda path, entries: ros2_bag(path, entries, compression=CompressionMode.FILE),
    "mcap-files": lambda path, entries: ros2_bag(path, entries, StoragePlugin.MCAP, CompressionMode.FILE),
    "monday.db3.zstd": lambda path, entries: packed(path, entries, StoragePlugin.SQLITE3, ".db3.zstd"),
    "monday.mcap.zstd": lambda path, entries: packed(path, entries, StoragePlugin.MCAP, ".mcap.zstd"),
    "messages.mcap": lambda path, entries: mcap_file(path, entries, CompressionMode.MESSAGE),
    "ros1.mcap": ros1_mcap,
    "mcap": lambda path, entries: ros2_bag(path, entries, StoragePlugin.MCAP),
    "mcap-chunks": lambda path, entries: ros2_bag(path, entries, StoragePlugin.MCAP, CompressionMode.STORAGE),
    "monday.mcap": mcap_file,
    "monday.db3": db3_file,
}
"""Name of a log -> what writes commands to it in a format of its own."""
