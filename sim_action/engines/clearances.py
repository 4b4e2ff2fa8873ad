"""Clearances between the robot and bodies, measured at every step where the result can matter.

Distances change no faster than bodies move. A pair that was 1 m farther apart than any distance of interest is measured
again only after robot and body together have moved by 1 m. Upper bounds on how far any point has moved are cheap enough
for every step; `travel` is their sum so far. An engine that can restore past states gets many steps at once, most of
which are never measured.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, field
from sim_action.core.units import first_step
from sim_action.engines.observers import presences
from sim_action.robot.model.robot_model import Joint, RobotModel, Shape
from sim_action.state.trace_records import ALWAYS, Channels, ClearanceRecord, ClearanceWatch, Nearness
from sim_action.world import Body, World
from sim_action.world.parts import reach
from sim_action.world.scene import Scene

# Factor that covers rounding errors, and how far beyond its limits a prismatic joint may be pushed.
_ROUNDING = 1 + 1e-9
_BEYOND_LIMITS = 1.1


class BodyMotionBound:
    """An upper bound in m on how far any point of a rigid body has moved.

    A pose that changes by dp and by dq (of its unit quaternion) moves a point at a distance r by no more than
    |dp| + 2 r |dq|.
    """

    def __init__(self, radius: float) -> None:
        """`radius`: greatest distance of its points from its origin in m; inf if unknown."""
        self._diameter = 2 * radius
        self._last: Sequence[float] = ()

    def advance(self, pose: Sequence[float]) -> float:
        """Return the bound for a step that ends at `pose` (7,): position and unit quaternion."""
        last, self._last = self._last or pose, pose
        turned = math.dist(pose[3:], last[3:])
        # 0 times infinity would be NaN.
        return (math.dist(pose[:3], last[:3]) + (self._diameter * turned if turned else 0.0)) * _ROUNDING

    def advance_all(self, poses: FloatArray) -> FloatArray:
        """Return the bounds (T,) in m for T steps, (T, 7)."""
        change = np.diff(np.vstack((self._last or poses[0], poses)), axis=0) ** 2
        self._last = tuple(poses[-1].tolist())
        moved, turned = np.sqrt(change[:, :3].sum(axis=1)), np.sqrt(change[:, 3:].sum(axis=1))
        bounds: FloatArray = (moved + _times(turned, self._diameter)) * _ROUNDING
        return bounds


class RobotMotionBound:
    """An upper bound in m on the motion of any point of a robot: of the base, plus each joint's angle times reach."""

    def __init__(self, model: RobotModel, radii: Mapping[str, float]) -> None:
        """`radii`: link -> greatest distance of its shapes from its origin in m; inf if unknown."""
        # Link -> greatest distance in m of its own shapes and of its descendants from its origin.
        extents: dict[str, float] = {}
        for name in reversed(_from_root(model)):
            ways = (
                math.hypot(*joint.origin.position_xyz) + _stroke(joint) + extents[joint.child]
                for joint in model.joints
                if joint.parent == name
            )
            extents[name] = max([radii.get(name, 0.0), *ways])
        self._base = BodyMotionBound(extents[model.root])
        self._chains = _chains(model, extents)
        self._last: Sequence[float] = ()

    def advance(self, pose: Sequence[float], joints: Sequence[float]) -> float:
        """Return the bound for a step that ends at `pose` (7,) of the base and at joint positions (J,)."""
        last, self._last = self._last or joints, joints
        moved = 0.0
        for chain in self._chains:
            swung = 0.0
            for joint, swing in chain:
                turned = abs(joints[joint] - last[joint])
                swung += swing * turned if turned else 0.0
            moved = max(moved, swung)
        return (moved + self._base.advance(pose)) * _ROUNDING

    def advance_all(self, poses: FloatArray, joints: FloatArray) -> FloatArray:
        """Return the bounds (T,) in m for T steps, (T, 7) and (T, J)."""
        turned = np.abs(np.diff(np.vstack((self._last or joints[0], joints)), axis=0))
        self._last = tuple(joints[-1].tolist())
        moved = np.zeros(len(joints))
        for chain in self._chains:
            moved = np.maximum(moved, sum(_times(turned[:, joint], swing) for joint, swing in chain))
        return (moved + self._base.advance_all(poses)) * _ROUNDING


def _times(turned: FloatArray, reach: float) -> FloatArray:
    return turned * reach if reach < math.inf else np.where(turned == 0.0, 0.0, math.inf)


def _from_root(model: RobotModel) -> list[str]:
    names = [model.root]
    for name in names:
        names += [joint.child for joint in model.joints if joint.parent == name]
    return names


def _stroke(joint: Joint) -> float:
    if joint.type != "prismatic":
        return 0.0
    if joint.lower is None or joint.upper is None:
        return math.inf
    return _BEYOND_LIMITS * max(abs(joint.lower), abs(joint.upper))


