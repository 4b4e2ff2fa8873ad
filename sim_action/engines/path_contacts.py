"""Contacts between bodies on paths and links that cannot move, for every engine.

Neither of the two gives way, so engines compute no contact between them. Such a pair is judged by its distance: it
touches at each step at which its shapes overlap. After a query the pair is measured again only when the body can have
come near enough, at the greatest speed of its path.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from sim_action.core.units import first_step
from sim_action.engines.observers import NearestPoints
from sim_action.state.observation import Contact
from sim_action.world import Body, path_of
from sim_action.world.parts import reach
from sim_action.world.scene import Scene

MIN_OVERLAP_M: Final = 1e-4
"""Shapes that overlap by less do not touch: a body may slide along a fixed link."""

# The used share of a distance, and m. The rest covers rounding errors.
_SHARE: Final = 0.9
_PRECISION_M: Final = 1e-3


# The step at which a body is due that never moves again.
_NEVER: Final = 10**15


class _Traveller:
    """A body on a path.

    Attributes:
        due: the first step at which it can touch a link.
    """

    def __init__(self, scene: Scene, body: Body) -> None:
        parts = scene.parts_of(body)
        path = path_of(body, parts)
        fastest, _ = path.fastest(max(map(reach, parts)))
        self.name, self.due = body.name, 0
        self._way = fastest / scene.physics.rate
        self._end = _NEVER if body.loop else first_step(path.times[-1], scene.physics.rate)

    def update_due(self, step: int, distance: float) -> None:
        """Set `due` after a query at a step with the distance to the nearest link, in m."""
        free = _SHARE * distance - _PRECISION_M
        if free < 0:
            self.due = step + 1
        elif self._way == 0 or step >= self._end:
            self.due = _NEVER
        else:
            self.due = step + max(1, int(min(free / self._way, _NEVER)))


class PathContacts:
    """The contacts of bodies on paths with the links that cannot move. Steps must not go back."""

    def __init__(self, scene: Scene, links: Sequence[str], nearest: NearestPoints) -> None:
        self._rate, self._links, self._nearest = scene.physics.rate, links, nearest
        self._travellers = [_Traveller(scene, body) for body in scene.world.objects if body.path]
        self._due = 0
        self._measured, self._found = -1, list[Contact]()

    def at(self, step: int) -> Sequence[Contact]:
        """Return the contacts in the present state, that of a step; before t = 0 bodies wait at their start."""
        moment = max(step, 0)
        if moment >= self._due and moment != self._measured:
            self._measure(moment)
        return self._found if moment == self._measured else ()

    def _measure(self, step: int) -> None:
        self._measured, self._found = step, []
        for body in self._travellers:
            if step < body.due:
                continue
            nearest = self._nearest(body.name, self._links)
            for link, (distance, place) in sorted(nearest.items()):
                if distance < -MIN_OVERLAP_M:
                    time = step / self._rate
                    contact = Contact(time, link, body.name, place, 0.0, has_force=False, depth=-distance)
                    self._found.append(contact)
            body.update_due(step, min((near.distance for near in nearest.values()), default=math.inf))
        self._due = min(body.due for body in self._travellers)
