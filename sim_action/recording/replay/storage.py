"""Replay files: written in the scenario's own process, read by others, who trust nothing in them."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from sim_action.core.files import open_regular, whole_file
from sim_action.recording.replay.models import Replay

MOST_BYTES: Final = 8_000_000
"""Of a file."""

MOST_UNPACKED: Final = 24_000_000
"""Of what is in one: 20,000 moments of a robot of 30 joints and 50 bodies. Read, it takes ten times as much memory."""

# More takes twice the time and saves nothing to speak of.
_LEVEL: Final = 6


class ReplayError(ValueError):
    """A file that is no replay."""


def write(replay: Replay, path: Path) -> None:
    """Writes a replay, all of it or nothing. Raises OSError, and ValueError for one that nobody would read."""
    data = replay.model_dump_json(exclude_defaults=True).encode()
    if len(data) > MOST_UNPACKED:
        raise ValueError(f"it would have {len(data) // 1_000_000} MB")
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:
        file.write(gzip.compress(data, _LEVEL, mtime=0))


def read(path: Path) -> Replay:
    """Reads what `write` wrote, which may be a stranger's. Raises ReplayError."""
    try:
        with open_regular(path, follow_link=False) as file:
            packed = file.read(MOST_BYTES + 1)
        return Replay.model_validate_json(_unpacked(packed))
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False, include_context=False)[0]
        raise ReplayError(f"{path}: not a replay: {found['msg']}") from None
    except (OSError, ValueError, zlib.error) as error:
        raise ReplayError(f"{path}: not a replay: {error}") from None


def _unpacked(packed: bytes) -> bytes:
    """A small file may hold much."""
    if len(packed) > MOST_BYTES:
        raise ValueError(f"it has more than {MOST_BYTES // 1_000_000} MB")
    unpacker = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    data = unpacker.decompress(packed, MOST_UNPACKED + 1)
    if len(data) > MOST_UNPACKED:
        raise ValueError(f"it holds more than {MOST_UNPACKED // 1_000_000} MB")
    if not unpacker.eof:
        raise ValueError("it was cut off")
    return data
