"""The robot's part of the engine's state, step by step, as rows of a trace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from sim_action import geometry
from sim_action.backends.mujoco.model import Compiled
from sim_action.geometry import Pose, Twist
from sim_action.observation import ByName, JointState
from sim_action.trace import FloatArray


class Present(NamedTuple):
    """What the robot is like now: sim time in s, base link and its twist in the world frame, joints by name."""

    time: float
    pose: Pose
    twist: Twist
    joints: dict[str, JointState]


class States:
    """Keeps what the state is after each step, as cheaply as it can; what it is in our terms is worked out at the end.

    A row is (1 + P + V + J,): step, qpos, qvel, efforts of the motors.
    """

    def __init__(
        self, compiled: Compiled, joint_names: Sequence[str], rate: float, read_efforts: Callable[[FloatArray], None]
    ) -> None:
        self._compiled, self._rate, self._read_efforts = compiled, rate, read_efforts
        self._joints = len(compiled.positions)
        # Live views of the robot's part: it was added to the world first.
        self._qpos = compiled.data.qpos[: compiled.robot_qpos]
        self._qvel = compiled.data.qvel[: compiled.robot_qvel]
        self._speeds = 1 + len(self._qpos)
        self._efforts = self._speeds + len(self._qvel)
        self._blocks: list[FloatArray] = []
        self._end = 0
        # Of each joint: its name, and where in a row its position, velocity and effort are.
        efforts = range(self._efforts, self._efforts + self._joints)
        positions, velocities = 1 + compiled.positions, self._speeds + compiled.velocities
        self._places = list(zip(joint_names, positions.tolist(), velocities.tolist(), efforts, strict=True))
        self._fixed_pose = self._pose_of_fixed() if compiled.fixed else None

    def expect(self, first_step: int, steps: int) -> FloatArray:
        """Room for so many steps, to be filled by `keep`: until then they are no numbers."""
        block = np.full((steps, self._efforts + self._joints), np.nan)
        block[:, 0] = np.arange(first_step, first_step + steps)
        self._blocks.append(block)
        self._end = first_step + steps - 1
        return block

    def keep(self, row: FloatArray) -> None:
        """Writes down the present."""
        row[1 : self._speeds] = self._qpos
        row[self._speeds : self._efforts] = self._qvel
        self._read_efforts(row[self._efforts :])

    def place(self, row: FloatArray) -> tuple[list[float], list[float]]:
        """The pose (7,) of the base, whatever its quaternion's order, and the joint positions (J,) of a row."""
        told = row[: self._speeds].tolist()
        base = [0.0] * 7 if self._fixed_pose is not None else told[1:8]
        return base, [told[position] for _, position, _, _ in self._places]

    def collect(self) -> FloatArray:
        """(T, 14 + 3 J): rows of `Trace.state` for the steps since the last call."""
        blocks, self._blocks = self._blocks, []
        return self._in_our_terms(np.concatenate(blocks or [np.empty((0, self._efforts + self._joints))]))

    def now(self, step: int) -> Present:
        """The present, as that of a step: bit by bit what `collect` makes of it.

        Number by number, since arrays of one row would take five times as long.
        """
        row = self._last(step).tolist()
        joints = ByName((name, JointState(row[p], row[v], row[e])) for name, p, v, e in self._places)
        return Present(step / self._rate, *self._present_base(row), joints)

    def _last(self, step: int) -> FloatArray:
        """(1 + P + V + J,): after a step, its row is the present; else it is read anew."""
        if self._blocks and step == self._end:
            last: FloatArray = self._blocks[-1][-1]
            return last
        row = np.empty(self._efforts + self._joints)
        row[0] = step
        self.keep(row)
        return row

    def _present_base(self, row: list[float]) -> tuple[Pose, Twist]:
        if self._fixed_pose is not None:
            return self._fixed_pose, Twist()
        _, x, y, z, qw, qx, qy, qz = row[:8]
        vx, vy, vz, wx, wy, wz = row[self._speeds : self._speeds + 6]
        orientation = (qx, qy, qz, qw)
        # The engine has the angular velocity in the body's own frame, the linear one in the world's.
        return Pose((x, y, z), orientation), Twist((vx, vy, vz), geometry.rotate(orientation, (wx, wy, wz)))

    def _in_our_terms(self, rows: FloatArray) -> FloatArray:
        positions, velocities = 1 + self._compiled.positions, self._speeds + self._compiled.velocities
        joints = (rows[:, positions], rows[:, velocities], rows[:, self._efforts :])
        return np.concatenate((rows[:, :1] / self._rate, self._base(rows), *joints), axis=1)

    def _pose_of_fixed(self) -> Pose:
        x, y, z, qx, qy, qz, qw = self._base(np.empty((1, 0)))[0, :7].tolist()
        return Pose((x, y, z), (qx, qy, qz, qw))

    def _base(self, rows: FloatArray) -> FloatArray:
        """(T, 13): where the base link is, x, y, z, w, and its twist in the world frame."""
        base: FloatArray = np.zeros((len(rows), 13))
        if self._compiled.fixed:
            model, body = self._compiled.model, self._compiled.base
            base[:, :3], base[:, 3:7] = model.body_pos[body], model.body_quat[body][[1, 2, 3, 0]]
            return base
        base[:, :3], base[:, 3:7] = rows[:, 1:4], rows[:, [5, 6, 7, 4]]
        base[:, 7:10] = rows[:, self._speeds : self._speeds + 3]
        # The engine has the angular velocity in the body's own frame, the linear one in the world's.
        orientation: Any = tuple(base[:, 3:7].T)
        turning: Any = tuple(rows[:, self._speeds + 3 : self._speeds + 6].T)
        base[:, 10:13] = np.column_stack(geometry.rotate(orientation, turning))
        return base
