"""Logs of ROS: rosbag1 (.bag), rosbag2 (a folder, or one .db3 or .mcap, also as .zstd), read by `rosbags`.

Only the scenario's own process reads them, because native code decompresses them. The message definitions in a log are
compared with ours and never used, because `rosbags` generates Python code from definitions.
"""

from __future__ import annotations

import shutil
import sqlite3
import struct
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, Protocol

from sim_action.commands.logs import MAX_ROWS, Recorded, TimedRow
from sim_action.commands.logs.damaged_logs import MAX_UNPACKED_BYTES, SCANNERS, ScannedLog, ScannedMcap, zstd
from sim_action.commands.logs.ros_messages import ARRAY, DEFINITIONS, TYPES, MessageError, MessageSelection
from sim_action.core.errors import RecordingError, RunError
from sim_action.core.files import open_regular, read_at_most
from sim_action.core.lazy_numpy import np
from sim_action.core.records import replace
from sim_action.core.wording import did_you_mean, escaped_line

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.typesys.store import Typestore


PACKAGE: Final = "rosbags"
METADATA: Final = "metadata.yaml"
_MAX_METADATA_BYTES: Final = 10_000_000
_BLOCK_BYTES: Final = 1_000_000
_MAX_DISORDER_NS: Final = 100_000_000  # recorders with several threads may exchange messages
_CLOCK: Final = "/clock"
_CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
_ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"
# These characters have a special meaning in SQLite's paths.
_NOT_IN_PATHS: Final = ("?", "#", "%")
FILES: Final = (".bag", ".bag.active", ".db3", ".mcap", ".db3.zstd", ".mcap.zstd")
INSTALL_HINT: Final = (
    "logs of ROS need the package rosbags, which is not installed: pip install 'sim-action[rosbags]', or in a workflow "
    "set the input 'extras: rosbags'"
)


def path_problem(path: Path) -> str | None:
    """Return the problem of a path that cannot be a log of ROS; None if it can."""
    if path.is_dir() and not (path / METADATA).is_file() and not _storages_in(path):
        return f"is a folder without {METADATA} and without a file {' or '.join(FILES[2:])}, so it is not a rosbag2"
    if not path.is_dir() and not path.name.endswith(FILES):
        return f"is not a log that can be replayed (allowed: .csv, {', '.join(FILES)}, the folder of a rosbag2)"
    if any(sign in str(path) for sign in _NOT_IN_PATHS):
        return f"contains one of the characters {' '.join(_NOT_IN_PATHS)}; rename it"
    return None


def read_log(path: Path, name: str, selection: MessageSelection) -> Recorded:
    """Return the messages of a topic, in the order of their times.

    `path`: of the file, or of a folder whose files are known to be in the workspace; `name`: of the log in messages.
    Raises RecordingError, and RunError if the log does not fit into memory.
    """
    with _as_recording_error(name), ExitStack() as stack:
        if problem := path_problem(path):
            raise RecordingError(problem)
        try:
            import rosbags.rosbag1  # noqa: F401 - a missing package has a message of its own
        except ImportError:
            raise RecordingError(INSTALL_HINT) from None
        notes: list[str] = []
        files = [path / file for file in files_of(path, name) if file != METADATA] if path.is_dir() else [path]
        if path.is_dir() and not (path / METADATA).is_file():
            notes.append(f"{name} has no {METADATA}, so its recorder was killed: all its files are read")
        storages = [stack.enter_context(_opened(file, notes)) for file in files]
        try:
            recorded = _recorded(storages, selection)
        except (RecordingError, MemoryError):
            raise
        except Exception as damage:
            try:
                holes = [hole for storage in storages for hole in _holes_cut_out(storage, selection.topic)]
            except AttributeError:
                # This version of rosbags keeps its index elsewhere: the log is read as it is, or not at all.
                raise damage from None
            if not holes:
                raise
            notes += holes
            recorded = _recorded(storages, selection)
        notes += [storage.unfinished for storage in storages if isinstance(storage, ScannedLog) and storage.cut]
        return replace(recorded, notes=tuple(escaped_line(note) for note in notes))


