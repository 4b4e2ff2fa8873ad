"""Pieces: what links and bodies are drawn as, before meshes have come down to their budget."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_action import geometry
from sim_action.convex_hull import hull_faces
from sim_action.geometry import Pose, Vector3
from sim_action.hull_file import hull_points
from sim_action.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart
from sim_action.rendering.hulls import outermost
from sim_action.rendering.picture import Colour
from sim_action.replay.grids import coarse_surface
from sim_action.replay.shapes import BoxShape, CapsuleShape, CylinderShape, EllipsoidShape, PoseNumbers, Shape, numbers
from sim_action.replay.simplification import FloatArray, IntArray, Triangles
from sim_action.robot_model import Shape as RobotShape


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """Triangles in the frame of what they are part of, turned and moved by `pose`."""

    surface: Triangles
    pose: PoseNumbers
    color: Colour


Piece = Shape | MeshPiece


def pose_numbers(pose: Pose) -> PoseNumbers:
    """A pose as it is stored."""
    x, y, z = numbers(pose.position_xyz)
    qx, qy, qz, qw = numbers(pose.orientation_xyzw)
    return (x, y, z, qx, qy, qz, qw)


def of_robot_shape(shape: RobotShape, color: Colour) -> Iterator[Piece]:
    """What is neither plain nor a mesh that was rewritten is seen as the box around it; a plane is not seen.

    Raises OSError.
    """
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(shape.pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)))
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    if shape.hulls:
        for points in hull_points(Path(shape.hulls)):
            yield from _hull(points, pose_numbers(shape.pose), color)
    elif shape.kind != "plane":
        yield plain_shape(shape.kind, half, pose_numbers(middle), color)


def plain_shape(kind: str, half: Vector3, pose: PoseNumbers, color: Colour) -> Shape:
    """A shape that has its frame in its middle, and reaches so far from it along its axes, in m."""
    x, y, z = numbers(half)
    if kind in {"sphere", "ellipsoid"}:
        return EllipsoidShape(kind="ellipsoid", half=(x, y, z), pose=pose, color=color)
    if kind == "cylinder":
        return CylinderShape(kind="cylinder", radius=x, length=2 * z, pose=pose, color=color)
    if kind == "capsule":
        return CapsuleShape(kind="capsule", radius=x, length=max(0.0, 2 * (z - x)), pose=pose, color=color)
    return BoxShape(kind="box", size=(2 * x, 2 * y, 2 * z), pose=pose, color=color)


def of_part(part: Part, color: Colour) -> Iterator[Piece]:
    """A part of a body of the world."""
    here = pose_numbers(Pose())
    if isinstance(part, BoxPart):
        x, y, z = numbers(part.size_xyz)
        yield BoxShape(kind="box", size=(x, y, z), pose=pose_numbers(part.pose), color=color)
    elif isinstance(part, CylinderPart):
        yield CylinderShape(kind="cylinder", radius=part.radius, length=part.height, pose=here, color=color)
    elif isinstance(part, SpherePart):
        yield EllipsoidShape(kind="ellipsoid", half=(part.radius,) * 3, pose=here, color=color)
    elif isinstance(part, HullPart):
        yield from _hull(np.array(part.points_xyz), here, color)
    elif isinstance(part, GridPart):
        yield MeshPiece(coarse_surface(part), here, color)
    else:
        yield MeshPiece(Triangles(part.points_xyz, part.triangles), here, color)


def _hull(points: FloatArray, pose: PoseNumbers, color: Colour) -> Iterator[MeshPiece]:
    """What has no volume is not seen."""
    middle = points.mean(axis=0)
    kept = outermost(points - middle) + middle
    faces = hull_faces(kept - middle)
    if faces is not None:
        yield MeshPiece(Triangles(kept, _outwards(kept, faces.astype(np.int64))), pose, color)


def _outwards(points: FloatArray, faces: IntArray) -> IntArray:
    """Faces of a hull, with their corners the way round that shows which side is out."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inwards = ((a - points.mean(axis=0)) * np.cross(b - a, c - a)).sum(axis=1) < 0
    turned = faces.copy()
    turned[inwards] = faces[inwards][:, ::-1]
    return turned
