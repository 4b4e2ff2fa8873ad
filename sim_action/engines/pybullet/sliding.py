"""Sliding wheels in PyBullet: turns their friction against the direction of slip.

Bullet solves the friction of a contact along two axes of the world. If the contact slides, each part of the force is
proportional to the slip along its axis, and to how hard it is to accelerate the contact along it. A wheel rolls easily
and is hard to push sideways. So its friction is not opposite to its slip, and changes with the heading: rovers
with four wheels turned by 6 to 60 % less than by Coulomb's law, and by another angle after a start turned by 1 deg.

After each step, the difference between Coulomb's force and Bullet's is known for each contact that slides. It acts on
the link, and in the opposite direction on a body that can move, as an external force in the next step.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from typing import Final

import pybullet

from sim_action.core.geometry import Vector3
from sim_action.engines.pybullet.loaded_bodies import BASE

_SLIDING_SHARE: Final = 0.98  # a contact slides if its friction has reached this share of its limit
_MIN_SLIP: Final = 1e-6  # m/s; below, the slip has no direction

# The centre of mass, its velocity and the angular velocity of a body, in m, m/s and rad/s.
_Motion = tuple[Vector3, Vector3, Vector3]


class SlidingWheels:
    """The friction of some links of the robot. Only they are corrected, because this takes as long as a step."""

    def __init__(self, client: int, robot: int, links: Iterable[int], movers: Collection[int]) -> None:
        """`movers`: the bodies of the world that can move."""
        self._client, self._robot, self._links, self._movers = client, robot, frozenset(links), frozenset(movers)
        # Link, other body, and its link -> coefficient.
        self._frictions: dict[tuple[int, int, int], float] = {}

    def forget(self) -> None:
        """Look up all friction again."""
        self._frictions.clear()

    def correct(self) -> None:
        """Apply the missing friction of the last step to the next one."""
        moving: dict[tuple[int, int], _Motion] = {}
        for point in pybullet.getContactPoints(self._robot, physicsClientId=self._client):
            link, body, pressing = point[3], point[2], point[9]
            if link not in self._links or pressing <= 0.0:
                continue
            x, y, z = (point[10] * one + point[12] * two for one, two in zip(point[11], point[13], strict=True))
            limit = self._friction(link, body, point[4]) * pressing
            if math.sqrt(x * x + y * y + z * z) < _SLIDING_SHARE * limit:
                continue
            if (self._robot, link) not in moving:
                state = pybullet.getLinkState(self._robot, link, 1, 1, self._client)
                moving[self._robot, link] = state[0], state[6], state[7]
            velocity_xyz = _velocity(moving[self._robot, link], point[5])
            if body in self._movers:
                if (body, BASE) not in moving:
                    moving[body, BASE] = self._body_motion(body)
                vx, vy, vz = _velocity(moving[body, BASE], point[5])
                velocity_xyz = velocity_xyz[0] - vx, velocity_xyz[1] - vy, velocity_xyz[2] - vz
            slip_x, slip_y, slip_z = _along(velocity_xyz, point[7])
            speed = math.sqrt(slip_x * slip_x + slip_y * slip_y + slip_z * slip_z)
            if speed > _MIN_SLIP:
                share = -limit / speed
                missing = (share * slip_x - x, share * slip_y - y, share * slip_z - z)
                self._push(self._robot, link, missing, point[5])
                if body in self._movers:
                    self._push(body, BASE, (-missing[0], -missing[1], -missing[2]), point[5])

    def _push(self, body: int, link: int, force_xyz: Vector3, point_xyz: Vector3) -> None:
        pybullet.applyExternalForce(body, link, force_xyz, point_xyz, pybullet.WORLD_FRAME, self._client)

    def _body_motion(self, body: int) -> _Motion:
        place_xyz, _ = pybullet.getBasePositionAndOrientation(body, self._client)
        linear_xyz, angular_xyz = pybullet.getBaseVelocity(body, self._client)
        return place_xyz, linear_xyz, angular_xyz

    def _friction(self, link: int, body: int, its_link: int) -> float:
        friction = self._frictions.get((link, body, its_link))
        if friction is None:
            one = pybullet.getDynamicsInfo(self._robot, link, self._client)[1]
            other = pybullet.getDynamicsInfo(body, its_link, self._client)[1]
            friction = self._frictions[link, body, its_link] = float(one * other)
        return friction


def _velocity(motion: _Motion, point_xyz: Vector3) -> Vector3:
    (cx, cy, cz), (vx, vy, vz), (wx, wy, wz) = motion
    rx, ry, rz = point_xyz[0] - cx, point_xyz[1] - cy, point_xyz[2] - cz
    return vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx


def _along(velocity_xyz: Vector3, normal_xyz: Vector3) -> Vector3:
    (vx, vy, vz), (nx, ny, nz) = velocity_xyz, normal_xyz
    away = vx * nx + vy * ny + vz * nz
    return vx - away * nx, vy - away * ny, vz - away * nz
