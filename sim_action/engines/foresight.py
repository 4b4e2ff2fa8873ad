"""What is known of distances between moments at which the engine is asked: as bounds, by how far all have moved."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Final

from sim_action.state.trace_channels import ClearanceWatch
from sim_action.state.trace_records import Nearness

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
