"""The robot's part of the engine's state, step by step, as rows of a trace."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sim_action import geometry
from sim_action.backends.mujoco.model import Compiled
from sim_action.trace import FloatArray


class States:
    """Keeps what the state is after each step, as cheaply as it can; what it is in our terms is worked out at the end.

    A row is (1 + P + V + J,): step, qpos, qvel, efforts of the motors.
    """

    def __init__(self, compiled: Compiled, rate: float, read_efforts: Callable[[FloatArray], None]) -> None:
        self._compiled, self._rate, self._read_efforts = compiled, rate, read_efforts
        self._joints = len(compiled.positions)
        # Live views of the robot's part: it was added to the world first.
        self._qpos = compiled.data.qpos[: compiled.robot_qpos]
        self._qvel = compiled.data.qvel[: compiled.robot_qvel]
        self._speeds = 1 + len(self._qpos)
        self._efforts = self._speeds + len(self._qvel)
        self._blocks: list[FloatArray] = []

    def expect(self, first_step: int, steps: int) -> FloatArray:
        """Room for so many steps, to be filled by `keep`: until then they are no numbers."""
        block = np.full((steps, self._efforts + self._joints), np.nan)
        block[:, 0] = np.arange(first_step, first_step + steps)
        self._blocks.append(block)
        return block

    def keep(self, row: FloatArray) -> None:
        """Writes down the present."""
        row[1 : self._speeds] = self._qpos
        row[self._speeds : self._efforts] = self._qvel
        self._read_efforts(row[self._efforts :])

    def collect(self) -> FloatArray:
        """(T, 14 + 3 J): rows of `Trace.state` for the steps since the last call."""
        blocks, self._blocks = self._blocks, []
        return self._in_our_terms(np.concatenate(blocks or [np.empty((0, self._efforts + self._joints))]))

    def now(self, step: int) -> FloatArray:
        """(14 + 3 J,): the present, as that of a step."""
        row = np.empty((1, self._efforts + self._joints))
        row[0, 0] = step
        self.keep(row[0])
        present: FloatArray = self._in_our_terms(row)[0]
        return present

    def _in_our_terms(self, rows: FloatArray) -> FloatArray:
        positions, velocities = 1 + self._compiled.positions, self._speeds + self._compiled.velocities
        joints = (rows[:, positions], rows[:, velocities], rows[:, self._efforts :])
        return np.concatenate((rows[:, :1] / self._rate, self._base(rows), *joints), axis=1)

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