def _reach(model: RobotModel, joint: Joint, extent: float) -> float:
    """Return by how many m a joint moves the links beyond it, per rad or m."""
    if joint.type == "prismatic":
        return 1.0
    shapes = model.links_by_name[joint.child].collisions
    if not shapes or any(other.parent == joint.child for other in model.joints):
        return extent
    return min(extent, max(swing_per_turn(shape, joint.axis_xyz) for shape in shapes))


def swing_per_turn(shape: Shape, axis_xyz: Vector3) -> float:
    """Return by how many m per rad a shape's surface moves when it turns about an axis; 0 if it is round about it."""
    if shape.kind not in ("cylinder", "sphere"):
        return math.inf
    place, size = shape.pose.position_xyz, math.hypot(*shape.upper_xyz)
    upright = geometry.rotate(shape.pose.orientation_xyzw, (0.0, 0.0, 1.0))
    tilt = math.hypot(*geometry.cross(upright, axis_xyz)) if shape.kind == "cylinder" else 0.0
    # An axis that changes by dz turns by no more than 2 |dz|.
    return math.hypot(*geometry.cross(place, axis_xyz)) + 2 * tilt * size


def _chains(model: RobotModel, extents: Mapping[str, float]) -> list[list[tuple[int, float]]]:
    """Return for each leaf the joints that move it, each with the reach in m per rad or m."""
    numbers = {joint.name: number for number, joint in enumerate(model.moving_joints)}
    chains: dict[str, list[tuple[int, float]]] = {model.root: []}
    inner = set()
    for name in _from_root(model):
        for joint in (joint for joint in model.joints if joint.parent == name):
            reach = _reach(model, joint, extents[joint.child])
            moves = [(numbers[joint.name], reach)] if joint.name in numbers else []
            chains[joint.child] = chains[name] + moves
            inner.add(name)
    return [chain for name, chain in chains.items() if chain and name not in inner]


# A surface that moves less per rad of its own joint is round about it.
_ROUND_M = 1e-6
_FAR_M = 1e6


class MotionFactors(NamedTuple):
    """The factors (2 + J,) of the base's speed and turn rate and of the joint speeds."""

    ways: FloatArray  # their product with these is an upper bound in m/s on the speed of any point of a link
    turns: FloatArray  # the same in rad/s on its turn rate. The spin of a round link about its axis does not count.


def motion_factors(model: RobotModel, reaches: Mapping[str, float]) -> dict[str, MotionFactors]:
    """Return the factors of each link; `reaches`: link -> greatest distance in m of its shapes from its frame."""
    numbers = {joint.name: number for number, joint in enumerate(model.moving_joints)}
    above = {joint.child: joint for joint in model.joints}
    factors = {}
    for link, least in reaches.items():
        ways, turns, name, reach = np.zeros(2 + len(numbers)), np.zeros(2 + len(numbers)), link, least
        while name in above:
            joint = above[name]
            anchor = math.hypot(*joint.anchor_xyz)
            if joint.name in numbers:
                column = 2 + numbers[joint.name]
                ways[column] = 1.0 if joint.type == "prismatic" else reach + anchor
                turns[column] = 0.0 if joint.type == "prismatic" else 1.0
                if name == link and joint.type != "prismatic" and not anchor:
                    swings = [swing_per_turn(shape, joint.axis_xyz) for shape in model.links_by_name[link].collisions]
                    ways[column] = min(reach, max(swings, default=reach))
                    turns[column] = float(ways[column] > _ROUND_M)
            reach += math.hypot(*joint.origin.position_xyz) + 2 * anchor + _stroke(joint)
            name = joint.parent
        ways[0], ways[1], turns[1] = 1.0, reach, 1.0
        # The product of infinity and 0 would be NaN.
        factors[link] = MotionFactors(np.minimum(ways, _FAR_M), turns)
    return factors


LinkDistances = Callable[[str, Collection[str] | None, float], dict[str, float]]
"""(body, links or None for all, limit in m) -> link -> distance in m, without links beyond the limit."""

NO_ACTORS: Final[Mapping[str, Callable[[], float]]] = {}
_PRECISION: Final = 1e-6  # precision in m of the engines' distances
# Search margin beyond the limit, in steps as long as the last one: a wider search makes the next query later.
_STEPS_AHEAD: Final = 256
_AHEAD: Final = 1e-3
_MAX_DISTANCE_M: Final = 1e5


