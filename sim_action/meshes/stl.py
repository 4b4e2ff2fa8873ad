"""Read STL, binary and ASCII."""

from __future__ import annotations

import itertools
import math
import re
from array import array
from typing import Final

from sim_action.core.wording import shown
from sim_action.meshes.mesh import (
    MAX_BINARY_TRIANGLES,
    Mesh,
    MeshError,
    mesh_of,
    refuse_more_parts,
    refuse_more_triangles,
)

_HEADER_BYTES: Final = 84
_TRIANGLE_BYTES: Final = 50

_VERTEX: Final = rb"\s+vertex\s+(\S+)\s+(\S+)\s+(\S+)"
_FACET: Final = re.compile(
    rb"\s*facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop" + 3 * _VERTEX + rb"\s+endloop\s+endfacet(?=\s)",
    re.IGNORECASE,
)
_BEGIN: Final = re.compile(rb"\s*solid(?:[ \t][^\n]*|\r)?\n", re.IGNORECASE)
_NOTHING: Final = re.compile(rb"\s*\Z")
_END: Final = re.compile(rb"\s*endsolid(?:[ \t][^\n]*|\r)?(?:\n|$)", re.IGNORECASE)


def read_stl(data: bytes) -> Mesh:
    """Read the bytes of a file. Raises MeshError."""
    count = int.from_bytes(data[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    size = _HEADER_BYTES + count * _TRIANGLE_BYTES
    # The size distinguishes the two. The start does not: many binary headers begin with "solid", too.
    if len(data) == size:
        return _read_binary(data, count)
    if _BEGIN.match(data) and b"\0" not in data:
        return _read_ascii(data)
    if len(data) < _HEADER_BYTES:
        raise MeshError(
            "broken-mesh", f"is not an STL file: it has only {len(data)} bytes and does not begin with 'solid'"
        )
    message = f"its header announces {count:,} triangles, which need {size:,} bytes, but it has {len(data):,}"
    raise MeshError("broken-mesh", f"is not an STL file, or was cut off: {message}")


def _read_binary(data: bytes, count: int) -> Mesh:
    import numpy as np

    refuse_more_triangles(count, MAX_BINARY_TRIANGLES)
    # The corners as one item of 36 bytes, which are copied at once.
    layout = np.dtype([("normal", "V12"), ("corners", "V36"), ("attributes", "V2")])
    corners = np.frombuffer(data, layout, count, _HEADER_BYTES)["corners"].copy().view("<f4").reshape(-1, 3)
    with np.errstate(invalid="ignore"):  # a signalling NaN
        return mesh_of(corners, [slice(0, count)])


def _read_ascii(data: bytes) -> Mesh:
    import numpy as np

    corners, ends, at = array("d"), [0], 0
    while not _NOTHING.match(data, at):
        at = _read_solid(data, at, corners)
        ends.append(len(corners) // 9)
        refuse_more_parts(len(ends) - 1)
    parts = [slice(start, end) for start, end in itertools.pairwise(ends)]
    return mesh_of(np.array(corners).reshape(-1, 3), parts)


def _read_solid(data: bytes, at: int, corners: array[float]) -> int:
    """Read one solid and return its end."""
    begin = _BEGIN.match(data, at)
    if begin is None:
        raise _unexpected(data, at, "'solid' or the end of the file")
    at = begin.end()
    while facet := _FACET.match(data, at):
        corners.extend(_coordinates(facet, data))
        refuse_more_triangles(len(corners) // 9)
        at = facet.end()
    end = _END.match(data, at)
    if end is None:
        raise _unexpected(data, at, "a whole facet or 'endsolid'")
    return end.end()


def _coordinates(facet: re.Match[bytes], data: bytes) -> tuple[float, ...]:
    try:
        found = tuple(map(float, facet.groups()))
    except ValueError:
        found = (math.nan,)
    if not math.isfinite(sum(found)):
        raise MeshError("broken-mesh", "a facet has a vertex that is not three finite numbers", _line(data, facet))
    return found


def _unexpected(data: bytes, at: int, wanted: str) -> MeshError:
    rest = data[at : at + 200].lstrip()
    found = shown(rest.split(b"\n")[0].decode("latin-1").strip()) if rest else "nothing: was the file cut off?"
    line = data.count(b"\n", 0, at + len(data[at : at + 200]) - len(rest)) + 1
    return MeshError("broken-mesh", f"expected {wanted}, found {found}", line)


def _line(data: bytes, match: re.Match[bytes]) -> int:
    return data.count(b"\n", 0, match.start(1)) + 1
