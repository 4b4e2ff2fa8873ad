"""Record the robot's state after each step, and convert it to rows of a trace."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.engines.mujoco.scene import CompiledScene
from sim_action.robot.model.link_motion import LinkStates
from sim_action.robot.model.robot_model import RobotModel, ball_angles
from sim_action.state.observation import ByName, Contact, JointState, Observation
from sim_action.state.trace import FloatArray


class StateRecorder:
    """Keeps MuJoCo's raw state after each step; the conversion to a trace happens at the end.

    A row is (1 + P + V + J,): step, qpos, qvel, efforts of the motors. All but the step is kept in one array of bytes:
    copying bytes takes a third of the time of copying arrays, and objects of their own would have to be read again from
    memory that the steps in between have pushed out.
    """

    def __init__(
        self,
        compiled: CompiledScene,
        robot: RobotModel,
        rate: float,
        efforts: Callable[[], FloatArray],
    ) -> None:
        """`efforts` returns the efforts (J,) of the last step."""
        self._compiled, self._robot, self._rate, self._efforts_now = compiled, robot, rate, efforts
        # Live views of the robot's part, which comes first.
        self._qpos = compiled.data.qpos[: compiled.robot_qpos]
        self._qvel = compiled.data.qvel[: compiled.robot_qvel]
        self._qpos_bytes, self._qvel_bytes = memoryview(self._qpos), memoryview(self._qvel)
        self._speeds = 1 + len(self._qpos)
        self._efforts = self._speeds + len(self._qvel)
        self._width = self._efforts + len(compiled.positions)
        self._steps: list[int] = []
        self._kept = bytearray()
        # Per joint: its name, and the columns of its position, velocity and effort.
        positions, velocities = 1 + compiled.positions, self._speeds + compiled.velocities
        efforts_at = range(self._efforts, self._width)
        names = [joint.name for joint in robot.moving_joints]
        self._places = list(zip(names, positions.tolist(), velocities.tolist(), efforts_at, strict=True))
        # The columns of the quaternion of each ball joint, whose parts are three of the places.
        balls = positions[len(positions) - 3 * len(robot.balls) :: 3].tolist()
        self._balls = [slice(first - 1, first + 3) for first in balls]
        self._fixed_pose = self._pose_of_fixed() if compiled.fixed else None

    def opened(self) -> tuple[list[int], bytearray, memoryview, memoryview]:
        """Return where to add each step and its bytes, and live views of the first two parts of these.

        The bytes are those of qpos, of qvel, and of the efforts: (P + V + J,) numbers.
        """
        return self._steps, self._kept, self._qpos_bytes, self._qvel_bytes

    def keep_nan(self, steps: Sequence[int]) -> None:
        """Record NaN for steps after the simulation has diverged."""
        nothing = np.full(self._width - 1, np.nan).tobytes()
        self._steps += steps
        self._kept += nothing * len(steps)

    def last(self) -> list[float]:
        """Return the last row (1 + P + V + J,)."""
        # For few numbers a list takes a fifth of the time of an array.
        return [self._steps[-1], *array("d", self._kept[-8 * (self._width - 1) :])]

    def place(self, row: Sequence[float]) -> tuple[Sequence[float], list[float]]:
        """Return the pose (7,) of the base, in MuJoCo's order, and the joint positions (J,) of a row."""
        base = [0.0] * 7 if self._fixed_pose is not None else row[1:8]
        row = self._with_angles(row) if self._balls else row
        return base, [row[position] for _, position, _, _ in self._places]

    def places(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the same for T rows: (T, 7) and (T, J)."""
        base = np.zeros((len(rows), 7)) if self._fixed_pose is not None else rows[:, 1:8]
        return base, self._with_all_angles(rows)[:, 1 + self._compiled.positions]

    def robot_qpos(self, rows: FloatArray) -> FloatArray:
        """Return the robot's part of qpos, (T, P)."""
        return rows[:, 1 : self._speeds]

    def take(self) -> FloatArray:
        """Return the rows (T, 1 + P + V + J) since the last call."""
        rows = np.empty((len(self._steps), self._width))
        rows[:, 0] = self._steps
        rows[:, 1:] = np.frombuffer(self._kept).reshape(len(rows), self._width - 1)
        self._steps, self._kept = [], bytearray()
        return rows

    def now(self, step: int, contacts: Sequence[Contact]) -> Observation:
        """Return the present state as that of a step, bit by bit equal to `trace_rows`.

        It computes with single numbers, because arrays of one row would take five times as long.
        """
        row = self._row(step)
        if self._balls:
            row = self._with_angles(row)
        joints = ByName([(name, JointState(row[p], row[v], row[e])) for name, p, v, e in self._places])
        pose, twist = self._present_base(row)
        links = LinkStates(self._robot, pose, twist, joints)
        return Observation(step / self._rate, pose, twist, joints, contacts, links=links)

    def _row(self, step: int) -> list[float]:
        if self._steps and step == self._steps[-1]:
            return self.last()
        return [step, *self._qpos.tolist(), *self._qvel.tolist(), *self._efforts_now().tolist()]

    def _present_base(self, row: list[float]) -> tuple[Pose, Twist]:
        if self._fixed_pose is not None:
            return self._fixed_pose, Twist()
        _, x, y, z, qw, qx, qy, qz = row[:8]
        vx, vy, vz, wx, wy, wz = row[self._speeds : self._speeds + 6]
        orientation = (qx, qy, qz, qw)
        # MuJoCo has the angular velocity in the body frame and the linear one in the world frame.
        return Pose((x, y, z), orientation), Twist((vx, vy, vz), geometry.rotate(orientation, (wx, wy, wz)))

    def trace_rows(self, rows: FloatArray) -> FloatArray:
        """Return the rows as those of `Trace.state`, (T, 14 + 3 J)."""
        positions, velocities = 1 + self._compiled.positions, self._speeds + self._compiled.velocities
        count = len(positions)
        state = np.empty((len(rows), 14 + 3 * count))
        state[:, 0] = rows[:, 0] / self._rate
        self._write_base(rows, state[:, 1:14])
        state[:, 14 : 14 + count] = self._with_all_angles(rows)[:, positions]
        state[:, 14 + count : 14 + 2 * count] = rows[:, velocities]
        state[:, 14 + 2 * count :] = rows[:, self._efforts :]
        return state

    def _with_angles(self, row: Sequence[float]) -> list[float]:
        """Return a row in which the quaternion of each ball joint is replaced by 0 and its three angles."""
        changed = list(row)
        for at in self._balls:
            w, x, y, z = row[at]
            changed[at] = [0.0, *ball_angles((x, y, z, w))]
        return changed

    def _with_all_angles(self, rows: FloatArray) -> FloatArray:
        return np.array([self._with_angles(row) for row in rows.tolist()]) if self._balls and len(rows) else rows

    def _pose_of_fixed(self) -> Pose:
        base = np.empty((1, 13))
        self._write_base(base[:, :0], base)
        x, y, z, qx, qy, qz, qw = base[0, :7].tolist()
        return Pose((x, y, z), (qx, qy, qz, qw))

    def _write_base(self, rows: FloatArray, base: FloatArray) -> None:
        """Write pose (quaternion x, y, z, w) and twist of the base link into `base`, (T, 13), world frame."""
        if self._compiled.fixed:
            model, body = self._compiled.model, self._compiled.base
            base[:, :3], base[:, 3:7] = model.body_pos[body], model.body_quat[body][[1, 2, 3, 0]]
            base[:, 7:] = 0.0
            return
        base[:, :3], base[:, 3:6], base[:, 6] = rows[:, 1:4], rows[:, 5:8], rows[:, 4]
        base[:, 7:10] = rows[:, self._speeds : self._speeds + 3]
        # MuJoCo has the angular velocity in the body frame and the linear one in the world frame. Arithmetic on rows of
        # memory is faster than on columns.
        w, x, y, z = np.ascontiguousarray(rows[:, 4:8].T)
        turning: Any = tuple(np.ascontiguousarray(rows[:, self._speeds + 3 : self._speeds + 6].T))
        orientation: Any = (x, y, z, w)
        base[:, 10], base[:, 11], base[:, 12] = geometry.rotate(orientation, turning)