@dataclass(slots=True)
class _Body:
    """Lower bounds on the distance of a body to the links of the robot."""

    name: str
    clear: dict[str, float]  # link -> m; at a travel of w the distance is at least this minus w
    rest: float  # the same for all other links
    due: float = -math.inf  # travel in m at which a link can matter again
    ahead: float = _MAX_DISTANCE_M  # search margin beyond the limit, in m

    @classmethod
    def unknown(cls, name: str, links: Collection[str] | None) -> _Body:
        """Return the bounds before the first query about these links (None: all)."""
        if links is None:
            return cls(name, {}, -math.inf)
        return cls(name, dict.fromkeys(links, -math.inf), math.inf)

    def ask(self, near: LinkDistances, travel: float, moved: float, limit: float) -> dict[str, float]:
        """Query the links that may be nearer than a limit; return link -> m, with the nearest one if it is in range."""
        matters = travel + limit + _PRECISION
        links = None if self.rest < matters else [link for link, clear in self.clear.items() if clear < matters]
        if links is not None and not links:
            return {}
        within = min(limit + self.ahead, _MAX_DISTANCE_M)
        distances = near(self.name, links, within)
        self._learn(links, distances, travel, within)
        self.ahead = min(self.ahead, _STEPS_AHEAD * moved + _AHEAD) if distances else 2 * self.ahead
        return distances

    def update_due(self, limit: float) -> None:
        """Set `due` to the travel at which a link can be nearer than a limit."""
        self.due = min(self.rest, min(self.clear.values(), default=math.inf)) - limit - _PRECISION

    def _learn(
        self, asked: Collection[str] | None, distances: Mapping[str, float], travel: float, within: float
    ) -> None:
        if asked is None:
            self.clear, self.rest, asked = {}, travel + within, distances
        for link in asked:
            self.clear[link] = travel + distances.get(link, within)


@dataclass(slots=True)
class _WatchState:
    """The state of one clearance watch during a run."""

    watch: ClearanceWatch
    names: tuple[str, ...]
    bodies: list[_Body] = field(default_factory=list)
    least: float = math.inf  # least distance in m since the watch opened
    latest: float = math.inf  # m; at a travel of w some body is at most this plus w away
    due: float = math.inf  # travel in m at which a body can matter again
    minima: list[Nearness] = field(default_factory=list)

    def begin(self) -> None:
        """Open the watch at the present step."""
        self.least = math.inf
        self.forget()

    def forget(self) -> None:
        """Drop all bounds, because the travel is unknown."""
        self.bodies = [_Body.unknown(name, self.watch.links) for name in self.names]
        self.latest, self.due = math.inf, -math.inf if self.bodies else math.inf

    def measure(self, near: LinkDistances, time: float, travel: float, moved: float) -> None:
        """Measure the present state at a travel `travel`, of which the last step added `moved`, in m."""
        best: Nearness | None = None
        for body in self.bodies:
            if travel <= body.due:
                continue
            distances = body.ask(near, travel, moved, self._limit(travel))
            if distances:
                distance, link = min(zip(distances.values(), distances, strict=True))
                self.latest = min(self.latest, distance - travel)
                if self._counts(distance) and (best is None or distance < best.distance):
                    best = Nearness(time, distance, link, body.name)
                    self.least = min(self.least, distance)
            self._update_due(body, travel)
        self.due = min(body.due for body in self.bodies)
        if best is not None:
            self.minima.append(best)

    def _limit(self, travel: float) -> float:
        return min(self.watch.within, self.latest + travel if self.watch.always else self.least)

    def _counts(self, distance: float) -> bool:
        return distance <= self.watch.within and (self.watch.always or distance < self.least)

    def _update_due(self, body: _Body, travel: float) -> None:
        if self.watch.always:
            # This watch records every step, so the body is always due.
            return
        body.update_due(self._limit(travel))
        # A body at rest does not come nearer.
        body.due = max(body.due, travel)


RestoreState = Callable[[int], object]  # makes the engine answer for one of several past steps, by its index among them


