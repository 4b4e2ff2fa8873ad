"""Convex hulls of a mesh for collisions: the facts of a mesh, and files of hulls.

A file is a minimal OBJ in the cache, whose hulls are read again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any, Final, Literal

from sim_action.core.files import Entry
from sim_action.core.geometry import Box, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass
from sim_action.meshes.mesh import Mesh, MeshError, compacted

MAX_HULLS: Final = 256  # Limit of hulls per mesh. A mesh with more parts becomes one hull.
MAX_HULL_POINTS: Final = 1000  # Limit of points per hull. More make loading and every contact slower.
_AXES: Final[tuple[Vector3, ...]] = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))

# The least share of an extent that shrinking keeps, for hulls that are thinner than the margin.
_MIN_KEPT_SHARE: Final = 0.1


@dataclass(frozen=True, slots=True)
class MeshFacts:
    """The facts of a mesh file."""

    format: str  # stl, obj or dae
    triangles: int  # number of triangles with an area
    vertices: int  # number of distinct points of these
    hulls: int  # number of convex hulls, one per part
    # convex if the hulls equal the mesh; concave if they fill hollow or open regions; flat without a volume. A sample
    # of the triangles is tested if there are many.
    shape: Literal["convex", "concave", "flat"]
    lower_xyz: Vector3  # lower corner of the bounding box in the file's units; for dae in m
    upper_xyz: Vector3  # upper corner


def facts_of(name: str, mesh: Mesh) -> MeshFacts:
    """Return the facts of a mesh that was read from this format."""
    parts = _hulls(mesh)
    return MeshFacts(
        format=name,
        triangles=sum(map(len, mesh.parts)),
        vertices=len(mesh.points_xyz),
        hulls=len(parts),
        shape=_shape(mesh, parts),
        lower_xyz=_vector([column.min() for column in mesh.points_xyz.T]),
        upper_xyz=_vector([column.max() for column in mesh.points_xyz.T]),
    )


def hulls_of(mesh: Mesh, scale: Vector3, margin: float) -> Iterator[NDArray[np.float64]]:
    """Yield the points (P, 3) of each hull in m, shrunk by the margin that the engine adds."""
    for triangles in _hulls(mesh):
        points, _ = compacted(mesh.points_xyz, triangles)
        yield shrunk(_outermost(points * np.array(scale)), margin)


def _hulls(mesh: Mesh) -> tuple[NDArray[np.int64], ...]:
    """Return the triangles of each hull. If a part is flat, the parts are faces of one body, not bodies."""
    if len(mesh.parts) == 1:
        return mesh.parts
    if len(mesh.parts) > MAX_HULLS or any(is_flat(mesh.points_xyz[part.ravel()]) for part in mesh.parts):
        return (np.concatenate(mesh.parts),)
    return mesh.parts


def _shape(mesh: Mesh, parts: tuple[NDArray[np.int64], ...]) -> Literal["convex", "concave", "flat"]:
    if len(parts) == 1 and is_flat(mesh.points_xyz):
        return "flat"
    return "convex" if all(is_convex(mesh.points_xyz, part, len(parts)) for part in parts) else "concave"


def _outermost(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the most distant points in many directions: the hull changes by at most 0.3 % of the extent."""
    from sim_action.meshes.convex_hull import furthest, spread_directions  # it imports this module

    if len(points) <= MAX_HULL_POINTS:
        return points
    return furthest(points, (*_AXES, *spread_directions(MAX_HULL_POINTS - len(_AXES))))


