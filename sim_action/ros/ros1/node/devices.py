"""The Gazebo plugins of drives and sensors: twists from topics, odometry, lidar, IMU, true poses and joint states."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import Twist as TwistMessage
from pydantic import ValidationError
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan, PointCloud2
from sensor_msgs.msg import Imu as ImuMessage

from sim_action.core.geometry import Pose, Twist
from sim_action.robot.documents.sdf_elements import pose_of
from sim_action.ros.messages import (
    camera_info_message,
    header,
    image_message,
    imu_message,
    joint_states_message,
    scan_message,
)
from sim_action.ros.robot_topics import Schedule, diagonal, in_frame_of
from sim_action.ros.ros1.gazebo_plugins import Plugin
from sim_action.ros.ros1.node.internal_parts import states_in
from sim_action.ros.ros1.node.message_classes import points_message, twist_of
from sim_action.ros.ros1.node.plugins import TICKS, Device, Wiring, schedule_of
from sim_action.ros.ros1.node.topics import OdometryPublisher, Publisher, Subscription
from sim_action.sensors import MountedSensor, Sensor
from sim_action.sensors.camera import Camera
from sim_action.sensors.imu import Imu
from sim_action.sensors.lidar import Lidar
from sim_action.state.observation import Observation
from sim_action.state.readings import CameraImage, ImuReading, LidarScan
from sim_action.world.world_files.world_bodies import said

_UNKNOWN: Final = 1e12
_BGR_FORMATS: Final = ("B8G8R8", "BGR_INT8")


def open_drive(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_diff_drive or gazebo_ros_skid_steer_drive. Odometry is the true motion."""
    subscription = wiring.subscribe(plugin.topic("commandTopic", default="cmd_vel"), TwistMessage, twist_of)
    wiring.add_mover(lambda _seconds, _seen: subscription.value)
    yield odometry_device(plugin, wiring, child=wiring.model.root, rate=0.0)
    if plugin.own.flag("publishWheelJointState", default=False):
        # The publisher of the positions of the wheels.
        publisher = wiring.publisher(f"{plugin.space}/joint_states", JointState)
        moving = {joint.name for joint in wiring.model.moving_joints}
        names = [name for tag in ("leftJoint", "rightJoint") for name in plugin.own.texts(tag) if name in moving]

        def publish(seconds: float, seen: Observation) -> None:
            positions = [seen.joints[name].position for name in names]
            publisher.send({"header": header(seconds, ""), "name": names, "position": positions})

        yield Device(schedule_of(plugin.own.number("updateRate", default=0.0)), (publisher,), publish)


def odometry_device(plugin: Plugin, wiring: Wiring, *, child: str, rate: float) -> Device:
    """Return the publisher of odometry and of its frame; `child`, `rate`: defaults of the plugin."""
    # The variances of odometry, as the plugins of Gazebo state them: x, y and yaw are known.
    if plugin.name == "gazebo_ros_skid_steer_drive":
        x, y = (plugin.own.number(f"covariance_{axis}", default=1e-4) for axis in "xy")
        yaw = plugin.own.number("covariance_yaw", default=0.01)
    else:
        x, y, yaw = 1e-5, 1e-5, 1e-3
    own, variances = plugin.own, diagonal((x, y, _UNKNOWN, _UNKNOWN, _UNKNOWN, yaw))
    is_skid_steer = plugin.name == "gazebo_ros_skid_steer_drive"
    odometry = OdometryPublisher(
        plugin.topic("odometryTopic", default="odom"),
        (own.text("odometryFrame", default="odom"), own.text("robotBaseFrame", default=child)),
        wiring.traffic,
        covariances=(variances, variances if is_skid_steer else diagonal((0.0,) * 6)),
        publishes_tf=own.flag("publishTf", "publishOdomTF", "broadcastTF", default=True),
    )

    def publish(seconds: float, seen: Observation) -> None:
        pose = wiring.frame.pose(seen.pose)
        twist = wiring.frame.twist(seen.pose, seen.twist)
        odometry.send(seconds, pose, in_frame_of(pose, twist))

    schedule = schedule_of(own.number("updateRate", "odometryRate", default=rate))
    return Device(schedule, odometry.publishers, publish)