class ClearanceRecorder:
    """Records the clearances of `Channels.clearances` during a run."""

    def __init__(
        self,
        channels: Channels,
        scene: Scene,
        radii: Mapping[str, float],
        *,
        near: LinkDistances,
        body_at: Callable[[str], Sequence[float]],
        actors: Mapping[str, Callable[[], float]] = NO_ACTORS,
    ) -> None:
        """Open all watches of a scene.

        `radii`: see RobotMotionBound. `near` measures present distances in the engine; `body_at` returns the present
        position and unit quaternion (7,) of a body. `actors`: name of another robot -> how far any of its points has
        moved since the last call, in m at most.
        """
        self._rate, self._near = scene.physics.rate, near
        everything = scene.world.names
        watches = sorted(channels.clearances, key=repr)
        self._watches = [_WatchState(watch, everything if watch.bodies is None else watch.bodies) for watch in watches]
        self._presences = presences(scene.world, self._rate)
        steps = (first_step(time, self._rate) for time in channels.openings | {0.0})
        self._openings = sorted(set(steps), reverse=True)
        self._model, self._radii, self._travel = scene.model, radii, 0.0
        # Travel in m at which any watch is due again.
        self._next = math.inf
        watched = {body for watch_state in self._watches for body in watch_state.names}
        moving = (body for body in scene.world.objects if body.name in watched and _moves(body))
        self._moving = [_motion_of(body.name, max(map(reach, scene.parts_of(body))), body_at) for body in moving]
        self._moving += [bound for name, bound in actors.items() if name in watched]

    def follow(self, world: World, time: float) -> None:
        """Take the times of a world, and begin all observations again at a later sim time in s."""
        self._presences = presences(world, self._rate)
        self._openings = sorted({*self._openings, first_step(time, self._rate)}, reverse=True)

    @cached_property
    def _robot(self) -> RobotMotionBound:
        # Few runs need it.
        return RobotMotionBound(self._model, self._radii)

    @property
    def is_idle(self) -> bool:
        """Return True if there is no watch."""
        return not self._watches

    @property
    def bodies_are_static(self) -> bool:
        """Return True if none of the watched bodies ever moves."""
        return not self._moving

    def record(self, step: int, pose: Sequence[float], joints: Sequence[float]) -> None:
        """Record a step from t = 0 on that ends with the base at `pose` (7,) and the joints at `joints` (J,)."""
        if step <= 0:
            return
        self._open(step)
        moved = self._robot.advance(pose, joints)
        for bound in self._moving:
            moved += bound()
        if moved < math.inf:
            self._travel += moved
            if self._travel > self._next:
                self._measure(step, self._travel, moved)
        elif all(map(math.isfinite, (*pose, *joints))):
            # The bound is infinite. (A state that is not finite is left to the watchdog.)
            self._forget()
            self._measure(step, self._travel, moved)

    def record_past(self, steps: Sequence[int], poses: FloatArray, joints: FloatArray, restore: RestoreState) -> None:
        """Record T past steps, (T, 7) and (T, J); only for static bodies."""
        first = bisect_right(steps, 0)
        if first == len(steps):
            return
        states = np.column_stack((poses[first:], joints[first:]))
        exploded = np.flatnonzero(~np.isfinite(states).all(axis=1))
        end = int(exploded[0]) if len(exploded) else len(states)
        if end:
            self._measure_past(steps[first : first + end], states[:end], lambda row: restore(first + row))

    def collect(self) -> dict[ClearanceWatch, ClearanceRecord]:
        """Return the records since the last call."""
        records = {}
        for state in self._watches:
            spans = tuple(dict.fromkeys(self._presences.get(name, ALWAYS) for name in state.names))
            records[state.watch] = ClearanceRecord.of(state.minima, (ALWAYS,) if ALWAYS in spans else spans)
            state.minima = []
        return records

    def _measure_past(self, steps: Sequence[int], states: FloatArray, restore: RestoreState) -> None:
        moved = self._robot.advance_all(states[:, :7], states[:, 7:])
        bounded = np.isfinite(moved)
        travels = (self._travel + np.cumsum(np.where(bounded, moved, 0.0))).tolist()
        self._travel = travels[-1]
        for first, end in self._stretches(steps, np.flatnonzero(~bounded).tolist()):
            row = max(first, bisect_right(travels, self._next))
            while row < end:
                restore(row)
                self._measure(steps[row], travels[row], float(moved[row]))
                row = max(row + 1, bisect_right(travels, self._next))

    def _stretches(self, steps: Sequence[int], far: Sequence[int]) -> Iterator[tuple[int, int]]:
        """Yield ranges of rows; at each start a watch opens, or the travel is unknown."""
        opened = (bisect_left(steps, opening) for opening in self._openings)
        starts = sorted({0, *far, *(row for row in opened if row < len(steps))})
        for first, end in pairwise((*starts, len(steps))):
            self._open(steps[first])
            if first in far:
                self._forget()
            yield first, end

    def _measure(self, step: int, travel: float, moved: float) -> None:
        for watch_state in self._watches:
            if travel > watch_state.due:
                watch_state.measure(self._near, step / self._rate, travel, moved)
        self._next = min([watch_state.due for watch_state in self._watches])

    def _forget(self) -> None:
        for watch_state in self._watches:
            watch_state.forget()
        self._next = -math.inf

    def _open(self, step: int) -> None:
        if not self._openings or step < self._openings[-1]:
            return
        while self._openings and step >= self._openings[-1]:
            self._openings.pop()
        for watch_state in self._watches:
            watch_state.begin()
        self._next = -math.inf


def _motion_of(name: str, radius: float, body_at: Callable[[str], Sequence[float]]) -> Callable[[], float]:
    bound = BodyMotionBound(radius)
    return lambda: bound.advance(body_at(name))


def _moves(body: Body) -> bool:
    return body.mass is not None or bool(body.path) or body.appears is not None or body.disappears is not None
