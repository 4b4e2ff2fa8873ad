"""The record of the robot's state after each PyBullet step: rows of `Trace.state`."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from struct import Struct
from typing import TYPE_CHECKING, Final

import numpy as np
import pybullet

from sim_action.core.geometry import Pose, Twist
from sim_action.engines.pybullet.queries import in_link_frame
from sim_action.engines.pybullet.scene import BASE
from sim_action.robot.model.link_motion import LinkStates
from sim_action.state.observation import ByName, Contact, JointState, Observation
from sim_action.state.trace import Trace

if TYPE_CHECKING:
    from sim_action.engines.pybullet.passive_joints import BallJoints
    from sim_action.robot.model.robot_model import RobotModel

_BASE_COLUMNS: Final = 14


class StateRecorder:
    """Reads the state of the robot, and keeps that of each step.

    A kept row holds the time, the 13 numbers of the base's centre of mass, and position, velocity and effort of each
    joint. All rows are kept in one array of bytes: numbers, or a string for each row, would be read again from memory
    that the steps in between have pushed out.
    """

    def __init__(
        self,
        client: int,
        robot: int,
        joints: Sequence[str],
        motors: Collection[int],
        balls: BallJoints | None,
        *,
        rate: float,
        efforts: Mapping[int, float],
    ) -> None:
        """Prepare the record.

        :param joints: the names of all joints; those that motors can move come before the ball joints.
        :param motors: the numbers of the joints that motors can move.
        :param efforts: number of a joint -> the effort that a controller applies. PyBullet reports only its own motors,
            which are the friction that such an effort works against. The caller changes this mapping.
        """
        self._client, self._robot, self._motors, self._balls = client, robot, list(motors), balls
        self._joints, self._rate, self._efforts = tuple(joints), rate, efforts
        self._width = _BASE_COLUMNS + 3 * len(self._joints)
        self._rows = bytearray()
        self._packed = Struct(f"={self._width}d")
        _, _, _, com_position, com_orientation, *_ = pybullet.getDynamicsInfo(robot, BASE, client)
        self.com_in_link: Final = Pose(com_position, com_orientation)
        """The centre of mass of the base, in the frame of its link."""

    def keep(self, step: int) -> None:
        """Read the present state, and keep it as that of a step; it is called at every step."""
        self._rows += self._packed.pack(*self._read(step))

    def last(self) -> list[float]:
        """Return the row that was kept last, in the order of `Trace.state`, but with the base's centre of mass."""
        row = self._last()
        positions, velocities, efforts = (row[_BASE_COLUMNS + group :: 3] for group in range(3))
        return [*row[:_BASE_COLUMNS], *positions, *velocities, *efforts]

    def collect(self) -> Trace:
        """Return the states that were kept since the last call."""
        kept = np.frombuffer(self._rows).reshape(-1, self._width)
        self._rows = bytearray()
        state = np.empty_like(kept)
        state[:, 0] = kept[:, 0]
        # Arithmetic on rows of memory is faster than on columns.
        com = np.ascontiguousarray(kept[:, 1:_BASE_COLUMNS].T)
        for column, values in enumerate(in_link_frame(tuple(com), self.com_in_link), start=1):
            state[:, column] = values
        joints = len(self._joints)
        for group in range(3 if joints else 0):
            first = _BASE_COLUMNS + group * joints
            state[:, first : first + joints] = kept[:, _BASE_COLUMNS + group :: 3]
        return Trace(self._joints, state)

    def observe(self, step: int, model: RobotModel, contacts: Sequence[Contact]) -> Observation:
        """Return the present state as that of a step."""
        row: Sequence[float] = self._last() if self._rows else ()
        # The row of the last step is the present state.
        if not row or row[0] != step / self._rate:
            row = self._read(step)
        pose, twist = self.base_of(row[1:_BASE_COLUMNS])
        columns = (row[_BASE_COLUMNS + group :: 3] for group in range(3))
        joints = ByName(zip(self._joints, map(JointState, *columns), strict=True))
        links = LinkStates(model, pose, twist, joints)
        return Observation(row[0], pose, twist, joints, contacts, links=links)

    def base_of(self, com: Sequence[float]) -> tuple[Pose, Twist]:
        """Return pose and twist of the base link from the 13 numbers of its centre of mass."""
        px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = in_link_frame(com, self.com_in_link)
        return Pose((px, py, pz), (qx, qy, qz, qw)), Twist((vx, vy, vz), (wx, wy, wz))

    def _last(self) -> tuple[float, ...]:
        return self._packed.unpack_from(self._rows, len(self._rows) - self._packed.size)

    def _read(self, step: int) -> list[float]:
        """Return the row of the present state."""
        position, orientation = pybullet.getBasePositionAndOrientation(self._robot, self._client)
        linear, angular = pybullet.getBaseVelocity(self._robot, self._client)
        row: list[float] = [step / self._rate, *position, *orientation, *linear, *angular]
        if self._motors:
            if self._efforts:
                self._read_motors(row)
            else:
                for angle, velocity, _, effort in pybullet.getJointStates(self._robot, self._motors, self._client):
                    row += (angle, velocity, effort)
        if self._balls is not None:
            for angle, speed in zip(*self._balls.state(), strict=True):
                row += (angle, speed, 0.0)
        return row

    def _read_motors(self, row: list[float]) -> None:
        states = pybullet.getJointStates(self._robot, self._motors, self._client)
        for number, (position, velocity, _, effort) in zip(self._motors, states, strict=True):
            row += (position, velocity, self._efforts.get(number, effort))
