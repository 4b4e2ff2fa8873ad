"""Read mesh files (STL, OBJ, COLLADA) and rewrite them as convex hulls for the engines.

The engines' own readers crash on a wrong index, hang on a material that is a pipe, and turn unreadable files into
shapes without contacts (see tests/integration/test_meshes.py for PyBullet). They therefore get only text that
`clean_mesh` has made, which holds the points of convex hulls.
"""

from __future__ import annotations

import io
import itertools
import math
import re
from array import array
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final

from sim_action.core.files import Entry, read_at_most
from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.wording import shown
from sim_action.meshes.collada import read_collada
from sim_action.meshes.collision_hulls import FORMAT, CleanMesh, MeshFacts, facts_of, read_clean_mesh, write_clean_mesh
from sim_action.meshes.mesh import (
    MAX_BINARY_TRIANGLES,
    MAX_BYTES,
    MAX_POINTS,
    MAX_TRIANGLES,
    Mesh,
    MeshError,
    mesh_of,
    refuse_more_parts,
    refuse_more_points,
    refuse_more_triangles,
)

__all__ = [
    "MAX_BYTES",
    "MAX_TRIANGLES",
    "READERS",
    "CleanMesh",
    "MeshError",
    "MeshFacts",
    "clean_mesh",
    "mesh_bytes",
    "parsed_mesh",
    "read_mesh",
]


_LFS_POINTER: Final = b"version https://git-lfs"


def read_mesh(path: Path) -> MeshFacts:
    """Return the facts of a mesh file. Raises MeshError."""
    return facts_of(_format(path), _parsed(path, mesh_bytes(path)))


def parsed_mesh(path: Path, data: bytes | None = None) -> Mesh:
    """Return the triangles of a mesh file; `data`: its bytes, if they are known. Raises MeshError."""
    return _parsed(path, mesh_bytes(path) if data is None else data)


def clean_mesh(path: Path, folder: Path | None, scale: Vector3 = (1.0, 1.0, 1.0), margin: float = 0.0) -> CleanMesh:
    """Rewrite a mesh as an OBJ of hulls in metres, for use without a scale; equal files share a cache entry.

    Args:
        path: of the mesh.
        folder: the cache of rewritten meshes; None: there is none.
        scale: `<mesh scale>` of the URDF: the length in m of one unit of the file.
        margin: collision margin in m that the engine adds around a hull; the hulls are shrunk by it.

    Raises MeshError.
    """
    data = mesh_bytes(path)
    entry = Entry.of(folder, "obj", data, FORMAT, "hulls", _format(path), scale, margin)
    cached = read_clean_mesh(entry, scale)
    if cached is not None:
        return cached
    mesh = _parsed(path, data)
    return write_clean_mesh(entry, mesh, facts_of(_format(path), mesh), scale, margin)


