"""Pieces: what links and bodies are drawn as, before meshes have come down to their budget."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.recording.replay.grids import coarse_surface
from sim_action.recording.replay.shapes import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    PoseNumbers,
    Shape,
    numbers,
)
from sim_action.recording.replay.simplification import Triangles
from sim_action.robot.robot_model import Shape as RobotShape
from sim_action.sensors.rendering.colours import Colour
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart


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


def of_robot_shape(shape: RobotShape, color: Colour, hulls: Callable[[str], Triangles | None]) -> Iterator[Piece]:
    """What is neither plain nor a mesh that was rewritten is seen as the box around it; a plane is not seen."""
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(shape.pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)))
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    surface = hulls(shape.hulls) if shape.hulls else None
    if surface is not None:
        yield MeshPiece(surface, pose_numbers(shape.pose), color)
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


def of_parts(parts: Sequence[Part], color: Colour) -> Iterator[Piece]:
    """The parts of a body of the world."""
    here = pose_numbers(Pose())
    hulls = [np.array(part.points_xyz) for part in parts if isinstance(part, HullPart)]
    if hulls:
        from sim_action.recording.replay.hulls import hull_surface

        surface = hull_surface(hulls)
        if surface is not None:
            yield MeshPiece(surface, here, color)
    for part in parts:
        if not isinstance(part, HullPart):
            yield _of_part(part, here, color)


def _of_part(
    part: BoxPart | CylinderPart | SpherePart | GridPart | SurfacePart, here: PoseNumbers, color: Colour
) -> Piece:
    if isinstance(part, BoxPart):
        x, y, z = numbers(part.size_xyz)
        return BoxShape(kind="box", size=(x, y, z), pose=pose_numbers(part.pose), color=color)
    if isinstance(part, CylinderPart):
        return CylinderShape(kind="cylinder", radius=part.radius, length=part.height, pose=here, color=color)
    if isinstance(part, SpherePart):
        return EllipsoidShape(kind="ellipsoid", half=(part.radius,) * 3, pose=here, color=color)
    surface = coarse_surface(part) if isinstance(part, GridPart) else Triangles(part.points_xyz, part.triangles)
    return MeshPiece(surface, here, color)
