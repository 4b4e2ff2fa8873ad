"""Pendulums, arms and lifts with a fixed base: periods, loads of motors, and trajectories."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, Literal

import numpy as np

from sim_action.core.lazy_numpy import FloatArray
from tests.physics.case import Case, Run, Setup
from tests.physics.measures import GRAVITY, Measure, joint_angle, passages
from tests.physics.oracles import pendulum_period
from tests.physics.robots import arm, followers, lift, pendulum
from tools.bench.robots import ROBOTS, KnownRobot

GROUP: Final = "arms"
_BOLTED: Final[Mapping[str, object]] = {"base": "fixed"}
_ALLOW: Final = {"allow": ["fixed-base"]}
_ROD_LENGTH: Final = 2 / 3  # the length in m of the mathematical pendulum that swings like a rod of 1 m
Shape = Literal["linear", "minimum_jerk"]


def period(name: str) -> Measure:
    """The mean period of a joint that swings about 0, by its passages through 0."""
    return lambda run: float(np.diff(passages(run.trace.time, joint_angle(run, name))).mean())


def effort(name: str) -> Measure:
    """The mean effort of a motor in the last half second."""

    def measure(run: Run) -> float:
        efforts = run.trace.joint_effort[:, run.trace.joint_names.index(name)]
        return float(efforts[run.row(run.setup.seconds - 0.5) :].mean())

    return measure


def sag(run: Run) -> float:
    """The largest distance of any joint from its first position, in rad or m."""
    return float(np.abs(run.trace.joint_position - run.trace.joint_position[0]).max())


def angle_at(name: str, time: float) -> Measure:
    return lambda run: float(joint_angle(run, name)[run.row(time)])


def lag(points: Mapping[str, list[tuple[float, float]]], shape: Shape = "linear") -> Measure:
    """The largest distance of joints from their way between points (time, position), in rad or m."""

    def measure(run: Run) -> float:
        return max(
            float(np.abs(joint_angle(run, name) - _wanted(run.trace.time, path, shape)).max())
            for name, path in points.items()
        )

    return measure


def _wanted(time: FloatArray, path: list[tuple[float, float]], shape: Shape) -> FloatArray:
    times, angles = np.array(path).T
    part = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(path) - 2)
    share = (time - times[part]) / (times[part + 1] - times[part])
    if shape == "minimum_jerk":
        share = share**3 * (10 + share * (-15 + share * 6))
    return np.asarray(angles[part] + share * (angles[part + 1] - angles[part]))


def apart(one: Run, other: Run) -> float:
    """The largest difference of any joint between two runs, in rad or m."""
    return float(np.abs(one.trace.joint_position - other.trace.joint_position).max())


def double_energy_gain(run: Run) -> float:
    """The highest energy of the double pendulum less the first, over the energy between hanging and standing."""
    one, two = joint_angle(run, "j1"), joint_angle(run, "j2")
    rate_one, rate_two = run.trace.joint_velocity.T
    spin = rate_one + rate_two
    heights = -0.5 * np.cos(one) - np.cos(one) - 0.5 * np.cos(one + two)
    # The centre of the second rod: the end of the first, and half a rod from there.
    squared = rate_one**2 + spin**2 / 4 + rate_one * spin * np.cos(two)
    kinetic = (1 / 3) * rate_one**2 / 2 + squared / 2 + (1 / 12) * spin**2 / 2
    energy = kinetic + GRAVITY * heights
    return float((energy.max() - energy[0]) / (4 * GRAVITY))


DOUBLE_START: Final = math.pi / 2
DOUBLE_TIME: Final = 0.5
DOUBLE_ANGLE: Final = 0.325526  # the angle of the first hinge in rad after DOUBLE_TIME, by Lagrange's equations


def _pendulums() -> list[Case]:
    cases = []
    for degrees in (5, 45, 90, 150):
        truth = pendulum_period(_ROD_LENGTH, math.radians(degrees))
        robot = {**_BOLTED, "joints": {"j1": math.radians(degrees)}, "pose": {"z": 3.0}}
        setup = Setup(pendulum(), 10.0, _ALLOW, robot, settle=0.0)
        name = f"pendulum from {degrees} deg"
        cases.append(Case(name, GROUP, (setup,), period("j1"), "s", "analytic", truth, 0.001 * truth))
    start = {"j1": DOUBLE_START, "j2": DOUBLE_START}
    double = Setup(pendulum(2), 5.0, _ALLOW, {**_BOLTED, "joints": start, "pose": {"z": 5.0}}, settle=0.0)
    angle, tolerance, name = angle_at("j1", DOUBLE_TIME), math.radians(2), "double pendulum"
    return [
        *cases,
        Case(f"{name}: angle", GROUP, (double,), angle, "rad", "integrated", DOUBLE_ANGLE, tolerance, name),
        Case(f"{name}: energy", GROUP, (double,), double_energy_gain, "of 4 m g l", "bound", 0.0, 0.02, name),
    ]


def _held() -> list[Case]:
    """Joints without a command are held where they begin; the motor carries the load."""
    cases = []
    for payload in (0.5, 2.0):
        setup = Setup(arm(payload=payload), 3.0, _ALLOW, {**_BOLTED, "pose": {"z": 2.0}})
        shoulder = GRAVITY * (0.25 + 0.75 + payload * 1.0)
        elbow = GRAVITY * (0.25 + payload * 0.5)
        name = f"arm holds {payload:g} kg"
        for joint, torque in (("shoulder", shoulder), ("elbow", elbow)):
            title, tolerance = f"{name}: torque of the {joint}", 0.01 * torque
            cases.append(Case(title, GROUP, (setup,), effort(joint), "N m", "analytic", -torque, tolerance, name))
        cases.append(Case(f"{name}: sag", GROUP, (setup,), sag, "rad", "bound", 0.0, 0.002, name))
    for payload in (5.0, 50.0):
        setup = Setup(lift(payload), 3.0, _ALLOW, {**_BOLTED, "pose": {"z": 2.0}})
        name, weight = f"lift holds {payload:g} kg", payload * GRAVITY
        cases.append(Case(name, GROUP, (setup,), effort("slide"), "N", "analytic", weight, 0.01 * weight))
    return cases


def _weak() -> list[Case]:
    """A motor with half the torque that gravity needs lets the arm fall, with the other half."""
    payload = 2.0
    needed = GRAVITY * (0.25 + 0.75 + payload)
    setup = Setup(arm(effort=needed / 2, payload=payload), 0.2, _ALLOW, {**_BOLTED, "pose": {"z": 3.0}}, settle=0.0)
    # About the shoulder: two rods and the payload, with a straight elbow, which is strong enough.
    moment = 1 / 48 + 0.25**2 + 1 / 48 + 0.75**2 + payload * (1.0 + 0.4 * 0.05**2)
    truth = weak_fall(needed / moment, needed / 2 / moment, 0.2)
    name, angle = "weak motor lets an arm fall", angle_at("shoulder", 0.2)
    return [Case(name, GROUP, (setup,), angle, "rad", "integrated", truth, 0.03 * truth)]


def weak_fall(weight: float, brake: float, seconds: float) -> float:
    """The angle after some time of an arm that starts level: angle'' = weight cos(angle) - brake."""
    angle = rate = 0.0
    steps = 20_000
    step = seconds / steps
    for _ in range(steps):
        # The method of Verlet, of second order.
        half = rate + step / 2 * (weight * math.cos(angle) - brake)
        angle += step * half
        rate = half + step / 2 * (weight * math.cos(angle) - brake)
    return angle


def behind(multipliers: tuple[float, ...]) -> Measure:
    """The largest distance of followers from where their leader puts them, in rad."""

    def measure(run: Run) -> float:
        leader = joint_angle(run, "leader")
        followed = zip(multipliers, range(1, len(multipliers) + 1), strict=True)
        return max(float(np.abs(joint_angle(run, f"follower{n}") - ratio * leader).max()) for ratio, n in followed)

    return measure


def _followers() -> list[Case]:
    """Followers stay with a light leader that moves and holds them; its motor carries all loads through the gears."""
    cases = []
    rows = (
        ("10 kg twice as far", ((2.0, 10.0),), False),
        ("100 kg the other way", ((-1.0, 100.0),), False),
        ("1 kg half as far", ((0.5, 1.0),), False),
        ("0.1 kg ten times as far", ((10.0, 0.1),), False),
        ("two of 5 and 20 kg", ((1.0, 5.0), (-2.0, 20.0)), False),
        ("2 kg that its leader carries", ((-1.0, 2.0),), True),
        ("2 kg twice as far that its leader carries", ((2.0, 2.0),), True),
        ("20 kg half as far that its leader carries", ((0.5, 20.0),), True),
    )
    for what, loads, in_series in rows:
        ratios = tuple(ratio for ratio, _ in loads)
        points = {"commands": {"joints": [{"at": 2, "position": {"leader": 0.6 / max(map(abs, ratios))}}], "rate": 40}}
        robot = {**_BOLTED, "pose": {"z": 3.0}}
        model, name = followers(loads, in_series=in_series), f"follower of {what}"
        moves = Setup(model, 3.0, {**points, **_ALLOW}, robot)
        keys: dict[str, Any] = {"group": GROUP, "unit": "rad", "kind": "bound", "truth": 0.0, "family": name}
        keys["quick"] = what != "2 kg twice as far that its leader carries"
        most = math.radians(0.05)
        cases.append(Case(f"{name}: lag behind it", setups=(moves,), measure=behind(ratios), tolerance=most, **keys))
        # With level loads: each turns by its multiplier, and a load on the leader by one more.
        torque = sum(
            (ratio + in_series) * mass * GRAVITY * 0.5 + in_series * mass * GRAVITY * 0.2 for ratio, mass in loads
        )
        keys |= {"unit": "N m", "kind": "analytic", "truth": -torque, "tolerance": abs(0.01 * torque)}
        holds = (Setup(model, 3.0, _ALLOW, robot),)
        cases.append(Case(f"{name}: torque of its leader", setups=holds, measure=effort("leader"), **keys))
    return cases


_PATH: Final = {"shoulder": [(0.0, 0.0), (2.0, 1.0), (4.0, -0.5)], "elbow": [(0.0, 0.0), (2.0, -0.8), (4.0, 0.4)]}


def _commanded(points: Mapping[str, list[tuple[float, float]]], shape: Shape = "linear") -> dict[str, object]:
    times = sorted({time for path in points.values() for time, _ in path} - {0.0})
    rows = [
        {"at": time, "position": {name: dict(path)[time] for name, path in points.items() if time in dict(path)}}
        for time in times
    ]
    return {"commands": {"joints": rows, "rate": 40, "interpolation": shape}, **_ALLOW}


def _known(name: str) -> KnownRobot:
    return next(known for known in ROBOTS if known.name == name)


_KUKA: Final = _known("kuka_iiwa")
_KUKA_PATH: Final = {f"lbr_iiwa_joint_{number}": [(0.0, 0.0), (2.0, 0.6), (4.0, -0.2)] for number in range(1, 8)}


def _trajectories() -> list[Case]:
    """Joints follow lines, whose corners are jumps of speed, and smooth motions; in both engines the same way."""
    bolted = {**_BOLTED, "pose": {"z": 2.0}}
    degree = math.radians(1)
    cases = []
    rows: tuple[tuple[str, str, Mapping[str, object], Mapping[str, list[tuple[float, float]]], Shape], ...] = (
        ("arm on lines", arm(), bolted, _PATH, "linear"),
        ("arm on smooth ways", arm(), bolted, _PATH, "minimum_jerk"),
        ("kuka on smooth ways", _KUKA.path, _KUKA.keys, _KUKA_PATH, "minimum_jerk"),
    )
    for name, model, keys, path, shape in rows:
        setup = Setup(model, 4.0, _commanded(path, shape), keys)
        most = degree if shape == "linear" else 0.5 * degree
        figures: dict[str, Any] = {"group": GROUP, "setups": (setup,), "unit": "rad", "truth": 0.0, "family": name}
        figures["bundled"] = name.startswith("kuka")
        cases += [
            Case(f"{name}: lag", measure=lag(path, shape), kind="bound", tolerance=most, **figures),
            Case(f"{name}: engines", measure=apart, kind="spread", tolerance=0.2 * degree, between=True, **figures),
        ]
    panda = _known("franka_panda")
    for name, known, joints in (
        ("kuka", _KUKA, {"lbr_iiwa_joint_2": 1.0, "lbr_iiwa_joint_4": -1.0}),
        ("panda", panda, {"panda_joint2": 0.5, "panda_joint4": -1.5}),
    ):
        setup = Setup(known.path, 3.0, _ALLOW, {**known.keys, "joints": joints})
        cases.append(Case(f"{name} holds itself: sag", GROUP, (setup,), sag, "rad", "bound", 0.0, 0.002, bundled=True))
    return cases


CASES: Final = (*_pendulums(), *_held(), *_weak(), *_followers(), *_trajectories())
