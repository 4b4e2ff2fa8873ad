"""Contacts between links of the robot, for every engine: which pairs count, and pairs that are only watched.

A pair that touches where the model itself puts the joints would be pushed apart at the first step, so it is left out.
Where links do not collide, their distances are measured. After a query, a pair is measured again only when its joints
can have brought it near enough.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import zip_longest
from typing import Final, Self

import numpy as np

from sim_action.core import units
from sim_action.core.errors import BadStart, EngineError
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.engines.observers import MIN_OVERLAP_M, Nearest
from sim_action.robot.model.robot_model import NO_PAIRS, Joint, LinkPair, RobotModel, Shape
from sim_action.state.observation import SelfContact
from sim_action.state.trace import Trace
from sim_action.world.scene import Scene

NearestOfLinks = Callable[[str, str], Nearest | None]
"""(link, other) -> distance in m and a place in the present state; None for links without shapes."""

_MAX_NAMED: Final = 4
# Instead of infinity, which would turn into NaN.
_FAR_M: Final = 1e6
_PRECISION_M: Final = 1e-5


@dataclass(frozen=True, slots=True)
class SelfPairs:
    """The pairs of links that count, and pairs that are left out because they touch where the model puts the joints."""

    counted: tuple[LinkPair, ...]
    resting: tuple[tuple[LinkPair, float], ...]  # pairs with the depth in m of their overlap; negative for a gap

    @classmethod
    def of(cls, pairs: Iterable[LinkPair], nearest: NearestOfLinks) -> Self:
        """Sort pairs, with all joints at home in the present state. Raises EngineError if none counts."""
        counted = list[LinkPair]()
        resting = list[tuple[LinkPair, float]]()
        for pair in pairs:
            near = nearest(*pair)
            if near is not None and near.distance < MIN_OVERLAP_M:
                resting.append((pair, -near.distance))
            elif near is not None:
                counted.append(pair)
        if not counted:
            which = f"all of them touch at the model's own position ({_named(resting)})" if resting else NO_PAIRS
            raise EngineError(f"self-collision cannot be judged: {which}")
        return cls(tuple(counted), tuple(resting))

    @property
    def notes(self) -> tuple[str, ...]:
        """A note on the pairs that are left out, if there are any."""
        if not self.resting:
            return ()
        note = f"links that touch at the model's own position do not count as self-collision: {_named(self.resting)}"
        return (f"{note}; to accept it, state them with <disable_collisions> in an SRDF, or <exclude> in MJCF",)


def _named(resting: Sequence[tuple[LinkPair, float]]) -> str:
    deepest = sorted(resting, key=lambda pair: -pair[1])
    names = [
        f"'{one}' and '{other}'" + (f" ({units.display(depth, 'm')} deep)" if depth > MIN_OVERLAP_M else "")
        for (one, other), depth in deepest[:_MAX_NAMED]
    ]
    more = len(resting) - _MAX_NAMED
    return ", ".join(names) + (f", and {more} more" if more > 0 else "")


def refuse_start_inside(pairs: Iterable[LinkPair], nearest: NearestOfLinks) -> None:
    """Raise BadStart if links that collide overlap at the start: the engine would throw them apart."""
    nearest_points = ((pair, nearest(*pair)) for pair in pairs)
    inside = [
        (pair, -near.distance) for pair, near in nearest_points if near is not None and near.distance < -MIN_OVERLAP_M
    ]
    if inside:
        places = f"the robot starts with links inside each other: {_named(inside)}"
        raise BadStart([(("robot",), f"{places}; change robot.joints, or disable the pair in an SRDF (robot.srdf)")])


class SelfWatch:
    """Watches the distances of links that do not collide. It does not change the run."""

    def __init__(
        self, model: RobotModel, pairs: Sequence[LinkPair], joints: Sequence[str], rate: float, nearest: NearestOfLinks
    ) -> None:
        """`joints`: the order of the positions that `record` gets."""
        self._pairs, self._nearest, self._rate = pairs, nearest, rate
        self._reaches = reaches(model, pairs, joints)
        self._last: FloatArray | None = None
        self._travelled = np.zeros(len(joints))
        # A pair is due when its joints can have moved its links by this distance in m since the start.
        self._due = np.zeros(len(pairs))
        self._contacts: list[SelfContact] = []

    def record(self, step: int, positions: Sequence[float]) -> None:
        """Record the pairs that overlap at the present step, with these joint positions."""
        current = np.array(positions)
        if self._last is not None:
            self._travelled += np.abs(current - self._last)
        self._last = current
        moved = self._reaches @ self._travelled
        for index in np.flatnonzero(moved >= self._due).tolist():
            one, other = self._pairs[index]
            near = self._nearest(one, other)
            if near is None or not np.isfinite(near.distance):
                continue
            self._due[index] = moved[index] + max(0.0, near.distance - _PRECISION_M)
            if near.distance < -MIN_OVERLAP_M:
                place, depth = near.position_xyz, -near.distance
                self._contacts.append(SelfContact(step / self._rate, one, other, place, 0.0, depth))

    def collect(self) -> tuple[SelfContact, ...]:
        """Return the contacts since the last call."""
        contacts = tuple(self._contacts)
        self._contacts = []
        return contacts


class LinkContacts:
    """The contacts between links of the robot: the engine's contacts, or the overlaps of links that do not collide."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._order = {link.name: place for place, link in enumerate(scene.model.links)}
        self._watch: SelfWatch | None = None
        self._contacts: list[SelfContact] = []

    def nearest(self, link: str, other: str) -> Nearest | None:
        """Return the distance of two links, as `NearestOfLinks` does."""
        raise NotImplementedError

    def added_to(self, trace: Trace) -> Trace:
        """Return a trace with the contacts since the last call."""
        if self._watch is not None:
            return replace(trace, self_contacts=self._watch.collect())
        contacts = tuple(self._contacts)
        self._contacts = []
        return replace(trace, self_contacts=contacts)

    def _in_order(self, one: str, other: str) -> tuple[str, str]:
        return (one, other) if self._order[one] <= self._order[other] else (other, one)


