"""Plugins of lidars that sweep a plane."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sensor_msgs.msg import LaserScan

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.ros.ros1.gazebo_tags import Plugin
from sim_action.ros.ros1.node.devices import TICKS, Device, Wiring, period_of
from sim_action.ros.ros1.node.messages import header
from sim_action.ros.ros1.node.sensor_messages import scan_message
from sim_action.sensors.lidar import Lidar
from sim_action.sensors.mounting import MountedSensor
from sim_action.state.observation import Observation
from sim_action.state.readings import LidarScan


def open_laser(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """gazebo_ros_laser, gazebo_ros_gpu_laser."""
    sensor, name = plugin.sensor, f"laser {plugin.topic('topicName', default='scan')}"
    sender = wiring.sender(plugin.topic("topicName", default="scan"), LaserScan)
    frame = plugin.own.text("frameName", default=plugin.link)
    period = period_of(sensor.number("update_rate", default=0.0))

    def publish(seconds: float, seen: Observation) -> None:
        scan = seen.sensors[name]
        if not isinstance(scan, LidarScan):
            return
        sender.send(scan_message(scan, header(seconds, frame), period / TICKS))

    lidar = wiring.heard(_lidar(plugin), sender)
    mounted = MountedSensor(lidar, name, plugin.link, _pose(plugin), TICKS / period, trace=False)
    yield Device(period, (sender,), publish, mounted)


def _lidar(plugin: Plugin) -> Lidar:
    sensor, sweep = plugin.sensor, "ray/scan/horizontal"
    first, last = (sensor.number(f"{sweep}/{end}_angle", default=0.0) for end in ("min", "max"))
    return Lidar(
        rays=max(1, round(sensor.number(f"{sweep}/samples", default=1))),
        field_of_view=min(max(last - first, 1e-6), 2 * math.pi),
        angle_min=first,
        min_range=sensor.number("ray/range/min", default=0.0),
        range=sensor.number("ray/range/max", default=10.0),
        noise=sensor.number("ray/noise/stddev", default=plugin.own.number("gaussianNoise", default=0.0)),
    )


def _pose(plugin: Plugin) -> Pose:
    words = (plugin.sensor.text("pose") or "0 0 0 0 0 0").split()
    x, y, z, roll, pitch, yaw = map(float, words)
    return Pose((x, y, z), quaternion_from_rpy(roll, pitch, yaw))
