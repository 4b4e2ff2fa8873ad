"""Lidars on a robot that moves: what they tell is where the walls are, and it closes a loop. On every engine."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.geometry import Pose, compose, quaternion_from_rpy, rotate
from sim_action.engines import installed
from sim_action.robot.model.kinematics import link_poses
from sim_action.scenario.loading import build_scene
from sim_action.simulation.loop import SimulationRun
from sim_action.state.trace import Trace
from tests.integration.ray_oracle import Floats, first_hits
from tests.integration.test_rays import TOLERANCES
from tests.scenarios import load
from tests.simulated import simulated

pytestmark = pytest.mark.parametrize("engine", installed())
EXAMPLE = Path(__file__).parents[2] / "examples/sensors"
TURNING = """\
name: burger turns in a room
robot: {model: turtlebot3_burger}
world:
  objects:
    - {name: south, box: [4, 0.1, 0.5], pose: {y: -1.5, z: 0.25}}
    - {name: north, box: [4, 0.1, 0.5], pose: {y: 1.5, z: 0.25}}
    - {name: west, box: [0.1, 3, 0.5], pose: {x: -2, z: 0.25}}
    - {name: east, box: [0.1, 3, 0.5], pose: {x: 2, z: 0.25, yaw: 0.2}}
    - {name: barrel, cylinder: {radius: 0.2, height: 0.5}, pose: {x: 1, y: 0.6, z: 0.25}}
    - {name: ball, sphere: {radius: 0.3}, pose: {x: -1, y: 0.5, z: 0.4}}
commands: {twist: [{linear: 0.1, angular: 1.0}]}
expect: [{travel: {at_most: 1 m}}]
trace: {rate: 240 Hz}
duration: 5 s
time_limit: 5 s
"""
LIDAR = """\
sensors:
  - lidar: {rays: 90, min_range: 0.9, range: 1.8 m}
    link: base_scan
    pose: {x: 5 cm, z: 2 cm, pitch: 10 deg, yaw: 30 deg}
    rate: 16 Hz
    trace: true
"""
ALONG_A_WALL = """\
name: burger follows a wall
robot: {model: turtlebot3_burger, pose: {y: 0.8, yaw: 20 deg}}
world: {objects: [{name: wall, box: [20, 0.1, 0.5], pose: {x: 5, y: -0.05}}]}
sensors: [{lidar: {range: 3.5 m, noise: NOISE}, name: scan, link: base_scan}]
commands: {script: follow_wall.py}
expect: [no_collision]
duration: 10 s
time_limit: 10 s
"""


def run(folder: Path, text: str, engine: str, seed: int = 0) -> SimulationRun:
    shutil.copy(EXAMPLE / "follow_wall.py", folder)
    return simulated(folder, f"{text}seed: {seed}\nbackend: {engine}\n")


def sensor_poses(trace: Trace, base_to_sensor: Pose) -> list[Pose]:
    rows = zip(trace.base_position_xyz.tolist(), trace.base_orientation_xyzw.tolist(), strict=True)
    return [compose(Pose(tuple(position), tuple(turned)), base_to_sensor) for position, turned in rows]


def test_a_turning_tilted_lidar_tells_where_the_walls_and_the_ground_are(engine: str, tmp_path: Path) -> None:
    loaded = load(tmp_path, TURNING)
    scene = build_scene(loaded)
    trace = run(tmp_path, TURNING + LIDAR, engine).trace
    record = trace.sensors["lidar"]
    assert record.time.tolist() == [tick / 16 for tick in range(80)]
    mount = Pose((0.05, 0.0, 0.02), quaternion_from_rpy(0.0, math.radians(10), math.radians(30)))
    poses = sensor_poses(trace, compose(link_poses(scene.model, {})["base_scan"], mount))
    angles = np.radians(np.arange(-180, 180, 4))
    in_plane = 1.8 * np.column_stack((np.cos(angles), np.sin(angles), 0 * angles))
    kinds = set()
    for ranges, pose in zip(record.columns["ranges"], poses[:-1:15], strict=True):
        ends: Floats = np.array([rotate(pose.orientation_xyzw, tuple(end)) for end in in_plane]) + pose.position_xyz
        for grown, sign in ((TOLERANCES[engine], 1), (-TOLERANCES[engine], -1)):
            bound = 1.8 * first_hits(scene.world.objects, pose.position_xyz, ends, grown=grown)
            bound[bound < 0.9] = -np.inf
            assert (sign * ranges >= sign * bound - 1e-6).all()
        kinds |= set(np.sign(ranges) * np.isinf(ranges))
    assert kinds == {-1.0, 0.0, 1.0}


def test_a_wall_is_followed(engine: str, tmp_path: Path) -> None:
    trace = run(tmp_path, ALONG_A_WALL.replace("NOISE", "0"), engine).trace
    x, y, _ = trace.base_position_xyz.T
    assert x[-1] == pytest.approx(0.3 * 10, abs=0.3)
    assert y[trace.time > 8] == pytest.approx(0.5, abs=0.005)


def test_noise_in_a_closed_loop_is_that_of_the_seed(engine: str, tmp_path: Path) -> None:
    noisy, exact = (ALONG_A_WALL.replace("NOISE", noise) for noise in ("3 cm", "0"))
    first, again, other = (run(tmp_path, noisy, engine, seed) for seed in (1, 1, 2))
    assert first.digest == again.digest != other.digest
    assert run(tmp_path, exact, engine, 1).digest == run(tmp_path, exact, engine, 2).digest
    for noise in (first, other):
        assert noise.trace.base_position_xyz[noise.trace.time > 6, 1] == pytest.approx(0.5, abs=0.1)
