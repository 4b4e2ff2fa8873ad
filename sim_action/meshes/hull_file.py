"""The cache files of convex hulls: write a mesh as a minimal OBJ, once per content, and read its hulls."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core.files import whole_file
from sim_action.core.geometry import Box, Vector3
from sim_action.meshes.collision_hulls import MeshFacts, hulls_of
from sim_action.meshes.mesh import Mesh, MeshError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# Format version; a new number makes old files unused.
_VERSION: Final = 1

_FACTS: Final = "# facts: "

_MAX_COORDINATE_M: Final = 1e6
"""Limit of coordinates in m. Beyond, the floats of the engines do not resolve millimetres."""


@dataclass(frozen=True, slots=True)
class CleanMesh:
    """A rewritten mesh and the facts of the original; `scale`: length in m of one unit of the original."""

    path: Path
    facts: MeshFacts
    scale: Vector3

    @property
    def box(self) -> Box:
        """The bounding box in m; a negative scale has mirrored it."""
        ends = zip(self.scale, self.facts.lower_xyz, self.facts.upper_xyz, strict=True)
        (ax, bx), (ay, by), (az, bz) = (sorted((factor * low, factor * high)) for factor, low, high in ends)
        return (ax, ay, az), (bx, by, bz)


def read_clean_mesh(path: Path, scale: Vector3) -> CleanMesh | None:
    """Return the rewritten mesh if the file exists."""
    try:
        with path.open(encoding="ascii") as file:
            stated = json.loads(file.readline().removeprefix(_FACTS))
        corners = {corner: tuple(stated[corner]) for corner in ("lower_xyz", "upper_xyz")}
        return CleanMesh(path, MeshFacts(**stated | corners), scale)
    except (OSError, ValueError, TypeError, KeyError):
        return None


def write_clean_mesh(path: Path, mesh: Mesh, facts: MeshFacts, scale: Vector3, margin: float) -> CleanMesh:
    """Rewrite a mesh. Raises MeshError."""
    _check(facts, scale)
    _write(path, facts, hulls_of(mesh, scale, margin))
    return CleanMesh(path, facts, scale)


def clean_mesh_name(format_name: str, data: bytes, scale: Vector3, margin: float) -> str:
    """Return the file name of a rewritten mesh, which depends on content, format, scale and margin."""
    digest = hashlib.sha256(json.dumps([_VERSION, format_name, scale, margin]).encode())
    digest.update(data)
    return f"{digest.hexdigest()}.obj"


def _check(facts: MeshFacts, scale: Vector3) -> None:
    reach = [max(abs(low), abs(high)) for low, high in zip(facts.lower_xyz, facts.upper_xyz, strict=True)]
    if not all(0 < abs(factor) < float("inf") for factor in scale):
        raise MeshError("bad-shape", f"has the scale {scale}; expected three finite numbers other than 0")
    if not all(abs(factor) * most <= _MAX_COORDINATE_M for factor, most in zip(scale, reach, strict=True)):
        raise MeshError(
            "bad-shape", f"extends beyond {_MAX_COORDINATE_M:g} m; URDF is in metres: is the file in millimetres?"
        )


def _write(path: Path, facts: MeshFacts, hulls: Iterable[NDArray[np.float64]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:  # another process may write the same mesh
        file.write(f"{_FACTS}{json.dumps(asdict(facts))}\n".encode())
        above = 0
        for number, points in enumerate(hulls):
            file.write(f"o hull_{number}\n{_lines(points, above)}".encode())
            above += len(points)


def _lines(points: NDArray[np.float64], above: int) -> str:
    """Return the points and faces that refer to each of them, because engines use only referenced points."""
    corners = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points.tolist())
    last = above + len(points)
    faces = ((row, min(row + 1, last), min(row + 2, last)) for row in range(above + 1, last + 1, 3))
    return corners + "".join(f"f {a} {b} {c}\n" for a, b, c in faces)


def read_hull_points(path: Path) -> list[NDArray[np.float64]]:
    """Return the points (P, 3) in m of each hull of a hull file. Raises OSError."""
    import numpy as np

    hulls = list[list[list[float]]]()
    for line in path.read_text(encoding="ascii").splitlines():
        kind, *values = line.split()
        if kind == "o":
            hulls.append([])
        elif kind == "v":
            hulls[-1].append([float(value) for value in values])
    return [np.array(points) for points in hulls]
