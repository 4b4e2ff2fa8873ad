"""Passive joints in PyBullet: ball joints, and the springs of joints.

PyBullet starts each ball joint with a motor that holds it. It gives the orientation and the angular velocity of the
child link in the frame of its principal axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import pybullet

from sim_action.core import geometry
from sim_action.robot.model.robot_model import Joint, ball_angles, ball_orientation

_STILL: Final = {"targetVelocity": (0, 0, 0), "positionGain": 0, "velocityGain": 0, "force": (0, 0, 0)}


class BallJoints:
    """The ball joints of a robot."""

    def __init__(self, client: int, robot: int, joints: Mapping[str, int]) -> None:
        """`joints`: name of each ball joint -> its number."""
        self._client, self._robot, self._joints = client, robot, list(joints.values())
        self._axes = [pybullet.getDynamicsInfo(robot, joint, client)[4] for joint in self._joints]

    def release(self, positions: Sequence[float]) -> None:
        """Set the positions in rad, three for each joint, and switch the motors off."""
        for joint, axes, first in zip(self._joints, self._axes, range(0, len(positions), 3), strict=True):
            x, y, z = positions[first : first + 3]
            start = _turned(ball_orientation((x, y, z)), geometry.conjugate(axes))
            pybullet.resetJointStateMultiDof(self._robot, joint, start, physicsClientId=self._client)
            pybullet.setJointMotorControlMultiDof(
                self._robot,
                joint,
                pybullet.POSITION_CONTROL,
                targetPosition=start,
                **_STILL,
                physicsClientId=self._client,
            )

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the positions in rad and the velocities in rad/s, three for each joint."""
        positions, velocities = list[float](), list[float]()
        states = pybullet.getJointStatesMultiDof(self._robot, self._joints, self._client)
        for (turned, angular, *_), axes in zip(states, self._axes, strict=True):
            positions += ball_angles(_turned(turned, axes))
            velocities += geometry.rotate(axes, angular)
        return positions, velocities


def _turned(rotation: geometry.Quaternion, frame: geometry.Quaternion) -> geometry.Quaternion:
    x, y, z = geometry.rotate(frame, rotation[:3])
    return (x, y, z, rotation[3])


class Springs:
    """The springs of joints, which PyBullet does not have: their efforts are applied at every step."""

    def __init__(self, client: int, robot: int, joints: Mapping[int, Joint]) -> None:
        """`joints`: number -> joint."""
        self._client, self._robot = client, robot
        self._springs = [(number, joint.stiffness, joint.spring_reference) for number, joint in joints.items()]
        self._numbers = list(joints)

    def added_to(self, efforts: Mapping[int, float]) -> dict[int, float]:
        """Return efforts by number of the joint, in N m or N, with those of the springs added.

        The position before the step makes the integrator symplectic: a spring neither gains nor loses energy.
        """
        states = pybullet.getJointStates(self._robot, self._numbers, self._client)
        total = dict(efforts)
        for (number, stiffness, rest), (position, *_) in zip(self._springs, states, strict=True):
            total[number] = total.get(number, 0.0) + stiffness * (rest - position)
        return total
