"""Runs as recordings get to see them, made by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.lazy_numpy import FloatArray
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.sensors import MountedSensor
from sim_action.sensors.imu import Imu
from sim_action.sensors.lidar import Lidar
from sim_action.sensors.odometry import Odometry
from sim_action.state.trace_records import BodyRecord, CommandedTwists, SensorRecord
from sim_action.world.scene import Scene
from tests.outcomes import like
from tests.traces import contact, scene, trace

MOMENTS = 16
TIME = [moment / 30 for moment in range(MOMENTS)]


def run() -> RecordedRun:
    """The burger drives 1 m/s forward, turns and is told so, and touches the wall twice; the ball rolls."""
    seen = trace(
        TIME,
        x=TIME,
        y=[0.25] * MOMENTS,
        yaw=[2 * time for time in TIME],
        speed=[1.0] * MOMENTS,
        turn_rate=[2.0] * MOMENTS,
        position=[-3 * time for time in TIME],
        velocity=[-3.0] * MOMENTS,
        contacts=[contact(0.305), contact(0.31), contact(0.31), contact(0.31, body="ball")],
    )
    twists = CommandedTwists(np.array([0.0, 0.1]), np.array([[1.0, 0, 0, 0, 0, 2.0], [0.5, 0, 0, 0, 0, -2.0]]))
    return RecordedRun(_scene(), replace(seen, bodies={"ball": rolling()}), twists=twists)


def _scene() -> Scene:
    made = scene()
    wall, ball, _ = made.world.objects
    ahead = like(wall, pose=Placement(x=2.0))
    return replace(made, world=like(made.world, objects=(ahead, ball)))


def rolling() -> BodyRecord:
    """The ball, along y."""
    return standing(np.array([[1.0, time, 0.1] for time in TIME]))


def standing(position_xyz: FloatArray) -> BodyRecord:
    """A body that does not turn, (T, 3)."""
    return BodyRecord(np.array(TIME), position_xyz, np.tile([0.0, 0.0, 0.0, 1.0], (len(TIME), 1)))


def with_bodies(made: RecordedRun, **bodies: BodyRecord) -> RecordedRun:
    """The same with other bodies that move."""
    return replace(made, trace=replace(made.trace, bodies=bodies))


def appearing(time: float) -> RecordedRun:
    """The same, in which wall and ball are not there before a time in s."""
    made = run()
    late = tuple(like(body, appears=time) for body in made.scene.world.objects)
    world = like(made.scene.world, objects=late)
    # Before that, an engine has them where nothing meets them.
    ball = made.trace.bodies["ball"]
    away = np.where(ball.time[:, None] < time - 1e-6, [0.0, 0.0, 1e6], ball.position_xyz)
    return replace(with_bodies(made, ball=standing(away)), scene=replace(made.scene, world=world))


def sensing_run() -> RecordedRun:
    """The same with a lidar, an IMU and wheels that are counted, at 10 Hz."""
    made = run()
    time = np.arange(5) / 10
    at_rest = np.tile(quaternion_from_rpy(0.0, 0.0, 0.5), (5, 1))
    records = {
        "front": SensorRecord("lidar", time, {"ranges": np.tile([1.0, math.inf, -math.inf, 2.5], (5, 1))}),
        "imu": SensorRecord(
            "imu",
            time,
            {
                "orientation_xyzw": at_rest,
                "angular_velocity_xyz": np.tile([0.0, 0.0, 2.0], (5, 1)),
                "linear_acceleration_xyz": np.tile([0.0, 0.0, 9.80665], (5, 1)),
            },
        ),
        "wheels": SensorRecord(
            "odometry",
            time,
            {
                "position_xyz": np.column_stack((1.1 * time, 0 * time + 0.25, 0 * time)),
                "orientation_xyzw": at_rest,
                "linear_xyz": np.tile([1.1, 0.0, 0.0], (5, 1)),
                "angular_xyz": np.tile([0.0, 0.0, 2.0], (5, 1)),
            },
        ),
    }
    lidar = Lidar(rays=4, range=3.5, min_range=0.1)
    sensors = (
        MountedSensor(lidar, "front", "base_scan", Pose((0.0, 0.0, 0.02)), 10.0, trace=True),
        MountedSensor(Imu(), "imu", None, Pose(), 10.0, trace=True),
        MountedSensor(Odometry(), "wheels", None, Pose(), 10.0, trace=True),
    )
    return replace(made, trace=replace(made.trace, sensors=records), sensors=sensors)
