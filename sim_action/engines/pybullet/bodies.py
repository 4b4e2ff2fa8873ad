"""Bodies of the world in PyBullet, part by part.

What it has to straighten out, as measured: a compound takes 16 shapes and drops the rest in silence, each body that
stands still costs time at every step unless it is a plain rigid one, a hull is 1 mm larger than its points, and a
heightfield is centred between its lowest and its highest sample and folds its cells along the other diagonal than
MuJoCo.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import pybullet

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.meshes.convex_hull import mass_properties
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart

_MOST_SHAPES: Final = 16
# m, around a hull: without any, a third of all rays would go through it.
_MARGIN: Final = 1e-5
_ROUND: Final = geometry.quaternion_from_rpy(0.0, 0.0, math.pi / 2)


@dataclass(frozen=True, slots=True)
class Piece:
    """One of the engine's bodies, of which a body of the world may be several.

    Attributes:
        shape: the engine's number of its shape.
        pose: of what the engine takes for its middle, in the frame of the body of the world.
        dynamics: what is to be set for it.
    """

    shape: int
    pose: Pose = field(default_factory=Pose)
    dynamics: dict[str, Any] = field(default_factory=dict)


def pieces(client: int, parts: Sequence[Part], mass: float = 0.0) -> Iterator[Piece]:
    """Makes the shapes of a body; with a mass, it is of one part."""
    boxes = [part for part in parts if isinstance(part, BoxPart)]
    for first in range(0, len(boxes), _MOST_SHAPES) if len(boxes) > 1 else ():
        yield Piece(_compound(client, boxes[first : first + _MOST_SHAPES]))
    for part in parts:
        if not isinstance(part, BoxPart) or len(boxes) == 1:
            yield _piece(client, part, mass)


def _compound(client: int, boxes: Sequence[BoxPart]) -> int:
    return int(
        pybullet.createCollisionShapeArray(
            shapeTypes=[pybullet.GEOM_BOX] * len(boxes),
            halfExtents=[[size / 2 for size in box.size_xyz] for box in boxes],
            collisionFramePositions=[box.pose.position_xyz for box in boxes],
            collisionFrameOrientations=[box.pose.orientation_xyzw for box in boxes],
            physicsClientId=client,
        )
    )


def _piece(client: int, part: Part, mass: float) -> Piece:
    if isinstance(part, HullPart):
        return _hull(client, part, mass)
    if isinstance(part, GridPart):
        return _grid(client, part)
    pose = part.pose if isinstance(part, BoxPart) else Pose()
    return Piece(_shape(client, **_properties(part)), pose)


def _shape(client: int, **properties: Any) -> int:
    return int(pybullet.createCollisionShape(**properties, physicsClientId=client))


def _properties(part: BoxPart | CylinderPart | SpherePart | SurfacePart) -> dict[str, Any]:
    if isinstance(part, BoxPart):
        return {"shapeType": pybullet.GEOM_BOX, "halfExtents": [size / 2 for size in part.size_xyz]}
    if isinstance(part, CylinderPart):
        return {"shapeType": pybullet.GEOM_CYLINDER, "radius": part.radius, "height": part.height}
    if isinstance(part, SpherePart):
        return {"shapeType": pybullet.GEOM_SPHERE, "radius": part.radius}
    return {
        "shapeType": pybullet.GEOM_MESH,
        "vertices": part.points_xyz.tolist(),
        "indices": part.triangles.ravel().tolist(),
        "flags": pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
    }


def _hull(client: int, part: HullPart, mass: float) -> Piece:
    points = np.array(part.points_xyz)
    no_margin = {"collisionMargin": _MARGIN}
    if not mass:
        return Piece(_shape(client, shapeType=pybullet.GEOM_MESH, vertices=points.tolist()), Pose(), no_margin)
    # The engine would have its mass in the middle, and spread as that of the box around it.
    weighs = mass_properties(points)
    moments, axes = np.linalg.eigh(weighs.inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    x, y, z = weighs.centre_xyz.tolist()
    pose = Pose((x, y, z), _turned(axes))
    own = (points - weighs.centre_xyz) @ axes
    shape = _shape(client, shapeType=pybullet.GEOM_MESH, vertices=own.tolist())
    return Piece(shape, pose, {**no_margin, "localInertiaDiagonal": (mass * moments).tolist()})


def _turned(axes: Any) -> geometry.Quaternion:
    """The rotation whose columns these are."""
    found = np.linalg.eigh(_quaternion_matrix(axes))[1][:, -1]
    x, y, z, w = found.tolist()
    return (x, y, z, w)


def _quaternion_matrix(m: Any) -> Any:
    """Whose greatest eigenvector is the quaternion of a rotation matrix (Bar-Itzhack, 2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    rows = [
        [xx - yy - zz, 0, 0, 0],
        [yx + xy, yy - xx - zz, 0, 0],
        [zx + xz, zy + yz, zz - xx - yy, 0],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    return np.array(rows) / 3


def _grid(client: int, part: GridPart) -> Piece:
    # A quarter turn makes the other diagonal of each cell the one that it is folded along.
    heights = np.rot90(part.heights, 1)
    rows, columns = heights.shape
    width, depth = part.size_xy
    shape = _shape(
        client,
        shapeType=pybullet.GEOM_HEIGHTFIELD,
        meshScale=[depth / (columns - 1), width / (rows - 1), 1.0],
        heightfieldData=heights.ravel().tolist(),
        numHeightfieldRows=columns,
        numHeightfieldColumns=rows,
    )
    middle = float(heights.min() + heights.max()) / 2
    return Piece(shape, Pose((0.0, 0.0, middle), _ROUND))
