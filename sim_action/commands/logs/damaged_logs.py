"""Readers of unfinished and damaged logs of ROS: from the beginning of a file up to its end, or to the first damage."""

from __future__ import annotations

import shutil
import sqlite3
import struct
import sys
from abc import ABC, abstractmethod
from bz2 import BZ2Decompressor
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, BinaryIO, Final, Self, TypeVar
from zlib import crc32

from typing_extensions import override

from sim_action.core.errors import RecordingError
from sim_action.core.files import open_regular

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

MAX_UNPACKED_BYTES: Final = 4_000_000_000  # the size of a compressed file after it is unpacked
_T = TypeVar("_T")
_Message = tuple[int, int, bytes]  # the number of a connection, the time of receipt in ns, and the data


class ScannedLog(ABC):
    """A reader of one file of a log without an index: `connections` of topics; `cut`: it ends early, or is damaged."""

    remedy: str = ""

    def __init__(self, path: Path) -> None:
        self._path = path
        # Damaged lengths of records are gigabytes, and reading that many bytes needs as much memory.
        self._most = path.stat().st_size
        self.cut = False
        self.connections: list[Connection] = []
        self._opened = ExitStack()

    def __enter__(self) -> Self:
        by_id = {connection.id: connection for connection in self._undamaged(self._connections())}
        self.connections = list(by_id.values())
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    @abstractmethod
    def _connections(self) -> Iterator[Connection]:
        """Yield the connection of each topic, also several times; raise any exception where the file is damaged."""

    @abstractmethod
    def _messages(self) -> Iterator[_Message]:
        """Yield the messages in the order of the file; see _connections for exceptions."""

    @property
    def unfinished(self) -> str:
        """A note on a file that is cut off."""
        return f"{self._path.name} is unfinished or damaged: the messages before the damage were read{self.remedy}"

    def messages(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time of receipt in ns and data of the messages, in the order of the file."""
        by_id = {connection.id: connection for connection in connections}
        for number, time_ns, data in self._undamaged(self._messages()):
            if number in by_id:
                yield by_id[number], time_ns, data

    def _undamaged(self, items: Iterator[_T]) -> Iterator[_T]:
        """Yield the items before the first damage."""
        try:
            yield from items
        except (RecordingError, MemoryError):
            raise
        except Exception as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise  # the disk is damaged, not the log
            self.cut = True


# The magic bytes of MCAP, and the kind of its first record.
_HEAD: Final = b"\x89MCAP0\r\n\x01"
_RECORD_HEAD: Final = struct.Struct("<BQ")
# Times of the first and the last message, size and checksum of the records, length of the compression's name.
_CHUNK_HEAD: Final = struct.Struct("<QQQII")
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F


class ScannedMcap(ScannedLog):
    """A reader of an MCAP file: without an index, unfinished, or with messages of ROS 1."""

    remedy = " ('mcap recover' repairs it)"

    @override
    def _connections(self) -> Iterator[Connection]:
        from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat

        formats = {"ros1msg": MessageDefinitionFormat.MSG, "ros2msg": MessageDefinitionFormat.MSG}
        schemas: dict[int, tuple[str, MessageDefinition]] = {}
        for kind, data in self._records():
            if kind == _SCHEMA:
                name, encoding, text = _texts(data[2:], 3)
                of = MessageDefinition(formats.get(encoding, MessageDefinitionFormat.NONE), text)
                schemas[struct.unpack_from("<H", data)[0]] = name, of
            elif kind == _CHANNEL:
                channel, schema = struct.unpack_from("<HH", data)
                topic, encoding = _texts(data[4:], 2)
                name, definition = schemas.get(schema, ("", MessageDefinition(MessageDefinitionFormat.NONE, "")))
                extra = ConnectionExtRosbag2(encoding, [])
                yield Connection(channel, topic, _type(name), definition, "", 0, extra, self)

    @override
    def _messages(self) -> Iterator[_Message]:
        for kind, data in self._records():
            if kind == _MESSAGE:
                channel, _, time_ns = struct.unpack_from("<HIQ", data)
                yield channel, time_ns, data[22:]

    def _records(self) -> Iterator[tuple[int, bytes]]:
        """Yield kind and data of the records of the data section, also of those in chunks."""
        with open_regular(self._path, follow_link=True) as file:
            if file.read(len(_HEAD)) != _HEAD:
                raise RecordingError("the log cannot be read: it does not begin as MCAP does")
            file.seek(len(_HEAD) - 1)
            while True:
                head = file.read(_RECORD_HEAD.size)
                kind, size = _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (_CHUNK, 1)
                data = file.read(min(size, self._most))
                self.cut = len(data) < size
                if kind == _CHUNK:
                    yield from _records_in(_chunk(data, is_whole=not self.cut))
                elif not self.cut:
                    yield kind, data
                if self.cut or kind == _DATA_END:
                    return


def _chunk(data: bytes, *, is_whole: bool) -> bytes:
    """Return the decompressed records of a chunk; the beginning of them if it is cut off. Raises ValueError."""
    if len(data) < _CHUNK_HEAD.size:
        return b""
    *_, size, checksum, length = _CHUNK_HEAD.unpack_from(data)
    start = _CHUNK_HEAD.size + length
    compression, packed = data[_CHUNK_HEAD.size : start].decode(), data[start + 8 :]
    if compression == "lz4":
        records = _lz4(packed)
    elif compression == "zstd":
        records = bytes(zstd().ZstdDecompressor().decompress(packed))
    else:
        records = packed
    # A checksum of 0 means that there is none.
    if is_whole and (len(records) != size or checksum not in (0, crc32(records))):
        raise ValueError("a chunk is damaged")
    return records


def _records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and data of the whole records in a chunk."""
    place = 0
    while place + _RECORD_HEAD.size <= len(data):
        kind, size = _RECORD_HEAD.unpack_from(data, place)
        place += _RECORD_HEAD.size + size
        if place <= len(data):
            yield kind, data[place - size : place]


def _texts(data: bytes, count: int) -> Iterator[str]:
    """Yield texts that begin with their lengths."""
    place = 0
    for _ in range(count):
        (size,) = struct.unpack_from("<I", data, place)
        yield data[place + 4 : place + 4 + size].decode()
        place += 4 + size


def _type(name: str) -> str:
    return name if "/msg/" in name else name.replace("/", "/msg/")


def _lz4(packed: bytes) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    return bytes(LZ4FrameDecompressor().decompress(packed))


def zstd() -> Any:
    """Return the module that decompresses zstd."""
    if sys.version_info >= (3, 14):
        from compression import zstd  # only compressed logs need it
    else:
        from backports import zstd  # only compressed logs need it
    return zstd


_BAG_HEAD: Final = b"#ROSBAG V2.0\n"
_BAG_MESSAGE, _BAG_CHUNK, _BAG_CONNECTION = b"\x02", b"\x05", b"\x07"
_UNPACK: Final[Mapping[bytes, Callable[[bytes], bytes]]] = MappingProxyType(
    {b"none": bytes, b"bz2": lambda packed: BZ2Decompressor().decompress(packed), b"lz4": _lz4}
)
_Fields = dict[bytes, bytes]


class _ScannedBag(ScannedLog):
    """A reader of a rosbag1 without a valid index, as a recorder leaves it that is killed."""

    @override
    def _connections(self) -> Iterator[Connection]:
        from rosbags.interfaces import Connection, ConnectionExtRosbag1, MessageDefinition, MessageDefinitionFormat

        self.cut = True
        for fields, data in self._records():
            if fields[b"op"] == _BAG_CONNECTION:
                number = int.from_bytes(fields[b"conn"], "little")
                of = _fields(data)
                text = MessageDefinition(MessageDefinitionFormat.MSG, of[b"message_definition"].decode())
                names = fields[b"topic"].decode(), _type(of[b"type"].decode())
                extra = ConnectionExtRosbag1(None, None)
                yield Connection(number, *names, text, of[b"md5sum"].decode(), 0, extra, self)

    @override
    def _messages(self) -> Iterator[_Message]:
        for fields, data in self._records():
            if fields[b"op"] == _BAG_MESSAGE:
                seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
                yield int.from_bytes(fields[b"conn"], "little"), seconds * 10**9 + nanoseconds, data

    def _records(self) -> Iterator[tuple[_Fields, bytes]]:
        """Yield header and data of whole records, also of those in chunks, up to the first damage."""
        with open_regular(self._path, follow_link=True) as file:
            if file.read(len(_BAG_HEAD)) != _BAG_HEAD:
                raise RecordingError("the log cannot be read: it does not begin as a rosbag does")
            for fields, data in _bag_records(file, self._most):
                if fields[b"op"] != _BAG_CHUNK:
                    yield fields, data
                elif (unpack := _UNPACK.get(fields[b"compression"])) is not None:
                    records = unpack(data)
                    yield from _bag_records(BytesIO(records), len(records), is_whole=True)


def _bag_records(stream: BinaryIO, most: int, *, is_whole: bool = False) -> Iterator[tuple[_Fields, bytes]]:
    """Yield header and data of records of at most so many bytes; without `is_whole`, also a chunk that is cut off."""
    while len(size := stream.read(4)) == 4:
        fields = _fields(stream.read(min(int.from_bytes(size, "little"), most)))
        length = int.from_bytes(stream.read(4), "little")
        data = stream.read(min(length, most))
        if b"op" not in fields or (len(data) < length and (is_whole or fields[b"op"] != _BAG_CHUNK)):
            return
        yield fields, data


def _fields(header: bytes) -> _Fields:
    fields: _Fields = {}
    place = 0
    while place < len(header):
        (size,) = struct.unpack_from("<I", header, place)
        name, _, value = header[place + 4 : place + 4 + size].partition(b"=")
        fields[name] = value
        place += 4 + size
    return fields


class _ScannedDatabase(ScannedLog):
    """A reader of a rosbag2 of SQLite that lacks pages, without its indices."""

    @override
    def _connections(self) -> Iterator[Connection]:
        from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat

        self.cut = True
        copy = Path(self._opened.enter_context(TemporaryDirectory())) / self._path.name
        with open_regular(self._path, follow_link=True) as source, copy.open("w+b") as target:
            shutil.copyfileobj(source, target)
            size = target.tell()
            target.seek(0)
            page, pages = struct.unpack_from(">H10xI", target.read(32).ljust(32, b"\0"), 16)
            page = 65536 if page == 1 else max(512, page)
            # A page that is cut off looks like a whole one. SQLite refuses a file with fewer pages than it states.
            target.truncate(size // page * page)
            target.truncate(max(size, min(MAX_UNPACKED_BYTES, page * pages)))
        self._database = sqlite3.connect(f"file:{copy}?mode=ro", uri=True)
        self._opened.callback(self._database.close)
        definition = MessageDefinition(MessageDefinitionFormat.NONE, "")
        topics = "SELECT id, name, type, serialization_format FROM topics"
        for number, topic, kind, encoding in self._database.execute(topics):
            yield Connection(number, topic, kind, definition, "", 0, ConnectionExtRosbag2(encoding, []), self)

    @override
    def _messages(self) -> Iterator[_Message]:
        yield from self._database.execute("SELECT topic_id, timestamp, data FROM messages")


SCANNERS: Final[Mapping[str, type[ScannedLog]]] = MappingProxyType(
    {".bag": _ScannedBag, ".db3": _ScannedDatabase, ".mcap": ScannedMcap}
)
"""The ending of a file -> the reader for it."""
