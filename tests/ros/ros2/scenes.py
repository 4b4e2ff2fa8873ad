"""Scenes and moments of robots, as the topics of ROS 2 see them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sim_action.core.geometry import Pose, Twist
from sim_action.ros.messages import Message
from sim_action.ros.ros2.topics import Channels, Publisher
from sim_action.scenario.loading import build_scene
from sim_action.state.observation import ByName, JointState, Observation
from sim_action.state.readings import CameraImage, ContactReading, ImuReading, LidarScan, OdometryReading
from sim_action.world.scene import Scene
from tests.scenarios import load

BURGER = "turtlebot3_burger"
ARM = "ur5e_gripper"
AT_ORIGIN = Pose()
AT_REST = Twist()

SENSORS = """
sensors:
  - {lidar: {rays: 4, range: 3.5 m}, link: base_scan, rate: 5 Hz}
  - {imu: {gyro_noise: 0.1 rad/s, accelerometer_noise: 0.2 m/s^2}, link: base_scan, rate: 60 Hz}
  - {odometry: {}, name: wheels, rate: 20 Hz}
  - {camera: {width: 4, height: 2}, name: eye, pose: {x: 10 cm}, rate: 10 Hz}
  - {contact, name: bumper}
"""


def scene(folder: Path, model: str = BURGER, more: str = "", robot: str = "") -> Scene:
    """Return the scene of a robot; `more`: keys of the scenario, `robot`: keys of its robot, in one line."""
    text = f"name: s\nrobot: {{model: {model}{robot}}}\nexpect: [no_collision]\ntime_limit: 1 s\n{more}"
    return build_scene(load(folder, text))


def moment(time: float = 0.0, pose: Pose = AT_ORIGIN, twist: Twist = AT_REST, **states: Any) -> Observation:
    """Return an observation; `joints`: name -> position."""
    joints = {name: JointState(position, 0.0, 0.0) for name, position in states.get("joints", {}).items()}
    return Observation(time, pose, twist, ByName(joints), sensors=ByName(states.get("sensors", {})))


def resting(there: Scene, time: float = 0.0, **states: Any) -> Observation:
    """Return an observation of a robot with all joints where they begin, and with a reading of each sensor."""
    readings = {
        "lidar": LidarScan(time, -1.0, 0.5, 0.1, 3.5, np.array([1.0, 2.0, np.inf, -np.inf, 3.0])),
        "imu": ImuReading(time, (0.0, 0.0, 0.0, 1.0), (0.1, 0.2, 0.3), (0.0, 0.0, 9.81)),
        "odometry": OdometryReading(time, Pose((1.0, 0.0, 0.0)), Twist.planar(0.5)),
        "camera": CameraImage(time, np.arange(24, dtype=np.uint8).reshape(2, 4, 3), np.full((2, 4), 1.5, np.float32)),
        "contact": ContactReading(time, touching=True, force=1.0, bodies=("wall",)),
    }
    sensors = {sensor.name: readings[sensor.kind] for sensor in there.sensors}
    return moment(time, **{"joints": there.joint_positions, "sensors": sensors, **states})


def publisher(found: Channels, topic: str) -> Publisher:
    """Return the publisher of a topic."""
    return next(each for each in found.publishers if each.topic == topic)


def first_message(found: Channels, topic: str, seen: Observation) -> Message:
    """Return the first message of a topic."""
    message = publisher(found, topic).message(0, seen)
    assert message is not None
    return message
