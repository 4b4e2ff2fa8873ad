"""Logs of ROS: rosbag1 (.bag), rosbag2 (a folder with metadata.yaml, or one .db3 or .mcap), read by `rosbags`.

Only the scenario's own process reads them: they are decompressed, and native code does it. What a log says about its
message types is compared with ours and never used, since `rosbags` makes Python code of definitions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Literal

from sim_action.commands.logs import KINDS, JointColumn, Moment, followed, targets
from sim_action.core.errors import RecordingError, RunError
from sim_action.core.files import read_at_most
from sim_action.core.geometry import Twist, Vector3
from sim_action.core.messages import did_you_mean, escaped_line
from sim_action.state.command import Command, is_finite

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2


PACKAGE: Final = "rosbags"
METADATA: Final = "metadata.yaml"
_MOST_METADATA: Final = 10_000_000
# SQLite takes these in a path for something else.
_NOT_IN_PATHS: Final = ("?", "#", "%")
FILES: Final = (".bag", ".db3", ".mcap")
INSTALLING: Final = (
    "logs of ROS are read by the package rosbags, which is not installed here: pip install '.[rosbags]', or "
    "in a workflow the input 'extras: rosbags'"
)


def path_problem(path: Path) -> str | None:
    """What to say of a path that no log of ROS can be read from."""
    if path.is_dir() and not (path / METADATA).is_file():
        return f"is a folder without {METADATA}, which a rosbag2 has"
    if not path.is_dir() and path.suffix not in FILES:
        return f"is no log that can be replayed (allowed: .csv, {', '.join(FILES)}, the folder of a rosbag2)"
    if any(sign in str(path) for sign in _NOT_IN_PATHS):
        return f"is a path with one of {' '.join(_NOT_IN_PATHS)} in it; rename it"
    return None


def read_moments(path: Path, name: str, topic: str, type_name: str | None) -> list[Moment]:
    """The commands of one topic, by the time at which the log received them; at least one.

    Args:
        path: of the file, or of the folder whose files have been found to be where they may be.
        name: how messages call it.
        topic: as the log has it.
        type_name: what its messages must be; None: any of `TYPES`.

    Raises RecordingError, and RunError for what does not fit into memory.
    """
    with _told_of(name):
        if problem := path_problem(path):
            raise RecordingError(problem)
        try:
            from rosbags.rosbag1 import Reader as Reader1
            from rosbags.rosbag2 import Reader as Reader2
        except ImportError:
            raise RecordingError(INSTALLING) from None
        reader = Reader1(path) if path.suffix == ".bag" else Reader2(path)
        with reader:
            connections = _connections(reader, topic, type_name)
            return _moments(reader, connections, is_ros1=path.suffix == ".bag")


def files_of(folder: Path, name: str) -> Iterator[str]:
    """The names of the files that a rosbag2 folder consists of. Raises RecordingError."""
    yield METADATA
    with _told_of(name):
        information = _information(folder / METADATA)
        if str(information.get("compression_mode", "")).lower() == "file":
            raise RecordingError(
                "its files are compressed as wholes, which would have to be unpacked onto the disk: "
                "let 'ros2 bag convert' write it anew, or record with '--compression-mode message'"
            )
        # As rosbags takes them.
        names = [Path(str(path)).name for path in information["relative_file_paths"]]
    yield from names


def _information(metadata: Path) -> dict[str, Any]:
    import yaml

    if (text := read_at_most(metadata, _MOST_METADATA)) is None:
        raise RecordingError(f"its {METADATA} has more than {_MOST_METADATA // 1_000_000} MB")
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    if not isinstance(information, dict):
        raise RecordingError(f"its {METADATA} says nothing about it")
    return information


@contextmanager
def _told_of(name: str) -> Iterator[None]:
    """Makes a RecordingError of whatever is raised: of damaged logs, the reader raises all kinds."""
    try:
        yield
    except MemoryError:
        # Which is its context: the process that runs it says how much there is.
        raise RunError(escaped_line(f"{name}: what it unpacks to is too large, or it is damaged")) from None
    except RecordingError as error:
        raise RecordingError(escaped_line(f"{name}: {error}"), error.key) from None
    except Exception as error:  # noqa: BLE001 - see above
        what = str(error) or "it is damaged"
        raise RecordingError(escaped_line(f"{name}: cannot be read: {type(error).__name__}: {what}")) from None


def _connections(reader: Reader1 | Reader2, topic: str, type_name: str | None) -> list[Connection]:
    found = [connection for connection in reader.connections if connection.topic == topic]
    if not found:
        there = {connection.topic for connection in reader.connections}
        raise RecordingError(f"it has no topic '{topic}'{did_you_mean(topic, there)}", "topic")
    if len({connection.msgtype for connection in found}) > 1:
        raise RecordingError(f"'{topic}' has messages of several types", "topic")
    there_is = found[0].msgtype
    if there_is not in TYPES:
        raise RecordingError(f"'{topic}' is of type {there_is}{did_you_mean(there_is, TYPES)}", "topic")
    if type_name not in (None, there_is):
        raise RecordingError(f"'{topic}' is of type {there_is}, where the scenario says {type_name}", "type")
    return found


def _moments(reader: Reader1 | Reader2, connections: list[Connection], *, is_ros1: bool) -> list[Moment]:
    topic = connections[0].topic
    decoded = (_ros1 if is_ros1 else _ros2)(connections)
    stamped: list[tuple[int, Command]] = []
    for number, (connection, stamp, data) in enumerate(reader.messages(connections), start=1):
        try:
            stamped.append((stamp, command_of(connection.msgtype, decoded(connection, data))))
        except MessageError as error:
            raise RecordingError(f"message {number} of '{topic}': {error}") from None
    if not stamped:
        raise RecordingError(f"it has no message of '{topic}'")
    # Each file of a bag is in order, the files may not be.
    stamped.sort(key=lambda each: each[0])
    return [((stamp - stamped[0][0]) / 1e9, command) for stamp, command in stamped]


_Decoded = Callable[["Connection", bytes], object]


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
            raise RecordingError(f"'{connection.topic}' is encoded as '{encoding}'; what is read is cdr")
    return lambda connection, data: store.deserialize_cdr(data, connection.msgtype)


def _refuse_other(connection: Connection, digests: set[str]) -> None:
    """A type of the same name with other fields cannot be read as ours. Raises RecordingError."""
    if connection.digest not in digests:
        raise RecordingError(
            f"'{connection.topic}' is of a type {connection.msgtype} that is not the one of ROS (by its digest, "
            f"{connection.digest})"
        )


class MessageError(ValueError):
    """A message that no robot can be told."""


def command_of(type_name: str, message: Any) -> Command:
    """What a message of one of `TYPES` tells a robot. Raises MessageError."""
    command = TYPES[type_name](message)
    if not is_finite(command):
        raise MessageError("a value of it is not finite")
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
        raise MessageError("a joint is named twice in it")
    values: dict[JointColumn, float] = {}
    for kind in KINDS:
        numbers: Sequence[float] = getattr(message, kind).tolist()
        if numbers and len(numbers) != len(names):
            raise MessageError(f"it has {len(names)} names, and {len(numbers)} numbers in '{kind}'")
        values.update((JointColumn(kind, name), number) for name, number in zip(names, numbers, strict=False))
    if not values:
        raise MessageError("it has no position, no velocity and no effort")
    columns = list(values)
    return targets((columns[place], values[columns[place]]) for place in followed(columns))


TYPES: Final[Mapping[str, Callable[[Any], Command]]] = MappingProxyType(
    {
        "geometry_msgs/msg/Twist": _twist,
        "geometry_msgs/msg/TwistStamped": _stamped_twist,
        "sensor_msgs/msg/JointState": _joint_state,
    }
)
"""Type of a message -> how it is read."""


MessageType = Literal["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/JointState"]

TWISTS: Final[frozenset[str]] = frozenset({"geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"})
"""Those that drive a base."""
