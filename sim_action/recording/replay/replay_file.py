"""The replay file: reading and writing.

A replay is the recording of one run for `report.html`: gzipped JSON. A file that is read may come from anywhere, so its
sizes and indices are checked.
"""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from sim_action.core.files import open_regular, whole_file
from sim_action.core.wording import system_reason
from sim_action.recording.replay.replay_data import WITHOUT_SCENE, Replay, first_problem
from sim_action.recording.replay.scene_data import SceneData

MAX_PACKED_BYTES: Final = 8_000_000  # the largest size of a file

MAX_UNPACKED_BYTES: Final = 24_000_000
"""The largest unpacked size: 20,000 moments of 30 joints and 50 bodies. Reading takes ten times as much memory."""

_LEVEL: Final = 6  # a higher level takes twice the time and saves almost nothing


class ReplayError(ValueError):
    """An error for a file that is not a valid replay."""


def write_replay(replay: Replay, path: Path) -> None:
    """Write a replay completely or not at all. Raises OSError, or ValueError if it is too large to be read."""
    data = replay.model_dump_json(exclude_defaults=True).encode()
    if len(data) > MAX_UNPACKED_BYTES:
        raise ValueError(
            f"the replay has {len(data) // 1_000_000} MB; the limit is {MAX_UNPACKED_BYTES // 1_000_000} MB"
        )
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:
        file.write(gzip.compress(data, _LEVEL, mtime=0))


def read_replay(path: Path) -> Replay:
    """Read a replay file, which may come from anywhere. Raises ReplayError."""
    return ReplayReader().read(path)


class ReplayReader:
    """Reads replay files one after another. Equal scenes, such as those of variations, are read once and shared."""

    def __init__(self) -> None:
        """Start without a known scene."""
        self._scene: SceneData | None = None
        # The beginning of files with the known scene.
        self._beginning = b""

    def read(self, path: Path) -> Replay:
        """Read a replay file, which may come from anywhere. Raises ReplayError."""
        try:
            with open_regular(path, follow_link=False) as file:
                packed = file.read(MAX_PACKED_BYTES + 1)
            return self._parsed(_unpacked(packed))
        except ValidationError as error:
            found = error.errors(include_url=False, include_context=False)[0]
            if found["loc"] == ("version",) and isinstance(version := found.get("input"), int):
                raise ReplayError(f"{path.name}: {_OTHER_VERSION.format(version=version)}") from None
            reason = found["msg"].removeprefix("Value error, ")
        except OSError as error:
            reason = system_reason(error)
        except (ValueError, zlib.error) as error:
            reason = str(error)
        # The error is on a page that others read, so it has no path of this machine.
        raise ReplayError(f"{path.name}: not a valid replay: {reason}")

    def _parsed(self, data: bytes) -> Replay:
        """Return the replay. Raise ValueError."""
        if self._scene is not None and data.startswith(self._beginning):
            rest = data[len(self._beginning) :]
            replay = Replay.model_validate_json(_BEFORE_SCENE + _NO_SCENE + b"," + rest, context=WITHOUT_SCENE)
            # A second scene in the file would replace the first one.
            if replay.scene.links[0].name == replay.scene.robot == _UNNAMED:
                replay = replay.model_copy(update={"scene": self._scene})
                if (problem := first_problem(replay)) is not None:
                    raise ValueError(problem)
                return replay
        replay = Replay.model_validate_json(data)
        scene = replay.scene.model_dump_json(exclude_defaults=True).encode()
        self._scene, self._beginning = replay.scene, _BEFORE_SCENE + scene + b","
        return replay


_OTHER_VERSION: Final = "was written by another version of sim-action (format {version}; this one reads 1 and 2)"
_BEFORE_SCENE: Final = b'{"version":2,"scene":'
_UNNAMED: Final = "?"
_NO_SCENE: Final = b'{"robot":"?","links":[{"name":"?"}]}'


def _unpacked(packed: bytes) -> bytes:
    """Unpack data with a limit, because a small file may unpack to a large one."""
    if len(packed) > MAX_PACKED_BYTES:
        raise ValueError(f"the file has more than {MAX_PACKED_BYTES // 1_000_000} MB")
    unpacker = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    data = unpacker.decompress(packed, MAX_UNPACKED_BYTES + 1)
    if len(data) > MAX_UNPACKED_BYTES:
        raise ValueError(f"the unpacked data has more than {MAX_UNPACKED_BYTES // 1_000_000} MB")
    if not unpacker.eof:
        raise ValueError("the file is truncated")
    return data
