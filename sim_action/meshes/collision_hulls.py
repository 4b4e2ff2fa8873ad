"""What of a mesh an engine collides with: the points of convex hulls."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from sim_action.core.geometry import Vector3
from sim_action.meshes.mesh import Mesh, compacted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


MAX_HULLS: Final = 256
"""Of a mesh. A mesh of more parts becomes one hull, as screws and cables are not worth a hull each."""

MAX_HULL_POINTS: Final = 1000
"""Of a hull. The engine keeps as many as it is given: it loads slowly with more, and every contact looks at each."""

_AXES: Final[tuple[Vector3, ...]] = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))

# What is thinner than the engine's margin cannot be drawn in by it: so much of it stays.
_MIN_KEPT_SHARE: Final = 0.1


@dataclass(frozen=True, slots=True)
class MeshFacts:
    """What a mesh file holds.

    Attributes:
        format: stl, obj or dae.
        triangles: that have an area.
        vertices: points of these, none twice.
        hulls: how many convex hulls it is to the engine, one for each of its parts.
        shape: convex if the hulls are the mesh; concave if they fill what is hollow or open; flat without a volume.
            Of a mesh of many triangles this is judged by a sample.
        lower_xyz: of the box around it, in the file's units; m for dae, whose unit is applied.
        upper_xyz: of the same.
    """

    format: str
    triangles: int
    vertices: int
    hulls: int
    shape: Literal["convex", "concave", "flat"]
    lower_xyz: Vector3
    upper_xyz: Vector3


def facts_of(name: str, mesh: Mesh) -> MeshFacts:
    """What a mesh holds, read from the format of this name."""
    parts = _hulls(mesh)
    return MeshFacts(
        format=name,
        triangles=sum(map(len, mesh.parts)),
        vertices=len(mesh.points_xyz),
        hulls=len(parts),
        shape=_shape(mesh, parts),
        lower_xyz=_vector(mesh.points_xyz.min(axis=0)),
        upper_xyz=_vector(mesh.points_xyz.max(axis=0)),
    )


def hulls_of(mesh: Mesh, scale: Vector3, margin: float) -> Iterator[NDArray[np.float64]]:
    """The points (P, 3) of each hull, in m, drawn in by the margin that the engine puts around it."""
    import numpy as np

    for triangles in _hulls(mesh):
        points, _ = compacted(mesh.points_xyz, triangles)
        yield _shrunk(_outermost(points * np.array(scale)), margin)


def _hulls(mesh: Mesh) -> tuple[NDArray[np.int64], ...]:
    """The triangles of each hull. Where a part is flat, the parts are faces of one body rather than bodies."""
    import numpy as np

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
    """The points that reach furthest in one of many directions; all of them, if they are not too many.

    The hull of those left lies within 0.3 % of the body's extent of the hull of all; a box keeps its size.
    """
    from sim_action.meshes.convex_hull import furthest, spread_directions

    if len(points) <= MAX_HULL_POINTS:
        return points
    return furthest(points, (*_AXES, *spread_directions(MAX_HULL_POINTS - len(_AXES))))


def _shrunk(points: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    """Points whose hull, with the margin around it, is as large as the hull was: exactly along the axes.

    So is a box, a sphere, and a wheel about an axis, but for rounded edges; anything else within the margin.
    """
    import numpy as np

    lower, upper = points.min(axis=0), points.max(axis=0)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    kept = np.maximum(1 - margin / np.where(half > 0, half, np.inf), _MIN_KEPT_SHARE)
    moved: NDArray[np.float64] = middle + (points - middle) * kept
    return moved


def _vector(values: NDArray[np.float64]) -> Vector3:
    x, y, z = values.tolist()
    return (x, y, z)


# Of the largest extent: how far the points of what is flat may be off.
_FLAT: Final = 1e-5
# Of the largest extent: how far a point may lie before a plane of what is convex. Files hold 6 digits.
_CONVEX: Final = 1e-4
# Of the whole sphere about a point within: how much of it a closed surface may fail to cover.
_OPEN: Final = 1e-3
# Products of planes and points that the look for convexity may take: some ms.
_MAX_PRODUCTS: Final = 1_000_000
_PLANES_AT_A_TIME: Final = 64


def is_flat(points: NDArray[np.float64]) -> bool:
    """Whether there is a plane that all points lie in."""
    import numpy as np

    apart = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(np.einsum("pi,pj->ij", apart, apart))
    return bool(np.ptp(_along(apart, axes[None, :, 0])) <= _FLAT * np.ptp(points, axis=0).max())


def is_convex(points_xyz: NDArray[np.float64], triangles: NDArray[np.int64], sharers: int = 1) -> bool:
    """Whether the triangles are the surface of their convex hull: all of it, and nothing else.

    Of many triangles a sample is judged, of fewer if so many parts share the time that this may take.
    """
    import numpy as np

    used, rows = compacted(points_xyz, triangles)
    points = used - used.mean(axis=0)
    points /= np.abs(points).max()
    corners = points[rows]
    if _solid_angles(corners).sum() < 4 * np.pi * (1 - _OPEN):
        return False
    step = max(1, len(corners) * len(points) * sharers // _MAX_PRODUCTS)
    corners = corners[::step]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for start in range(0, len(corners), _PLANES_AT_A_TIME):
        planes = slice(start, start + _PLANES_AT_A_TIME)
        ahead = _along(points, normals[planes]) - (normals[planes] * corners[planes, 0]).sum(axis=1, keepdims=True)
        # Which side is out is left open: not every file keeps to it.
        if (np.minimum(ahead.max(axis=1), -ahead.min(axis=1)) > _CONVEX).any():
            return False
    return True


def _along(points: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each point (P, 3) is along each direction (D, 3): (D, P).

    Written out, as a product of matrices would wake threads that cost more than they help with.
    """
    x, y, z = directions[:, :1], directions[:, 1:2], directions[:, 2:]
    distances: NDArray[np.float64] = x * points[:, 0] + y * points[:, 1] + z * points[:, 2]
    return distances


def _solid_angles(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much of the sphere about the origin each triangle covers (van Oosterom and Strackee, 1983)."""
    import numpy as np

    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    angles: NDArray[np.float64] = np.abs(2 * np.arctan2(volume, below))
    return angles
