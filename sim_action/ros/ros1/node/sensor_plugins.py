"""Sensor plugins: lidar, IMU, true pose of a link, and joint states."""

from __future__ import annotations

import math
from collections.abc import Iterable

from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu as ImuMessage
from sensor_msgs.msg import JointState, LaserScan

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.ros.ros1.gazebo_plugins import Plugin
from sim_action.ros.ros1.node.internal_sensors import states_in
from sim_action.ros.ros1.node.messages import header, imu_message, pose_message, scan_message, twist_message
from sim_action.ros.ros1.node.plugins import TICKS, Device, Wiring, schedule_of
from sim_action.sensors import MountedSensor
from sim_action.sensors.imu import Imu
from sim_action.sensors.lidar import Lidar
from sim_action.state.observation import Observation
from sim_action.state.readings import ImuReading, LidarScan


def open_laser(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_laser or gazebo_ros_gpu_laser."""
    sensor, name = plugin.sensor, f"laser {plugin.topic('topicName', default='scan')}"
    publisher = wiring.publisher(plugin.topic("topicName", default="scan"), LaserScan)
    frame = plugin.own.text("frameName", default=plugin.link)
    schedule = schedule_of(sensor.number("update_rate", default=0.0))

    def publish(seconds: float, seen: Observation) -> None:
        scan = seen.sensors[name]
        if not isinstance(scan, LidarScan):
            return
        publisher.send(scan_message(scan, header(seconds, frame), 1 / schedule.rate))

    lidar = wiring.on_schedule(_lidar(plugin), publisher, schedule)
    rate = schedule.rate if schedule.is_even else TICKS
    mounted = MountedSensor(lidar, name, plugin.link, _pose(plugin), rate, trace=False)
    yield Device(schedule, (publisher,), publish, mounted)


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


def open_imu(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_imu, which names its link, or gazebo_ros_imu_sensor, which belongs to a sensor on a link."""
    topic = plugin.topic("topicName", default="imu")
    link = plugin.own.text("bodyName", default=plugin.link or wiring.model.root)
    frame = plugin.own.text("frameName", default=link)
    rate = plugin.own.number("updateRate", "updateRateHZ", default=plugin.sensor.number("update_rate", default=0.0))
    publisher, schedule = wiring.publisher(topic, ImuMessage), schedule_of(rate)
    noise = plugin.own.number("gaussianNoise", default=0.0)
    sensor = MountedSensor(
        wiring.on_demand(Imu(gyro_noise=noise, accelerometer_noise=noise), publisher),
        f"imu {topic}",
        link,
        Pose(),
        schedule.rate if schedule.is_even else TICKS,
        trace=False,
    )

    def publish(seconds: float, seen: Observation) -> None:
        reading = seen.sensors[sensor.name]
        if not isinstance(reading, ImuReading):
            return
        publisher.send(imu_message(reading, header(seconds, frame), noise))

    yield Device(schedule, (publisher,), publish, sensor)


def open_ground_truth(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_p3d."""
    link, frame = plugin.own.text("bodyName", default=wiring.model.root), plugin.own.text("frameName", default="world")
    publisher = wiring.publisher(plugin.topic("topicName", default="odom"), Odometry)

    def publish(seconds: float, seen: Observation) -> None:
        pose, twist = states_in(seen).links[link]
        message = Odometry(header=header(seconds, frame), child_frame_id=link)
        message.pose.pose, message.twist.twist = pose_message(pose), twist_message(twist)
        publisher.send(message)

    yield Device(schedule_of(plugin.own.number("updateRate", default=0.0)), (publisher,), publish, reads_links=True)


def open_joint_states(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_joint_state_publisher; without names, it publishes all moving joints."""
    publisher = wiring.publisher(plugin.topic("topicName", default="joint_states"), JointState)
    moving = [joint.name for joint in wiring.model.moving_joints]
    names = [name for name in plugin.own.texts("jointName") if name in moving] or moving

    def publish(seconds: float, seen: Observation) -> None:
        positions, velocities, efforts = zip(*(seen.joints[name] for name in names), strict=True)
        publisher.send(JointState(header(seconds, ""), names, positions, velocities, efforts))

    yield Device(schedule_of(plugin.own.number("updateRate", default=0.0)), (publisher,), publish)
