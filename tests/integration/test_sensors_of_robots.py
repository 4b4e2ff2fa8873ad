"""IMUs, contact sensors and lidars of robots, on every engine: they tell what there is, and close a loop."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, compose, quaternion_from_rpy, rotate
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.loading import build_scene
from sim_action.sensors import Mount
from sim_action.sensors.imu import Imu
from sim_action.simulation.loop import SimulationRun
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.state.trace_records import SensorRecord
from sim_action.world import GRAVITY
from tests.integration.engines import advance, on_every_engine, running, scene_of
from tests.integration.ray_oracle import Floats, first_hits
from tests.integration.test_probe import ARM
from tests.integration.test_rays import TOLERANCES
from tests.scenarios import LEAST, load
from tests.sensors.stubs import sight_of
from tests.simulated import simulated
from tests.traces import burger

IMU = "sensors:\n  - {imu: {}, rate: 20 Hz, pose: {x: 0.1, z: 0.05}, trace: true}\n"


def felt_by(folder: Path, engine: str, twist: str) -> SensorRecord:
    text = LEAST.replace("{linear: 1.0}", twist).replace("travel: {at_least: 1.5 m}", "upright: {}")
    run = simulated(folder, text.replace("30 s", "3 s") + f"{IMU}backend: {engine}\n")
    (readings,) = run.trace.sensors.values()
    assert readings.time.tolist() == [tick / 20 for tick in range(60)]
    return readings


@on_every_engine
def test_a_robot_that_stands_feels_gravity_alone(engine: str, tmp_path: Path) -> None:
    told = felt_by(tmp_path, engine, "{linear: 0.0}").columns
    assert np.abs(told["linear_acceleration_xyz"] - (0, 0, GRAVITY)).max() < 0.02
    assert np.abs(told["angular_velocity_xyz"]).max() < 0.005
    assert np.abs(told["orientation_xyzw"] - (0, 0, 0, 1)).max() < 0.005


@on_every_engine
def test_it_feels_the_ramp_of_the_wheels(engine: str, tmp_path: Path) -> None:
    found = felt_by(tmp_path, engine, "{linear: 1.0}")
    ahead = found.columns["linear_acceleration_xyz"][:, 0]
    ramp, cruise = (found.time > 0.2) & (found.time <= 1.0), found.time > 1.3
    assert ahead[ramp].mean() == pytest.approx(1.0, abs=0.03)
    assert abs(ahead[cruise].mean()) < 0.01
    # All of it, reading by reading, is the speed of the robot; who leans by 1 mrad feels 0.01 m/s^2 of gravity.
    assert ahead[found.time <= 1.3].sum() / 20 == pytest.approx(1.0, abs=0.02)


@on_every_engine
def test_off_the_middle_of_a_spin_it_feels_what_holds_it(engine: str, tmp_path: Path) -> None:
    found = felt_by(tmp_path, engine, "{angular: 2.0}")
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


WHEELS = ("wheel_left_link", "wheel_right_link")
LINKS = ("base_footprint", *WHEELS, "caster_back_link", "base_scan")
CONTACTS = "".join(f"  - {{contact: {{}}, name: {link}, link: {link}, rate: 240 Hz, trace: true}}\n" for link in LINKS)
# The burger's shell ends 38 mm ahead of its base link.
WALL, FRONT = 0.3, 0.038
TO_A_WALL = f"""\
name: burger
robot: {{model: turtlebot3_burger}}
world:
  objects: [{{name: wall, box: [0.1, 2, 0.5], pose: {{x: {WALL + 0.05}}}}}]
commands:
  twist: [{{linear: SPEED}}]
