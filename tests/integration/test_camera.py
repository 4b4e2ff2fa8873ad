"""Cameras on real engines: where things are in the picture, how far they are, and that nobody feels it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.engines import installed
from sim_action.engines.engine import Engine
from sim_action.robot.model.robot_spec import Robot
from sim_action.sensors import Mount
from sim_action.sensors.camera import Camera
from sim_action.state.readings import CameraImage
from sim_action.world import Body, Cylinder, Sphere, World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, on_every_engine, running, scene_of
from tests.physics.robots import collision, inertial, joint, link, robot
from tests.scenarios import LEAST
from tests.sensors.stubs import sight_of
from tests.simulated import simulated

CAMERA = Camera(width=160, height=120, field_of_view=math.radians(60), far=20.0)
FOCAL = 80 / math.tan(math.radians(30))
RED = (1.0, 0.0, 0.0)
WIDE = 'lower="-3" upper="3" effort="100" velocity="10"'
# A post that is bolted down, with an arm that turns about the upright; its camera is at the height of 1 m.
POST = robot(
    link("world", ""),
    link("head", inertial(1.0, (1.0, 1.0, 1.0))),
    link("hand", inertial(0.1, (1.0, 1.0, 1.0)) + collision('<box size="0.02 0.1 0.02"/>')),
    joint("pan", "revolute", "world", "head", (0.5, 0.0, 1.0), axis=(0.0, 0.0, 1.0), limit=WIDE),
    joint("reach", "fixed", "head", "hand", (0.3, 0.0, -0.1)),
)


def post(folder: Path, *objects: Body, pan: float = 0.0) -> Scene:
    return scene_of(folder, POST, Robot(model="robot.urdf", joints={"pan": pan}), World(objects=objects))


def box(**pose: float) -> Body:
    return Body(name="box", box=(1.0, 1.0, 1.0), pose=Placement(**pose), color=RED)


def picture(backend: Engine, scene: Scene, pose: Pose | None = None, camera: Camera = CAMERA) -> CameraImage:
    mount = Mount(scene, "head", pose or Pose(), 10.0, scene.generator("x"))
    image = camera.open(mount)(sight_of(backend.observe(0, contacts=False), backend))
    assert isinstance(image, CameraImage)
    return image


def shown(engine: str, scene: Scene, pose: Pose | None = None, camera: Camera = CAMERA) -> CameraImage:
    with running(engine, scene) as backend:
        return picture(backend, scene, pose, camera)


def is_red(image: CameraImage) -> np.ndarray:
    red, green, _ = np.moveaxis(image.rgb.astype(int), 2, 0)
    return np.asarray(red > 2 * green)


def edges(seen: np.ndarray) -> tuple[int, int, int, int]:
    """The first and the last row and column of what is seen."""
    rows, columns = np.nonzero(seen)
    return int(rows.min()), int(rows.max()), int(columns.min()), int(columns.max())


@on_every_engine
def test_a_box_is_where_the_pinhole_formula_has_it(engine: str, tmp_path: Path) -> None:
    # Its face is 4 m ahead, from 0.2 m to the right to 0.8 m to the left, from 0.6 m below the eye to 0.4 m above.
    image = shown(engine, post(tmp_path, box(x=5.0, y=0.3, z=0.9)))
    seen = is_red(image)
    assert image.depth[seen] == pytest.approx(np.full(seen.sum(), 4.0), abs=1e-6)
    # A pixel is red if its middle is on the face.
    lines = (60 - FOCAL * 0.4 / 4, 59 + FOCAL * 0.6 / 4, 80 - FOCAL * 0.8 / 4, 79 + FOCAL * 0.2 / 4)
    top, bottom, left, right = (math.ceil(line - 0.5) for line in lines)
    assert edges(seen) == (top, bottom, left, right)
    assert seen.sum() == (bottom - top + 1) * (right - left + 1)


@on_every_engine
def test_ground_and_sky_meet_at_the_horizon_and_the_robot_sees_itself(engine: str, tmp_path: Path) -> None:
    image = shown(engine, post(tmp_path), camera=CAMERA.model_copy(update={"far": 1000.0}))
    assert np.isinf(image.depth[:60]).all()
    down = (np.arange(60, 120) + 0.5 - 60) / FOCAL
    # The arm's hand is before the camera.
    assert image.depth[60:, 0] == pytest.approx(1 / down, rel=1e-6)
    assert image.depth[60:, 159] == pytest.approx(1 / down, rel=1e-6)
    hand = image.depth < 0.3
    assert image.depth[hand].min() == pytest.approx(0.29, abs=1e-6)
    top, bottom = 60 + FOCAL * 0.09 / 0.31, 60 + FOCAL * 0.11 / 0.29
    assert edges(image.depth < 0.32)[:2] == (math.ceil(top - 0.5), math.ceil(bottom - 1.5))


@on_every_engine
@pytest.mark.parametrize("pan", [0.0, 0.35])
@pytest.mark.parametrize("rpy", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.2), (0.3, 0.35, 0.1)])
def test_a_ball_is_where_it_is_seen_from_a_mount_that_is_turned(
    engine: str, pan: float, rpy: tuple[float, float, float], tmp_path: Path
) -> None:
    ball = Body(name="ball", sphere=Sphere(radius=0.3), pose=Placement(x=3.5, y=1.0, z=0.5), color=RED)
    pose = Pose((0.05, 0.02, 0.1), quaternion_from_rpy(*rpy))
    image = shown(engine, post(tmp_path, ball, pan=pan), pose)
    # Independent of the code: matrices.
    camera = turned(0, 0, pan) @ turned(*rpy)
    at = np.array((0.5, 0, 1)) + turned(0, 0, pan) @ np.array(pose.position_xyz)
    rows, columns = np.nonzero(is_red(image))
    assert len(rows) > 200
    ways = np.column_stack((np.ones(len(rows)), (79.5 - columns) / FOCAL, (59.5 - rows) / FOCAL))
    points = at + image.depth[rows, columns, None] * (ways @ camera.T)
    away = np.linalg.norm(points - (3.5, 1.0, 0.5), axis=1)
    assert away == pytest.approx(np.full(len(rows), 0.3), abs=1e-5)


def turned(roll: float, pitch: float, yaw: float) -> np.ndarray:
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    about_x = np.array([(1, 0, 0), (0, cr, -sr), (0, sr, cr)])
    about_y = np.array([(cp, 0, sp), (0, 1, 0), (-sp, 0, cp)])
    return np.asarray(np.array([(cy, -sy, 0), (sy, cy, 0), (0, 0, 1)]) @ about_y @ about_x)


@on_every_engine
def test_what_moves_is_seen_where_it_is_now(engine: str, tmp_path: Path) -> None:
    ball = Body(name="ball", sphere=Sphere(radius=0.3), pose=Placement(x=3.5, z=3.0), mass=1.0, color=RED)
    scene = post(tmp_path, ball)
    with running(engine, scene) as backend:
        advance(backend, 0, 120)
        rows = edges(is_red(picture(backend, scene)))[:2]
        fallen = 3.0 - backend.body_pose("ball").position_xyz[2]
    # Half a second of free fall, by steps.
    assert fallen == pytest.approx(9.80665 / 2 * 0.5 * (0.5 + 1 / 240), abs=1e-3)
    assert sum(rows) / 2 + 0.5 == pytest.approx(60 - FOCAL * (2.0 - fallen) / 3.0, abs=1.5)


def test_every_engine_gives_the_same_picture(tmp_path: Path) -> None:
    if len(installed()) < 2:
        pytest.skip("there is one engine only")
    can = Body(name="can", cylinder=Cylinder(radius=0.2, height=0.5), pose=Placement(x=3, y=-0.6, z=0.4, roll=0.4))
    scene = post(tmp_path, box(x=5.0, z=0.9, yaw=0.3), can, pan=0.1)
    one, other = (shown(engine, scene) for engine in installed())
    assert (one.rgb != other.rgb).any(axis=-1).mean() < 1e-3
    both = np.isfinite(one.depth) & np.isfinite(other.depth)
    assert np.median(np.abs(one.depth[both] - other.depth[both])) < 1e-5


SENSORS = """\
sensors:
  - {camera: {width: 32, height: 24}, name: eye, pose: {z: 0.3}, rate: 8 Hz, trace: true}
  - {imu: {}, rate: 20 Hz, pose: {x: 0.1, z: 0.05}, trace: true}
  - {lidar: {rays: 90, range: 1.8 m}, link: base_scan, pose: {pitch: 10 deg}, rate: 16 Hz, trace: true}
  - {odometry: {}, trace: true}
  - {contact: {}, link: base_footprint, rate: 240 Hz, trace: true}
"""
TUMBLING = "world: {objects: [{name: ball, sphere: {radius: 0.2}, mass: 1, pose: {x: 0.8, y: 0.1, z: 1}}]}\n"


@pytest.mark.parametrize("engine", installed())
def test_sensors_change_nothing_and_pictures_are_repeatable_bit_by_bit(engine: str, tmp_path: Path) -> None:
    text = f"{LEAST}{TUMBLING}backend: {engine}\n".replace("1.5 m", "50 cm")
    blind, first, second = (simulated(tmp_path, text + sensors) for sensors in ("", SENSORS, SENSORS))
    assert blind.digest == first.digest == second.digest
    for name, column in first.trace.sensors["eye"].columns.items():
        assert len(column) > 4
        assert np.array_equal(column, second.trace.sensors["eye"].columns[name])
        assert not np.array_equal(column[0], column[-1])
