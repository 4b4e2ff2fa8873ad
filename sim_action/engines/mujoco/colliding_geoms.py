"""Contacts between links of the robot in MuJoCo: contact pairs of their geoms, or their distances."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, Final

import mujoco
import numpy as np
from typing_extensions import override

from sim_action.core.errors import EngineError
from sim_action.engines.link_contacts import LinkContacts, SelfPairs, SelfWatch, refuse_start_inside
from sim_action.engines.mujoco.geoms import Collider, engine_name
from sim_action.engines.observers import Nearest
from sim_action.robot.model.robot_model import LinkPair, touchable_pairs
from sim_action.state.observation import SelfContact
from sim_action.world.scene import Scene

Recorder = Callable[[int], None]  # records something of the present state, given the number of its step
_ANYWHERE_M: Final = 1e3
_MAX_PAIRS: Final = 50_000

GeomPairs = Mapping[LinkPair, Sequence[tuple[Collider, Collider]]]
"""Pair of links -> the pairs of their geoms that may touch."""


def geom_pairs(scene: Scene, robot: Iterable[Collider]) -> GeomPairs:
    """Return the geoms that may touch, by contype, conaffinity and <pair>. Raises EngineError if too many."""
    geoms: dict[str, list[Collider]] = {}
    for collider in robot:
        geoms.setdefault(collider.part, []).append(collider)
    stated = frozenset[frozenset[str]]() if scene.model.mjcf is None else scene.model.mjcf.paired
    paired = {frozenset(map(engine_name, pair)) for pair in stated}
    pairs: dict[LinkPair, list[tuple[Collider, Collider]]] = {}
    count = 0
    for one, other in touchable_pairs(scene.model):
        both = product(geoms.get(one, ()), geoms.get(other, ()))
        if may_touch := [pair for pair in both if _may_touch(*pair, paired)]:
            pairs[one, other] = may_touch
            count += len(may_touch)
        if count > _MAX_PAIRS:
            raise EngineError(
                f"self-collision has more than {_MAX_PAIRS:,} pairs of shapes; disable pairs of links that never touch "
                "with <disable_collisions> in an SRDF (robot.srdf)"
            )
    return pairs


def _may_touch(one: Collider, other: Collider, paired: Collection[frozenset[str]]) -> bool:
    bits = one.contype & other.conaffinity or other.contype & one.conaffinity
    return bool(bits) or (bool(paired) and frozenset((one.geom, other.geom)) in paired)


def colliding_pairs(spec: Any, scene: Scene, robot: Iterable[Collider]) -> list[tuple[Collider, Collider]]:
    """Return the pairs of geoms that collide, without pairs that touch where the model puts its joints.

    Raises EngineError if there are none. `spec`: a model with the robot alone.
    """
    pairs = geom_pairs(scene, robot)
    counted = _Distances(spec.copy().compile(), pairs).sorted_at_home(scene).counted
    return [pair for links in counted for pair in pairs[links]]


class _Distances:
    """Measures distances between links of the robot in a compiled model."""

    def __init__(self, model: Any, pairs: GeomPairs) -> None:
        self._model = model
        self._geoms = {
            links: [(int(model.geom(one.geom).id), int(model.geom(other.geom).id)) for one, other in both]
            for links, both in pairs.items()
        }

    def sorted_at_home(self, scene: Scene) -> SelfPairs:
        """Return the pairs that count. Raises EngineError if there are none."""
        home = mujoco.MjData(self._model)
        for joint in scene.model.motor_joints:
            home.joint(engine_name(joint.name)).qpos[:] = joint.home
        mujoco.mj_kinematics(self._model, home)
        return SelfPairs.of(self._geoms, lambda one, other: self.nearest(home, one, other))

    def nearest(self, data: Any, link: str, other: str) -> Nearest | None:
        """Return the distance of two links in these data, and the nearest point of the first one."""
        least, place = _ANYWHERE_M, np.empty(6)
        nearest: Nearest | None = None
        for one, two in self._geoms[link, other]:
            distance = mujoco.mj_geomDistance(self._model, data, one, two, least, place)
            if distance < least:
                x, y, z = place[:3].tolist()
                least, nearest = distance, Nearest(distance, (x, y, z))
        return nearest


class SelfCollision(LinkContacts):
    """The contacts between links of the robot."""

    def __init__(
        self, scene: Scene, model: Any, data: Any, links: Mapping[int, str], robot: Iterable[Collider]
    ) -> None:
        """Raises EngineError if no pair of links counts, BadStart if links that collide start inside each other.

        `links`: geom -> name of its link; `robot`: the geoms of the robot.
        """
        super().__init__(scene)
        self._links, self._model, self._data = links, model, data
        self._distances = _Distances(model, geom_pairs(scene, robot))
        pairs = self._distances.sorted_at_home(scene)
        self.notes, self._counted = pairs.notes, pairs.counted
        self._collides = scene.robot.self_collision
        if self._collides:
            refuse_start_inside(self._counted, self.nearest)

    def recorder(self, rate: float, joints: Sequence[str], positions: Callable[[], Sequence[float]]) -> Recorder:
        """Return a function that records the present contacts; `joints`: the order of `positions`."""
        if self._collides:
            return lambda step: self._contacts.extend(self._present(step / rate))
        watch = self._watch = SelfWatch(self._scene.model, self._counted, joints, rate, self.nearest)

        def record(step: int) -> None:
            # After a step, the poses in the data are those before it.
            mujoco.mj_kinematics(self._model, self._data)
            watch.record(step, positions())

        return record

    @override
    def nearest(self, link: str, other: str) -> Nearest | None:
        return self._distances.nearest(self._data, link, other)

    def _present(self, time: float) -> Iterator[SelfContact]:
        """Yield the contacts of the last step."""
        if not self._data.ncon:
            return
        contacts, forces, links = self._data.contact, self._data.efc_force, self._links
        columns = contacts.geom, contacts.efc_address, contacts.pos, contacts.dist
        for (one, other), row, (x, y, z), distance in zip(*(column.tolist() for column in columns), strict=True):
            if one in links and other in links and row >= 0:
                yield SelfContact(
                    time, *self._in_order(links[one], links[other]), (x, y, z), float(forces[row]), max(0.0, -distance)
                )
