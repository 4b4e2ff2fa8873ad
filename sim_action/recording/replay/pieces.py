"""The pieces that are drawn of links and bodies, before their meshes are simplified to a budget."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass
from sim_action.recording.replay.shapes import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    PoseNumbers,
    Shape,
    numbers,
)
from sim_action.recording.replay.surfaces import ROBOT_BUDGET, Triangles, coarse_surface, hull_surface
from sim_action.robot.model.robot_model import Link, RobotModel, Visual
from sim_action.robot.model.robot_model import Shape as RobotShape
from sim_action.sensors.rendering import ROBOT, Colour
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart

if TYPE_CHECKING:
    from sim_action.recording.replay.visual_meshes import VisualMeshes


class LinkPieces:
    """The pieces of a robot's links: their visuals if all can be read, else their collision shapes.

    Pieces from the same mesh file share their surface.

    Attributes:
        replaced: the number of links so far whose collision shapes are drawn because a mesh cannot be read.
    """

    def __init__(self, model: RobotModel) -> None:
        # A link without visuals is invisible, unless no link has any.
        self._is_drawn = any(link.visuals for link in model.links)
        self._model = model
        self.replaced = 0
        self._scaled: dict[tuple[str, Vector3], Triangles] = {}

    @cached_property
    def _meshes(self) -> VisualMeshes:
        # Robots without meshes do not need the mesh readers.
        from sim_action.recording.replay.visual_meshes import VisualMeshes

        return VisualMeshes(self._model, ROBOT_BUDGET.each)

    def of(self, link: Link) -> list[Piece]:
        """Return the pieces of a link."""
        if self._is_drawn and not link.visuals:
            return []
        found = [self._piece(visual) for visual in link.visuals]
        seen = [piece for piece in found if piece is not None]
        if seen and len(seen) == len(found):
            return seen
        touched = list(self._touched(link))
        self.replaced += bool(touched and found)
        return touched or seen

    @property
    def unreadable(self) -> dict[str, str]:
        """Name of each mesh file so far that is not drawn -> the reason."""
        return self._meshes.unreadable if any(link.has_mesh for link in self._model.links) else {}

    def _piece(self, visual: Visual) -> Piece | None:
        pose, color, opacity = pose_numbers(visual.pose), visual.color or ROBOT, round(visual.opacity, 3)
        if not visual.file:
            x, y, z = visual.size_xyz
            shape = plain_shape(visual.kind, (x / 2, y / 2, z / 2), pose, color)
            return shape if opacity == 1 else shape.model_copy(update={"opacity": opacity})
        surface = self._surface(visual)
        if surface is None:
            return None
        return MeshPiece(surface, pose, visual.color or self._meshes.colour(visual.file) or ROBOT, opacity)

    def _surface(self, visual: Visual) -> Triangles | None:
        key = visual.file, visual.scale
        if key not in self._scaled:
            own = self._meshes.surface(visual.file)
            if own is None:
                return None
            self._scaled[key] = own.scaled(visual.scale)
        return self._scaled[key]

    def _touched(self, link: Link) -> Iterator[Piece]:
        for shape in link.collisions:
            yield from of_robot_shape(shape, ROBOT, self._hulls)

    def _hulls(self, text: bytes) -> Triangles | None:
        return self._meshes.hulls(text)


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """A surface at a pose in the frame of its link or body, before simplification."""

    surface: Triangles
    pose: PoseNumbers
    color: Colour
    opacity: float = 1.0


Piece = Shape | MeshPiece


def pose_numbers(pose: Pose) -> PoseNumbers:
    """Return a pose as rounded numbers for storage."""
    x, y, z = numbers(pose.position_xyz)
    qx, qy, qz, qw = numbers(pose.orientation_xyzw)
    return (x, y, z, qx, qy, qz, qw)


def of_robot_shape(shape: RobotShape, color: Colour, hulls: Callable[[bytes], Triangles | None]) -> Iterator[Piece]:
    """Yield the piece of a collision shape: a solid, its hulls, or else the bounding box; nothing for a plane."""
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(shape.pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)))
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    surface = hulls(shape.hulls) if shape.hulls else None
    if surface is not None:
        yield MeshPiece(surface, pose_numbers(shape.pose), color)
    elif shape.kind != "plane":
        yield plain_shape(shape.kind, half, pose_numbers(middle), color)


def plain_shape(kind: str, half: Vector3, pose: PoseNumbers, color: Colour) -> Shape:
    """Return a solid centred in its frame; `half` are its half sizes along the axes in m."""
    x, y, z = numbers(half)
    if kind in {"sphere", "ellipsoid"}:
        return EllipsoidShape(kind="ellipsoid", half=(x, y, z), pose=pose, color=color)
    if kind == "cylinder":
        return CylinderShape(kind="cylinder", radius=x, length=2 * z, pose=pose, color=color)
    if kind == "capsule":
        return CapsuleShape(kind="capsule", radius=x, length=max(0.0, 2 * (z - x)), pose=pose, color=color)
    return BoxShape(kind="box", size=(2 * x, 2 * y, 2 * z), pose=pose, color=color)


def of_parts(parts: Sequence[Part], color: Colour) -> Iterator[Piece]:
    """Yield the pieces of a body of the world."""
    here = pose_numbers(Pose())
    hulls = [np.array(part.points_xyz) for part in parts if isinstance(part, HullPart)]
    if hulls:
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
        return CylinderShape(
            kind="cylinder", radius=part.radius, length=part.height, pose=pose_numbers(part.pose), color=color
        )
    if isinstance(part, SpherePart):
        return EllipsoidShape(kind="ellipsoid", half=(part.radius,) * 3, pose=pose_numbers(part.pose), color=color)
    surface = coarse_surface(part) if isinstance(part, GridPart) else Triangles(part.points_xyz, part.triangles)
    return MeshPiece(surface, here, color)