def _format(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")


def _parsed(path: Path, data: bytes) -> Mesh:
    if data.startswith(_LFS_POINTER):
        message = "is a Git LFS pointer, not the mesh; fetch it: git lfs pull, or actions/checkout with lfs: true"
        raise MeshError("broken-mesh", message)
    return READERS[_format(path)](data)


def mesh_bytes(path: Path) -> bytes:
    """Return the bytes of a mesh file. Raises MeshError."""
    if _format(path) not in READERS:
        message = f"'{path.suffix}' files are not supported; convert it to one of .{', .'.join(READERS)}"
        raise MeshError("unknown-mesh-format", message)
    try:
        data = read_at_most(path, MAX_BYTES)
    except FileNotFoundError:
        raise MeshError("missing-mesh", "does not exist") from None
    except (OSError, ValueError) as error:  # a NUL in the name
        raise MeshError("broken-mesh", f"cannot be read: {error}") from None
    if data is None:
        message = f"is larger than {MAX_BYTES // 1_000_000} MB; a few thousand triangles are enough for collisions"
        raise MeshError("too-large-mesh", message)
    return data


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
    refuse_more_triangles(count, MAX_BINARY_TRIANGLES)
    corners = _corners(data, count, 1).reshape(-1, 3)
    with np.errstate(invalid="ignore"):  # a signalling NaN
        return mesh_of(corners, [slice(0, count)])


def _corners(data: bytes, count: int, step: int) -> NDArray[np.float32]:
    """Return the corners (N, 3, 3) of every `step`-th triangle of a binary file."""
    # The corners as one item of 36 bytes, which are copied at once.
    layout = np.dtype([("normal", "V12"), ("corners", "V36"), ("attributes", "V2")])
    return np.frombuffer(data, layout, count, _HEADER_BYTES)["corners"][::step].copy().view("<f4").reshape(-1, 3, 3)


def sampled_triangles(data: bytes, most: int) -> tuple[int, NDArray[np.float32]] | None:
    """Return the number of triangles of a binary STL file, and corners (N, 3, 3) of about `most`; else None."""
    count = int.from_bytes(data[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    if len(data) != _HEADER_BYTES + count * _TRIANGLE_BYTES or not count:
        return None
    return count, _corners(data, count, max(1, count // most))


def _read_ascii(data: bytes) -> Mesh:
    corners = array("d")
    ends = [0]
    at = 0
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
        coordinates = tuple(map(float, facet.groups()))
    except ValueError:
        coordinates = (math.nan,)
    if not math.isfinite(sum(coordinates)):
        raise MeshError("broken-mesh", "a facet has a vertex that is not three finite numbers", _line(data, facet))
    return coordinates


def _unexpected(data: bytes, at: int, expected: str) -> MeshError:
    rest = data[at : at + 200].lstrip()
    text = shown(rest.split(b"\n")[0].decode("latin-1").strip()) if rest else "nothing: was the file cut off?"
    line = data.count(b"\n", 0, at + len(data[at : at + 200]) - len(rest)) + 1
    return MeshError("broken-mesh", f"expected {expected}, found {text}", line)


def _line(data: bytes, match: re.Match[bytes]) -> int:
    return data.count(b"\n", 0, match.start(1)) + 1


_BEGINS_A_PART: Final = (b"o", b"g")  # keywords that start a part; like in PyBullet, each part becomes a hull
_MAX_LINES: Final = 5_000_000
_MAX_SHOWN_DIGITS: Final = 30
_MAX_STATEMENT_CHARACTERS: Final = 1_000_000  # limit in characters, more than any real face needs


def read_obj(data: bytes) -> Mesh:
    """Read the bytes of a file. Raises MeshError."""
    if b"\0" in data:
        raise MeshError("broken-mesh", "is not an OBJ file: it contains NUL bytes")
    if data.count(b"\n") > _MAX_LINES:
        raise MeshError("too-large-mesh", f"has more than {_MAX_LINES:,} lines")
    reader = _Reader()
    for number, words in _statements(data):
        reader.take(words, number)
    return reader.mesh()


def _statements(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the words of each statement and its last line; a backslash continues it on the next line."""
    waiting: list[bytes] = []
    for number, line in enumerate(io.BytesIO(data), start=1):
        if len(line) > _MAX_STATEMENT_CHARACTERS or len(waiting) > _MAX_STATEMENT_CHARACTERS:
            raise MeshError(
                "too-large-mesh", f"a statement of more than {_MAX_STATEMENT_CHARACTERS:,} characters", number
            )
        words = line.split()
        if words and words[-1].endswith(b"\\"):
            waiting += [word for word in (*words[:-1], words[-1][:-1]) if word]
        elif waiting:
            yield number, waiting + words
            waiting = []
        elif words:
            yield number, words
    if waiting:
        raise MeshError("broken-mesh", "the last line ends with a continuation backslash: was the file cut off?")


class _Reader:
    """The reader of one file."""

    def __init__(self) -> None:
        self._coordinates = array("d")
        self._points = 0
        # Point numbers as in the file: from 1.
        self._corners = array("q")
        self._starts = [0]
        # The highest point number used before its definition, and its line.
        self._ahead = (0, 0)

    def take(self, words: list[bytes], line: int) -> None:
        keyword = words[0]
        if keyword == b"v":
            self._take_point(words, line)
        elif keyword == b"f":
            self._take_face(words, line)
        elif keyword in _BEGINS_A_PART and self._starts[-1] < len(self._corners):
            self._starts.append(len(self._corners))
            refuse_more_parts(len(self._starts))

    def mesh(self) -> Mesh:
        if self._ahead[0] > self._points:
            raise self._no_such_point(*self._ahead)
        triangles = np.array(self._corners, np.int64).reshape(-1, 3) - 1
        parts = np.split(triangles, [start // 3 for start in self._starts[1:]])
        return mesh_of(np.array(self._coordinates).reshape(-1, 3), parts)

    def _take_point(self, words: list[bytes], line: int) -> None:
        try:
            x, y, z = map(float, words[1:4])
        except ValueError:
            x = y = z = math.nan
        if not math.isfinite(x + y + z):
            raise MeshError("broken-mesh", f"{_quoted(words)}: expected three finite numbers", line)
        self._coordinates.extend((x, y, z))
        self._points += 1
        refuse_more_points(self._points)

    def _take_face(self, words: list[bytes], line: int) -> None:
        if len(words) < 4:  # an edge, which some programs leave in the file
            return
        try:
            # In 1/2/3 only the first number refers to a point.
            named = [int(word.split(b"/", 1)[0]) for word in words[1:]]
        except ValueError:
            raise MeshError("broken-mesh", f"{_quoted(words)}: expected whole numbers as corners", line) from None
        if min(named) < 1 or max(named) > self._points:
            named = [self._counted_from_1(point, line) for point in named]
        first, *others = named
        for second, third in itertools.pairwise(others):
            self._corners.extend((first, second, third))
        refuse_more_triangles(len(self._corners) // 3)

    def _counted_from_1(self, point: int, line: int) -> int:
        """Return the number of a point with a negative index or a definition further down."""
        if point == 0 or point < -self._points or point > MAX_POINTS:
            raise self._no_such_point(point, line)
        if point > max(self._points, self._ahead[0]):
            self._ahead = (point, line)
        return point if point > 0 else self._points + 1 + point

    def _no_such_point(self, point: int, line: int) -> MeshError:
        named = f"{point:,}"
        named = named if len(named) <= _MAX_SHOWN_DIGITS else f"{named[:_MAX_SHOWN_DIGITS]}..."
        if point == 0:
            reason = "points are numbered from 1"
        elif point > MAX_POINTS:
            reason = f"at most {MAX_POINTS:,} are read"
        else:
            reason = f"there are only {self._points:,}"
        return MeshError("mesh-index", f"a face refers to point {named}, but {reason}; export the mesh again", line)


def _quoted(words: list[bytes]) -> str:
    return shown(b" ".join(words)[:100].decode("latin-1"))


READERS: Final[Mapping[str, Callable[[bytes], Mesh]]] = {"stl": read_stl, "obj": read_obj, "dae": read_collada}
"""File extension -> reader."""
