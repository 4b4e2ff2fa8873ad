"""How far things are from each other in MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import mujoco

from sim_action.backends.mujoco.model import Compiled


class Distances:
    """Of the robot's links to bodies of the world, at present."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._links, self._bodies = _by_name(compiled.links), _by_name(compiled.bodies)
        # A plane has no end.
        self._radii = [radius or math.inf for radius in self._model.geom_rbound.tolist()]

    def near(self, body: str, links: Collection[str] | None, within: float) -> dict[str, float]:
        """See clearances.Near."""
        # After a step, the engine has but where everything was before it.
        mujoco.mj_kinematics(self._model, self._data)
        told = ((link, self._distance(link, body, within)) for link in (self._links if links is None else links))
        return {link: distance for link, distance in told if distance < within}

    def body_at(self, body: str) -> list[float]:
        """See Clearances; whatever the order of the quaternion."""
        number = self._model.geom_bodyid[self._bodies[body][0]]
        start = self._model.jnt_qposadr[self._model.body_jntadr[number]]
        there: list[float] = self._data.qpos[start : start + 7].tolist()
        return there

    def radii(self) -> dict[str, float]:
        """Link -> m: how far its shapes are from its frame at most."""
        return {link: max(map(self._reach, geoms)) for link, geoms in self._links.items()}

    def _distance(self, link: str, body: str, within: float) -> float:
        least, model, data, radii = within, self._model, self._data, self._radii
        for geom in self._links.get(link, ()):
            middle = data.geom_xpos[geom].tolist()
            for other in self._bodies[body]:
                apart = math.dist(middle, data.geom_xpos[other].tolist()) - radii[geom] - radii[other]
                if apart < least:
                    least = min(least, mujoco.mj_geomDistance(model, data, geom, other, least, None))
        return least

    def _reach(self, geom: int) -> float:
        return math.hypot(*self._model.geom_pos[geom].tolist()) + self._radii[geom]


def _by_name(names: Mapping[int, str]) -> dict[str, list[int]]:
    """Name -> its geoms."""
    geoms: dict[str, list[int]] = {}
    for geom, name in names.items():
        geoms.setdefault(name, []).append(geom)
    return geoms
