"""Files of convex hulls: write a mesh as a minimal OBJ, keep it in the cache, and read its hulls."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict
from typing import Final

from sim_action.core.content_cache import Entry
from sim_action.core.geometry import Box, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass
from sim_action.meshes.collision_hulls import MeshFacts, hulls_of, unshrunk
from sim_action.meshes.mesh import Mesh, MeshError

FORMAT: Final = 2  # the version of the text and its facts; a new number makes older cache entries unused
_FACTS: Final = b"# facts: "

_MAX_COORDINATE_M: Final = 1e6
"""Limit of coordinates in m. Beyond, the floats of the engines do not resolve millimetres."""


@dataclass(frozen=True, slots=True)
class CleanMesh:
    """A rewritten mesh, and the facts of the original."""

    text: bytes  # the OBJ
    facts: MeshFacts  # of the original
    scale: Vector3  # length in m of one unit of the original

    @property
    def box(self) -> Box:
        """The bounding box in m; a negative scale has mirrored it."""
        ends = zip(self.scale, self.facts.lower_xyz, self.facts.upper_xyz, strict=True)
        (ax, bx), (ay, by), (az, bz) = (sorted((factor * low, factor * high)) for factor, low, high in ends)
        return (ax, ay, az), (bx, by, bz)


def hull_file_name(text: bytes) -> str:
    """Return the file name of a rewritten mesh: the digest of its text."""
    return f"{hashlib.sha256(text).hexdigest()}.obj"


def read_clean_mesh(entry: Entry, scale: Vector3) -> CleanMesh | None:
    """Return the rewritten mesh from the cache, if it is there."""
    text = entry.read()
    if text is None:
        return None
    try:
        stated = json.loads(text.partition(b"\n")[0].removeprefix(_FACTS))
        corners = {corner: tuple(stated[corner]) for corner in ("lower_xyz", "upper_xyz")}
        return CleanMesh(text, MeshFacts(**stated | corners), scale)
    except (ValueError, TypeError, KeyError):
        return None


def write_clean_mesh(entry: Entry, mesh: Mesh, facts: MeshFacts, scale: Vector3, margin: float) -> CleanMesh:
    """Rewrite a mesh and keep it in the cache. Raises MeshError."""
    _check(facts, scale)
    text = _text(facts, hulls_of(mesh, scale, margin))
    entry.write(text)
    return CleanMesh(text, facts, scale)


def _check(facts: MeshFacts, scale: Vector3) -> None:
    reach = [max(abs(low), abs(high)) for low, high in zip(facts.lower_xyz, facts.upper_xyz, strict=True)]
    if not all(0 < abs(factor) < float("inf") for factor in scale):
        raise MeshError("bad-shape", f"has the scale {scale}; expected three finite numbers other than 0")
    if not all(abs(factor) * most <= _MAX_COORDINATE_M for factor, most in zip(scale, reach, strict=True)):
        raise MeshError(
            "bad-shape", f"extends beyond {_MAX_COORDINATE_M:g} m; URDF is in metres: is the file in millimetres?"
        )


def _text(facts: MeshFacts, hulls: Iterable[NDArray[np.float64]]) -> bytes:
    pieces, above = [_FACTS + json.dumps(asdict(facts)).encode() + b"\n"], 0
    for number, points in enumerate(hulls):
        pieces.append(f"o hull_{number}\n{hull_lines(points, above)}".encode())
        above += len(points)
    return b"".join(pieces)


def hull_lines(points: NDArray[np.float64], above: int) -> str:
    """Return the points and faces that refer to each of them, because engines use only referenced points."""
    corners = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points.tolist())
    last = above + len(points)
    faces = ((row, min(row + 1, last), min(row + 2, last)) for row in range(above + 1, last + 1, 3))
    return corners + "".join(f"f {a} {b} {c}\n" for a, b, c in faces)


def read_hull_points(text: bytes) -> list[NDArray[np.float64]]:
    """Return the points (P, 3) in m of each hull of a rewritten mesh."""
    hulls = list[list[list[float]]]()
    for line in text.decode("ascii").splitlines():
        kind, *values = line.split()
        if kind == "o":
            hulls.append([])
        elif kind == "v":
            hulls[-1].append([float(value) for value in values])
    return [np.array(points) for points in hulls]


def read_unshrunk_points(text: bytes, margin: float) -> list[NDArray[np.float64]]:
    """Return the points (P, 3) in m of each hull of a rewritten mesh, before they were shrunk by the margin."""
    return [unshrunk(points, margin) for points in read_hull_points(text)]
