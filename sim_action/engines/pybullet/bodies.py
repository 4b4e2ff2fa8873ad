"""Bodies of PyBullet: their present poses, distances, contacts, overlaps and rays, and forces and motions for a step.

Rays hit flat surfaces exactly; on round ones PyBullet stops within 1 mm of the surface. They hit only the
collision groups that they ask for, and the robot has a group of its own.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pybullet
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.engines.body_control import MAX_ATTRACTION_M, BodyControl, RobotInertia, Target, base_wrench
from sim_action.engines.observers import Nearest, ReadPoses, deepest
from sim_action.engines.pybullet.loaded_bodies import BASE
from sim_action.state.command import BasePush
from sim_action.state.observation import Clash, Contact, Overlap
from sim_action.state.trace_records import LinkTouch
from sim_action.world import GROUND, MAX_ACTORS

if TYPE_CHECKING:
    from sim_action.engines.pybullet.sliding import SlidingWheels


def link_pose(client: int, robot: int, link: int) -> Pose:
    """Return the pose of a link's frame, world frame; not for the base."""
    return _frame(_state(client, robot, link))


def link_twist(client: int, robot: int, link: int) -> Twist:
    """Return the twist of the origin of a link's frame, world frame; not for the base."""
    state = _state(client, robot, link)
    (cx, cy, cz), (px, py, pz), (vx, vy, vz), angular = state[0], _frame(state).position_xyz, state[6], state[7]
    # PyBullet reports the velocity of the centre of mass.
    ux, uy, uz = geometry.cross(angular, (px - cx, py - cy, pz - cz))
    return Twist((vx + ux, vy + uy, vz + uz), angular)


def in_link_frame(com: Sequence[Any], com_in_link: Pose) -> tuple[Any, ...]:
    """Convert pose and twist from the base link's centre of mass to its frame: 13 numbers or 13 columns.

    It computes element by element, so that the result for one moment does not depend on how many moments are computed
    together. Matrix products do not guarantee that.
    """
    px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = com
    orientation = (qx, qy, qz, qw)
    if com_in_link.orientation_xyzw != geometry.IDENTITY:
        orientation = geometry.multiply(orientation, geometry.conjugate(com_in_link.orientation_xyzw))
    ox, oy, oz = offset = geometry.rotate(orientation, com_in_link.position_xyz)
    ux, uy, uz = geometry.cross((wx, wy, wz), offset)
    return (px - ox, py - oy, pz - oz, *orientation, vx - ux, vy - uy, vz - uz, wx, wy, wz)


def _frame(state: Any) -> Pose:
    return geometry.compose(Pose(*state[:2]), geometry.inverse(Pose(*state[2:4])))


def _state(client: int, robot: int, link: int) -> Any:
    # Without computeForwardKinematics the state would be that before the last step.
    return pybullet.getLinkState(robot, link, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client)


def pose_reader(client: int, bodies: Sequence[tuple[int, Pose]]) -> ReadPoses:
    """Return a function that reads the poses of bodies; each is given by the number and the pose of one piece."""
    numbers = [number for number, _ in bodies]
    aside = {place: geometry.inverse(piece) for place, (_, piece) in enumerate(bodies) if piece != Pose()}

    def look() -> Sequence[float]:
        poses = [pybullet.getBasePositionAndOrientation(number, client) for number in numbers]
        for place, back in aside.items():
            pose = geometry.compose(Pose(*poses[place]), back)
            poses[place] = pose.position_xyz, pose.orientation_xyzw
        return [value for position, orientation in poses for value in (*position, *orientation)]

    return look


# Up to this many links are queried one by one; beyond, one query for the whole robot is cheaper.
_MAX_SINGLE_QUERIES: Final = 3
_ANYWHERE_M: Final = 1e5


