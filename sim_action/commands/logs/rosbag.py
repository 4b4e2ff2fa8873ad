"""Logs of ROS: rosbag1 (.bag), rosbag2 (a folder with metadata.yaml, or one .db3 or .mcap), read by `rosbags`.

Only the scenario's own process reads them, because native code decompresses them. The message definitions in a log are
compared with ours and never used, because `rosbags` generates Python code from definitions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Literal

from sim_action.commands.logs import KINDS, JointColumn, TimedCommand, row_targets, used_columns
from sim_action.core.errors import RecordingError, RunError
from sim_action.core.files import read_at_most
from sim_action.core.geometry import Twist, Vector3
from sim_action.core.wording import did_you_mean, escaped_line
from sim_action.state.command import Command, is_finite

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2


PACKAGE: Final = "rosbags"
METADATA: Final = "metadata.yaml"
_MAX_METADATA_BYTES: Final = 10_000_000
# These characters have a special meaning in SQLite's paths.
_NOT_IN_PATHS: Final = ("?", "#", "%")
FILES: Final = (".bag", ".db3", ".mcap")
INSTALL_HINT: Final = (
    "logs of ROS need the package rosbags, which is not installed: pip install '.[rosbags]', or in a workflow set "
    "the input 'extras: rosbags'"
)

_Decoded = Callable[["Connection", bytes], object]

MessageType = Literal["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/JointState"]

TWISTS: Final[frozenset[str]] = frozenset({"geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"})
"""The message types that command a base."""


def path_problem(path: Path) -> str | None:
    """Return the problem of a path that cannot be a log of ROS; None if it can."""
    if path.is_dir() and not (path / METADATA).is_file():
        return f"is a folder without {METADATA}, so it is not a rosbag2"
    if not path.is_dir() and path.suffix not in FILES:
        return f"is not a log that can be replayed (allowed: .csv, {', '.join(FILES)}, the folder of a rosbag2)"
    if any(sign in str(path) for sign in _NOT_IN_PATHS):
        return f"contains one of the characters {' '.join(_NOT_IN_PATHS)}; rename it"
    return None


def read_commands(path: Path, name: str, topic: str, type_name: str | None) -> list[TimedCommand]:
    """Return the commands of a topic, at least one, in the order in which the log received them.

    Args:
        path: path of the file, or of a folder whose files are known to be in the workspace.
        name: name of the log in messages.
        topic: name of the topic in the log.
        type_name: required type of its messages; None: any of `TYPES`.

    Raises RecordingError, and RunError if the log does not fit into memory.
    """
    with _as_recording_error(name):
        if problem := path_problem(path):
            raise RecordingError(problem)
        try:
            from rosbags.rosbag1 import Reader as Reader1
            from rosbags.rosbag2 import Reader as Reader2
        except ImportError:
            raise RecordingError(INSTALL_HINT) from None
        reader = Reader1(path) if path.suffix == ".bag" else Reader2(path)
        with reader:
            connections = _connections(reader, topic, type_name)
            return _moments(reader, connections, is_ros1=path.suffix == ".bag")


def files_of(folder: Path, name: str) -> Iterator[str]:
    """Yield the names of the files of a rosbag2 folder. Raises RecordingError."""
    yield METADATA
    with _as_recording_error(name):
        information = _information(folder / METADATA)
        if str(information.get("compression_mode", "")).lower() == "file":
            raise RecordingError(
                "its files are compressed as a whole, which is not supported: convert the log with 'ros2 bag convert', "
                "or record it with '--compression-mode message'"
            )
        # rosbags uses the file names in the same way.
        names = [Path(str(path)).name for path in information["relative_file_paths"]]
    yield from names


def _information(metadata: Path) -> dict[str, Any]:
    import yaml

    if (text := read_at_most(metadata, _MAX_METADATA_BYTES)) is None:
        raise RecordingError(f"its {METADATA} is larger than {_MAX_METADATA_BYTES // 1_000_000} MB")
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    if not isinstance(information, dict):
        raise RecordingError(f"its {METADATA} has no information about the log")
    return information


@contextmanager
def _as_recording_error(name: str) -> Iterator[None]:
    """Turn every exception into a RecordingError: the reader raises many types for damaged logs."""
    try:
        yield
    except MemoryError:
        # The MemoryError stays as the context: the process of the scenario adds the memory limit.
        raise RunError(escaped_line(f"{name}: the log is too large when it is unpacked, or it is damaged")) from None
    except RecordingError as error:
        raise RecordingError(escaped_line(f"{name}: {error}"), error.key) from None
    except Exception as error:  # noqa: BLE001 - see above
        what = str(error) or "the log is damaged"
        raise RecordingError(escaped_line(f"{name}: the log cannot be read: {type(error).__name__}: {what}")) from None


def _connections(reader: Reader1 | Reader2, topic: str, type_name: str | None) -> list[Connection]:
    found = [connection for connection in reader.connections if connection.topic == topic]
    if not found:
        there = {connection.topic for connection in reader.connections}
        raise RecordingError(f"the log has no topic '{topic}'{did_you_mean(topic, there)}", "topic")
    if len({connection.msgtype for connection in found}) > 1:
        raise RecordingError(f"topic '{topic}' has messages of several types", "topic")
    there_is = found[0].msgtype
    if there_is not in TYPES:
        raise RecordingError(
            f"topic '{topic}' has the type {there_is}, which is not supported{did_you_mean(there_is, TYPES)}", "topic"
        )
    if type_name not in (None, there_is):
        raise RecordingError(f"topic '{topic}' has the type {there_is}, but the scenario requires {type_name}", "type")
    return found


def _moments(reader: Reader1 | Reader2, connections: list[Connection], *, is_ros1: bool) -> list[TimedCommand]:
    topic = connections[0].topic
    decoded = (_ros1 if is_ros1 else _ros2)(connections)
    stamped: list[tuple[int, Command]] = []
    for number, (connection, stamp, data) in enumerate(reader.messages(connections), start=1):
        try:
            stamped.append((stamp, command_of(connection.msgtype, decoded(connection, data))))
        except MessageError as error:
            raise RecordingError(f"message {number} of '{topic}': {error}") from None
    if not stamped:
        raise RecordingError(f"the log has no message of '{topic}'")
    # The messages of each file are in order, but the files may overlap.
    stamped.sort(key=lambda each: each[0])
    return [((stamp - stamped[0][0]) / 1e9, command) for stamp, command in stamped]


def _ros1(connections: list[Connection]) -> _Decoded:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    for connection in connections:
        _refuse_other(connection, {"*", store.generate_msgdef(connection.msgtype)[1]})
    return lambda connection, data: store.deserialize_ros1(data, connection.msgtype)


def _ros2(connections: list[Connection]) -> _Decoded:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    for connection in connections:
        _refuse_other(connection, {"", store.hash_rihs01(connection.msgtype)})
        encoding = getattr(connection.ext, "serialization_format", "cdr")
        if encoding != "cdr":
            raise RecordingError(f"topic '{connection.topic}' is encoded as '{encoding}'; only cdr is supported")
    return lambda connection, data: store.deserialize_cdr(data, connection.msgtype)


def _refuse_other(connection: Connection, digests: set[str]) -> None:
    """Raise RecordingError if a message type has the name of ours, but other fields."""
    if connection.digest not in digests:
        raise RecordingError(
            f"topic '{connection.topic}' has a type {connection.msgtype} that differs from the one of ROS (digest "
            f"{connection.digest})"
        )


class MessageError(ValueError):
    """A message that cannot be converted to a command."""


def command_of(type_name: str, message: Any) -> Command:
    """Return the command in a message of one of `TYPES`. Raises MessageError."""
    command = TYPES[type_name](message)
    if not is_finite(command):
        raise MessageError("it contains a value that is not finite")
    return command


def _twist(message: Any) -> Twist:
    return Twist(_vector(message.linear), _vector(message.angular))


def _vector(message: Any) -> Vector3:
    return (float(message.x), float(message.y), float(message.z))


def _stamped_twist(message: Any) -> Twist:
    return _twist(message.twist)


def _joint_state(message: Any) -> Command:
    names = list(message.name)
    if len(set(names)) != len(names):
        raise MessageError("it names a joint twice")
    values: dict[JointColumn, float] = {}
    for kind in KINDS:
        numbers: Sequence[float] = getattr(message, kind).tolist()
        if numbers and len(numbers) != len(names):
            raise MessageError(f"it has {len(names)} names, but {len(numbers)} numbers in '{kind}'")
        values.update((JointColumn(kind, name), number) for name, number in zip(names, numbers, strict=False))
    if not values:
        raise MessageError("it has no position, velocity or effort")
    columns = list(values)
    return row_targets((columns[place], values[columns[place]]) for place in used_columns(columns))


TYPES: Final[Mapping[str, Callable[[Any], Command]]] = MappingProxyType(
    {
        "geometry_msgs/msg/Twist": _twist,
        "geometry_msgs/msg/TwistStamped": _stamped_twist,
        "sensor_msgs/msg/JointState": _joint_state,
    }
)
"""The type of a message -> the function that converts it."""
