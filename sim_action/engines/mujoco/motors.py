"""Motors of joints, implemented as dry friction that is shifted by a target velocity.

MuJoCo's own velocity actuators act like springs in the solver and lag behind under acceleration. The constraint row of
a joint's dry friction behaves like a motor: it brings the velocity to zero with a force up to a limit. Its reference
acceleration is -b v; adding b v_target between the two halves of a step brings the velocity to v_target.

A motor that an MJCF model states works with its own gains, gears and limits instead, if it can do what a command asks
for: see `Actuators`. For other commands it is switched off, and this motor acts with the model's limit of effort.
A command sets the control at which a stated motor is in balance at the target: a position servo at the target position,
a velocity servo at the target velocity. A motor that exerts an effort gets the control that exerts it. A velocity
command for a position servo moves its target at that velocity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_action.core.lazy_numpy import FloatArray
from sim_action.drives.wheels import held_joints
from sim_action.engines.engine import UNLIMITED_EFFORT
from sim_action.engines.mujoco.scene import IMPEDANCE, STEPS_TO_CONVERGE, CompiledScene, solver_parameters
from sim_action.robot.model.robot_model import FOLLOWED, Joint, MotorKind, Reading, RobotModel
from sim_action.state.command import JointTargets
from sim_action.world.scene import Scene

_SERVO_SHARE: Final = 0.1  # share of its error that a position servo corrects in one step: PyBullet's default
_Numbers = slice | NDArray[np.intp]
_FREE, _VELOCITY, _POSITION, _OWN = range(4)
_READINGS: Final[Mapping[int, Reading]] = {_POSITION: "position", _VELOCITY: "velocity", _FREE: "effort"}


class Motors:
    """The motor of each joint, which keeps its last command."""

    def __init__(self, scene: Scene, compiled: CompiledScene, rate: float) -> None:
        model = scene.model
        joints = model.motor_joints
        self._model, self._data, self._dofs = compiled.model, compiled.data, compiled.velocities[: len(joints)]
        self._qpos = compiled.positions[: len(joints)]
        # Ball joints, which come last, have no motor.
        self._no_motors = np.zeros(len(compiled.positions) - len(joints))
        self._index = {joint.name: number for number, joint in enumerate(joints)}
        self._friction = self._model.dof_frictionloss[self._dofs].tolist()
        self._lower = [-math.inf if joint.lower is None else joint.lower for joint in joints]
        self._upper = [math.inf if joint.upper is None else joint.upper for joint in joints]
        self._max_effort = [joint.max_effort or UNLIMITED_EFFORT for joint in joints]
        self._max_velocity = [joint.max_velocity or math.inf for joint in joints]
        # Live views.
        self._positions, self._velocities = memoryview(compiled.data.qpos), memoryview(compiled.data.qvel)
        self._masses = memoryview(compiled.data.M)
        # Per joint, the inertia that its damping adds in the integrator, and the place of its own one in the matrix.
        self._added = (self._model.dof_damping[self._dofs] / rate).tolist()
        self._diagonal = (self._model.M_rowadr + self._model.M_rownnz - 1)[self._dofs].tolist()
        self._gain = _SERVO_SHARE * rate
        self._damping = 2 * rate / (STEPS_TO_CONVERGE * IMPEDANCE)
        # Per joint, its mode and the limit of its row, as last set.
        self._state: list[tuple[int, float]] = [(_FREE, math.nan)] * len(joints)
        self._is_native = model.mjcf is not None
        self._rows_are_others = True
        self.together: Sequence[Motors] = (self,)
        """The motors of all robots: if one gets a row, the rows of others move."""
        self._speeds = self._dofs.tolist()
        # A copy of `qfrc_applied` of the joints, because reading it costs more.
        self._applied = np.zeros(len(joints))
        self._target, self._ahead = [0.0] * len(joints), [0.0] * len(joints)
        # Parameters of dry friction: the motor's, and the model's.
        self._hard = solver_parameters(rate)
        self._soft = self._model.dof_solref[self._dofs].copy(), self._model.dof_solimp[self._dofs].copy()
        self._actuators = Actuators(model, compiled, rate, scene.controls)
        is_passive = model.mjcf is not None and bool(model.mjcf.actuators)
        held = held_joints(model)
        for number, joint in enumerate(joints):
            kind = self._actuators.kind(number)
            if kind in {"position", "velocity", "voltage", "none"}:
                self._set(number, _OWN, 0.0, self._friction[number])
            elif joint.name in held and not (is_passive and kind is None):
                self._set(number, _POSITION, self._data.qpos[self._qpos[number]], self._max_effort[number])
            elif model.mjcf is not None:
                self._set(number, _FREE, 0.0, self._friction[number])
        self._all_rows: _Numbers | None = None
        self.arrange()
        # The joints and the limits of the last targets, if these were only speeds.
        self._turned_before: list[str] | None = None
        self._numbers_before: list[int] = []
        self._limited_before: dict[str, float] = {}
        # No step has been taken yet.
        self._exerted: tuple[_Numbers, _Numbers] = slice(0), slice(0)
        self._own_exerted = self._own[:0]

    def apply(self, targets: JointTargets) -> None:
        """Use these targets until the next ones."""
        velocity = targets.velocity
        others = targets.position or targets.effort
        if not others and [*velocity] == self._turned_before and targets.max_effort == self._limited_before:
            # A drive gives the same joints another speed at each step of its ramp.
            for number, speed in zip(self._numbers_before, velocity.values(), strict=True):
                self._target[number] = float(speed)
            self._turn()
            return
        self._apply(targets)
        self._turned_before = None if others or self._is_native else [*velocity]
        self._numbers_before = [self._index[name] for name in velocity]
        self._limited_before = dict(targets.max_effort)

    def _apply(self, targets: JointTargets) -> None:
        for mode, group in ((_VELOCITY, targets.velocity), (_POSITION, targets.position)):
            for name, target in group.items():
                if mode == _VELOCITY and name in targets.position:
                    continue
                number = self._index[name]
                limit = targets.max_effort.get(name)
                ahead = targets.velocity.get(name, 0.0) if mode == _POSITION else 0.0
                if not self._command_own(number, mode, target, limit, ahead):
                    self._set(number, mode, target, self._max_effort[number] if limit is None else limit)
        for name in targets.position:
            self._ahead[self._index[name]] = float(targets.velocity.get(name, 0.0))
        for name, effort in targets.effort.items():
            number = self._index[name]
            if not self._command_own(number, _FREE, effort, None, 0.0):
                self._set(number, _FREE, 0.0, self._friction[number])
                self._data.qfrc_applied[self._dofs[number]] = self._applied[number] = effort
        if self._rows_are_others:
            for motors in self.together:
                motors.arrange()
        else:
            self._aim()

    def engage(self) -> tuple[Sequence[tuple[int, float]], Callable[[memoryview[float]], None] | None]:
        """Let the targets act from the step that has begun; `efforts` are its efforts from now on.

        Return what to do at each step until the next targets, between its halves: then rows are known and forces are
        not. First (row, bias): the bias is added to the reference of the row. Then a function to call with a live view
        of the references, `efc_aref`; None if there is nothing else to do.
        """
        self._exerted = self._exerting
        self._own_exerted = self._own
        return self._turning, self._hold if self._holding or self._actuators.creeping else None

    def _hold(self, references: memoryview[float]) -> None:
        """Set the rows of servos, whose references depend on where the joints are."""
        if self._actuators.creeping:
            self._actuators.step()
        gain, damping, positions = self._gain, self._damping, self._positions
        # For few numbers a loop takes a fifth of the time of arrays.
        for row, at, goal, ahead, fastest, _ in self._holding:
            speed = gain * (goal - positions[at]) + ahead
            references[row] += damping * (-fastest if speed < -fastest else min(speed, fastest))
        # The solver does not know the inertia that the damping of a joint adds: a light joint would lag behind.
        for row, at, goal, ahead, fastest, number in self._damped:
            speed = max(-fastest, min(gain * (goal - positions[at]) + ahead, fastest))
            share = self._added[number] / self._masses[self._diagonal[number]]
            references[row] += damping * share * (speed - self._velocities[self._speeds[number]])

    def efforts(self) -> FloatArray:
        """Return the efforts (J,) of the last step in N m or N; the array is valid until the next step."""
        motors, rows = self._exerted
        if rows is self._all_rows:
            in_order: FloatArray = self._data.efc_force[rows]
            return in_order
        efforts = self._applied.copy()
        efforts[motors] = self._data.efc_force[rows]
        own = self._own_exerted
        if len(own):
            efforts[own] = self._data.qfrc_actuator[self._dofs[own]]
        return np.concatenate((efforts, self._no_motors)) if self._no_motors.size else efforts

    def _command_own(self, number: int, mode: int, target: float, limit: float | None, ahead: float) -> bool:
        """Command the motor that the model states; return False if there is none, or if it cannot do this."""
        kind, motors = self._actuators.kind(number), self._actuators
        if kind is None:
            return False
        can = _READINGS[mode] in FOLLOWED[kind]
        motors.switch(number, limit, on=can)
        if not can:
            return False
        self._set(number, _OWN, 0.0, self._friction[number])
        if mode == _POSITION:
            motors.hold(number, target, ahead)
        elif mode == _FREE:
            motors.exert(number, target)
        elif kind != "position":
            motors.turn(number, target)
        else:
            motors.creep(number, target)
        return True

    def _set(self, number: int, mode: int, target: float, limit: float) -> None:
        self._target[number] = float(target)
        before = self._state[number]
        if before == (mode, limit):
            return
        dof, limits = self._dofs[number], self._model.dof_frictionloss
        self._rows_are_others |= mode != before[0] or (limits[dof] > 0) != (limit > 0)
        self._state[number] = mode, limit
        limits[dof] = limit
        if self._is_native:
            is_servo = mode in {_VELOCITY, _POSITION}
            self._model.dof_solref[dof] = self._hard["solref"] if is_servo else self._soft[0][number]
            self._model.dof_solimp[dof] = self._hard["solimp"] if is_servo else self._soft[1][number]
        self._data.qfrc_applied[dof] = self._applied[number] = 0.0

    def arrange(self) -> None:
        """Find the constraint rows of the motors: after the equalities, one for each joint with friction."""
        self._rows_are_others = False
        has_row = self._model.dof_frictionloss > 0
        rows = np.cumsum(has_row) - 1 + int(self._data.ne)
        modes = np.array([mode for mode, _ in self._state], dtype=int)
        moving = ((modes == _VELOCITY) | (modes == _POSITION)) & has_row[self._dofs]
        self._own = np.flatnonzero(modes == _OWN)
        self._motors = np.flatnonzero(moving)
        rows = rows[self._dofs[self._motors]]
        self._exerting = _in_a_row(self._motors), _in_a_row(rows)
        # If every joint has a row, in order, `efforts` needs no copy.
        in_order = len(self._motors) == len(modes) and not self._no_motors.size
        self._all_rows = self._exerting[1] if in_order else None
        both = list(zip(rows.tolist(), self._motors.tolist(), strict=True))
        self._turned = [(row, number) for row, number in both if modes[number] == _VELOCITY]
        places = self._qpos.tolist()
        self._held = [(row, number, places[number]) for row, number in both if modes[number] == _POSITION]
        self._aim()

    def _turn(self) -> None:
        """Find (row, bias) of velocity motors."""
        target, damping = self._target, self._damping
        turning = [(row, damping * target[number]) for row, number in self._turned]
        # Adding 0 would change the sign of zeros.
        self._turning = turning if self._held or any(bias for _, bias in turning) else []

    def _aim(self) -> None:
        """Find (row, bias) of velocity motors, and (row, index in qpos, goal, speed ahead, limit, joint) of servos."""
        target = self._target
        self._turn()
        # Targets are clipped to the joint limits, because MuJoCo's limits are soft.
        self._holding = [
            (row, at, min(max(target[n], self._lower[n]), self._upper[n]), self._ahead[n], self._max_velocity[n], n)
            for row, n, at in self._held
        ]
        self._damped = [held for held in self._holding if self._added[held[-1]]]


def _in_a_row(numbers: NDArray[np.intp]) -> _Numbers:
    first, count = (int(numbers[0]), len(numbers)) if len(numbers) else (0, 0)
    return slice(first, first + count) if (np.diff(numbers) == 1).all() else numbers


_FOLLOWS_CONTROL: Final = (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
_INPUT: Final = mujoco.mjtCtrlInput
_GAIN: Final = mujoco.mjtGain
# Where `actuator_dynprm` has the largest rate of the target of a controller; the target is then its first activation.
_SLEW: Final = {int(mujoco.mjtDyn.mjDYN_PID): 1, int(mujoco.mjtDyn.mjDYN_DCMOTOR): 7}


class Actuators:
    """The motors of the model, by the number of their joint in the order of the robot model."""

    def __init__(
        self, model: RobotModel, compiled: CompiledScene, rate: float, controls: Mapping[str, Sequence[float]]
    ) -> None:
        """`controls`: initial controls by the name of the actuator; other position servos begin at their joints."""
        self._model, self._data, self._rate, self._name = compiled.model, compiled.data, rate, compiled.name
        self._joints = model.motor_joints
        self._numbers = {joint.name: number for number, joint in enumerate(self._joints)}
        self._actuator = [self._number(joint) for joint in self._joints]
        self._controls = self._model.actuator_ctrladr.tolist()
        self._gears = self._model.actuator_gear[self._model.actuator_outadr, 0].tolist()
        # A <pid> or <dcmotor> has its gains elsewhere, and an input for each quantity.
        kinds = self._model.actuator_gaintype
        self._has_inputs = ((kinds == _GAIN.mjGAIN_PID) | (kinds == _GAIN.mjGAIN_DCMOTOR)).tolist()
        self._gains = self._model.actuator_gainprm.copy()
        self._biases = self._model.actuator_biasprm.copy()
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
        if not self._model.nactuator:
            return
        self._hold_others()
        for name, own in controls.items():
            first = self._controls[self._model.actuator(compiled.name(name)).id]
            self._data.ctrl[first : first + len(own)] = own
        self._begin()

    def kind(self, number: int) -> MotorKind | None:
        """Return what the motor of a joint controls; None if it has no motor."""
        motor = self._joints[number].motor
        return None if motor is None else motor.kind

    def hold(self, number: int, position: float, speed: float) -> None:
        """Set the target of a position servo in rad (m), and the speed of the target, if it has an input for that."""
        self.creeping.pop(number, None)
        self._targets[number] = position
        self._aim(number)
        self._lead(number, speed)

    def creep(self, number: int, speed: float) -> None:
        """Move the target of a position servo from where the joint is, in rad/s (m/s)."""
        if number not in self.creeping:
            joint = self._model.joint(self._name(self._joints[number].name)).qposadr[0]
            self._targets[number] = float(self._data.qpos[joint])
        self.creeping[number] = speed
        self._lead(number, speed)

    def turn(self, number: int, speed: float) -> None:
        """Set the target of a velocity servo in rad/s (m/s); for a voltage, the speed of a motor without load."""
        at = self._actuator[number]
        speed *= self._gears[at]
        if self._has_inputs[at]:
            voltage = self._input(at, _INPUT.mjINPUT_VOLTAGE)
            to = self._input(at, _INPUT.mjINPUT_VEL) if voltage is None else voltage
            self._data.ctrl[to] = speed if voltage is None else speed * self._gains[at, 1]
            return
        # The position target of an integrator moves.
        order = 1 if self._integrates(at) else 2
        self._data.ctrl[self._controls[at]] = -self._biases[at, order] * speed / self._gains[at, 0]

    def exert(self, number: int, effort: float) -> None:
        """Set the effort of a motor in N m (N); for a voltage, the effort of a motor at rest."""
        at = self._actuator[number]
        gain = float(self._gains[at, 0])
        if self._has_inputs[at]:
            gain = 1.0 if self._input(at, _INPUT.mjINPUT_VOLTAGE) is None else float(self._gains[at, 1]) / gain
        self._data.ctrl[self._controls[at]] = effort / (self._gears[at] * gain)

    def switch(self, number: int, limit: float | None, *, on: bool) -> None:
        """Switch a motor on or off; `limit`: of its effort in N m (N), below the model's limit."""
        at = self._actuator[number]
        if at < 0:
            return
        ranges, limited = self._forces
        self._model.actuator_forcerange[at], self._model.actuator_forcelimited[at] = ranges[at], limited[at]
        if self._has_inputs[at]:
            limit = limit if on else 0.0
        else:
            self._model.actuator_gainprm[at] = self._gains[at] if on else 0.0
            self._model.actuator_biasprm[at] = self._biases[at] if on else 0.0
        if limit is not None:
            most = limit / abs(self._gears[at])
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
        if joint.motor is None or joint.motor.kind == "none":
            return -1
        return int(self._model.actuator(self._name(joint.motor.actuator)).id)

    def _input(self, at: int, kind: mujoco.mjtCtrlInput) -> int | None:
        """Return the index in `ctrl` of an input of a <pid> or <dcmotor>; None if it does not have it."""
        present = int(self._model.actuator_ctrlspec[at])
        return self._controls[at] + (present & (int(kind) - 1)).bit_count() if present & kind else None

    def _lead(self, number: int, speed: float) -> None:
        """Set the velocity input of a position servo that has one."""
        at = self._actuator[number]
        if self._has_inputs[at] and (to := self._input(at, _INPUT.mjINPUT_VEL)) is not None:
            self._data.ctrl[to] = self._gears[at] * speed

    def _tendon(self, name: str) -> list[tuple[int, float]]:
        """Return the joints of a fixed tendon with their coefficients."""
        tendon = self._model.tendon(self._name(name)).id
        first, count = self._model.tendon_adr[tendon], self._model.tendon_num[tendon]
        names = {self._model.joint(self._name(joint.name)).id: number for number, joint in enumerate(self._joints)}
        return [
            (names[int(self._model.wrap_objid[row])], float(self._model.wrap_prm[row]))
            for row in range(first, first + count)
        ]

    def _aim(self, number: int) -> None:
        """Set the control of a position servo to its balance at the target."""
        at = self._actuator[number]
        through = self._on_tendon.get(at)
        length = self._target(number) if through is None else sum(share * self._target(n) for n, share in through)
        self._balance(at, length * self._gears[at])

    def _balance(self, at: int, length: float) -> None:
        """Set the control of a position servo to its balance at a length of the actuator."""
        if not self._has_inputs[at]:
            length = -(self._biases[at, 0] + self._biases[at, 1] * length) / self._gains[at, 0]
        self._data.ctrl[self._controls[at]] = length

    def _target(self, number: int) -> float:
        mimic = self._joints[number].mimic
        if mimic is None:
            return self._targets[number]
        return mimic.multiplier * self._target(self._numbers[mimic.joint]) + mimic.offset

    def _hold_others(self) -> None:
        """Set the controls of position servos that no command can name to their balance where they begin."""
        mujoco.mj_fwdPosition(self._model, self._data)
        for at in set(range(self._model.nactuator)).difference(self._actuator):
            fixed = self._model.actuator_gaintype[at] == _GAIN.mjGAIN_FIXED and bool(self._gains[at, 0])
            is_affine = self._model.actuator_biastype[at] == mujoco.mjtBias.mjBIAS_AFFINE
            is_servo = fixed and is_affine and bool(self._biases[at, 1]) and not self._integrates(at)
            if is_servo or (self._has_inputs[at] and self._input(at, _INPUT.mjINPUT_POS) is not None):
                self._balance(at, self._length(at))

    def _integrates(self, at: int) -> bool:
        return bool(self._model.actuator_dyntype[at] == mujoco.mjtDyn.mjDYN_INTEGRATOR)

    def _length(self, at: int) -> float:
        return float(self._data.actuator_length[self._model.actuator_outadr[at]])

    def _begin(self) -> None:
        """Begin the motors with an own state at rest: filters at their control, integrators at their position."""
        mujoco.mj_fwdPosition(self._model, self._data)
        for actuator in np.flatnonzero(self._model.actuator_actadr >= 0).tolist():
            first = self._model.actuator_actadr[actuator]
            last = first + self._model.actuator_actnum[actuator] - 1
            kind, control = self._model.actuator_dyntype[actuator], self._controls[actuator]
            if kind in _FOLLOWS_CONTROL:
                self._data.act[last] = self._data.ctrl[control]
            elif kind == mujoco.mjtDyn.mjDYN_INTEGRATOR:
                self._data.act[last] = self._length(actuator)
            elif kind in _SLEW and self._model.actuator_dynprm[actuator, _SLEW[kind]]:
                self._data.act[first] = self._data.ctrl[control]
