"""Find bodies on paths that pass through other bodies of the world.

Nothing stops a body on a path, and assertions judge the robot only, so such a mistake in a world would stay unseen. The
search needs no engine: the paths are known. It looks at the moments of the frames of a replay, and skips those at which
the body cannot have come near enough.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Self

import numpy as np

from sim_action.core import geometry
from sim_action.core.convex import hull_distance
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass
from sim_action.core.units import first_step
from sim_action.scenario.world_checks import DEPTH
from sim_action.simulation.convex_pieces import Obstacle, Piece, part_pieces, part_soups, turned
from sim_action.state.trace_records import FRAME_RATE
from sim_action.world import Body, path_of, placed
from sim_action.world.body_path import PosePath
from sim_action.world.parts import reach
from sim_action.world.scene import Scene

# A search that takes more comparisons of two shapes, or frames, ends without a result.
_MAX_COMPARISONS: Final = 500
_MAX_FRAMES: Final = 3_000
# Nearer hulls overlap.
_TOUCH_M: Final = 1e-7


def path_crossings(scene: Scene, end: float) -> Iterator[str]:
    """Yield a note on each body on a path that passes through another body before a sim time in s."""
    travellers = [_Traveller.of(scene, body) for body in scene.world.objects if body.path]
    if not travellers:
        return
    still = [body for body in scene.world.objects if body.mass is None and not body.path]
    fixed = _obstacle(scene, still, moves=False)
    for number, one in enumerate(travellers):
        found = {} if fixed is None else one.meets(fixed, None, end, scene.physics.rate)
        for other in travellers[:number]:
            own = _obstacle(scene, [other.body], moves=True)
            found |= {} if own is None else one.meets(own, other.path, end, scene.physics.rate)
        for name, time in sorted(found.items(), key=lambda item: item[1]):
            yield (
                f"body '{one.body.name}' passes through body '{name}' on its path, at {time:.2f} s: nothing stops it, "
                "and no assertion judges two bodies of the world"
            )


@dataclass(frozen=True, eq=False)
class _Traveller:
    """A body on a path, its convex pieces, and the greatest speed of any of its points in m/s."""

    body: Body
    path: PosePath
    pieces: tuple[Piece, ...]
    fastest: float

    @classmethod
    def of(cls, scene: Scene, body: Body) -> Self:
        """Return a body of a scene."""
        parts = scene.parts_of(body)
        path = path_of(body, parts)
        return cls(body, path, tuple(part_pieces(parts)), path.fastest(max(map(reach, parts)))[0])

    def meets(self, obstacle: Obstacle, path: PosePath | None, end: float, rate: float) -> dict[str, float]:
        """Return name -> s: when it first overlaps each body of an obstacle, which may be on a path itself."""
        search, free_until = _Search(obstacle), 0.0
        for time in self._moments(end, path):
            # Bodies may appear before the last moment.
            if time < min(free_until, end):
                continue
            pose = self.path.pose(time)
            if path is not None:
                pose = geometry.compose(geometry.inverse(path.pose(time)), pose)
            gap = min((search.look(piece, pose, time, first_step(time, rate)) for piece in self.pieces), default=0.0)
            if search.is_over:
                break
            if path is None and gap > 0:
                free_until = time + (gap / self.fastest if self.fastest else end)
        return search.found

    def _moments(self, end: float, path: PosePath | None) -> Sequence[float]:
        """Return the sim times in s to look at, up to the end of a run."""
        loops = self.path.loops or (path is not None and path.loops)
        last = max(self.path.times[-1], path.times[-1] if path is not None else 0.0)
        until = end if loops else min(last, end)
        frames: list[float] = (np.arange(min(int(until * FRAME_RATE) + 1, _MAX_FRAMES)) / FRAME_RATE).tolist()
        corners = [time for each in (self.path, path) if each is not None for time in each.times if time <= until]
        # Bodies may appear after the end of the path.
        return sorted({*frames, *corners, end})


class _Search:
    """The search for the bodies of an obstacle that something overlaps; `found`: name -> s."""

    def __init__(self, obstacle: Obstacle) -> None:
        self._obstacle, self._left = obstacle, _MAX_COMPARISONS
        self.found: dict[str, float] = {}

    @property
    def is_over(self) -> bool:
        """True if all bodies are found, or the search took too long."""
        return not self._left or len(self.found) == len(self._obstacle.names)

    def look(self, piece: Piece, pose: Pose, time: float, step: int) -> float:
        """Compare a piece in a frame at `pose` with the pieces near it; return a lower bound on its distance in m."""
        obstacle = self._obstacle
        points = turned(piece.points, pose.orientation_xyzw) + pose.position_xyz
        lower, upper = points.min(axis=0) - piece.radius, points.max(axis=0) + piece.radius
        for index in obstacle.near(lower + DEPTH, upper - DEPTH, step):
            name = obstacle.names[int(obstacle.bodies[index])]
            if name not in self.found and self._left:
                self._left -= 1
                if _overlap(piece, points, obstacle, index):
                    self.found[name] = time
        return float(np.maximum(obstacle.lower - upper, lower - obstacle.upper).max(axis=1).min())


def _overlap(piece: Piece, points: np.ndarray, obstacle: Obstacle, index: int) -> bool:
    """Return True if a piece at `points` (P, 3) is deeper inside another piece than an ordinary contact."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    thick = piece.width - 2 * piece.radius
    smaller = middle + (points - middle) * max(0.0, 1 - 2 * DEPTH / thick if thick > 0 else 0.0)
    limit = max(0.0, piece.radius - DEPTH) + float(obstacle.radius[index])
    return hull_distance(smaller, obstacle.corners(index), limit) <= max(limit, _TOUCH_M)


def _obstacle(scene: Scene, bodies: Sequence[Body], *, moves: bool) -> Obstacle | None:
    """Return bodies in the world frame, or in their own if they move; None without shapes."""
    found = []
    for body in bodies:
        parts = scene.parts_of(body)
        pieces, soups = tuple(part_pieces(parts)), tuple(part_soups(parts, is_solid=True))
        if pieces or soups:
            first = 0 if body.appears is None else first_step(body.appears, scene.physics.rate)
            found.append((body.name, first, Pose() if moves else placed(body, parts), pieces, soups))
    return Obstacle.of(found) if found else None
