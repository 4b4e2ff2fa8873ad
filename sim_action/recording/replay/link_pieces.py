"""What a robot's links are drawn as: their visuals where all of them can be read, else what they collide with."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from sim_action.core.geometry import Vector3
from sim_action.recording.replay.meshes import ROBOT as BUDGET
from sim_action.recording.replay.pieces import MeshPiece, Piece, of_robot_shape, plain_shape, pose_numbers
from sim_action.recording.replay.simplification import Triangles
from sim_action.robot.robot_model import Link, RobotModel, Visual
from sim_action.sensors.rendering.colours import ROBOT

if TYPE_CHECKING:
    from sim_action.recording.replay.visual_meshes import VisualMeshes


class LinkPieces:
    """The pieces of one robot's links, in which what comes from the same file is the same surface."""

    def __init__(self, model: RobotModel) -> None:
        # A link without a visual is not to be seen, unless nobody has drawn any.
        self._is_drawn = any(link.visuals for link in model.links)
        self._model = model
        self._scaled: dict[tuple[str, Vector3], Triangles] = {}

    @cached_property
    def _meshes(self) -> VisualMeshes:
        # Robots without meshes are spared what reads them.
        from sim_action.recording.replay.visual_meshes import VisualMeshes

        return VisualMeshes(self._model, BUDGET.each)

    def of(self, link: Link) -> list[Piece]:
        """A link's."""
        if self._is_drawn and not link.visuals:
            return []
        found = [self._piece(visual) for visual in link.visuals]
        seen = [piece for piece in found if piece is not None]
        return seen if seen and len(seen) == len(found) else list(self._touched(link)) or seen

    def _piece(self, visual: Visual) -> Piece | None:
        pose, color = pose_numbers(visual.pose), visual.color or ROBOT
        if not visual.file:
            x, y, z = visual.size_xyz
            return plain_shape(visual.kind, (x / 2, y / 2, z / 2), pose, color)
        surface = self._surface(visual)
        return None if surface is None else MeshPiece(surface, pose, color)

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

    def _hulls(self, file: str) -> Triangles | None:
        return self._meshes.hulls(file)