def shrunk(points: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    """Return points whose hull plus the margin has the extents of the original hull.

    A box, a sphere and a wheel about an axis keep their shape except for rounded edges; other shapes differ by at most
    the margin.
    """
    lower, upper = points.min(axis=0), points.max(axis=0)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    kept = np.maximum(1 - margin / np.where(half > 0, half, np.inf), _MIN_KEPT_SHARE)
    moved: NDArray[np.float64] = middle + (points - middle) * kept
    return moved


def unshrunk(points: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    """Return the points of a hull before they were shrunk by the margin."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    thin = half <= margin * _MIN_KEPT_SHARE / (1 - _MIN_KEPT_SHARE)
    share = np.where(thin, _MIN_KEPT_SHARE, half / (half + margin))
    larger: NDArray[np.float64] = middle + (points - middle) / share
    return larger


def _vector(values: Iterable[np.float64]) -> Vector3:
    x, y, z = map(float, values)
    return (x, y, z)


_FLAT: Final = 1e-5  # tolerance for a flat part, relative to the largest extent
_CONVEX: Final = 1e-4  # Tolerance for a convex part, relative to the largest extent. Files hold 6 digits.
_OPEN: Final = 1e-3  # share of the sphere about an inner point that a closed surface may leave open
# Limit for the convexity test in products of planes and points: a few ms.
_MAX_PRODUCTS: Final = 1_000_000
_PRODUCTS_AT_A_TIME: Final = 1 << 16
_TRIANGLES_AT_A_TIME: Final = 1 << 14


def is_flat(points: NDArray[np.float64]) -> bool:
    """Return True if all points lie in one plane."""
    apart = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(np.einsum("pi,pj->ij", apart, apart))
    return bool(np.ptp(_along(apart, axes[None, :, 0])) <= _FLAT * max(np.ptp(column) for column in points.T))


def is_convex(points_xyz: NDArray[np.float64], triangles: NDArray[np.int64], sharers: int = 1) -> bool:
    """Return True if the triangles, or a sample of many, are the surface of their hull; `sharers` of the time limit."""
    used, rows = compacted(points_xyz, triangles)
    points = used - used.mean(axis=0)
    points /= np.abs(points).max()
    step = max(1, len(rows) * len(points) * sharers // _MAX_PRODUCTS)
    # The sample first, because the solid angles of all triangles take longer.
    return _all_behind(points, points[rows[::step]]) and _is_closed(points, rows)


def are_concave(corners: NDArray[np.floating[Any]]) -> bool:
    """Return True if a mesh with these triangles (T, 3, 3) among others cannot be convex."""
    points = corners.reshape(-1, 3).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):  # triangles without an area
        points -= points.mean(axis=0)
        points /= np.abs(points).max()
        return not _all_behind(points, points.reshape(-1, 3, 3))


def _all_behind(points: NDArray[np.float64], corners: NDArray[np.float64]) -> bool:
    """Return True if all points lie on one side of each triangle (T, 3, 3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    at_a_time = max(1, _PRODUCTS_AT_A_TIME // len(points))
    for start in range(0, len(corners), at_a_time):
        planes = slice(start, start + at_a_time)
        ahead = _along(points, normals[planes]) - (normals[planes] * corners[planes, 0]).sum(axis=1, keepdims=True)
        # Either side may be the outside, because not every file orders its corners.
        if (np.minimum(ahead.max(axis=1), -ahead.min(axis=1)) > _CONVEX).any():
            return False
    return True


def _is_closed(points: NDArray[np.float64], rows: NDArray[np.int64]) -> bool:
    """Return True if the triangles (T, 3) surround the origin."""
    starts = range(0, len(rows), _TRIANGLES_AT_A_TIME)
    covered = sum(_solid_angles(points[rows[start : start + _TRIANGLES_AT_A_TIME]]) for start in starts)
    return covered >= 4 * np.pi * (1 - _OPEN)


def _along(points: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = directions[:, :1], directions[:, 1:2], directions[:, 2:]
    distances: NDArray[np.float64] = x * points[:, 0] + y * points[:, 1] + z * points[:, 2]
    return distances


def _solid_angles(corners: NDArray[np.float64]) -> float:
    """Return the sum of the solid angles of triangles about the origin (van Oosterom and Strackee, 1983)."""
    a, b, c = np.ascontiguousarray(corners.transpose(1, 2, 0))
    la, lb, lc = (np.sqrt(_product(corner, corner)) for corner in (a, b, c))
    (bx, by, bz), (cx, cy, cz) = b, c
    volume = _product(a, (by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx))
    below = la * lb * lc + _product(a, b) * lc + _product(b, c) * la + _product(c, a) * lb
    return float(np.abs(2 * np.arctan2(volume, below)).sum())


def _product(one: Iterable[NDArray[np.float64]], other: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    ax, ay, az = one
    bx, by, bz = other
    return ax * bx + ay * by + az * bz


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
    reach = [max(abs(low), abs(high)) for low, high in zip(facts.lower_xyz, facts.upper_xyz, strict=True)]
    if not all(0 < abs(factor) < float("inf") for factor in scale):
        raise MeshError("bad-shape", f"has the scale {scale}; expected three finite numbers other than 0")
    if not all(abs(factor) * most <= _MAX_COORDINATE_M for factor, most in zip(scale, reach, strict=True)):
        raise MeshError(
            "bad-shape", f"extends beyond {_MAX_COORDINATE_M:g} m; URDF is in metres: is the file in millimetres?"
        )
    hulls = hulls_of(mesh, scale, margin)
    pieces = [_FACTS + json.dumps(asdict(facts)).encode() + b"\n"]
    above = 0
    for number, points in enumerate(hulls):
        pieces.append(f"o hull_{number}\n{hull_lines(points, above)}".encode())
        above += len(points)
    text = b"".join(pieces)
    entry.write(text)
    return CleanMesh(text, facts, scale)


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
