"""Move bodies and apply forces in PyBullet."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pybullet
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.engines.body_control import MAX_ATTRACTION_M, BodyControl, RobotInertia, Target, base_wrench
from sim_action.engines.pybullet.loaded_bodies import BASE
from sim_action.engines.pybullet.queries import link_pose
from sim_action.state.command import BasePush
from sim_action.world import GROUND

if TYPE_CHECKING:
    from sim_action.engines.pybullet.sliding import SlidingWheels


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
        found = Pose(*pybullet.getBasePositionAndOrientation(number, self._client))
        return geometry.compose(found, geometry.inverse(piece))

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
        self._inertia = _robot_inertia(client, robot)
        self.push: BasePush | None = None

    def step(self, pose: Pose, twist: Twist) -> None:
        """Apply the force of the next step; `pose`, `twist`: of the base link's origin, world frame."""
        if self.push is None:
            return
        found = base_wrench(self.push, self._inertia, pose, twist, self._time_step)
        world = pybullet.WORLD_FRAME
        pybullet.applyExternalForce(self._robot, BASE, found.force_xyz, found.point_xyz, world, self._client)
        pybullet.applyExternalTorque(self._robot, BASE, found.torque_xyz, world, self._client)


def _robot_inertia(client: int, robot: int) -> RobotInertia:
    """Return the inertia of the whole robot with its joints at their present positions."""
    middle, _ = pybullet.getBasePositionAndOrientation(robot, client)
    mass = inertia = 0.0
    for link in range(-1, pybullet.getNumJoints(robot, client)):
        own_mass, _, own_inertia, *_ = pybullet.getDynamicsInfo(robot, link, client)
        place = middle if link < 0 else pybullet.getLinkState(robot, link, physicsClientId=client)[0]
        mass += own_mass
        inertia += own_mass * math.dist(place[:2], middle[:2]) ** 2 + min(own_inertia)
    return RobotInertia(mass, inertia)
