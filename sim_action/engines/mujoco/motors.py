"""Motors of joints, implemented as dry friction that is shifted by a target velocity.

MuJoCo's own velocity actuators act like springs in the solver and lag behind under acceleration. The constraint row of
a joint's dry friction behaves like a motor: it brings the velocity to zero with a force up to a limit. Its reference
acceleration is -b v; adding b v_target between the two halves of a step brings the velocity to v_target.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.engines import UNLIMITED_EFFORT
from sim_action.engines.mujoco.scene import IMPEDANCE, STEPS_TO_CONVERGE, CompiledScene
from sim_action.robot.robot_model import RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.trace import FloatArray

# Share of its error that a position servo corrects in one step: PyBullet's default.
_SERVO_SHARE: Final = 0.1

_Numbers = slice | NDArray[np.intp]

_FREE, _VELOCITY, _POSITION = range(3)


class Motors:
    """The motor of each joint, which keeps its last command."""

    def __init__(self, model: RobotModel, compiled: CompiledScene, rate: float) -> None:
        joints = model.motor_joints
        self._model, self._data, self._dofs = compiled.model, compiled.data, compiled.velocities[: len(joints)]
        self._qpos = compiled.positions[: len(joints)]
        # Ball joints, which come last, have no motor.
        self._no_motors = np.zeros(len(compiled.positions) - len(joints))
        self._index = {joint.name: number for number, joint in enumerate(joints)}
        self._friction = self._model.dof_frictionloss[self._dofs].copy()
        self._lower = np.array([-np.inf if joint.lower is None else joint.lower for joint in joints])
        self._upper = np.array([np.inf if joint.upper is None else joint.upper for joint in joints])
        self._max_effort = np.array([joint.max_effort or UNLIMITED_EFFORT for joint in joints])
        self._max_velocity = np.array([joint.max_velocity or np.inf for joint in joints])
        self._gain = _SERVO_SHARE * rate
        self._damping = 2 * rate / (STEPS_TO_CONVERGE * IMPEDANCE)
        self._mode = np.full(len(joints), _FREE)
        self._rows_are_others = True
        # A copy of `qfrc_applied` of the joints, because reading it costs more.
        self._applied = np.zeros(len(joints))
        self._target, self._ahead = np.zeros(len(joints)), np.zeros(len(joints))
        for number, joint in enumerate(joints):
            if joint.type != "continuous" and joint.mimic is None:
                self._set(number, _POSITION, self._data.qpos[self._qpos[number]], self._max_effort[number])
        self._all_rows: _Numbers | None = None
        self._arrange()
        # No step has been taken yet.
        self._exerted: tuple[_Numbers, _Numbers] = slice(0), slice(0)

    def apply(self, targets: JointTargets) -> None:
        """Use these targets until the next ones."""
        for mode, group in ((_VELOCITY, targets.velocity), (_POSITION, targets.position)):
            for name, target in group.items():
                number = self._index[name]
                limit = targets.max_effort.get(name, self._max_effort[number])
                self._set(number, mode, target, limit)
        for name in targets.position:
            self._ahead[self._index[name]] = targets.velocity.get(name, 0.0)
        for name, effort in targets.effort.items():
            number = self._index[name]
            self._set(number, _FREE, 0.0, self._friction[number])
            self._data.qfrc_applied[self._dofs[number]] = self._applied[number] = effort
        if self._rows_are_others:
            self._arrange()
        else:
            self._aim()

    def drive(self) -> None:
        """Set the motors' rows for this step, between its halves: then rows are known and forces are not."""
        self._exerted = self._exerting
        if self._still:
            return
        if len(self._servos):
            self._servo()
        self._data.efc_aref[self._exerting[1]] += self._bias

    def efforts(self) -> FloatArray:
        """Return the efforts (J,) of the last step in N m or N; the array is valid until the next step."""
        return np.concatenate((self._exerted_now(), self._no_motors)) if self._no_motors.size else self._exerted_now()

    def _exerted_now(self) -> FloatArray:
        motors, rows = self._exerted
        if rows is self._all_rows:
            in_order: FloatArray = self._data.efc_force[rows]
            return in_order
        efforts = self._applied.copy()
        efforts[motors] = self._data.efc_force[rows]
        return efforts

    def _set(self, number: int, mode: int, target: float, limit: float) -> None:
        dof, limits = self._dofs[number], self._model.dof_frictionloss
        self._rows_are_others |= mode != self._mode[number] or (limits[dof] > 0) != (limit > 0)
        self._mode[number], self._target[number] = mode, target
        limits[dof] = limit
        self._data.qfrc_applied[dof] = self._applied[number] = 0.0

    def _arrange(self) -> None:
        """Find the constraint rows of the motors: after the equalities, one for each joint with friction."""
        self._rows_are_others = False
        has_row = self._model.dof_frictionloss > 0
        rows = np.cumsum(has_row) - 1 + int(self._data.ne)
        moving = (self._mode != _FREE) & has_row[self._dofs]
        self._motors = np.flatnonzero(moving)
        self._exerting = _in_a_row(self._motors), _in_a_row(rows[self._dofs[self._motors]])
        # If every joint has a row, in order, `efforts` needs no copy.
        self._all_rows = self._exerting[1] if len(self._motors) == len(self._mode) else None
        self._servos = np.flatnonzero(self._mode[self._motors] == _POSITION)
        servo_joints = self._motors[self._servos]
        self._servo_qpos = self._qpos[servo_joints]
        self._fastest = self._max_velocity[servo_joints]
        self._aim()

    def _aim(self) -> None:
        self._bias = self._damping * self._target[self._motors]
        self._still = not len(self._servos) and not self._bias.any()
        if not len(self._servos):
            return
        servos = self._motors[self._servos]
        # Targets are clipped to the joint limits, because MuJoCo's limits are soft.
        self._goals = np.clip(self._target[servos], self._lower[servos], self._upper[servos])
        self._goal_speeds = self._ahead[servos]

    def _servo(self) -> None:
        speed = self._gain * (self._goals - self._data.qpos[self._servo_qpos]) + self._goal_speeds
        self._bias[self._servos] = self._damping * np.clip(speed, -self._fastest, self._fastest)


def _in_a_row(numbers: NDArray[np.intp]) -> _Numbers:
    """Return consecutive numbers as a slice, which makes every step cheaper."""
    first, count = (int(numbers[0]), len(numbers)) if len(numbers) else (0, 0)
    return slice(first, first + count) if (np.diff(numbers) == 1).all() else numbers