def reaches(model: RobotModel, pairs: Sequence[LinkPair], joints: Sequence[str]) -> FloatArray:
    """Return (P, J) the largest motion in m of the links of a pair against each other, per rad (m) of a joint."""
    numbers = {name: number for number, name in enumerate(joints)}
    above: dict[str, list[Joint]] = {}
    for joint in model.joints:
        above.setdefault(joint.child, []).append(joint)
    motions = np.zeros((len(pairs), len(joints)))
    for row, (one, other) in enumerate(pairs):
        ways = [_way_up(above, link) for link in (one, other)]
        shared = {joint.name for joint in ways[0]} & {joint.name for joint in ways[1]}
        for link, way in zip((one, other), ways, strict=True):
            reach = max((_radius(shape) for shape in model.links_by_name[link].collisions), default=0.0)
            for joint, upper in zip_longest(way, way[1:]):
                if joint.name in shared:
                    break
                reach += _length(joint.anchor_xyz)
                if joint.name in numbers:
                    motions[row, numbers[joint.name]] = 1.0 if joint.type == "prismatic" else reach
                # Joints in series move the same link, and have one origin.
                if upper is None or upper.child != joint.child:
                    reach += _length(joint.origin.position_xyz)
                reach = min(reach + _stroke(joint), _FAR_M)
    return motions


def _way_up(above: Mapping[str, Sequence[Joint]], link: str) -> list[Joint]:
    """Return the joints from a link to the base."""
    way = list[Joint]()
    while link in above:
        way += reversed(above[link])
        link = above[link][0].parent
    return way


def _stroke(joint: Joint) -> float:
    """Return how far a joint can move its link from the origin of the joint, in m."""
    if joint.type != "prismatic":
        return 2 * _length(joint.anchor_xyz)
    if joint.lower is None or joint.upper is None or joint.mimic is not None:
        return _FAR_M
    return max(abs(joint.lower - joint.reference), abs(joint.upper - joint.reference))


def _radius(shape: Shape) -> float:
    corner = [max(abs(low), abs(high)) for low, high in zip(shape.lower_xyz, shape.upper_xyz, strict=True)]
    return _length(shape.pose.position_xyz) + _length(corner)


def _length(vector: Sequence[float]) -> float:
    return float(np.sqrt(sum(part * part for part in vector)))
