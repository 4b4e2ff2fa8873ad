"""How near the robot comes to bodies: every step is watched, but the engine is asked only when it can matter.

Distances change no faster than bodies move: what was 1 m farther away than anything that matters need not be looked at
before robot and body have moved by 1 m together. An engine that can recall where things were is told of many steps at
once: most of them are then never looked at one by one.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from sim_action.core.units import first_step
from sim_action.engines.motion_bound import Odometer, PoseOdometer
from sim_action.state.trace import FloatArray
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.state.trace_records import ClearanceRecord, Nearness
from sim_action.world import Body
from sim_action.world.scene import Scene

Near = Callable[[str, Collection[str] | None, float], dict[str, float]]
"""Asks the engine how far a body is from some links (None: all), in m; what is farther than a limit is left out."""

# In m: engines find distances to within this.
_PRECISION: Final = 1e-6
# How far the engine looks beyond what matters, in steps as wide as the last: the farther, the later it is asked again.
_STEPS_AHEAD: Final = 256
_AHEAD: Final = 1e-3
_FARTHEST: Final = 1e5


@dataclass(slots=True)
class _Body:
    """What is known of the distance of a body to links of the robot.

    Attributes:
        clear: link -> m: on a way w of all that moves together, it is no nearer than this less w.
        rest: the same for all other links.
        due: on which way any of them matters again, in m.
        ahead: m, how far beyond what matters the engine looks.
    """

    name: str
    clear: dict[str, float]
    rest: float
    due: float = -math.inf
    ahead: float = _FARTHEST

    @classmethod
    def unknown(cls, name: str, links: Collection[str] | None) -> _Body:
        """Before the engine was asked for the first time about these links (None: all)."""
        if links is None:
            return cls(name, {}, -math.inf)
        return cls(name, dict.fromkeys(links, -math.inf), math.inf)

    def ask(self, near: Near, way: float, moved: float, limit: float) -> dict[str, float]:
        """Link -> m, of links that may be nearer than a limit, of which the nearest is among them if it is."""
        matters = way + limit + _PRECISION
        links = None if self.rest < matters else [link for link, clear in self.clear.items() if clear < matters]
        if links is not None and not links:
            return {}
        within = min(limit + self.ahead, _FARTHEST)
        distances = near(self.name, links, within)
        self._learn(links, distances, way, within)
        self.ahead = min(self.ahead, _STEPS_AHEAD * moved + _AHEAD) if distances else 2 * self.ahead
        return distances

    def foresee(self, limit: float) -> None:
        """Puts down when any link can be nearer than a limit."""
        self.due = min(self.rest, min(self.clear.values(), default=math.inf)) - limit - _PRECISION

    def _learn(self, asked: Collection[str] | None, told: Mapping[str, float], way: float, within: float) -> None:
        if asked is None:
            self.clear, self.rest, asked = {}, way + within, told
        for link in asked:
            self.clear[link] = way + told.get(link, within)


@dataclass(slots=True)
class Eye:
    """A watch while the run lasts.

    Attributes:
        least: m, the least distance since somebody began to look.
        latest: m, such that on a way w, something is as near as this plus w.
        due: on which way any of the bodies matters again, in m.
    """

    watch: ClearanceWatch
    names: tuple[str, ...]
    bodies: list[_Body] = field(default_factory=list)
    least: float = math.inf
    latest: float = math.inf
    due: float = math.inf
    found: list[Nearness] = field(default_factory=list)

    def begin(self) -> None:
        """From here on, somebody looks."""
        self.least = math.inf
        self.forget()

    def forget(self) -> None:
        """Nobody knows how far things have moved."""
        self.bodies = [_Body.unknown(name, self.watch.links) for name in self.names]
        self.latest, self.due = math.inf, -math.inf if self.bodies else math.inf

    def look(self, near: Near, time: float, way: float, moved: float) -> None:
        """Looks at the present, on a way of which the last step was `moved`, in m."""
        best: Nearness | None = None
        for body in self.bodies:
            if way <= body.due:
                continue
            distances = body.ask(near, way, moved, self._limit(way))
            if distances:
                distance, link = min(zip(distances.values(), distances, strict=True))
                self.latest = min(self.latest, distance - way)
                if self._counts(distance) and (best is None or distance < best.distance):
                    best = Nearness(time, distance, link, body.name)
                    self.least = min(self.least, distance)
            self._foresee(body, way)
        self.due = min(body.due for body in self.bodies)
        if best is not None:
            self.found.append(best)

    def _limit(self, way: float) -> float:
        """What matters, in m: a distance that is less."""
        return min(self.watch.within, self.latest + way if self.watch.always else self.least)

    def _counts(self, distance: float) -> bool:
        """Whether a distance is told."""
        return distance <= self.watch.within and (self.watch.always or distance < self.least)

    def _foresee(self, body: _Body, way: float) -> None:
        if self.watch.always:
            # What nobody may miss is looked at, whether it has moved or not.
            return
        body.foresee(self._limit(way))
        # What does not move comes no nearer.
        body.due = max(body.due, way)


Recall = Callable[[int], object]
"""Has the engine answer for one of several steps that are over, by its number among them."""


class Clearances:
    """The live half of `Channels.clearances`."""

    def __init__(
        self,
        channels: Channels,
        scene: Scene,
        radii: Mapping[str, float],
        near: Near,
        body_at: Callable[[str], Sequence[float]],
    ) -> None:
        """`radii`: see Odometer.

        What follows asks the engine about the present; `body_at` for a body's position and unit quaternion, (7,).
        """
        self._rate, self._near, self._body_at = scene.physics.rate, near, body_at
        everything = tuple(body.name for body in scene.world.objects)
        watches = sorted(channels.clearances, key=repr)
        self._eyes = [Eye(watch, everything if watch.bodies is None else watch.bodies) for watch in watches]
        steps = (first_step(time, self._rate) for time in channels.openings | {0.0})
        self._openings = sorted(set(steps), reverse=True)
        self._robot, self._way = Odometer(scene.model, radii), 0.0
        # On which way anything matters again, in m.
        self._next = math.inf
        watched = {body for eye in self._eyes for body in eye.names}
        moving = (body for body in scene.world.objects if body.name in watched and _moves(body))
        self._moving = {body.name: PoseOdometer(_radius(body)) for body in moving}

    @property
    def is_idle(self) -> bool:
        """Whether nobody wants to know."""
        return not self._eyes

    @property
    def stand_still(self) -> bool:
        """Whether none of the bodies ever moves."""
        return not self._moving

    def see(self, step: int, pose: Sequence[float], joints: Sequence[float]) -> None:
        """Looks at a step, where the base has come to `pose` (7,) and the joints to `joints` (J,).

        Before t = 0, nobody looks.
        """
        if step <= 0:
            return
        self._open(step)
        moved = self._robot.advance(pose, joints)
        for name, odometer in self._moving.items():
            moved += odometer.advance(self._body_at(name))
        if moved < math.inf:
            self._way += moved
            if self._way > self._next:
                self._look(step, self._way, moved)
        elif all(map(math.isfinite, (*pose, *joints))):
            # Nobody knows how far; what has exploded is the watchdog's.
            self._forget()
            self._look(step, self._way, moved)

    def look_back(self, steps: Sequence[int], poses: FloatArray, joints: FloatArray, recall: Recall) -> None:
        """The same at T steps that are over, (T, 7) and (T, J), of bodies that stand still."""
        first = bisect_right(steps, 0)
        if first == len(steps):
            return
        there = np.column_stack((poses[first:], joints[first:]))
        exploded = np.flatnonzero(~np.isfinite(there).all(axis=1))
        end = int(exploded[0]) if len(exploded) else len(there)
        if end:
            self._look_through(steps[first : first + end], there[:end], lambda row: recall(first + row))

    def collect(self) -> dict[ClearanceWatch, ClearanceRecord]:
        """What was found since the last call."""
        records = {eye.watch: ClearanceRecord.of(eye.found) for eye in self._eyes}
        for eye in self._eyes:
            eye.found = []
        return records

    def _look_through(self, steps: Sequence[int], there: FloatArray, recall: Recall) -> None:
        moved = self._robot.advance_all(there[:, :7], there[:, 7:])
        bounded = np.isfinite(moved)
        ways = (self._way + np.cumsum(np.where(bounded, moved, 0.0))).tolist()
        self._way = ways[-1]
        for first, end in self._stretches(steps, np.flatnonzero(~bounded).tolist()):
            row = max(first, bisect_right(ways, self._next))
            while row < end:
                recall(row)
                self._look(steps[row], ways[row], float(moved[row]))
                row = max(row + 1, bisect_right(ways, self._next))

    def _stretches(self, steps: Sequence[int], far: Sequence[int]) -> Iterator[tuple[int, int]]:
        """From one row to the next at which everything begins anew: somebody begins to look, or all has moved far."""
        opened = (bisect_left(steps, opening) for opening in self._openings)
        starts = sorted({0, *far, *(row for row in opened if row < len(steps))})
        for first, end in pairwise((*starts, len(steps))):
            self._open(steps[first])
            if first in far:
                self._forget()
            yield first, end

    def _look(self, step: int, way: float, moved: float) -> None:
        for eye in self._eyes:
            if way > eye.due:
                eye.look(self._near, step / self._rate, way, moved)
        self._next = min([eye.due for eye in self._eyes])

    def _forget(self) -> None:
        for eye in self._eyes:
            eye.forget()
        self._next = -math.inf

    def _open(self, step: int) -> None:
        if not self._openings or step < self._openings[-1]:
            return
        while self._openings and step >= self._openings[-1]:
            self._openings.pop()
        for eye in self._eyes:
            eye.begin()
        self._next = -math.inf


def _moves(body: Body) -> bool:
    return body.mass is not None or bool(body.path) or body.appears is not None


def _radius(body: Body) -> float:
    """How far its shape is from its middle at most, in m."""
    if body.box is not None:
        return math.hypot(*body.box) / 2
    if body.cylinder is not None:
        return math.hypot(body.cylinder.radius, body.cylinder.height / 2)
    return body.sphere.radius if body.sphere is not None else math.inf
