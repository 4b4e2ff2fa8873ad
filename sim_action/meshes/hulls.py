"""What of a mesh an engine collides with: the points of convex hulls."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from sim_action.core.geometry import Vector3
from sim_action.meshes.convexity import is_convex, is_flat
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
_THINNEST: Final = 0.1


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


def hull_points(mesh: Mesh, scale: Vector3, margin: float) -> Iterator[NDArray[np.float64]]:
    """The points (P, 3) of each hull, in m, drawn in by the margin that the engine puts around it."""
    import numpy as np

    for triangles in _hulls(mesh):
        points, _ = compacted(mesh.points_xyz, triangles)
        yield _drawn_in(_outermost(points * np.array(scale)), margin)


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


def _drawn_in(points: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    """Points whose hull, with the margin around it, is as large as the hull was: exactly along the axes.

    So is a box, a sphere, and a wheel about an axis, but for rounded edges; anything else within the margin.
    """
    import numpy as np

    lower, upper = points.min(axis=0), points.max(axis=0)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    kept = np.maximum(1 - margin / np.where(half > 0, half, np.inf), _THINNEST)
    moved: NDArray[np.float64] = middle + (points - middle) * kept
    return moved


def _vector(values: NDArray[np.float64]) -> Vector3:
    x, y, z = values.tolist()
    return (x, y, z)
