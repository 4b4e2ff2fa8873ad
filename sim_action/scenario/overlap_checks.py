"""Check without an engine that no body begins inside another one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Self

from sim_action.core import units
from sim_action.core.yaml_errors import SpecProblem, SpecProblems
from sim_action.world import GROUND, Body, World, placed
from sim_action.world.overlap_depth import Solid, depth, inner_solids
from sim_action.world.parts import lowest

DEPTH: Final = 0.005
"""In m. What is no deeper was meant to touch, as fingers do, and is eased apart while the robot settles."""

# Each is looked at beside each that moves: a heap that someone has made with a script is left to the engine.
_MAX_PAIRS: Final = 100_000


@dataclass(frozen=True, slots=True)
class _Placed:
    """A body where it begins.

    Attributes:
        buried: m of it that are below the ground.
    """

    body: Body
    index: int
    solids: tuple[Solid, ...]
    buried: float

    @classmethod
    def of(cls, body: Body, index: int) -> Self:
        """Of a shape that need not be read."""
        parts = body.parts()
        at = placed(body, parts)
        buried = -(at.position_xyz[2] + lowest(parts, at.orientation_xyzw))
        return cls(body, index, tuple(inner_solids(parts, at)), buried)


def clash_problems(world: World) -> SpecProblems:
    """One for each body with a mass that begins deep in another, or in the ground: the engine would throw it out.

    What is read from files, appears later, or is no box, sphere or cylinder is left to the run, and so is the robot.
    """
    there = [(body, index) for index, body in enumerate(world.objects) if body.appears is None and not body.is_read]
    moving = sum(body.mass is not None for body, _ in there)
    if not moving or moving * len(there) > _MAX_PAIRS:
        return
    everything = [_Placed.of(body, index) for body, index in there]
    for one in everything:
        if one.body.mass is not None:
            # Of two that move, the first is told.
            beside = [other for other in everything if other.body.mass is None or other.index > one.index]
            found = [(depth(one.solids, other.solids), other.body.name) for other in beside]
            deep, inside = max((*found, (one.buried, GROUND)))
            if deep > DEPTH:
                yield clash_problem(one.index, one.body.name, inside, deep)


def clash_problem(index: int, name: str, inside: str, deep: float) -> SpecProblem:
    """What is told of a body that begins so many m deep in another; `index`: its place among the world's objects."""
    where = "the ground" if inside == GROUND else f"'{inside}'"
    message = f"'{name}' begins {units.display(deep, 'm')} deep in {where}, which would throw it out; move it"
    return ("world", "objects", index, "pose"), message