class Distances:
    """Measures present distances between the robot's links and bodies of the world."""

    def __init__(self, client: int, robot: int, links: Mapping[int, str], bodies: Mapping[int, str]) -> None:
        """`links`, `bodies`: PyBullet number -> name; a body may have several numbers."""
        self._client, self._robot, self._names = client, robot, links
        self._bodies: dict[str, list[int]] = {}
        for number, name in bodies.items():
            self._bodies.setdefault(name, []).append(number)
        self._links = {name: index for index, name in links.items()}

    def near(self, body: str, links: Collection[str] | None, within: float) -> dict[str, float]:
        """Return the distances of links to a body, as `LinkDistances` does."""
        distances: dict[str, float] = {}
        points = (point for number in self._bodies[body] for point in self._points(number, links, within))
        for point in points:
            name, distance = self._names[point[3]], point[8]
            if distance < distances.get(name, math.inf) and (links is None or name in links):
                distances[name] = distance
        return distances

    def nearest(self, body: str, links: Collection[str]) -> dict[str, Nearest]:
        """Return the nearest points of links to a body, as `NearestPoints` does."""
        nearest: dict[str, Nearest] = {}
        for link, number in itertools.product(links, self._bodies[body]):
            index, client = self._links[link], self._client
            for point in pybullet.getClosestPoints(self._robot, number, _ANYWHERE_M, index, physicsClientId=client):
                if link not in nearest or point[8] < nearest[link].distance:
                    nearest[link] = Nearest(point[8], point[5])
        return nearest

    def _points(self, body: int, links: Collection[str] | None, within: float) -> Sequence[Any]:
        """Return the nearest points, at least for these links."""
        robot, client = self._robot, self._client
        if links is None or len(links) > _MAX_SINGLE_QUERIES:
            closest_points: Sequence[Any] = pybullet.getClosestPoints(robot, body, within, physicsClientId=client)
            return closest_points
        points: list[Any] = []
        for link in links:
            points += pybullet.getClosestPoints(robot, body, within, self._links[link], physicsClientId=client)
        return points

    def radii(self) -> dict[str, float]:
        """Return link -> greatest distance in m of its shapes from its frame (base: from its centre of mass)."""
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


Loose = Callable[[int, int], bool]
"""Return True for the number of a body and the index of its link if that can move; the robot is no such body."""


def touching(
    client: int, robot: int, links: Mapping[int, str], bodies: Mapping[int, str], is_loose: Loose
) -> Iterator[Overlap | Clash]:
    """Yield the contacts of the last step: of the robot, and of bodies of which one can move with each other."""
    for point in pybullet.getContactPoints(physicsClientId=client):
        one, other, distance = point[1], point[2], point[8]
        # Points are reported from a gap of 2 cm on.
        if distance > 0 and point[9] <= 0:
            continue
        if robot in {one, other}:
            link, body = (point[3], other) if one == robot else (point[4], one)
            if body in bodies:
                yield Overlap(links[link], bodies[body], -distance)
        elif one != other and one in bodies and other in bodies and any(map(is_loose, point[1:3], point[3:5])):
            yield Clash(bodies[one], bodies[other], -distance)


def overlaps(client: int, robot: int, links: Mapping[int, str], bodies: Mapping[int, str]) -> tuple[Overlap, ...]:
    """Return the links of the robot that overlap bodies; each pair once."""
    # Contact points would belong to the last step, which may not exist yet.
    points = (
        (point, name)
        for body, name in bodies.items()
        for point in pybullet.getClosestPoints(robot, body, 0.0, physicsClientId=client)
    )
    return deepest(Overlap(links[point[3]], name, -point[8]) for point, name in points)


def clashes(client: int, moving: Collection[int], bodies: Mapping[int, str], is_loose: Loose) -> tuple[Clash, ...]:
    """Return the moving bodies that overlap other bodies; each pair once."""
    pairs = (
        (one, other) for one in moving for other in bodies if not (other == one or (other in moving and other < one))
    )
    points = (point for pair in pairs for point in pybullet.getClosestPoints(*pair, 0.0, physicsClientId=client))
    return deepest(
        Clash(bodies[point[1]], bodies[point[2]], -point[8])
        for point in points
        if any(map(is_loose, point[1:3], point[3:5]))
    )


# Collision groups. Bullet's own (btBroadphaseProxy.h) go up to 32; every body is in one of the first two.
_MOVING: Final = 1
_FIXED: Final = 2
_ROBOT: Final = 64
_ALL: Final = -1
# PyBullet loses the last ray of a batch of its maximum size.
_MAX_RAYS_PER_CALL: Final = pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE - 1

_HIT_FRACTION: Final = itemgetter(2)


