"""Actuators and keyframes of an MJCF model: the motors that a scenario can command, and the states that it can name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Any, Final

import mujoco
import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.robot.model.robot_model import Joint, Keyframe, Motor, MotorKind, ball_angles
from sim_action.robot.reading.mjcf.mujoco_spec import Built, inputs

_NO_COMMAND: Final = (
    "an <actuator> that no command can name, because it {}: it keeps its control of robot.keyframe; without one, a "
    "servo holds where it begins, and others are at 0"
)
_TRN: Final = mujoco.mjtTrn
_PLACES: Final = {
    _TRN.mjTRN_SITE: "a site",
    _TRN.mjTRN_BODY: "a body (name it as the link of a disturbance with 'adhesion')",
    _TRN.mjTRN_SLIDERCRANK: "a slider-crank",
}
_ON_JOINT: Final = frozenset({_TRN.mjTRN_JOINT, _TRN.mjTRN_JOINTINPARENT})
_RANKS: Final[Mapping[MotorKind, int]] = {"position": 0, "velocity": 1, "voltage": 2, "effort": 3}
_INPUT: Final = mujoco.mjtCtrlInput
# Inputs of <pid> and <dcmotor>, in their order; the first one that an actuator has is commanded.
_INPUTS: Final[Mapping[MotorKind, mujoco.mjtCtrlInput]] = {
    "position": _INPUT.mjINPUT_POS,
    "velocity": _INPUT.mjINPUT_VEL,
    "effort": _INPUT.mjINPUT_FF,
    "voltage": _INPUT.mjINPUT_VOLTAGE,
}
_DIRECT: Final = frozenset({mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT})


def motors_of(built: Built, moving: Iterable[str]) -> dict[str, Motor]:
    """Return joint name -> its motor, of the joints `moving`, and note the actuators that no command can name."""
    spec, joints = built.spec, set(moving)
    tendons = {tendon.name: _joints_of(tendon) for tendon in spec.tendons}
    candidates = [(actuator, kind) for actuator in spec.actuators if (kind := _kind(actuator)) is not None]
    motors = dict[str, Motor]()
    commanded = set[str]()
    # A position servo comes before others.
    for actuator, kind in sorted(candidates, key=lambda candidate: _RANKS[candidate[1]]):
        name = actuator.target
        if actuator.trntype in _ON_JOINT and name in joints and name not in motors:
            motors[name] = Motor(actuator.name, kind, is_replaceable=not inputs(actuator) and not _integrates(actuator))
            commanded.add(actuator.name)
    for actuator, kind in candidates:
        through = tendons.get(actuator.target, ()) if actuator.trntype == _TRN.mjTRN_TENDON else ()
        if kind == "position" and through and joints.issuperset(through) and not motors.keys() & set(through):
            motors.update(dict.fromkeys(through, Motor(actuator.name, kind, actuator.target)))
            commanded.add(actuator.name)
    for actuator in spec.actuators:
        if actuator.name not in commanded:
            reason = _why_not_commanded(actuator, joints, tendons)
            built.notes.leave_out(actuator, _NO_COMMAND.format(reason))
            if actuator.trntype in _ON_JOINT and actuator.target in joints and not _is_passive(actuator):
                motors.setdefault(actuator.target, Motor(actuator.name, "none", is_replaceable=False, reason=reason))
    return motors


def _why_not_commanded(actuator: Any, joints: set[str], tendons: Mapping[str, tuple[str, ...]]) -> str:
    """Return why no command can name an actuator, to follow "it"; `tendons`: name -> joints, of fixed ones."""
    on_joint, on_tendon = actuator.trntype in _ON_JOINT, actuator.trntype == _TRN.mjTRN_TENDON
    through = tendons.get(actuator.target, ())
    reasons = (
        (actuator.dyntype == mujoco.mjtDyn.mjDYN_MUSCLE, "is a muscle"),
        (inputs(actuator) == _INPUT.mjINPUT_NONE, "has no control"),
        (
            actuator.dyntype == mujoco.mjtDyn.mjDYN_INTEGRATOR and not _integrates(actuator),
            "acts on the integral of its control",
        ),
        (on_tendon and not through, "acts on a spatial tendon"),
        (on_tendon and _kind(actuator) != "position", "acts on a fixed tendon and is not a position servo"),
        (on_tendon, "acts on a fixed tendon whose joints have motors of their own, or are not all hinges and slides"),
        (not on_joint, f"acts on {_PLACES.get(actuator.trntype, 'neither a joint nor a tendon')}"),
        (_kind(actuator) is None, "is neither a motor nor a servo, as <damper> is not"),
        (actuator.target not in joints, "acts on a ball joint or on the free base"),
    )
    return next((reason for applies, reason in reasons if applies), "shares its joint with one that is commanded")


def _kind(actuator: Any) -> MotorKind | None:
    """Return what the control of an actuator sets; None if it is something else."""
    if (stated := inputs(actuator)) != 0:
        return next((kind for kind, bit in _INPUTS.items() if stated & bit), None)
    if _integrates(actuator):
        return "velocity"
    if actuator.gaintype != mujoco.mjtGain.mjGAIN_FIXED or actuator.dyntype not in _DIRECT or not actuator.gainprm[0]:
        return None
    if actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
        return "effort"
    if actuator.biastype != mujoco.mjtBias.mjBIAS_AFFINE:
        return None
    return "position" if actuator.biasprm[1] else "velocity" if actuator.biasprm[2] else "effort"


def _integrates(actuator: Any) -> bool:
    """Return True if the control is the velocity of a position target, as of <intvelocity>."""
    is_linear = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED and actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE
    is_servo = is_linear and bool(actuator.gainprm[0]) and bool(actuator.biasprm[1])
    return is_servo and actuator.dyntype == mujoco.mjtDyn.mjDYN_INTEGRATOR


def _is_passive(actuator: Any) -> bool:
    """Return True for an actuator that only brakes: <damper>, and a <dcmotor> without a control."""
    is_damper = actuator.gaintype == mujoco.mjtGain.mjGAIN_AFFINE and not any(actuator.gainprm[:2])
    return inputs(actuator) == _INPUT.mjINPUT_NONE or (is_damper and actuator.biastype == mujoco.mjtBias.mjBIAS_NONE)


def _joints_of(tendon: Any) -> tuple[str, ...]:
    steps = list(tendon.path)
    return tuple(step.target.name for step in steps if step.type == mujoco.mjtWrap.mjWRAP_JOINT)


def largest_efforts(model: Any, motors: Mapping[str, Motor]) -> dict[str, float]:
    """Return joint name -> the largest effort of its motors in N m or N, by the limits of force and control."""
    limits: dict[str, float] = {}
    for name, motor in motors.items():
        if motor.tendon or motor.kind == "none":
            continue
        number = model.actuator(motor.actuator).id
        gear, control = (
            abs(float(model.actuator_gear[model.actuator_outadr[number], 0])),
            model.actuator_ctrladr[number],
        )
        most = []
        if model.actuator_forcelimited[number]:
            most.append(max(map(abs, model.actuator_forcerange[number].tolist())))
        if motor.kind == "effort" and model.actuator_ctrllimited[control]:
            is_direct = model.actuator_gaintype[number] != mujoco.mjtGain.mjGAIN_FIXED
            gain = 1.0 if is_direct else abs(model.actuator_gainprm[number, 0])
            most.append(max(map(abs, model.actuator_ctrlrange[control].tolist())) * gain)
        if most and min(most) * gear > 0:
            limits[name] = float(min(most) * gear)
    for joint in range(model.njnt):
        if model.jnt_actfrclimited[joint]:
            name = model.joint(joint).name
            most_here = max(map(abs, model.jnt_actfrcrange[joint].tolist()))
            limits[name] = min(limits.get(name, most_here), most_here)
    return {name: most for name, most in limits.items() if most > 0}


def adhesion_of(model: Any) -> dict[str, tuple[str, float]]:
    """Return the name of each <adhesion> actuator -> its body, and its largest force in N."""
    actuators = dict[str, tuple[str, float]]()
    for number in np.flatnonzero(model.actuator_trntype == _TRN.mjTRN_BODY).tolist():
        body, control = model.body(model.actuator_trnid[number, 0]).name, model.actuator_ctrladr[number]
        most = model.actuator_ctrlrange[control, 1] if model.actuator_ctrllimited[control] else math.inf
        most *= model.actuator_gainprm[number, 0]
        if model.actuator_forcelimited[number]:
            most = min(most, model.actuator_forcerange[number, 1])
        actuators[model.actuator(number).name] = body, float(most)
    return actuators


def keyframes_of(built: Built, joints: Iterable[Joint], free: str | None) -> dict[str, Keyframe]:
    """Return name -> keyframe, with a flaw if it does not fit the model; `free`: name of its free joint."""
    count = sum(numbers for _, numbers in built.positions.values())
    moving = [joint for joint in joints if joint.moves]
    keyframes = dict[str, Keyframe]()
    for name, qpos, ctrl, place in built.keyframes:
        flaw = _wrong_count("qpos", qpos, count, "joints")
        flaw = flaw or _wrong_count("ctrl", ctrl, sum(built.actuators.values()), "actuators")
        if flaw:
            keyframes.setdefault(name, Keyframe({}, place=place, flaw=flaw))
            continue
        at = (
            {joint: qpos[first : first + numbers] for joint, (first, numbers) in built.positions.items()}
            if qpos
            else {}
        )
        balls = {joint: _turn(numbers) for joint, numbers in at.items() if len(numbers) == _QUATERNION}
        base = None
        if free is not None and free in at:
            x, y, z, *turned = at[free]
            base = Pose((x, y, z - built.mjcf.floor), _turn(turned))
        rest = iter(ctrl)
        controls = {name: tuple(islice(rest, own)) for name, own in built.actuators.items()} if ctrl else {}
        controls = {name: own for name, own in controls.items() if name in built.mjcf.actuators}
        positions = {joint.name: at[joint.name][0] for joint in moving if joint.name in at}
        angles = {ball: ball_angles(turn) for ball, turn in balls.items()}
        for joint in moving:
            if joint.ball in angles:
                positions[joint.name] = angles[joint.ball][geometry.AXES.index(joint.axis_xyz)]
        keyframes.setdefault(name, Keyframe(positions, base, controls, place))
    return keyframes


def _wrong_count(attribute: str, numbers: tuple[float, ...], count: int, owners: str) -> str:
    if len(numbers) in (0, count):
        return ""
    return f"'{attribute}' has {len(numbers)} numbers, but the {owners} of the file need {count}"


_QUATERNION: Final = 4


def _turn(wxyz: Iterable[float]) -> tuple[float, float, float, float]:
    """Return a unit quaternion x, y, z, w; zeros mean no rotation, as in MuJoCo."""
    w, x, y, z = wxyz
    length = (w * w + x * x + y * y + z * z) ** 0.5
    if not length:
        return 0.0, 0.0, 0.0, 1.0
    return x / length, y / length, z / length, w / length