def _holes_cut_out(storage: _Storage, topic: str) -> Iterator[str]:
    """Remove the damaged parts of a file with a good index from its index; yield a note that counts lost messages.

    A part is a chunk of MCAP, or a message of a rosbag1 and the one before it, whose end may be damaged, too.
    """
    reader: Any = storage
    if isinstance(storage, ScannedLog) or reader.path.suffix not in (".bag", ".mcap"):
        return
    mine = [connection for connection in reader.connections if connection.topic == topic]
    lost = 0
    if reader.path.suffix == ".mcap":
        chunks, whole = reader.storage.chunks, []
        for chunk in chunks:
            reader.storage.chunks = [chunk]
            if _is_readable(reader, mine):
                whole.append(chunk)
            else:
                lost += _indexed(reader, mine)
        reader.storage.chunks = whole
    else:
        for connection in mine:
            good: list[Any] = []
            entries, damaged, is_after_loss = reader.indexes[connection.id], -1, True
            for entry in entries:
                reader.indexes[connection.id] = [entry]
                if entry.chunk_pos != damaged and _is_readable(reader, [connection]):
                    good.append(entry)
                    is_after_loss = False
                    continue
                if not is_after_loss:
                    good.pop()
                is_after_loss = True
                # Without this chunk, which cannot be decompressed.
                damaged = damaged if reader.current_chunk[0] == entry.chunk_pos else entry.chunk_pos
            reader.indexes[connection.id] = good
            lost += len(entries) - len(good)
    if lost:
        what = f"{lost} messages of '{topic}' are lost, the others were read"
        yield f"{reader.path.name} is damaged in the middle: {what}"


def _is_readable(reader: Any, connections: Sequence[Connection]) -> bool:
    try:
        for _ in _messages(reader, connections):
            pass
    except MemoryError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # the disk is damaged, not the log
        return False
    return True


def _indexed(reader: Any, connections: Sequence[Connection]) -> int:
    """Return the number of messages of some topics in the chunks of an MCAP file, as its index states it."""
    return sum(chunk.channel_count.get(topic.id, 0) for chunk in reader.storage.chunks for topic in connections)


def files_of(folder: Path, name: str) -> Iterator[str]:
    """Yield the names of the files of a rosbag2 folder. Raises RecordingError."""
    if not (folder / METADATA).is_file():
        yield from _storages_in(folder)
        return
    yield METADATA
    with _as_recording_error(name):
        # The names begin with the name of the folder in logs of Foxy.
        names = [Path(str(path)).name for path in _information(folder / METADATA)["relative_file_paths"]]
        # A recorder that is killed has not compressed its last file.
        yield from (
            next(
                (file for file in (name, f"{name}.zstd", name.removesuffix(".zstd")) if (folder / file).exists()), name
            )
            for name in names
        )


def _storages_in(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir() if file.name.endswith(FILES[2:]))


def _information(metadata: Path) -> dict[str, Any]:
    import yaml

    if (text := read_at_most(metadata, _MAX_METADATA_BYTES)) is None:
        raise RecordingError(f"its {METADATA} is larger than {_MAX_METADATA_BYTES // 1_000_000} MB")
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    if not isinstance(information, dict):
        raise RecordingError(f"its {METADATA} has no information about the log")
    return information