def hide_from_rays(client: int, robot: int, number: int, *, fixed: bool) -> int:
    """Put a robot into a collision group of its own that still touches the same bodies.

    `number`: of the robot among all of the world. `fixed`: the base is fixed; like all fixed bodies it then does not
    collide with fixed bodies. Return the groups that rays of this robot hit: all but its own.
    """
    group = _ROBOT << number
    pybullet.setCollisionFilterGroupMask(robot, BASE, group, _ALL ^ _FIXED if fixed else _ALL, client)
    for link in range(pybullet.getNumJoints(robot, client)):
        pybullet.setCollisionFilterGroupMask(robot, link, group, _ALL, client)
    robots = (_ROBOT << MAX_ACTORS + 1) - _ROBOT
    return _MOVING | _FIXED | (robots ^ group)


def cast_rays(client: int, start_xyz: Vector3, ends_xyz: NDArray[np.float64], seen: int) -> NDArray[np.float64]:
    """Return the fraction at which each ray hits `seen` groups, as `EngineQueries.cast_rays` does."""
    shares: NDArray[np.float64] = np.empty(len(ends_xyz))
    for first in range(0, len(ends_xyz), _MAX_RAYS_PER_CALL):
        # PyBullet reads lists faster than arrays.
        ends = ends_xyz[first : first + _MAX_RAYS_PER_CALL].tolist()
        hits = pybullet.rayTestBatch(
            [start_xyz] * len(ends), ends, numThreads=1, collisionFilterMask=seen, physicsClientId=client
        )
        shares[first : first + len(ends)] = list(map(_HIT_FRACTION, hits))
    # PyBullet reports a fraction of 1 for a ray that hits nothing.
    shares[shares >= 1] = np.inf
    return shares


class Contacts:
    """Reads the contacts of the last step."""

    def __init__(self, client: int, robot: int, links: Mapping[int, str], bodies: Mapping[int, str]) -> None:
        """`links`, `bodies`: PyBullet number -> name; a body may have several numbers."""
        self._client, self._robot, self._links, self._bodies = client, robot, links, bodies
        self._immovable, self._on_paths = frozenset[int](), frozenset[int]()

    def leave_out(self, links: Iterable[int], bodies: Iterable[int]) -> None:
        """Leave out links that cannot move with bodies on paths: PyBullet reports some, without a force."""
        self._immovable, self._on_paths = frozenset(links), frozenset(bodies)

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