expect: [upright: {{}}]
time_limit: 3 s
trace: {{rate: 240 Hz}}
"""


def bumped(folder: Path, engine: str, speed: float) -> Trace:
    return simulated(folder, f"{TO_A_WALL.replace('SPEED', str(speed))}sensors:\n{CONTACTS}backend: {engine}\n").trace


def forces(records: Mapping[str, SensorRecord]) -> dict[str, float]:
    """N, by link, in the mean of the last second."""
    return {link: float(record.columns["force"][record.time > 2.0].mean()) for link, record in records.items()}


@on_every_engine
def test_the_ground_carries_the_weight(engine: str, tmp_path: Path) -> None:
    found = forces(bumped(tmp_path, engine, 0.0).sensors)
    weight = burger().mass * GRAVITY
    assert sum(found.values()) == pytest.approx(weight, rel=0.01)
    # The mass is 3 cm behind the axle, the caster 8 cm.
    assert found["wheel_left_link"] == pytest.approx(found["wheel_right_link"], rel=0.05)
    assert 0.25 * weight < found["caster_back_link"] < 0.5 * weight
    assert found["base_footprint"] == found["base_scan"] == 0.0


@on_every_engine
def test_a_bumper_touches_the_wall_when_it_is_there(engine: str, tmp_path: Path) -> None:
    trace = bumped(tmp_path, engine, 0.2)
    record = trace.sensors["base_footprint"]
    touching = record.columns["touching"].astype(bool)
    ahead = trace.rows(slice(0, len(record))).base_position_xyz[:, 0]
    # From one reading to the next it drives 1 mm.
    first = int(np.flatnonzero(touching)[0])
    assert ahead[first] == pytest.approx(WALL - FRONT, abs=0.003)
    assert not record.columns["force"][~touching].any()
    # Wheels push as hard as they hold on to the ground, with a friction of 1: by what they carry. In MuJoCo, the shell
    # hits the wall again and again, so that it is so in the mean.
    pushed = forces(trace.sensors)
    assert pushed["base_footprint"] == pytest.approx(sum(pushed[wheel] for wheel in WHEELS), rel=0.1)


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


def in_room(folder: Path, text: str, engine: str, seed: int = 0) -> SimulationRun:
    shutil.copy(EXAMPLE / "follow_wall.py", folder)
    return simulated(folder, f"{text}seed: {seed}\nbackend: {engine}\n")


@on_every_engine
def test_a_turning_tilted_lidar_tells_where_the_walls_and_the_ground_are(engine: str, tmp_path: Path) -> None:
    loaded = load(tmp_path, TURNING)
    scene = build_scene(loaded)
    trace = in_room(tmp_path, TURNING + LIDAR, engine).trace
    record = trace.sensors["lidar"]
    assert record.time.tolist() == [tick / 16 for tick in range(80)]
    mount = Pose((0.05, 0.0, 0.02), quaternion_from_rpy(0.0, math.radians(10), math.radians(30)))
    base_to_sensor = compose(link_poses(scene.model, {})["base_scan"], mount)
    rows = zip(trace.base_position_xyz.tolist(), trace.base_orientation_xyzw.tolist(), strict=True)
    poses = [compose(Pose(tuple(position), tuple(turned)), base_to_sensor) for position, turned in rows]
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


@on_every_engine
def test_a_wall_is_followed(engine: str, tmp_path: Path) -> None:
    trace = in_room(tmp_path, ALONG_A_WALL.replace("NOISE", "0"), engine).trace
    x, y, _ = trace.base_position_xyz.T
    assert x[-1] == pytest.approx(0.3 * 10, abs=0.3)
    assert y[trace.time > 8] == pytest.approx(0.5, abs=0.005)


@on_every_engine
def test_noise_in_a_closed_loop_is_that_of_the_seed(engine: str, tmp_path: Path) -> None:
    noisy, exact = (ALONG_A_WALL.replace("NOISE", noise) for noise in ("3 cm", "0"))
    first, other = (in_room(tmp_path, noisy, engine, seed) for seed in (1, 2))
    assert first.digest != other.digest
    # The same seed, or no noise, gives the same run.
    for text, seeds in ((noisy, (1, 1)), (exact, (1, 2))):
        short = text.replace("10 s\n", "3 s\n")
        assert len({in_room(tmp_path, short, engine, seed).digest for seed in seeds}) == 1
    for noise in (first, other):
        assert noise.trace.base_position_xyz[noise.trace.time > 6, 1] == pytest.approx(0.5, abs=0.1)
