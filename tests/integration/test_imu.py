"""IMUs on real engines: what robots feel that drive, spin and reach out."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose
from sim_action.engines import installed
from sim_action.robot.model.robot_spec import Robot
from sim_action.sensors import Mount
from sim_action.sensors.imu import Imu
from sim_action.state.command import JointTargets
from sim_action.state.trace_records import SensorRecord
from sim_action.world import GRAVITY
from tests.integration.engines import advance, on_every_engine, running, scene_of
from tests.integration.test_probe import ARM
from tests.scenarios import LEAST
from tests.sensors.stubs import sight_of
from tests.simulated import simulated

SENSOR = "sensors:\n  - {imu: {}, rate: 20 Hz, pose: {x: 0.1, z: 0.05}, trace: true}\n"


def record(folder: Path, engine: str, twist: str) -> SensorRecord:
    text = LEAST.replace("{linear: 1.0}", twist).replace("travel: {at_least: 1.5 m}", "upright: {}")
    run = simulated(folder, text.replace("30 s", "3 s") + f"{SENSOR}backend: {engine}\n")
    (readings,) = run.trace.sensors.values()
    assert readings.time.tolist() == [tick / 20 for tick in range(60)]
    return readings


@pytest.mark.parametrize("engine", installed())
def test_a_robot_that_stands_feels_gravity_alone(engine: str, tmp_path: Path) -> None:
    told = record(tmp_path, engine, "{linear: 0.0}").columns
    assert np.abs(told["linear_acceleration_xyz"] - (0, 0, GRAVITY)).max() < 0.02
    assert np.abs(told["angular_velocity_xyz"]).max() < 0.005
    assert np.abs(told["orientation_xyzw"] - (0, 0, 0, 1)).max() < 0.005


@pytest.mark.parametrize("engine", installed())
def test_it_feels_the_ramp_of_the_wheels(engine: str, tmp_path: Path) -> None:
    found = record(tmp_path, engine, "{linear: 1.0}")
    ahead = found.columns["linear_acceleration_xyz"][:, 0]
    ramp, cruise = (found.time > 0.2) & (found.time <= 1.0), found.time > 1.3
    assert ahead[ramp].mean() == pytest.approx(1.0, abs=0.03)
    assert abs(ahead[cruise].mean()) < 0.01
    # All of it, reading by reading, is the speed of the robot; who leans by 1 mrad feels 0.01 m/s^2 of gravity.
    assert ahead[found.time <= 1.3].sum() / 20 == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("engine", installed())
def test_off_the_middle_of_a_spin_it_feels_what_holds_it(engine: str, tmp_path: Path) -> None:
    found = record(tmp_path, engine, "{angular: 2.0}")
    steady = found.time > 1.0
    turning = found.columns["angular_velocity_xyz"][steady, 2]
    assert turning.mean() == pytest.approx(2.0, rel=0.01)
    felt = found.columns["linear_acceleration_xyz"][steady].mean(axis=0)
    assert felt == pytest.approx((-0.1 * 2.0**2, 0, GRAVITY), abs=0.02)


@on_every_engine
def test_it_goes_with_the_link_of_an_arm(engine: str, tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=3))
    # The hinge is upright, and carries the sensor 0.5 m from its axis.
    scene = scene_of(tmp_path, ARM.replace('rpy="0.1 0 0.4"', 'rpy="0 0 0.4"'), robot)
    with running(engine, scene) as backend:
        measure = Imu().open(Mount(scene, "upper", Pose((0.5, 0, 0)), 20.0, scene.generator("imu")))
        advance(backend, 0, 120, JointTargets(velocity={"turn": 3.0}))
        told = []
        for step in range(120, 360, 12):
            told.append(measure(sight_of(backend.observe(step, contacts=False), backend)).columns())
            advance(backend, step, 12)
    arc = 3.0 / 20 / 2
    for columns in told[1:]:
        assert columns["angular_velocity_xyz"] == pytest.approx((0, 0, 3.0), abs=0.005)
        wanted = (-0.5 * 3.0**2 * math.sin(arc) / arc, 0, GRAVITY)
        assert columns["linear_acceleration_xyz"] == pytest.approx(wanted, abs=0.03)