class _Storage(Protocol):
    """A reader of one file of a log."""

    @property
    def connections(self) -> list[Connection]:
        """The topics."""

    def messages(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time of receipt in ns and data of all messages of some connections."""


@contextmanager
def _opened(file: Path, notes: list[str]) -> Iterator[_Storage]:
    """Open a file of a log; files of other forms are brought into one that `rosbags` reads. Notes are added."""
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    suffix = Path(file.name.removesuffix(".zstd").removesuffix(".active")).suffix
    journals = [journal for end in ("-wal", "-journal") if (journal := file.with_name(file.name + end)).is_file()]
    try:
        with ExitStack() as stack:
            if file.suffix == ".zstd":
                file = _unpacked(file, Path(stack.enter_context(TemporaryDirectory())))
            elif suffix == ".db3" and any(journal.stat().st_size for journal in journals):
                file = _finished(file, journals, Path(stack.enter_context(TemporaryDirectory())))
                notes.append(f"{file.name} was not closed by its recorder: its {journals[0].name} is read, too")
            if suffix == ".mcap":
                try:
                    with Reader2(file) as indexed:
                        # `rosbags` reads only messages in the index. Messages outside of chunks have no index, and
                        # writers may leave out the index of the messages in a chunk.
                        log: Any = indexed.storage
                        counts = [sum(chunk.channel_count.values()) for chunk in log.chunks]
                        is_indexed = bool(counts) and all(counts) and sum(counts) == indexed.message_count
                except MemoryError:
                    raise
                except Exception:  # noqa: BLE001 - readers raise many types for damaged logs
                    is_indexed = False
                if not is_indexed:
                    yield stack.enter_context(ScannedMcap(file))
                    return
            reader: Reader1 | Reader2 | ScannedLog
            try:
                reader = Reader1(file) if suffix == ".bag" else Reader2(file)
                stack.enter_context(reader)
            except Exception:  # noqa: BLE001 - see above
                reader = stack.enter_context(SCANNERS[suffix](file))
            yield reader
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001 - see above
        what = str(error) or "the log is damaged"
        raise RecordingError(f"the log cannot be read: {type(error).__name__}: {what}") from None


def _unpacked(file: Path, folder: Path) -> Path:
    """Decompress a file into a folder."""
    target, size = folder / file.stem, 0
    with open_regular(file, follow_link=True) as packed, zstd().open(packed, "rb") as source, target.open("wb") as copy:
        while block := source.read(_BLOCK_BYTES):
            size += len(block)
            if size > MAX_UNPACKED_BYTES:
                raise RecordingError(f"{file.name} has more than {MAX_UNPACKED_BYTES // 10**9} GB when it is unpacked")
            copy.write(block)
    return target


def _finished(file: Path, journals: Sequence[Path], folder: Path) -> Path:
    """Return a copy of a database, in a folder, with the messages of its journals."""
    for path in (file, *journals):
        with open_regular(path, follow_link=False) as source, (folder / path.name).open("wb") as copy:
            shutil.copyfileobj(source, copy)
    database = sqlite3.connect(folder / file.name)
    database.execute("PRAGMA journal_mode=DELETE").fetchall()
    database.close()
    return folder / file.name


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


def _recorded(storages: Sequence[_Storage], selection: MessageSelection) -> Recorded:
    topic, connections = selection.topic, _connections(storages, selection)
    clock = _clock_of(storages) if selection.stamps == "clock" else None
    content_of, decoded = TYPES[connections[0].msgtype].content, _decoder(connections)
    rows: list[TimedRow] = []
    receipts: list[int] = []
    read = 0
    too_many = f"the log has more than {MAX_ROWS:,} messages of '{topic}': keep only the part to replay"
    if sum(connection.msgcount for connection in connections) > MAX_ROWS:
        raise RecordingError(too_many)
    for connection, receipt, data in (record for storage in storages for record in _messages(storage, connections)):
        if read == MAX_ROWS:
            raise RecordingError(too_many)
        read += 1
        try:
            message = decoded(connection, data)
            content = content_of(message, selection)
            if content is not None:
                rows.append((_stamp(message) if selection.stamps == "header" else receipt, content))
                receipts.append(receipt)
        except MessageError as error:
            raise RecordingError(f"message {read} of '{topic}': {error}") from None
    if not rows:
        empty = f"none of the {read} messages of '{topic}' has a finite value"
        raise RecordingError(empty if read else f"the log has no message of '{topic}'")
    orders = [_recorded_times(storage, topic) for storage in storages]
    times = [time_ns for order in sorted(filter(None, orders)) for time_ns in order]
    _refuse_falling(times, f"'{topic}': its time of receipt", "split the log there", "replay", _MAX_DISORDER_NS)
    # The messages of an indexed file are in order, but files may come in any order.
    rows = [rows[place] for place in sorted(range(len(rows)), key=receipts.__getitem__)]
    if selection.stamps == "header":
        remedy = "remove 'stamps' to use the times of receipt"
        _refuse_falling([time_ns for time_ns, _ in rows], f"'{topic}': its header.stamp", remedy, "stamps")
    if clock is not None:
        rows = [(time_ns, content) for time_ns, (_, content) in zip(clock([t for t, _ in rows]), rows, strict=True)]
    return Recorded(tuple(rows), read=read, unused={"without a finite value": read - len(rows)})


def _connections(storages: Sequence[_Storage], selection: MessageSelection) -> list[Connection]:
    topic = selection.topic
    connections = [connection for storage in storages for connection in storage.connections]
    chosen = [connection for connection in connections if connection.topic == topic]
    if not chosen:
        names = {connection.topic for connection in connections}
        cut = "; ".join(storage.unfinished for storage in storages if isinstance(storage, ScannedLog) and storage.cut)
        if cut:
            raise RecordingError(f"the log has no readable topic '{topic}': {cut}")
        raise RecordingError(f"the log has no topic '{topic}'{did_you_mean(topic, names)}", "topic")
    if len({connection.msgtype for connection in chosen}) > 1:
        raise RecordingError(f"topic '{topic}' has messages of several types", "topic")
    type_name = chosen[0].msgtype
    if type_name not in TYPES:
        raise RecordingError(
            f"topic '{topic}' has the type {type_name}, which is not supported{did_you_mean(type_name, TYPES)}", "topic"
        )
    if selection.type not in (None, type_name):
        raise RecordingError(
            f"topic '{topic}' has the type {type_name}, but the scenario requires {selection.type}", "type"
        )
    if selection.stamps == "header" and not TYPES[type_name].has_header:
        raise RecordingError(f"messages of the type {type_name} have no header; remove this key", "stamps")
    if type_name == ARRAY and not selection.joints:
        raise RecordingError(f"topic '{topic}' has numbers without names: name their joints in 'joints'", "topic")
    if type_name != ARRAY and selection.joints:
        raise RecordingError(f"messages of the type {type_name} need no names of joints; remove this key", "joints")
    return chosen


def _messages(storage: _Storage, connections: Sequence[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
    """Yield the messages of some topics in a file, decompressed."""
    mine = [connection for connection in storage.connections if connection in connections]
    count = 0
    for connection, receipt, data in storage.messages(mine) if mine else ():
        count += 1
        yield connection, receipt, bytes(zstd().decompress(data)) if data[:4] == _ZSTD_MAGIC else data
    reader: Any = storage
    # A chunk without a checksum may have a hole.
    if (
        mine
        and not isinstance(storage, ScannedLog)
        and reader.path.suffix == ".mcap"
        and count < _indexed(reader, mine)
    ):
        raise ValueError(f"{count} of {_indexed(reader, mine)} messages can be read")


_Decoded = Callable[["Connection", bytes], Any]


def _decoder(connections: Sequence[Connection]) -> _Decoded:
    """Return the function that decodes messages of some topics. Raises RecordingError."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    own = [get_types_from_msg(text, name) for name, text in DEFINITIONS.items()]
    stores = {"cdr": get_typestore(Stores.LATEST), "ros1": get_typestore(Stores.ROS1_NOETIC)}
    for store in stores.values():
        for types in own:
            store.register(types)
    for connection in connections:
        if (encoding := _encoding(connection)) not in stores:
            supported = "only cdr and ros1 are supported"
            raise RecordingError(f"topic '{connection.topic}' is encoded as '{encoding}'; {supported}")
        _refuse_other(connection, stores[encoding], encoding)

    def decoded(connection: Connection, data: bytes) -> Any:
        if _encoding(connection) == "cdr":
            return stores["cdr"].deserialize_cdr(data, connection.msgtype)
        return stores["ros1"].deserialize_ros1(data, connection.msgtype)

    return decoded


def _encoding(connection: Connection) -> str:
    from rosbags.interfaces import ConnectionExtRosbag2

    return connection.ext.serialization_format if isinstance(connection.ext, ConnectionExtRosbag2) else "ros1"


def _refuse_other(connection: Connection, store: Typestore, encoding: str) -> None:
    """Raise RecordingError if a message type has the name of ours, but other fields."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import get_types_from_msg

    name, digest = connection.msgtype, connection.digest
    own = store.hash_rihs01(name) if encoding == "cdr" else store.generate_msgdef(name)[1]
    if not digest and connection.msgdef.format == MessageDefinitionFormat.MSG:
        fields = get_types_from_msg(connection.msgdef.data, name)
        digest = next((f"of {part}" for part, (_, of) in fields.items() if of != store.fielddefs[part][1]), "")
    if digest not in ("", "*", own):
        raise RecordingError(
            f"topic '{connection.topic}' has a type {name} that differs from the one of ROS (digest {digest})"
        )


def _stamp(message: Any) -> int:
    """Return the time in the header of a message, in ns. Raises MessageError."""
    stamp = message.header.stamp
    if not stamp.sec and not stamp.nanosec:
        raise MessageError("its header.stamp is 0; use the time of receipt: remove 'stamps'")
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _recorded_times(storage: _Storage, topic: str) -> list[int]:
    """Return the times of receipt in ns of the messages of a topic, in the order in which a file has them."""
    connections = [connection for connection in storage.connections if connection.topic == topic]
    reader: Any = storage
    if isinstance(storage, ScannedLog):
        return [time_ns for _, time_ns, _ in storage.messages(connections)]
    numbers = [connection.id for connection in connections]
    try:
        if reader.path.suffix == ".bag":
            entries = [entry for number in numbers for entry in reader.indexes[number]]
            return [entry.time for entry in sorted(entries, key=lambda entry: (entry.chunk_pos, entry.offset))]
        if reader.path.suffix == ".db3":
            query = "SELECT id, timestamp FROM messages WHERE topic_id = ?"
            rows = (row for number in numbers for row in reader.storage.dbconn.execute(query, (number,)))
            return [time_ns for _, time_ns in sorted(rows)]
        places: list[tuple[int, int, int]] = []
        for chunk in reader.storage.chunks:
            for number in set(numbers) & chunk.message_index_offsets.keys():
                # Kind and length of the record, channel, length of the list; then time and offset of each message.
                reader.storage.bio.seek(chunk.message_index_offsets[number] + 11)
                size = int.from_bytes(reader.storage.bio.read(4), "little")
                records = struct.iter_unpack("<QQ", reader.storage.bio.read(size))
                places += [(chunk.chunk_start_offset, offset, time_ns) for time_ns, offset in records]
        return [time_ns for *_, time_ns in sorted(places)]
    except (AttributeError, struct.error):
        return []  # this version of rosbags keeps its index elsewhere, or the index is damaged


def _refuse_falling(times: Sequence[int], what: str, remedy: str, key: str, most_ns: int = 0) -> None:
    """Raise RecordingError if times in ns fall by more than `most_ns`."""
    for number, (before, time_ns) in enumerate(pairwise(times), start=2):
        if before - time_ns > most_ns:
            fall = f"{(before - time_ns) / 1e9:g} s earlier than that of the message before"
            raise RecordingError(f"message {number} of {what} is {fall}; {remedy}", key)


def _clock_of(storages: Sequence[_Storage]) -> Callable[[Sequence[int]], list[int]]:
    """Return the function from times of receipt in ns to interpolated times of /clock."""
    connections = [
        connection
        for storage in storages
        for connection in storage.connections
        if connection.topic == _CLOCK and connection.msgtype == _CLOCK_TYPE
    ]
    if not connections:
        raise RecordingError(f"the log has no topic '{_CLOCK}' of the type {_CLOCK_TYPE}", "stamps")
    decoded = _decoder(connections)
    moments = sorted(
        (receipt, int(time.sec) * 1_000_000_000 + int(time.nanosec))
        for storage in storages
        for connection, receipt, data in _messages(storage, connections)
        for time in [decoded(connection, data).clock]
    )
    _refuse_falling([time_ns for _, time_ns in moments], f"'{_CLOCK}': its time", "split the log there", "stamps")
    if not moments:
        raise RecordingError(f"the log has no message of '{_CLOCK}'", "stamps")
    receipts, times = ([moment[place] - moments[0][place] for moment in moments] for place in (0, 1))

    def clock(received: Sequence[int]) -> list[int]:
        since = np.interp([receipt - moments[0][0] for receipt in received], receipts, times)
        return [moments[0][1] + round(seconds) for seconds in since.tolist()]

    return clock
