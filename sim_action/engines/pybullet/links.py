"""Where the links of a robot are in PyBullet, and how they move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pybullet

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist


def link_pose(client: int, robot: int, link: int) -> Pose:
    """Of a link's frame in the world; not for the base."""
    return _frame(_state(client, robot, link))


def link_twist(client: int, robot: int, link: int) -> Twist:
    """Of the origin of a link's frame, world frame; not for the base."""
    state = _state(client, robot, link)
    (cx, cy, cz), (px, py, pz), (vx, vy, vz), angular = state[0], _frame(state).position_xyz, state[6], state[7]
    # The engine has the velocity of the centre of mass.
    ux, uy, uz = geometry.cross(angular, (px - cx, py - cy, pz - cz))
    return Twist((vx + ux, vy + uy, vz + uz), angular)


def in_link_frame(com: Sequence[Any], com_in_link: Pose) -> tuple[Any, ...]:
    """Base pose and twist of the link frame from those of the centre of mass: 13 numbers, or as many columns.

    Only element by element: what is computed for a moment must not depend on how many moments are computed with it,
    which products of matrices do not promise.
    """
    px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = com
    orientation = (qx, qy, qz, qw)
    if com_in_link.orientation_xyzw != geometry.IDENTITY:
        orientation = geometry.multiply(orientation, geometry.conjugate(com_in_link.orientation_xyzw))
    ox, oy, oz = offset = geometry.rotate(orientation, com_in_link.position_xyz)
    ux, uy, uz = geometry.cross((wx, wy, wz), offset)
    return (px - ox, py - oy, pz - oz, *orientation, vx - ux, vy - uy, vz - uz, wx, wy, wz)


def _frame(state: Any) -> Pose:
    """The engine tells it, too, but in single precision; the centre of mass, and where that is in it, in double."""
    return geometry.compose(Pose(*state[:2]), geometry.inverse(Pose(*state[2:4])))


def _state(client: int, robot: int, link: int) -> Any:
    # Without being worked out anew, it would be that of before the last step.
    return pybullet.getLinkState(robot, link, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client)
