"""Lines around bodies of the world at a distance, seen from above."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from sim_action.core.geometry import Pose, Vector3, compose, convex_hull
from sim_action.world import placed
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, SpherePart, SurfacePart, moved
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.world.parts import Part

_ROUND: Final = 32
_MAX_POINTS: Final = 400
_MAX_LINES: Final = 60


def distance_lines(scene: Scene, names: tuple[str, ...] | None, distance: float) -> Iterator[tuple[Vector3, ...]]:
    """Yield a closed line at `distance` in m around each part of bodies, at the height of its lowest point.

    `names`: None for all bodies. Bodies that move, terrain and hollow shapes have no line.
    """
    left = _MAX_LINES
    for body in scene.world.objects:
        if body.mass is not None or body.path or (names is not None and body.name not in names):
            continue
        parts = scene.parts_of(body)
        pose = placed(body, parts)
        for part in parts[:left]:
            left -= 1
            if points := _points(moved(part, pose)):
                height = max(0.0, min(z - radius for (_, _, z), radius in points))
                around = ((x + dx, y + dy) for (x, y, _), radius in points for dx, dy in _ring(radius + distance))
                corners = convex_hull(sorted(set(around)))
                yield tuple((x, y, height) for x, y in (*corners, corners[0]))


def _points(part: Part) -> list[tuple[Vector3, float]]:
    """Return points with the radius of a ball around each; their hull is the part. Empty if it is not convex."""
    match part:
        case BoxPart():
            x, y, z = (size / 2 for size in part.size_xyz)
            corners = ((a * x, b * y, c * z) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1))
            return [(_place(part.pose, corner), 0.0) for corner in corners]
        case CylinderPart():
            ends = ((x, y, end * part.height / 2) for x, y in _ring(part.radius) for end in (-1, 1))
            return [(_place(part.pose, point), 0.0) for point in ends]
        case SpherePart():
            return [(part.pose.position_xyz, part.radius)]
        case HullPart():
            return [(point, 0.0) for point in part.points_xyz[:: 1 + len(part.points_xyz) // _MAX_POINTS]]
        case GridPart() | SurfacePart():
            return []


def _place(pose: Pose, point: Vector3) -> Vector3:
    return compose(pose, Pose(point)).position_xyz


def _ring(radius: float) -> list[tuple[float, float]]:
    angles = (2 * math.pi * number / _ROUND for number in range(_ROUND))
    return [(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles]
