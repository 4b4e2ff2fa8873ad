"""How far things are from each other in PyBullet."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

import pybullet

from sim_action.engines.pybullet.scene import BASE

# Up to so many links are asked for one by one: a robot's others cost as much as those that matter.
_FEW: Final = 3


class Distances:
    """Of the robot's links to bodies of the world, at present."""

    def __init__(self, client: int, robot: int, links: Mapping[int, str], bodies: Mapping[int, str]) -> None:
        """`links`, `bodies`: names by the engine's numbers, of which a body may have several."""
        self._client, self._robot, self._names = client, robot, links
        self._bodies: dict[str, list[int]] = {}
        for number, name in bodies.items():
            self._bodies.setdefault(name, []).append(number)
        self._links = {name: index for index, name in links.items()}

    def near(self, body: str, links: Collection[str] | None, within: float) -> dict[str, float]:
        """See foresight.Near."""
        found: dict[str, float] = {}
        points = (point for number in self._bodies[body] for point in self._points(number, links, within))
        for point in points:
            name, distance = self._names[point[3]], point[8]
            if distance < found.get(name, math.inf) and (links is None or name in links):
                found[name] = distance
        return found

    def _points(self, body: int, links: Collection[str] | None, within: float) -> Sequence[Any]:
        """The nearest points, at least those of these links."""
        robot, client = self._robot, self._client
        if links is None or len(links) > _FEW:
            found: Sequence[Any] = pybullet.getClosestPoints(robot, body, within, physicsClientId=client)
            return found
        points: list[Any] = []
        for link in links:
            points += pybullet.getClosestPoints(robot, body, within, self._links[link], physicsClientId=client)
        return points

    def radii(self) -> dict[str, float]:
        """Link -> m: how far its shapes are from its frame, or from the centre of mass of the base, at most."""
        return {name: self._radius(index) for name, index in self._links.items()}

    def _radius(self, link: int) -> float:
        if not pybullet.getCollisionShapeData(self._robot, link, self._client):
            return 0.0
        if link == BASE:
            origin = pybullet.getBasePositionAndOrientation(self._robot, self._client)[0]
        else:
            state = pybullet.getLinkState(self._robot, link, computeForwardKinematics=1, physicsClientId=self._client)
            origin = state[4]
        lower, upper = pybullet.getAABB(self._robot, link, self._client)
        return math.hypot(*(max(hi - at, at - lo) for lo, hi, at in zip(lower, upper, origin, strict=True)))
