"""The error of the integrator, against exact motions: the figures of docs/engines/accuracy.md.

Both engines use semi-implicit Euler, so they agree with each other and not with the reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.simulation.energy import Mechanics
from sim_action.state.command import JointTargets
from sim_action.state.trace import FloatArray, Trace
from tests.integration.engines import at, on_every_engine, scene_of, travelled

pytestmark = on_every_engine

G = 9.80665
INERTIA = '<inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/>'
BALL = (
    f'<robot name="ball"><link name="base"><inertial><mass value="2"/>{INERTIA.format(0.01)}</inertial></link></robot>'
)

LENGTH, MOMENT = 1.0, 0.01  # m, of two rods with a mass of 1 kg in the middle of each, and kg m^2 about that point


def rod(name: str, parent: str, origin: str) -> str:
    inertial = f'<inertial><origin xyz="0 0 -0.5"/><mass value="1"/>{INERTIA.format(MOMENT)}</inertial>'
    ends = f'<parent link="{parent}"/><child link="{name}"/><origin xyz="{origin}"/><axis xyz="0 1 0"/>'
    return f'<link name="{name}">{inertial}</link><joint name="{name}_joint" type="continuous">{ends}</joint>'


PENDULUM = (
    f'<robot name="it"><link name="base"/>{rod("upper", "base", "0 0 0")}{rod("lower", "upper", "0 0 -1")}</robot>'
)


def exact(start: tuple[float, float], torque: Callable[[float], float], seconds: float, gravity: float) -> FloatArray:
    """The angles of the two joints, by Runge-Kutta of 4th order with steps of 0.1 ms (Lagrange's equations)."""
    half = LENGTH / 2

    def slope(time: float, state: FloatArray) -> FloatArray:
        a, b, da, db = state
        # Angles from straight down: a, and a + b.
        cosine, sine = math.cos(b), math.sin(b)
        m11 = half**2 + LENGTH**2 + half**2 + 2 * LENGTH * half * cosine + 2 * MOMENT
        m12 = half**2 + LENGTH * half * cosine + MOMENT
        m22 = half**2 + MOMENT
        right = np.array(
            [
                torque(time)
                + LENGTH * half * sine * (2 * da * db + db**2)
                - gravity * ((half + LENGTH) * math.sin(a) + half * math.sin(a + b)),
                -LENGTH * half * sine * da**2 - gravity * half * math.sin(a + b),
            ]
        )
        determinant = m11 * m22 - m12**2
        return np.array(
            [da, db, (m22 * right[0] - m12 * right[1]) / determinant, (m11 * right[1] - m12 * right[0]) / determinant]
        )

    step, state = 1e-4, np.array([*start, 0.0, 0.0])
    for number in range(round(seconds / step)):
        time = number * step
        k1 = slope(time, state)
        k2 = slope(time + step / 2, state + step / 2 * k1)
        k3 = slope(time + step / 2, state + step / 2 * k2)
        k4 = slope(time + step, state + step * k3)
        state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state[:2]


def swung(engine: str, folder: Path, rate: float, seconds: float) -> tuple[Trace, Mechanics]:
    """A double pendulum that begins with both rods level."""
    robot = Robot(
        model="robot.urdf", base="fixed", pose=Placement(z=5), joints={"upper_joint": "90 deg", "lower_joint": "90 deg"}
    )
    scene = scene_of(folder, PENDULUM, robot, rate=rate)
    trace = travelled(engine, scene, round(seconds * rate))
    return trace, Mechanics(scene.model, scene.world.gravity_xyz)


@pytest.mark.parametrize(("rate", "short_mm"), [(240.0, 24.5), (960.0, 6.1)])
def test_a_fall_is_short_by_half_a_step_of_its_speed(engine: str, rate: float, short_mm: float, tmp_path: Path) -> None:
    seconds = 1.2
    trace = travelled(engine, scene_of(tmp_path, BALL, at(50.0), rate=rate), round(seconds * rate))
    fallen = 50.0 - float(trace.base_position_xyz[-1, 2])
    assert fallen - G * seconds**2 / 2 == pytest.approx(G * seconds / rate / 2, rel=1e-3)
    assert 1e3 * (fallen - G * seconds**2 / 2) == pytest.approx(short_mm, abs=0.05)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-G * seconds, rel=1e-6)


@pytest.mark.parametrize("degrees", [5, 90, 170])
def test_a_pendulum_has_the_exact_period(engine: str, degrees: float, tmp_path: Path) -> None:
    urdf = f'<robot name="it"><link name="base"/>{rod("upper", "base", "0 0 0")}</robot>'
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=5), joints={"upper_joint": f"{degrees} deg"})
    trace = travelled(engine, scene_of(tmp_path, urdf, robot), 4800)
    angle, time = trace.joint_position[:, 0], trace.time
    before = np.flatnonzero((angle[:-1] < 0) & (angle[1:] >= 0))
    crossings = time[before] - angle[before] * (time[before + 1] - time[before]) / (angle[before + 1] - angle[before])
    one, other = 1.0, math.cos(math.radians(degrees) / 2)
    for _ in range(8):
        # The arithmetic-geometric mean gives the complete elliptic integral of the period.
        one, other = (one + other) / 2, math.sqrt(one * other)
    period = 2 * math.pi * math.sqrt((MOMENT + 0.25) / (G * 0.5)) / one
    assert np.diff(crossings).mean() == pytest.approx(period, rel=2e-5)


@pytest.mark.parametrize(("rate", "off_deg"), [(240.0, 62.1), (480.0, 25.2), (1920.0, 6.1)])
def test_a_double_pendulum_is_off_by_an_error_of_first_order(
    engine: str, rate: float, off_deg: float, tmp_path: Path
) -> None:
    trace, _ = swung(engine, tmp_path, rate, 1.5)
    reference = exact((math.pi / 2, math.pi / 2), lambda _: 0.0, 1.5, G)
    # The inclination of the lower rod is the sum of both angles.
    off = math.degrees(abs(trace.joint_position[-1].sum() - reference.sum()))
    assert off == pytest.approx(off_deg, abs=0.1)


@pytest.mark.parametrize(("rate", "after"), [(240.0, -17.0), (960.0, -2.4), (1920.0, 1.8)])
def test_a_double_pendulum_loses_energy(engine: str, rate: float, after: float, tmp_path: Path) -> None:
    trace, mechanics = swung(engine, tmp_path, rate, 20)
    kinetic, potential = mechanics.energy(mechanics.frames(trace))
    # The potential energy counts from the hinge, at 5 m.
    total = kinetic + potential - 2 * G * 5
    assert total[0] == pytest.approx(4.9, abs=0.05)
    # Chaotic: at small steps, the engines differ in the last digits after 20 s.
    assert total[-1] == pytest.approx(after, abs=0.2)


@pytest.mark.parametrize(("rate", "off_deg"), [(240.0, (4.4, 10.6)), (960.0, (1.0, 2.6))])
def test_an_arm_that_torques_swing_fast_is_off(
    engine: str, rate: float, off_deg: tuple[float, float], tmp_path: Path
) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=5), joints={"lower_joint": "30 deg"})
    trace = travelled(
        engine,
        scene_of(tmp_path, PENDULUM, robot, rate=rate),
        round(0.5 * rate),
        JointTargets(effort={"upper_joint": 40.0}),
    )
    reference = exact((0.0, math.radians(30)), lambda _: 40.0, 0.5, G)
    assert np.degrees(np.abs(trace.joint_position[-1] - reference)) == pytest.approx(off_deg, abs=0.06)
    assert trace.joint_velocity[-1, 0] == pytest.approx(9.3, abs=0.3)
