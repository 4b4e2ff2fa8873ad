"""How far things are from each other in MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Final

import mujoco
import numpy as np

from sim_action.backends.mujoco.model import Compiled

# From so many on, arrays are quicker.
_FEW: Final = 8


class Distances:
    """Of the robot's links to bodies of the world, at present."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._links, self._bodies = _by_name(compiled.links), _by_name(compiled.bodies)
        # A plane has no end.
        self._radii = [radius or math.inf for radius in self._model.geom_rbound.tolist()]
        self._body_radii = {
            name: np.array([self._radii[geom] for geom in geoms]) for name, geoms in self._bodies.items()
        }

    def near(self, body: str, links: Collection[str] | None, within: float) -> dict[str, float]:
        """See clearances.Near."""
        # After a step, the engine has but where everything was before it.
        mujoco.mj_kinematics(self._model, self._data)
        told = ((link, self._distance(link, body, within)) for link in (self._links if links is None else links))
        return {link: distance for link, distance in told if distance < within}

    def radii(self) -> dict[str, float]:
        """Link -> m: how far its shapes are from its frame at most."""
        return {link: max(map(self._reach, geoms)) for link, geoms in self._links.items()}

    def _distance(self, link: str, body: str, within: float) -> float:
        least, model, data = within, self._model, self._data
        for geom in self._links.get(link, ()):
            for other in self._near_enough(geom, body, least):
                least = min(least, mujoco.mj_geomDistance(model, data, geom, other, least, None))
        return least

    def _near_enough(self, geom: int, body: str, within: float) -> Iterable[int]:
        """The geoms of a body that are not plainly too far away: by the balls around them."""
        others, places, radius = self._bodies[body], self._data.geom_xpos, self._radii[geom]
        if len(others) > _FEW:
            apart = np.sqrt(((places[others] - places[geom]) ** 2).sum(axis=1)) - self._body_radii[body]
            return [others[index] for index in np.flatnonzero(apart < within + radius)]
        middle = places[geom].tolist()
        reach = within + radius
        return [other for other in others if math.dist(middle, places[other].tolist()) < reach + self._radii[other]]

    def _reach(self, geom: int) -> float:
        return math.hypot(*self._model.geom_pos[geom].tolist()) + self._radii[geom]


def _by_name(names: Mapping[int, str]) -> dict[str, list[int]]:
    """Name -> its geoms."""
    geoms: dict[str, list[int]] = {}
    for geom, name in names.items():
        geoms.setdefault(name, []).append(geom)
    return geoms
