"""Contacts between links of the robot in PyBullet.

A robot is loaded with collisions between its links only if the scenario asks for them. PyBullet then collides all
links but direct parents and children; pairs that do not count are switched off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import combinations
from typing import Final, Self

import pybullet
from typing_extensions import override

from sim_action.core.errors import BadStart, EngineError
from sim_action.engines.link_contacts import LinkContacts, SelfPairs, SelfWatch, refuse_start_inside
from sim_action.engines.observers import Nearest
from sim_action.robot.model.robot_model import touchable_pairs
from sim_action.state.observation import SelfContact
from sim_action.state.trace_records import Channels
from sim_action.world.scene import Scene

_ANYWHERE_M: Final = 1e3
_FIRST_JOINT: Final = 14  # columns before the joints in `Trace.state`


@contextmanager
def _closing_after_errors(client: int) -> Iterator[None]:
    try:
        yield
    except (EngineError, BadStart):
        pybullet.disconnect(client)
        raise


class SelfCollision(LinkContacts):
    """The contacts between links of one robot."""

    @classmethod
    def of(cls, scene: Scene, client: int, robot: int, links: Mapping[str, int], joints: Mapping[str, int]) -> Self:
        """Move all joints to their home, and return the contacts there.

        Raises EngineError if no pair of links counts, after closing the engine. `links, joints`: name -> PyBullet's
        number.
        """
        for joint in scene.model.motor_joints:
            pybullet.resetJointState(robot, joints[joint.name], joint.home, physicsClientId=client)
        with _closing_after_errors(client):
            return cls(client, robot, scene, links)

    def __init__(self, client: int, robot: int, scene: Scene, links: Mapping[str, int]) -> None:
        """Prepare the contacts; all joints are at home, see `of`."""
        super().__init__(scene)
        self._client, self._robot, self._rate = client, robot, scene.physics.rate
        self._links, self._names = links, {number: name for name, number in links.items()}
        self._pairs = SelfPairs.of(touchable_pairs(scene.model), self.nearest)
        self.notes = self._pairs.notes
        if scene.robot.self_collision:
            counted = {frozenset(pair) for pair in self._pairs.counted}
            for (one, number), (other, its_number) in combinations(self._links.items(), 2):
                on = int(frozenset((one, other)) in counted)
                pybullet.setCollisionFilterPair(self._robot, self._robot, number, its_number, on, self._client)

    def start(self, channels: Channels, row: Callable[[], Sequence[float]]) -> list[Callable[[int], None]]:
        """Return what records the contacts of the present step, if they are asked for.

        Raises BadStart if links that collide start inside each other, after closing the engine. `row`: returns the row
        of the last step, see `Trace.state`.
        """
        collides, counted = self._scene.robot.self_collision, self._pairs.counted
        if collides:
            with _closing_after_errors(self._client):
                refuse_start_inside(counted, self.nearest)
        if not channels.self_contacts:
            return []
        if collides:
            return [self._record]
        joints = [joint.name for joint in self._scene.model.moving_joints]
        positions = slice(_FIRST_JOINT, _FIRST_JOINT + len(joints))
        watch = self._watch = SelfWatch(self._scene.model, counted, joints, self._rate, self.nearest)
        return [lambda step: watch.record(step, row()[positions])]

    @override
    def nearest(self, link: str, other: str) -> Nearest | None:
        one, two, client = self._links[link], self._links[other], self._client
        points = pybullet.getClosestPoints(self._robot, self._robot, _ANYWHERE_M, one, two, physicsClientId=client)
        return min((Nearest(point[8], point[5]) for point in points), default=None)

    def _record(self, step: int) -> None:
        for point in pybullet.getContactPoints(self._robot, self._robot, physicsClientId=self._client):
            # Points are reported from a gap of 2 cm on; a contact carries a force or overlaps.
            if point[9] > 0 or point[8] <= 0:
                links = self._in_order(self._names[point[3]], self._names[point[4]])
                contact = SelfContact(step / self._rate, *links, point[5], point[9], max(0.0, -point[8]))
                self._contacts.append(contact)
