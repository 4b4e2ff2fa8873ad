"""Check without an engine that no body begins inside another one.

The depth is computed for boxes and balls; other shapes use solids inside them. So it is a lower bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Self

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass
from sim_action.scenario.stage import DEPTH
from sim_action.state.observation import Clash
from sim_action.world import GROUND, Body, World, placed
from sim_action.world.parts import BoxPart, CylinderPart, Part, SpherePart, lowest

_PARALLEL: Final = 1e-9  # shorter cross products belong to parallel edges and are no direction


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball, world frame, in m."""

    centre: Vector3
    radius: float


@dataclass(frozen=True, slots=True)
class Box:
    """A box, world frame, in m."""

    centre: Vector3
    axes: tuple[Vector3, ...]  # its own x, y and z
    halves: Vector3  # half of its size along each

    @property
    def radius(self) -> float:
        """The radius of the bounding ball."""
        return math.hypot(*self.halves)


Solid = Ball | Box


def inner_solids(parts: Iterable[Part], at: Pose) -> Iterator[Solid]:
    """Yield solids inside a body with these parts at a pose: all of a box or a sphere, most of a cylinder."""
    for part in parts:
        if isinstance(part, SpherePart):
            yield Ball(geometry.compose(at, part.pose).position_xyz, part.radius)
        elif isinstance(part, BoxPart):
            x, y, z = part.size_xyz
            yield _box(geometry.compose(at, part.pose), (x / 2, y / 2, z / 2))
        elif isinstance(part, CylinderPart):
            side, middle = part.radius / math.sqrt(2), geometry.compose(at, part.pose)
            yield _box(middle, (side, side, part.height / 2))
            yield Ball(middle.position_xyz, min(part.radius, part.height / 2))


def _box(at: Pose, halves: Vector3) -> Box:
    return Box(at.position_xyz, tuple(geometry.rotate(at.orientation_xyzw, axis) for axis in geometry.AXES), halves)


def depth(one: Sequence[Solid], other: Sequence[Solid]) -> float:
    """Return the depth in m of the pair that overlaps most; 0 without an overlap."""
    return max((_depth(a, b) for a in one for b in other), default=0.0)


def _depth(one: Solid, other: Solid) -> float:
    if math.dist(one.centre, other.centre) >= one.radius + other.radius:
        return 0.0
    if isinstance(one, Ball):
        if isinstance(other, Ball):
            return one.radius + other.radius - math.dist(one.centre, other.centre)
        return max(0.0, _in_box(one, other))
    return max(0.0, _in_box(other, one) if isinstance(other, Ball) else _of_boxes(one, other))


def _in_box(ball: Ball, box: Box) -> float:
    """Return the depth of a ball in a box; negative if they are apart."""
    away = geometry.subtract(ball.centre, box.centre)
    along = [geometry.dot(away, axis) for axis in box.axes]
    beyond = [max(0.0, abs(way) - half) for way, half in zip(along, box.halves, strict=True)]
    if any(beyond):
        return ball.radius - math.hypot(*beyond)
    return ball.radius + min(half - abs(way) for way, half in zip(along, box.halves, strict=True))


def _of_boxes(one: Box, other: Box) -> float:
    """Return the least overlap on the separating axes (Gottschalk 1996); negative if they are apart."""
    away = geometry.subtract(other.centre, one.centre)
    crosses = (geometry.cross(a, b) for a in one.axes for b in other.axes)
    least = math.inf
    for axis in (*one.axes, *other.axes, *crosses):
        length = math.hypot(*axis)
        if length > _PARALLEL:
            least = min(least, (_reach(one, axis) + _reach(other, axis) - abs(geometry.dot(away, axis))) / length)
    return least


def _reach(box: Box, axis: Vector3) -> float:
    return sum(half * abs(geometry.dot(own, axis)) for half, own in zip(box.halves, box.axes, strict=True))


_MAX_PAIRS: Final = 100_000  # Each body is compared with each moving one. A very large heap is left to the engine.


@dataclass(frozen=True, slots=True)
class _Placed:
    """A body at its start."""

    body: Body
    index: int
    solids: tuple[Solid, ...]
    buried: float  # depth in m of its lowest point below the ground

    @classmethod
    def of(cls, body: Body, index: int) -> Self:
        """Return a body whose shape is not read from a file."""
        parts = body.parts()
        at = placed(body, parts)
        buried = -(at.position_xyz[2] + lowest(parts, at.orientation_xyzw))
        return cls(body, index, tuple(inner_solids(parts, at)), buried)


def clashes(world: World) -> Iterator[Clash]:
    """Yield each body with a mass that begins deep inside another body or the ground: an engine would throw it out.

    Only boxes, spheres and cylinders that are there from the start are checked here. The run checks the others and the
    robot.
    """
    present = [(body, index) for index, body in enumerate(world.objects) if body.appears is None and not body.is_read]
    moving = sum(body.mass is not None for body, _ in present)
    if not moving or moving * len(present) > _MAX_PAIRS:
        return
    everything = [_Placed.of(body, index) for body, index in present]
    for one in everything:
        if one.body.mass is not None:
            # Of two moving bodies, the first is reported.
            beside = [other for other in everything if other.body.mass is None or other.index > one.index]
            overlaps = [(depth(one.solids, other.solids), other.body.name) for other in beside]
            deep, inside = max((*overlaps, (one.buried, GROUND)))
            if deep > DEPTH:
                yield Clash(one.body.name, inside, deep)
