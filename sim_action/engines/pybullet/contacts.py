"""Contacts of the robot in PyBullet, with the names of links and bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from typing import Any

import pybullet

from sim_action.state.observation import Contact
from sim_action.state.trace_records import LinkTouch
from sim_action.world import GROUND


class Contacts:
    """Reads the contacts of the last step."""

    def __init__(
        self,
        client: int,
        robot: int,
        links: Mapping[int, str],
        bodies: Mapping[int, str],
        unforced: tuple[AbstractSet[int], AbstractSet[int]],
    ) -> None:
        """`links`, `bodies`: PyBullet number -> name; a body may have several numbers.

        `unforced`: links that cannot move and bodies on paths. PyBullet reports some of these pairs, without a force.
        """
        self._client, self._robot, self._links, self._bodies = client, robot, links, bodies
        self._immovable, self._on_paths = unforced

    def of_step(self, time: float, *, ground: bool) -> Iterator[Contact]:
        """Yield the present contacts of the robot, with or without the ground."""
        for point in self._points():
            body, distance, force = self._bodies[point[2]], point[8], point[9]
            if (ground or body != GROUND) and (point[3] not in self._immovable or point[2] not in self._on_paths):
                link, depth = self._links[point[3]], max(0.0, -distance)
                yield Contact(time, link, body, point[5], force, depth=depth, normal_xyz=point[7])

    def of_links(self) -> Iterator[LinkTouch]:
        """Yield the present contact points of links with bodies of the world and the ground."""
        for point in self._points():
            yield LinkTouch(self._links[point[3]], self._bodies[point[2]], point[5], point[7], point[9])

    def _points(self) -> Iterator[Any]:
        for point in pybullet.getContactPoints(self._robot, physicsClientId=self._client):
            # Points are reported from a gap of 2 cm on; a contact carries a force or overlaps.
            if point[2] in self._bodies and (point[9] > 0 or point[8] <= 0):
                yield point
