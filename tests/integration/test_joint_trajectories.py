"""Real arms follow joint trajectories in the real engine, against the analytic path; real legs stand by joint targets.

`off` is how far any joint of the arm is from its path at any time, in degrees: as measured, and a little. The rate of
the ticks changes nothing. On straight lines it comes from their corners, where a joint has 20 ms to change its speed:
franka_panda's last joint has a motor of 12 N m for an inertia that takes more.

Without knowing how fast their targets move, the same servos are behind by 3 to 5 deg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.core.lazy_numpy import FloatArray
from sim_action.scenario.loading import build_scene
from sim_action.state.trace import Trace
from tests.integration.engines import on_every_engine
from tests.simulated import simulated
from tools.bench.robots import ROBOTS

pytestmark = pytest.mark.pybullet
KNOWN: Final = {known.name: known for known in ROBOTS}
PHYSICS_RATE: Final = 240


def run(folder: Path, name: str, engine: str, commands: object, **robot: object) -> Trace:
    """Five seconds, and one more, of a robot that does as it is told."""
    known = KNOWN[name]
    scenario = {
        "name": name,
        "robot": {"model": known.path, **known.keys, **robot},
        "commands": commands,
        "expect": [{"travel": {"at_most": "2 cm"}}],
        # A fixed base does not travel; the trace is what is judged.
        "allow": ["fixed-base"],
        "backend": engine,
        "time_limit": 6,
        "trace": {"rate": PHYSICS_RATE},
    }
    return simulated(folder, scenario, outside=True).trace


@dataclass(frozen=True)
class Arm:
    """An arm that goes through knots at 0, 2, 3.5 and 5 s: rad, of its seven joints in their order."""

    name: str
    joints: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]


TIMES: Final = (0.0, 2.0, 3.5, 5.0)
ARMS: Final = (
    Arm(
        "kuka_iiwa",
        tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8)),
        (
            (0.0, 0.3, 0.0, -0.5, 0.0, 0.4, 0.0),
            (1.2, 0.8, -1.0, -1.4, 1.0, 0.9, 1.5),
            (0.6, 0.2, -0.2, -1.8, 0.2, 1.2, 0.9),
            (-0.4, 0.5, 0.5, -0.9, -0.7, 0.1, -0.3),
        ),
    ),
    Arm(
        "franka_panda",
        tuple(f"panda_joint{number}" for number in range(1, 8)),
        (
            (0.0, -0.3, 0.0, -1.6, 0.0, 1.8, 0.5),
            (1.0, 0.6, -0.8, -2.2, 0.9, 2.3, 1.7),
            (0.4, 0.1, -0.2, -1.2, 0.3, 1.4, 0.9),
            (-0.5, -0.4, 0.6, -1.9, -0.6, 1.9, 0.1),
        ),
    ),
)
# Arm and interpolation -> deg, in PyBullet and in MuJoCo: anywhere, and away from corners.
OFF: Final = {
    ("kuka_iiwa", "minimum_jerk"): {"pybullet": (0.005, 0.005), "mujoco": (0.005, 0.005)},
    ("kuka_iiwa", "linear"): {"pybullet": (0.01, 0.005), "mujoco": (0.03, 0.005)},
    ("franka_panda", "minimum_jerk"): {"pybullet": (0.005, 0.005), "mujoco": (0.005, 0.005)},
    ("franka_panda", "linear"): {"pybullet": (4.5, 0.03), "mujoco": (4.5, 0.03)},
}
NEAR_A_CORNER: Final = 0.3  # s
RAMP: Final = 0.02  # s
AT_REST: Final = 0.005  # deg, a second after the last knot


def wanted(arm: Arm, interpolation: str, time: FloatArray) -> FloatArray:
    """(T, 7) in rad: from knot to knot, by the integral of a speed with ramps or by 10 s^3 - 15 s^4 + 6 s^5."""
    knots, times = np.array(arm.knots), np.array(TIMES)
    if interpolation == "linear":
        return np.stack([ramped(times, column, time) for column in knots.T], axis=1)
    index = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    s = np.clip((time - times[index]) / (times[index + 1] - times[index]), 0, 1)
    share = 10 * s**3 - 15 * s**4 + 6 * s**5
    way: FloatArray = knots[index] + (knots[index + 1] - knots[index]) * share[:, None]
    return way


def ramped(times: FloatArray, values: FloatArray, time: FloatArray) -> FloatArray:
    """(T,) a joint at rest where it turns back, and else at a point at the lower of two speeds, by trapezoids."""
    means = np.diff(values) / np.diff(times)
    turns = [0.0, *(min(a, b, key=abs) if a * b > 0 else 0.0 for a, b in pairwise(means)), 0.0]
    at, speeds = [times[0]], [0.0]
    for (start, end), (first, last), mean in zip(pairwise(times), pairwise(turns), means, strict=True):
        cruise = (mean * (end - start) - RAMP * (first + last) / 2) / (end - start - RAMP)
        at += [start + RAMP, end - RAMP, end]
        speeds += [cruise, cruise, last]
    fine = np.unique(np.concatenate((at, time)))
    speed = np.interp(fine, at, speeds)
    ways = np.concatenate(([0.0], np.cumsum(np.diff(fine) * (speed[1:] + speed[:-1]) / 2)))
    along: FloatArray = values[0] + np.interp(time, fine, ways)
    return along


def followed(folder: Path, arm: Arm, engine: str, interpolation: str, rate: float) -> tuple[FloatArray, FloatArray]:
    """When, in s, and how far off the path each joint was, in deg: (T,), (T, 7)."""
    points = [
        {"at": time, "position": dict(zip(arm.joints, knot, strict=True))}
        for time, knot in zip(TIMES[1:], arm.knots[1:], strict=True)
    ]
    begins = {"joints": dict(zip(arm.joints, arm.knots[0], strict=True))}
    commands = {"joints": points, "interpolation": interpolation, "rate": rate}
    trace = run(folder, arm.name, engine, commands, **begins)
    columns = [trace.joint_names.index(joint) for joint in arm.joints]
    off = np.degrees(np.abs(trace.joint_position[:, columns] - wanted(arm, interpolation, trace.time)))
    return trace.time, off


@pytest.mark.parametrize("interpolation", ["minimum_jerk", "linear"])
@pytest.mark.parametrize(("arm", "rate"), [(ARMS[0], 240), (ARMS[1], 40)], ids=["kuka_iiwa", "franka_panda"])
@on_every_engine
def test_arms_follow_joint_trajectories(engine: str, arm: Arm, interpolation: str, rate: int, tmp_path: Path) -> None:
    time, off = followed(tmp_path, arm, engine, interpolation, rate)
    from_a_corner = np.abs(time[:, None] - np.array(TIMES)).min(axis=1)
    anywhere, away = OFF[arm.name, interpolation][engine]
    assert off.max() < anywhere
    assert off[from_a_corner > NEAR_A_CORNER].max() < away
    assert off[-1].max() < AT_REST


@dataclass(frozen=True)
class Legs:
    """A robot on legs."""

    name: str
    height: float  # m, of its base if nothing gave way: that of its legs, and of the balls that its toes are
    up: float  # deg, between the z axis of its base and the world's when it stands; y points up in laikago's file
    sunk: float  # m, by which its weight brings it down, at the most
    tilted: float  # deg, at the most


def a1s_height(bent: FloatArray | float) -> FloatArray:
    """Above feet that are below its hips: two links of 0.2 m, bent by as much, and 2 cm of toe. m, of rad."""
    height: FloatArray = 0.4 * np.cos(bent) + 0.02
    return height


LEGS: Final = (
    Legs("a1", float(a1s_height(0.8)), 0.0, sunk=0.002, tilted=0.1),
    Legs("laikago", 0.4583 + 0.03, 90.0, sunk=0.004, tilted=1.0),
)


@pytest.mark.parametrize("legs", LEGS, ids=lambda legs: legs.name)
@on_every_engine
def test_legs_stand_by_joint_targets(engine: str, legs: Legs, tmp_path: Path) -> None:
    """laikago's joints have no limits: nothing but the targets holds them, and so it is before t = 0."""
    positions = build_scene(KNOWN[legs.name].resting(tmp_path, 1.0)).joint_positions
    commands = {"joints": [{"at": 0, "position": positions}]}
    trace = run(tmp_path, legs.name, engine, commands, pose={"roll": math.radians(legs.up)})
    assert trace.time[-1] == pytest.approx(6.0)
    height = trace.base_position_xyz[:, 2]
    assert np.ptp(height) < 0.0005
    assert np.abs(height - legs.height).max() < legs.sunk
    assert np.abs(np.degrees(trace.tilt) - legs.up).max() < legs.tilted


@on_every_engine
def test_a1_bends_its_knees_and_comes_up_again(engine: str, tmp_path: Path) -> None:
    """By 13 cm; its height is that of its legs at every moment."""
    bends = ((1.0, 0.8), (2.5, 1.2), (4.0, 0.8))
    points = [
        {"at": time, "position": {f"{leg}_{part}_joint": way * bend for leg in A1S_LEGS for part, way in A1S_KNEE}}
        for time, bend in bends
    ]
    trace = run(tmp_path, "a1", engine, {"joints": points, "interpolation": "minimum_jerk"})
    share = np.clip(np.minimum(trace.time - 1.0, 4.0 - trace.time) / 1.5, 0, 1)
    bent = 0.8 + 0.4 * (10 * share**3 - 15 * share**4 + 6 * share**5)
    assert np.abs(trace.base_position_xyz[:, 2] - a1s_height(bent)).max() < 0.005
    assert np.degrees(trace.tilt).max() < 1.0


A1S_LEGS: Final = ("FR", "FL", "RR", "RL")
A1S_KNEE: Final = (("upper", 1.0), ("lower", -2.0))
