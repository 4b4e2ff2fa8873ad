"""How far things are from each other in MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from functools import cached_property
from typing import Any, Final

import mujoco
import numpy as np

from sim_action.engines.mujoco.model import Compiled
from sim_action.state.trace import FloatArray

# Up to so many geoms, to sort out what is too far away would take longer than to ask.
_FEW: Final = 8


class Distances:
    """Of the robot's links to bodies of the world, at present or at a step that is over."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._present, self._data = compiled.model, compiled.data, compiled.data
        self._robot_qpos = compiled.robot_qpos
        self._links, self._bodies = _by_name(compiled.links), _by_name(compiled.bodies)
        # A plane has no end.
        self._radii = [radius or math.inf for radius in self._model.geom_rbound.tolist()]
        self._body_radii = {
            name: np.array([self._radii[geom] for geom in geoms]) for name, geoms in self._bodies.items()
        }

    def look_at_present(self) -> None:
        """From here on, until the next step, `near` tells of the present."""
        self._data = self._present
        # After a step, the engine has but where everything was before it.
        mujoco.mj_kinematics(self._model, self._data)

    def recall(self, robot_qpos: FloatArray) -> None:
        """From here on, `near` tells of when the robot was there, (P,), and all else where it is when first asked."""
        self._data, qpos = self._past
        qpos[:] = robot_qpos
        mujoco.mj_kinematics(self._model, self._data)

    @cached_property
    def _past(self) -> tuple[Any, FloatArray]:
        """The data of steps that are over, and a live view of where the robot is in them."""
        past = mujoco.MjData(self._model)
        past.qpos[:] = self._present.qpos
        return past, past.qpos[: self._robot_qpos]

    def near(self, body: str, links: Collection[str] | None, within: float) -> dict[str, float]:
        """See foresight.Near."""
        found = {}
        for link in self._links if links is None else links:
            distance = self._distance(link, body, within)
            if distance < within:
                found[link] = distance
        return found

    def radii(self) -> dict[str, float]:
        """Link -> m: how far its shapes are from its frame at most."""
        return {link: max(map(self._reach, geoms)) for link, geoms in self._links.items()}

    def _distance(self, link: str, body: str, within: float) -> float:
        least, model, data, others = within, self._model, self._data, self._bodies[body]
        few = len(others) <= _FEW
        for geom in self._links.get(link, ()):
            for other in others if few else self._near_enough(geom, body, least):
                distance = mujoco.mj_geomDistance(model, data, geom, other, least, None)
                least = min(least, distance)
        return least

    def _near_enough(self, geom: int, body: str, within: float) -> Iterable[int]:
        """The geoms of a body that are not plainly too far away: by the balls around them."""
        others, places = self._bodies[body], self._data.geom_xpos
        apart = np.sqrt(((places[others] - places[geom]) ** 2).sum(axis=1)) - self._body_radii[body]
        return [others[index] for index in np.flatnonzero(apart < within + self._radii[geom])]

    def _reach(self, geom: int) -> float:
        return math.hypot(*self._model.geom_pos[geom].tolist()) + self._radii[geom]


def _by_name(names: Mapping[int, str]) -> dict[str, list[int]]:
    """Name -> its geoms."""
    geoms: dict[str, list[int]] = {}
    for geom, name in names.items():
        geoms.setdefault(name, []).append(geom)
    return geoms
