"""Tunnelling: the guard of links and bodies that pass through others between two physics steps.

An engine looks for contacts at the poses of each step only. A ball of 4 cm that moves 25 cm in a step can be in front
of a thin wall at one step and behind it at the next. Such a run would pass `no_collision`. No expectation sees a
contact between two bodies of the world. So a body whose centre moves into or through another one in such a step is
reported also if they touch at an end of the step: the engine may push it out on the far side. Few runs are that fast,
see `fast_motion`.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from typing_extensions import override

from sim_action.core import units
from sim_action.core.errors import MissedContact, RunError
from sim_action.core.lazy_numpy import FloatArray
from sim_action.simulation.fast_motion import Block, Miss, Parts
from sim_action.simulation.guards import NO_BODIES, Guard
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.world import MAX_PHYSICS_RATE_HZ
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.simulation.swept_search import SweptSearch

# A contact is seen early enough to push a body back if the body is not further inside than half of its size.
_STEPS_WITHIN: Final = 2
_LEAST_SIZE_M: Final = 1e-6


class Tunnelling(Guard):
    """Watches a robot for links, and bodies of the world, that pass through others within one step.

    Attributes:
        parts: the links and bodies.
        before: the row of `Trace.state` before the last block.
        seen: the moments of the last block.
        is_calm: True if nothing was fast in it.
    """

    def __init__(
        self, scene: Scene, start: Observation, bodies: FloatArray, *, solid_terrain: bool, links_only: bool = False
    ) -> None:
        """Begin at t = 0.

        :param bodies: the poses (M, 7) of the bodies with a mass at t = 0, in the order of the world.
        :param solid_terrain: True if the engine fills heightfields below their surface.
        :param links_only: True if another robot's guard watches the bodies among themselves.
        """
        self._made = partial(Parts, solid_terrain=solid_terrain, links_only=links_only)
        self.seen, self._last_bodies = Trace.of_observation(start), bodies
        self.before, self.is_calm = self.seen.state[0], True
        self._search: SweptSearch | None = None
        self.follow(scene)

    @override
    def follow(self, scene: Scene) -> None:
        self.parts = self._made(scene)
        self._calm = self.parts.calm_state()
        self._search = None

    @override
    def watch(self, trace: Trace, bodies: FloatArray) -> tuple[Trace, RunError | None]:
        if not len(trace):
            return trace, None
        self.before, self.seen = self.seen.state[-1], trace
        self.is_calm = bool((np.abs(trace.state[:, 8 : 8 + len(self._calm)]) <= self._calm).all())
        if self.is_calm:
            return trace, None
        poses = np.concatenate((self._last_bodies[None], bodies[: len(trace)]))
        self._last_bodies = poses[-1]
        block = Block(self.before, trace, poses)
        pairs = self.parts.fast_pairs(block)
        return until_miss(trace, self.search.first_miss(block, pairs) if pairs else None, self.parts.scene)

    @property
    def search(self) -> SweptSearch:
        """The search, which few runs need."""
        if self._search is None:
            from sim_action.simulation.swept_search import SweptSearch  # a usual run does without it

            self._search = SweptSearch(self.parts)
        return self._search

    def met(self, other: Tunnelling, name: str, trace: Trace) -> tuple[Trace, RunError | None]:
        """Return the moments of a trace before a link passed through one of another robot, `name`, and the error."""
        count = min(len(self.seen), len(other.seen))
        if (self.is_calm and other.is_calm) or not len(trace):
            return trace, None
        spares = self.parts.spare(self.seen)[:, None] + other.parts.spare(other.seen)
        pairs = [(int(link), int(against)) for link, against in np.argwhere(spares < 0)]
        if not pairs:
            return trace, None
        from sim_action.simulation.swept_search import first_meeting  # a usual run does without it

        blocks = [Block(side.before, side.seen.rows(slice(count)), NO_BODIES) for side in (self, other)]
        return until_miss(trace, first_meeting((self.search, other.search), blocks, pairs, name), self.parts.scene)


def until_miss(trace: Trace, miss: Miss | None, scene: Scene) -> tuple[Trace, RunError | None]:
    """Return the moments of a trace before a missed contact, and its error."""
    if miss is None or miss.row >= len(trace):
        return trace, None
    return trace.first(miss.row), _missed(miss, float(trace.time[miss.row]), scene.physics.rate)


def _missed(miss: Miss, time: float, rate: float) -> MissedContact:
    way, extent = (units.display(length, "m", 3) for length in (miss.way, miss.extent))
    thick = f"{units.display(miss.thickness, 'm', 3)} thick" if miss.thickness else "a surface without thickness"
    speed = units.display(miss.way * rate, "m/s", 3)
    seen = "with a contact that came too late" if miss.is_late else "without a contact"
    # A multiple of the present rate suits all ticks that suit it.
    size = max(miss.extent + miss.thickness, _LEAST_SIZE_M)
    least_rate = math.ceil(_STEPS_WITHIN * miss.way / size) * rate
    remedy = (
        f"set physics.rate to {least_rate:.10g} Hz or more"
        if least_rate <= MAX_PHYSICS_RATE_HZ
        else f"no physics.rate up to {MAX_PHYSICS_RATE_HZ:,.0f} Hz would see it: make it slower or thicker"
    )
    return MissedContact(
        f"{miss.mover} passed through {miss.body} {seen}, in the step that ends at {time:.4f} s: it "
        f"moved {way} ({speed} at {rate:g} Hz), but it is only {extent} long in that direction, and "
        f"{miss.body} is {thick}; {remedy}",
        keys=("physics", "rate"),
    )
