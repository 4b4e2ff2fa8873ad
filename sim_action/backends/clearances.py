"""How near the robot comes to bodies: every step is watched, but the engine is asked only when it can matter.

Distances change no faster than bodies move: what was 1 m farther away than anything that matters need not be looked at
before robot and body have moved by 1 m together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from sim_action.backends.odometer import Odometer, PoseOdometer
from sim_action.channels import Channels, ClearanceWatch
from sim_action.clearance_record import ClearanceRecord, Nearness
from sim_action.scene import Scene
from sim_action.world import Body

Near = Callable[[str, Collection[str] | None, float], dict[str, float]]
"""Asks the engine how far a body is from some links (None: all), in m; what is farther than a limit is left out."""

# In m: engines find distances to within this, and steps of sim time are whole to within the other.
_PRECISION: Final = 1e-6
_STEP_ROUNDING: Final = 1e-6
# How far the engine looks beyond what matters, in steps as wide as the last: the farther, the later it is asked again.
_STEPS_AHEAD: Final = 16
_AHEAD: Final = 1e-3
_FARTHEST: Final = 1e5


@dataclass(slots=True)
class _Body:
    """What is known of the distance of a body to the robot.

    Attributes:
        due: on which way of all that moves together the links that are near matter again, in m.
        all_due: on which way other links may matter.
        near: the links that may matter before that.
        ahead: m, how far beyond what matters is looked when all links are.
    """

    name: str
    due: float = -1.0
    all_due: float = -1.0
    near: Collection[str] = ()
    ahead: float = _FARTHEST

    def foresee(self, distances: Mapping[str, float], way: float, limit: float, ahead: float) -> None:
        """Sorts out the links that may matter within the next so many m, from the distances up to `self.ahead`."""
        ahead = min(ahead, self.ahead) if distances else self.ahead
        matters = min([limit, *distances.values()]) + ahead
        self.near = [link for link, distance in distances.items() if distance <= matters]
        self.all_due = way + ahead - _PRECISION
        self.ahead = ahead if distances else 2 * ahead


@dataclass(slots=True)
class _Eye:
    """A watch while the run lasts.

    Attributes:
        least: m, the least distance since somebody began to look.
        due: on which way any of the bodies matters again, in m.
    """

    watch: ClearanceWatch
    names: tuple[str, ...]
    bodies: list[_Body] = field(default_factory=list)
    least: float = math.inf
    due: float = -1.0
    found: list[Nearness] = field(default_factory=list)

    @property
    def limit(self) -> float:
        """What matters, in m: a distance that is less."""
        return self.watch.within if self.watch.always else min(self.least, self.watch.within)

    def counts(self, distance: float) -> bool:
        """Whether a distance is told."""
        return distance <= self.watch.within and (self.watch.always or distance < self.least)

    def begin(self) -> None:
        """From here on, somebody looks."""
        self.least, self.due = math.inf, -1.0 if self.names else math.inf
        self.bodies = [_Body(name) for name in self.names]


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
        self._eyes = [_Eye(watch, everything if watch.bodies is None else watch.bodies) for watch in watches]
        steps = (math.ceil(time * self._rate - _STEP_ROUNDING) for time in channels.openings | {0.0})
        self._openings = sorted(set(steps), reverse=True)
        self._robot = Odometer(scene.model, radii)
        watched = {body for eye in self._eyes for body in eye.names}
        moving = (
            body
            for body in scene.world.objects
            if body.name in watched and (body.mass is not None or body.path or body.appears is not None)
        )
        self._moving = {body.name: PoseOdometer(_radius(body)) for body in moving}

    @property
    def is_idle(self) -> bool:
        """Whether nobody wants to know."""
        return not self._eyes

    def see(self, step: int, pose: Sequence[float], joints: Sequence[float]) -> None:
        """Looks at a step, where the base has come to `pose` (7,) and the joints to `joints` (J,).

        Before t = 0, nobody looks.
        """
        if step <= 0:
            return
        if self._openings and step >= self._openings[-1]:
            self._begin(step)
        moved = self._robot.advance(pose, joints)
        way = self._robot.way
        if self._moving:
            ways = [odometer.advance(self._body_at(name)) for name, odometer in self._moving.items()]
            moved = max(moved, *ways)
            way += sum(odometer.way for odometer in self._moving.values())
        if not moved < math.inf:
            # There is nothing left to measure: what has exploded is the watchdog's.
            return
        for eye in self._eyes:
            if way > eye.due:
                self._look(eye, step, way, moved)

    def collect(self) -> dict[ClearanceWatch, ClearanceRecord]:
        """What was found since the last call."""
        records = {eye.watch: ClearanceRecord.of(eye.found) for eye in self._eyes}
        for eye in self._eyes:
            eye.found = []
        return records

    def _begin(self, step: int) -> None:
        while self._openings and step >= self._openings[-1]:
            self._openings.pop()
        for eye in self._eyes:
            eye.begin()

    def _look(self, eye: _Eye, step: int, way: float, moved: float) -> None:
        best: Nearness | None = None
        for body in eye.bodies:
            if way <= body.due:
                continue
            distances = self._ask(eye, body, way, moved)
            if not distances:
                continue
            distance, link = min(zip(distances.values(), distances, strict=True))
            if eye.counts(distance) and (best is None or distance < best.distance):
                best = Nearness(step / self._rate, distance, link, body.name)
                eye.least = min(eye.least, distance)
        eye.due = min(body.due for body in eye.bodies)
        if best is not None:
            eye.found.append(best)

    def _ask(self, eye: _Eye, body: _Body, way: float, moved: float) -> dict[str, float]:
        """Link -> m, of those that matter; puts down when it is to be asked again."""
        limit = eye.limit
        if way <= body.all_due:
            within = min(limit + body.all_due - way, _FARTHEST)
            distances = self._near(body.name, body.near, within)
        else:
            within = min(limit + body.ahead, _FARTHEST)
            distances = self._near(body.name, eye.watch.links, within)
            body.foresee(distances, way, limit, _STEPS_AHEAD * moved + _AHEAD)
        slack = min(distances.values(), default=within) - limit - _PRECISION
        # What does not move comes no nearer.
        body.due = way + (slack if eye.watch.always else max(0.0, slack))
        return distances


def _radius(body: Body) -> float:
    """How far its shape is from its middle at most, in m."""
    if body.box is not None:
        return math.hypot(*body.box) / 2
    if body.cylinder is not None:
        return math.hypot(body.cylinder.radius, body.cylinder.height / 2)
    return body.sphere.radius if body.sphere is not None else math.inf
