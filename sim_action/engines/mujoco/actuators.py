"""The motors that an MJCF model states: MuJoCo simulates them with their own gains, gears and limits.

A command sets the control at which the motor is in balance at the target: a position servo at the target position, a
velocity servo at the target velocity. A motor that exerts an effort gets the control that exerts it. A velocity command
for a position servo moves its target at that velocity. Any other command switches the motor off; see `Motors`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np

from sim_action.engines.mujoco.names import engine_name
from sim_action.engines.mujoco.scene import CompiledScene
from sim_action.robot.model.mjcf_data import MotorKind
from sim_action.robot.model.robot_model import Joint, RobotModel

_FOLLOWS_CONTROL: Final = (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)


class Actuators:
    """The motors of the model, by the number of their joint in the order of the robot model."""

    def __init__(self, model: RobotModel, compiled: CompiledScene, rate: float, controls: Mapping[str, float]) -> None:
        """`controls`: initial controls by the name of the actuator; other position servos begin at their joints."""
        self._model, self._data, self._rate = compiled.model, compiled.data, rate
        self._joints = model.motor_joints
        self._numbers = {joint.name: number for number, joint in enumerate(self._joints)}
        self._actuator = [self._number(joint) for joint in self._joints]
        self._gains, self._biases = self._model.actuator_gainprm.copy(), self._model.actuator_biasprm.copy()
        self._forces = self._model.actuator_forcerange.copy(), self._model.actuator_forcelimited.copy()
        # Position targets of all joints, which a motor on a tendon needs together.
        self._targets: list[float] = self._data.qpos[compiled.positions[: len(self._joints)]].tolist()
        self.creeping: dict[int, float] = {}
        """The position servos that follow a velocity command: number of the joint -> rad/s (m/s)."""
        self._on_tendon = {
            actuator: self._tendon(joint.motor.tendon)
            for joint, actuator in zip(self._joints, self._actuator, strict=True)
            if joint.motor is not None and joint.motor.tendon
        }
        for number, kind in enumerate(map(self.kind, range(len(self._joints)))):
            if kind == "position":
                self._aim(number)
        self._hold_others()
        for name, control in controls.items():
            self._data.ctrl[self._model.actuator(engine_name(name)).id] = control
        self._begin()

    def kind(self, number: int) -> MotorKind | None:
        """Return what the motor of a joint controls; None if it has no motor."""
        motor = self._joints[number].motor
        return None if motor is None else motor.kind

    def hold(self, number: int, position: float) -> None:
        """Set the target of a position servo in rad (m)."""
        self.creeping.pop(number, None)
        self._targets[number] = position
        self._aim(number)

    def creep(self, number: int, speed: float) -> None:
        """Move the target of a position servo from where the joint is, in rad/s (m/s)."""
        if number not in self.creeping:
            joint = self._model.joint(engine_name(self._joints[number].name)).qposadr[0]
            self._targets[number] = float(self._data.qpos[joint])
        self.creeping[number] = speed

    def turn(self, number: int, speed: float) -> None:
        """Set the target of a velocity servo in rad/s (m/s)."""
        at = self._actuator[number]
        self._data.ctrl[at] = -self._biases[at, 2] * self._model.actuator_gear[at, 0] * speed / self._gains[at, 0]

    def exert(self, number: int, effort: float) -> None:
        """Set the effort of a motor in N m (N)."""
        at = self._actuator[number]
        self._data.ctrl[at] = effort / (self._model.actuator_gear[at, 0] * self._gains[at, 0])

    def switch(self, number: int, limit: float | None, *, on: bool) -> None:
        """Switch a motor on or off; `limit`: of its effort in N m (N), below that of the model."""
        at = self._actuator[number]
        if at < 0:
            return
        self._model.actuator_gainprm[at] = self._gains[at] if on else 0.0
        self._model.actuator_biasprm[at] = self._biases[at] if on else 0.0
        ranges, limited = self._forces
        self._model.actuator_forcerange[at], self._model.actuator_forcelimited[at] = ranges[at], limited[at]
        if limit is not None:
            most = limit / abs(float(self._model.actuator_gear[at, 0]))
            lower, upper = ranges[at].tolist() if limited[at] else (-most, most)
            self._model.actuator_forcerange[at] = max(lower, -most), min(upper, most)
            self._model.actuator_forcelimited[at] = True
        if not on:
            self.creeping.pop(number, None)

    def step(self) -> None:
        """Move the targets that creep by one step."""
        for number, speed in self.creeping.items():
            joint = self._joints[number]
            target = self._targets[number] + speed / self._rate
            lower = -np.inf if joint.lower is None else joint.lower
            upper = np.inf if joint.upper is None else joint.upper
            self._targets[number] = float(min(max(target, lower), upper))
            self._aim(number)

    def _number(self, joint: Joint) -> int:
        return -1 if joint.motor is None else int(self._model.actuator(engine_name(joint.motor.actuator)).id)

    def _tendon(self, name: str) -> list[tuple[int, float]]:
        """Return the joints of a fixed tendon with their coefficients."""
        tendon = self._model.tendon(engine_name(name)).id
        first, count = self._model.tendon_adr[tendon], self._model.tendon_num[tendon]
        names = {self._model.joint(engine_name(joint.name)).id: number for number, joint in enumerate(self._joints)}
        return [
            (names[int(self._model.wrap_objid[row])], float(self._model.wrap_prm[row]))
            for row in range(first, first + count)
        ]

    def _aim(self, number: int) -> None:
        """Set the control of a position servo to its balance at the target."""
        at = self._actuator[number]
        through = self._on_tendon.get(at)
        length = self._target(number) if through is None else sum(share * self._target(n) for n, share in through)
        length *= self._model.actuator_gear[at, 0]
        self._data.ctrl[at] = -(self._biases[at, 0] + self._biases[at, 1] * length) / self._gains[at, 0]

    def _target(self, number: int) -> float:
        mimic = self._joints[number].mimic
        if mimic is None:
            return self._targets[number]
        return mimic.multiplier * self._target(self._numbers[mimic.joint]) + mimic.offset

    def _hold_others(self) -> None:
        """Set the controls of position servos that no command can name to their balance where they begin."""
        mujoco.mj_fwdPosition(self._model, self._data)
        for at in set(range(self._model.nu)).difference(self._actuator):
            gain, (bias, per_length) = float(self._gains[at, 0]), self._biases[at, :2].tolist()
            fixed = self._model.actuator_gaintype[at] == mujoco.mjtGain.mjGAIN_FIXED
            if fixed and gain and per_length and self._model.actuator_biastype[at] == mujoco.mjtBias.mjBIAS_AFFINE:
                self._data.ctrl[at] = -(bias + per_length * self._data.actuator_length[at]) / gain

    def _begin(self) -> None:
        """Begin the motors with an own state at rest: filters at their control, integrators at their position."""
        mujoco.mj_fwdPosition(self._model, self._data)
        for actuator in np.flatnonzero(self._model.actuator_actadr >= 0):
            last = self._model.actuator_actadr[actuator] + self._model.actuator_actnum[actuator] - 1
            kind = self._model.actuator_dyntype[actuator]
            if kind in _FOLLOWS_CONTROL:
                self._data.act[last] = self._data.ctrl[actuator]
            elif kind == mujoco.mjtDyn.mjDYN_INTEGRATOR:
                self._data.act[last] = self._data.actuator_length[actuator]