def open_planar_move(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_planar_move. A command holds until the next one, or for `cmdTimeout` s if it is set."""
    subscription = wiring.subscribe(plugin.topic("commandTopic", default="cmd_vel"), TwistMessage, twist_of)
    wiring.add_mover(CommandWithTimeout(subscription, plugin.own.number("cmdTimeout", default=-1.0)))
    yield odometry_device(plugin, wiring, child="base_footprint", rate=20.0)


class CommandWithTimeout:
    """The last twist, for `timeout` s of sim time after it came; negative: forever."""

    def __init__(self, subscription: Subscription, timeout: float) -> None:
        self._subscription, self._timeout = subscription, timeout
        self._count = 0
        self._since = 0.0

    def __call__(self, seconds: float, _: Observation) -> Twist | None:
        """Return the last twist; zero if it is too old, None before the first."""
        if self._subscription.count != self._count:
            self._count, self._since = self._subscription.count, seconds
        twist: Twist | None = self._subscription.value
        is_over = 0 <= self._timeout < seconds - self._since
        return Twist() if is_over and twist is not None else twist


def open_laser(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_laser or gazebo_ros_gpu_laser."""
    sensor, name = plugin.sensor, f"laser {plugin.topic('topicName', default='scan')}"
    publisher = wiring.publisher(plugin.topic("topicName", default="scan"), LaserScan)
    frame = plugin.own.text("frameName", default=plugin.link)
    schedule = schedule_of(sensor.number("update_rate", default=0.0))

    def publish(seconds: float, seen: Observation) -> None:
        scan = seen.sensors[name]
        if isinstance(scan, LidarScan):
            publisher.send(scan_message(seconds, frame, scan, 1 / schedule.rate))

    lidar = wiring.on_schedule(_lidar(plugin), schedule, publisher)
    yield Device(schedule, (publisher,), publish, _mounted(lidar, name, plugin, schedule))


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


def open_camera(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_camera or gazebo_ros_openni_kinect. The frame of messages is the optical one that is stated."""
    own, sensor = plugin.own, plugin.sensor
    space = f"{plugin.space}/{own.text('cameraName').strip('/')}".rstrip("/")

    def publisher(tag: str, default: str, kind: type[Any]) -> Publisher:
        topic = own.text(tag, default=default)
        return wiring.publisher(topic if topic.startswith("/") else f"{space}/{topic}", kind)

    images = publisher("imageTopicName", "image_raw", Image)
    name, frame = f"camera {images.topic}", own.text("frameName", default=plugin.link)
    try:
        camera = _camera(plugin)
    except ValidationError as error:
        wiring.lose(f"the {name} takes no pictures: {said(error)}")
        return
    infos = [publisher("cameraInfoTopicName", "camera_info", CameraInfo)]
    depths, clouds = list[Publisher](), list[Publisher]()
    if plugin.name == "gazebo_ros_openni_kinect":
        infos.append(publisher("depthImageCameraInfoTopicName", "depth/camera_info", CameraInfo))
        depths.append(publisher("depthImageTopicName", "depth/image_raw", Image))
        clouds.append(publisher("pointCloudTopicName", "points", PointCloud2))
    schedule = schedule_of(own.number("updateRate", default=0.0) or sensor.number("update_rate", default=0.0))
    baseline = own.number("hackBaseline", default=0.0)
    nearest, farthest = own.number("pointCloudCutoff", default=0.4), own.number("pointCloudCutoffMax", default=5.0)
    encoding = "bgr8" if sensor.text("camera/image/format") in _BGR_FORMATS else "rgb8"

    def publish(seconds: float, seen: Observation) -> None:
        picture = seen.sensors[name]
        if isinstance(picture, CameraImage):
            images.send(image_message(seconds, frame, picture.rgb[:, :, :: 1 if encoding == "rgb8" else -1], encoding))
            within = (picture.depth > nearest) & (picture.depth < farthest)
            depth = np.where(within, picture.depth, np.float32(np.nan))
            for output in (output for output in depths if output.has_subscribers):
                output.send(image_message(seconds, frame, depth, "32FC1"))
            for output in (output for output in clouds if output.has_subscribers):
                output.send(points_message(seconds, frame, camera, depth, picture.rgb))
        for output in infos:
            output.send(camera_info_message(seconds, frame, camera, baseline))

    pictures = (images, *depths, *clouds)
    on_schedule = wiring.on_schedule(camera, schedule, *pictures)
    yield Device(schedule, (*pictures, *infos), publish, _mounted(on_schedule, name, plugin, schedule))


def _camera(plugin: Plugin) -> Camera:
    """Return the camera of a plugin, with Gazebo's defaults. Raises ValidationError."""
    sensor = plugin.sensor
    return Camera(
        width=round(sensor.number("camera/image/width", default=320)),
        height=round(sensor.number("camera/image/height", default=240)),
        field_of_view=sensor.number("camera/horizontal_fov", default=1.047),
        near=sensor.number("camera/clip/near", default=0.1),
        far=sensor.number("camera/clip/far", default=100.0),
        noise=sensor.number("camera/noise/stddev", default=0.0),
    )


def _mounted(sensor: Sensor, name: str, plugin: Plugin, schedule: Schedule) -> MountedSensor:
    """Return a sensor at the pose of its tag; it is read at every tick if its messages are not evenly spaced."""
    tag = plugin.sensor.element
    pose = pose_of(None if tag is None else tag.find("pose"))
    return MountedSensor(sensor, name, plugin.link, pose, schedule.rate if schedule.is_even else TICKS, trace=False)


def open_imu(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_imu, which names its link, or gazebo_ros_imu_sensor, which belongs to a sensor on a link."""
    topic = plugin.topic("topicName", default="imu")
    link = plugin.own.text("bodyName", default=plugin.link or wiring.model.root)
    frame = plugin.own.text("frameName", default=link)
    rate = plugin.own.number("updateRate", "updateRateHZ", default=plugin.sensor.number("update_rate", default=0.0))
    publisher = wiring.publisher(topic, ImuMessage)
    schedule = schedule_of(rate)
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
        if isinstance(reading, ImuReading):
            publisher.send(imu_message(seconds, frame, reading, (noise, noise), noise))

    yield Device(schedule, (publisher,), publish, sensor)


def open_ground_truth(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_p3d."""
    link, frame = plugin.own.text("bodyName", default=wiring.model.root), plugin.own.text("frameName", default="world")
    topic = plugin.topic("topicName", default="odom")
    odometry = OdometryPublisher(topic, (frame, link), wiring.traffic, publishes_tf=False)

    def publish(seconds: float, seen: Observation) -> None:
        odometry.send(seconds, *states_in(seen).links[link])

    schedule = schedule_of(plugin.own.number("updateRate", default=0.0))
    yield Device(schedule, odometry.publishers, publish, reads_links=True)


def open_joint_states(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_joint_state_publisher; without names, it publishes all moving joints."""
    publisher = wiring.publisher(plugin.topic("topicName", default="joint_states"), JointState)
    moving = [joint.name for joint in wiring.model.moving_joints]
    names = [name for name in plugin.own.texts("jointName") if name in moving] or moving

    def publish(seconds: float, seen: Observation) -> None:
        publisher.send(joint_states_message(seconds, {name: seen.joints[name] for name in names}))

    yield Device(schedule_of(plugin.own.number("updateRate", default=0.0)), (publisher,), publish)
