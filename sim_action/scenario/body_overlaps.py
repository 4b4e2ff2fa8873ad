"""Check without an engine that no body begins inside another one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Self

from sim_action.core.records import dataclass
from sim_action.scenario.world_checks import DEPTH
from sim_action.state.observation import Clash
from sim_action.world import GROUND, Body, World, placed
from sim_action.world.overlap_depth import Solid, depth, inner_solids
from sim_action.world.parts import lowest

# Each body is compared with each moving one. A very large heap is left to the engine.
_MAX_PAIRS: Final = 100_000


@dataclass(frozen=True, slots=True)
class _Placed:
    """A body at its start.

    Attributes:
        buried: depth in m of its lowest point below the ground.
    """

    body: Body
    index: int
    solids: tuple[Solid, ...]
    buried: float

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
    there = [(body, index) for index, body in enumerate(world.objects) if body.appears is None and not body.is_read]
    moving = sum(body.mass is not None for body, _ in there)
    if not moving or moving * len(there) > _MAX_PAIRS:
        return
    everything = [_Placed.of(body, index) for body, index in there]
    for one in everything:
        if one.body.mass is not None:
            # Of two moving bodies, the first is reported.
            beside = [other for other in everything if other.body.mass is None or other.index > one.index]
            found = [(depth(one.solids, other.solids), other.body.name) for other in beside]
            deep, inside = max((*found, (one.buried, GROUND)))
            if deep > DEPTH:
                yield Clash(one.body.name, inside, deep)
