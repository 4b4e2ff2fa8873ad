"""Writing of .npz files, with the same bytes as `numpy.savez`.

numpy goes through `zipfile`, with a dozen small writes for each array and a header that is made anew for each. For the
arrays of a short run this takes longer than all other work on its trace.

The format: a ZIP file (PKWARE's APPNOTE) without compression, and in it a .npy file for each array (NEP 1).
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_action.core.files import whole_file

# Larger files are written without a copy in memory, and numpy takes care of those above 4 GB.
_MAX_COPIED_BYTES: Final = 1_000_000

# ZIP64 sizes in each local header, as `zipfile` writes them if it does not know the size before.
_VERSION: Final = 45
_UNIX: Final = 3
_PLACEHOLDER: Final = 0xFFFFFFFF
_ZIP64: Final = 1
# 1980-01-01, the earliest date, and no time of day.
_TIME, _DATE = 0, 0x21
_ATTRIBUTES: Final = 0o600 << 16
_ASCII, _UTF8 = 0, 0x800

# Signature, version, flags, method, time, date, checksum, sizes, lengths of name and extra field.
_LOCAL: Final = struct.Struct("<4s2B4HL2L2H")
# Extra field: its type and length, both sizes.
_SIZES: Final = struct.Struct("<2H2Q")
# As `_LOCAL` with two versions; then length of a comment, disk, attributes (2), place of the local header.
_CENTRAL: Final = struct.Struct("<4s4B4H3L5H2L")
# Signature, disks (2), numbers of entries (2), size and place of the directory, length of a comment.
_END: Final = struct.Struct("<4s4H2LH")


def save_arrays(arrays: Mapping[str, Any], path: Path) -> None:
    """Write a .npz file, completely or not at all. Raise OSError."""
    with whole_file(path) as file:
        if sum(array.nbytes for array in arrays.values()) > _MAX_COPIED_BYTES:
            np.savez(file, **arrays)
        else:
            file.write(packed(arrays))


def packed(arrays: Mapping[str, Any]) -> bytes:
    """Return the content of the .npz file of some arrays, below 4 GB."""
    parts: list[bytes] = []
    directory: list[bytes] = []
    place = 0
    for key, array in arrays.items():
        # As in numpy, an array whose columns lie in a row is stored by columns.
        data = _header(array.dtype, array.shape, by_columns=array.flags.fnc) + array.tobytes("A")
        name, flags = _encoded(f"{key}.npy")
        size, checksum = len(data), zlib.crc32(data)
        known = flags, 0, _TIME, _DATE, checksum
        local = _LOCAL.pack(b"PK\3\4", _VERSION, 0, *known, _PLACEHOLDER, _PLACEHOLDER, len(name), _SIZES.size)
        sizes = _SIZES.pack(_ZIP64, _SIZES.size - 4, size, size)
        central = _CENTRAL.pack(
            b"PK\1\2", _VERSION, _UNIX, _VERSION, 0, *known, size, size, len(name), 0, 0, 0, 0, _ATTRIBUTES, place
        )
        parts += (local, name, sizes, data)
        directory += (central, name)
        place += len(local) + len(name) + len(sizes) + size
    listed = b"".join(directory)
    return b"".join((*parts, listed, _END.pack(b"PK\5\6", 0, 0, len(arrays), len(arrays), len(listed), place, 0)))


def _encoded(name: str) -> tuple[bytes, int]:
    return (name.encode("ascii"), _ASCII) if name.isascii() else (name.encode("utf-8"), _UTF8)


# Runs of one scenario have arrays of the same shapes.
@lru_cache(maxsize=256)
def _header(kind: np.dtype[Any], shape: tuple[int, ...], *, by_columns: bool) -> bytes:
    """Return the beginning of a .npy file, before the numbers."""
    written = io.BytesIO()
    stated = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": by_columns, "shape": shape}
    np.lib.format.write_array_header_1_0(written, stated)
    return written.getvalue()