class PyBulletBodyControl(BodyControl):
    """The bodies of PyBullet. Contacts do not move a body without a mass, but its velocity acts on what touches it."""

    def __init__(
        self,
        client: int,
        robot: int,
        links: Mapping[str, int],
        objects: Mapping[str, Sequence[tuple[int, Pose]]],
        *,
        tiles: Sequence[int] = (),
        sliding: SlidingWheels | None = None,
    ) -> None:
        """`objects`: body -> PyBullet number and pose in the body of each of its pieces; `tiles`: of the ground."""
        self._client, self._robot, self._links, self._objects = client, robot, links, objects
        self._tiles, self._sliding = tiles, sliding

    @override
    def pose(self, body: str) -> Pose:
        number, piece = self._objects[body][0]
        middle = Pose(*pybullet.getBasePositionAndOrientation(number, self._client))
        return geometry.compose(middle, geometry.inverse(piece)) if piece != Pose() else middle

    @override
    def set_pose(self, body: str, pose: Pose, twist: Twist) -> None:
        for number, piece in self._objects[body]:
            at = geometry.compose(pose, piece)
            arm = geometry.rotate(pose.orientation_xyzw, piece.position_xyz)
            around = geometry.cross(twist.angular_xyz, arm)
            velocity = [speed + more for speed, more in zip(twist.linear_xyz, around, strict=True)]
            # Setting a pose clears the velocity.
            pybullet.resetBasePositionAndOrientation(number, at.position_xyz, at.orientation_xyzw, self._client)
            pybullet.resetBaseVelocity(number, velocity, twist.angular_xyz, self._client)

    @override
    def apply_force(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        body, link = self._number(target)
        at = self._middle(body, link)
        if point_xyz is not None:
            own = self._objects[target.name][0][1] if not target.is_link else self._inertial(body, link)
            at = geometry.compose(at, geometry.compose(geometry.inverse(own), Pose(point_xyz)))
        world = pybullet.WORLD_FRAME
        pybullet.applyExternalForce(body, link, force_xyz, at.position_xyz, world, self._client)
        pybullet.applyExternalTorque(body, link, torque_xyz, world, self._client)

    @override
    def attract(self, target: Target, force: float) -> None:
        pieces = [(self._robot, self._links[target.name])] if target.is_link else []
        pieces = pieces or [(number, BASE) for number, _ in self._objects[target.name]]
        names = {number: name for name, several in self._objects.items() for number, _ in several}
        touching: dict[int | str, list[Any]] = {}
        for body, link in pieces:
            for point in pybullet.getContactPoints(body, linkIndexA=link, physicsClientId=self._client):
                if point[2] != body and point[8] < MAX_ATTRACTION_M:
                    thing = point[4] if point[2] == self._robot else names.get(point[2], GROUND)
                    touching.setdefault(thing, []).append(point)
        for points in touching.values():
            for point in points:
                # The normal points from the second body to the first.
                pull = geometry.scale(point[7], force / len(points))
                for body, link, pulled in (
                    (point[1], point[3], geometry.scale(pull, -1.0)),
                    (point[2], point[4], pull),
                ):
                    pybullet.applyExternalForce(body, link, pulled, point[5], pybullet.WORLD_FRAME, self._client)

    @override
    def clear_forces(self) -> None:
        """Do nothing: PyBullet clears them itself after each step."""

    @override
    def add_mass(self, link: str, mass: float) -> None:
        at = self._robot, self._links[link]
        before, _, inertia, *_ = pybullet.getDynamicsInfo(*at, self._client)
        # PyBullet computes an inertia from the shapes of the link.
        pybullet.changeDynamics(*at, mass=before + mass, physicsClientId=self._client)
        pybullet.changeDynamics(*at, localInertiaDiagonal=inertia, physicsClientId=self._client)

    @override
    def scale_friction(self, patch: int, factor: float) -> None:
        tile = self._tiles[patch], BASE
        friction = factor * pybullet.getDynamicsInfo(*tile, self._client)[1]
        pybullet.changeDynamics(*tile, lateralFriction=friction, physicsClientId=self._client)
        if self._sliding is not None:
            self._sliding.forget()

    @override
    def add_velocity(self, target: Target, velocity_xyz: Vector3) -> None:
        body, _ = self._number(target)
        (vx, vy, vz), turning = pybullet.getBaseVelocity(body, self._client)
        dx, dy, dz = velocity_xyz
        pybullet.resetBaseVelocity(body, (vx + dx, vy + dy, vz + dz), turning, self._client)

    def _number(self, target: Target) -> tuple[int, int]:
        return (self._robot, self._links[target.name]) if target.is_link else (self._objects[target.name][0][0], BASE)

    def _middle(self, body: int, link: int) -> Pose:
        if link == BASE:
            return Pose(*pybullet.getBasePositionAndOrientation(body, self._client))
        return geometry.compose(link_pose(self._client, body, link), self._inertial(body, link))

    def _inertial(self, body: int, link: int) -> Pose:
        return Pose(*pybullet.getDynamicsInfo(body, link, self._client)[3:5])


class BasePusher:
    """Applies the last push of the base at every step. `push`: the push in effect; None without one."""

    def __init__(self, client: int, robot: int, rate: float) -> None:
        self._client, self._robot, self._time_step = client, robot, 1 / rate
        # The inertia of the whole robot with its joints at their present positions.
        middle, _ = pybullet.getBasePositionAndOrientation(robot, client)
        mass = inertia = 0.0
        for link in range(-1, pybullet.getNumJoints(robot, client)):
            own_mass, _, own_inertia, *_ = pybullet.getDynamicsInfo(robot, link, client)
            place = middle if link < 0 else pybullet.getLinkState(robot, link, physicsClientId=client)[0]
            mass += own_mass
            inertia += own_mass * math.dist(place[:2], middle[:2]) ** 2 + min(own_inertia)
        self._inertia = RobotInertia(mass, inertia)
        self.push: BasePush | None = None

    def step(self, pose: Pose, twist: Twist) -> None:
        """Apply the force of the next step; `pose`, `twist`: of the base link's origin, world frame."""
        if self.push is None:
            return
        wrench = base_wrench(self.push, self._inertia, pose, twist, self._time_step)
        world = pybullet.WORLD_FRAME
        pybullet.applyExternalForce(self._robot, BASE, wrench.force_xyz, wrench.point_xyz, world, self._client)
        pybullet.applyExternalTorque(self._robot, BASE, wrench.torque_xyz, world, self._client)
