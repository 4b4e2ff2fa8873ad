"""Messages of ROS 1 and 2 as plain data: field -> value, with `array.array` for arrays of numbers.

The functions need no ROS. Fields that are left out keep the defaults of the message. All times are sim times in s.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from sim_action.core.geometry import Pose, Quaternion, Twist, Vector3
from sim_action.core.lazy_numpy import NDArray
from sim_action.ros.robot_topics import PlacedFrame, Schedule, diagonal, pinhole_of, seconds_and_nanoseconds
from sim_action.sensors.camera import Camera
from sim_action.state.observation import JointState, Observation
from sim_action.state.readings import ImuReading, LidarScan

Message = dict[str, Any]  # a message: field -> number, text, message, list of messages, or array of numbers

Messages = Callable[[int, Observation], Message | None]
"""Tick and observation -> the message of a topic; None if nothing is due. Ticks must be given in order, each once."""

OPTICAL: Final = Pose(orientation_xyzw=(-0.5, 0.5, -0.5, 0.5))
"""The optical frame of a camera in the frame of its sensor: x to the right, y down, z ahead (REP 103)."""


def when_due(schedule: Schedule, made: Callable[[Observation], Message]) -> Messages:
    """Return the messages of a topic that is published by a schedule."""
    return lambda tick, seen: made(seen) if schedule.is_due(tick) else None


def each_reading(name: str, made: Callable[[Any], Message]) -> Messages:
    """Return the messages of a topic that has each reading of a sensor once."""
    last: float | None = None

    def message(_: int, seen: Observation) -> Message | None:
        nonlocal last
        reading = seen.sensors[name]
        if reading.time == last:
            return None
        last = reading.time
        return made(reading)

    return message


def stamp(time: float) -> Message:
    """Return builtin_interfaces/Time of a sim time in s."""
    seconds, nanoseconds = seconds_and_nanoseconds(time)
    return {"sec": seconds, "nanosec": nanoseconds}


def clock_message(time: float) -> Message:
    """Return rosgraph_msgs/Clock of a sim time in s."""
    return {"clock": stamp(time)}


def header(time: float, frame: str) -> Message:
    """Return std_msgs/Header of a measurement at a sim time in s."""
    return {"stamp": stamp(time), "frame_id": frame}


def vector(xyz: Vector3) -> Message:
    """Return geometry_msgs/Vector3 or Point."""
    return dict(zip("xyz", xyz, strict=True))


def quaternion(xyzw: Quaternion) -> Message:
    """Return geometry_msgs/Quaternion."""
    return dict(zip("xyzw", xyzw, strict=True))


def transforms_message(time: float, frames: Iterable[PlacedFrame]) -> Message:
    """Return tf2_msgs/TFMessage of frames at a sim time in s."""
    return {
        "transforms": [
            {
                "header": header(time, parent),
                "child_frame_id": child,
                "transform": {"translation": vector(pose.position_xyz), "rotation": quaternion(pose.orientation_xyzw)},
            }
            for parent, child, pose in frames
        ]
    }


def odometry_message(
    time: float, frames: tuple[str, str], pose: Pose, twist: Twist, covariances: Sequence[Sequence[float]] = ()
) -> Message:
    """Return nav_msgs/Odometry; `frames`: of the pose, and the base, in which the twist is; `covariances`: of both."""
    frame, base = frames
    placed = {"position": vector(pose.position_xyz), "orientation": quaternion(pose.orientation_xyzw)}
    moving = {"linear": vector(twist.linear_xyz), "angular": vector(twist.angular_xyz)}
    parts = [{"covariance": array("d", values)} for values in covariances] or [{}, {}]
    pair = {"pose": {"pose": placed, **parts[0]}, "twist": {"twist": moving, **parts[1]}}
    return {"header": header(time, frame), "child_frame_id": base, **pair}


def joint_states_message(time: float, joints: Mapping[str, JointState]) -> Message:
    """Return sensor_msgs/JointState."""
    return {
        "header": header(time, ""),
        "name": list(joints),
        "position": array("d", (joint.position for joint in joints.values())),
        "velocity": array("d", (joint.velocity for joint in joints.values())),
        "effort": array("d", (joint.effort for joint in joints.values())),
    }


def scan_message(time: float, frame: str, reading: LidarScan, period: float) -> Message:
    """Return sensor_msgs/LaserScan; all rays are measured at once. `period`: s between two scans."""
    return {
        "header": header(time, frame),
        "angle_min": reading.angle_min,
        "angle_max": reading.angle_min + reading.angle_increment * (len(reading.ranges) - 1),
        "angle_increment": reading.angle_increment,
        "time_increment": 0.0,
        "scan_time": period,
        "range_min": reading.range_min,
        "range_max": reading.range_max,
        "ranges": array("f", reading.ranges.tolist()),
    }


def imu_message(
    time: float, frame: str, reading: ImuReading, noise: Sequence[float], orientation: float = 0
) -> Message:
    """Return sensor_msgs/Imu; `noise`: deviations in rad/s, m/s^2 and rad; zeros mean "unknown", as with Gazebo."""
    gyro, accelerometer = noise
    return {
        "header": header(time, frame),
        "orientation": quaternion(reading.orientation_xyzw),
        "orientation_covariance": array("d", diagonal((orientation**2,) * 3)),
        "angular_velocity": vector(reading.angular_velocity_xyz),
        "angular_velocity_covariance": array("d", diagonal((gyro**2,) * 3)),
        "linear_acceleration": vector(reading.linear_acceleration_xyz),
        "linear_acceleration_covariance": array("d", diagonal((accelerometer**2,) * 3)),
    }


def image_message(time: float, frame: str, pixels: NDArray[Any], encoding: str = "rgb8") -> Message:
    """Return sensor_msgs/Image of colours, or of depths in m as "32FC1": inf where nothing is seen (REP 118)."""
    height, width = pixels.shape[:2]
    return {
        "header": header(time, frame),
        "height": height,
        "width": width,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": pixels.nbytes // height,
        "data": array("B", pixels.tobytes()),
    }


def camera_info_message(time: float, frame: str, camera: Camera, baseline: float = 0.0) -> Message:
    """Return sensor_msgs/CameraInfo without distortion; `baseline`: m from the first camera of a pair."""
    focal, cx, cy = pinhole_of(camera.width, camera.height, camera.field_of_view)
    return {
        "header": header(time, frame),
        "height": camera.height,
        "width": camera.width,
        "distortion_model": "plumb_bob",
        "d": array("d", (0.0,) * 5),
        "k": array("d", (focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0)),
        "r": array("d", (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
        "p": array("d", (focal, 0.0, cx, 0.0 - focal * baseline, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0)),
    }


def twist_of(message: Mapping[str, Any]) -> Twist:
    """Return the twist of a geometry_msgs/Twist, or of a TwistStamped, whose stamp and frame are ignored."""
    twist = message.get("twist", message)
    return Twist(_xyz(twist["linear"]), _xyz(twist["angular"]))


def _xyz(vector: Mapping[str, float]) -> Vector3:
    return vector["x"], vector["y"], vector["z"]


def seconds_of(time: Mapping[str, int]) -> float:
    """Return a Time or a Duration in s."""
    return time["sec"] + time["nanosec"] / 1e9
