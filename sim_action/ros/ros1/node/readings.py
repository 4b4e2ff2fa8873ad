"""What nodes hear of a robot: its odometry, its joints, and what its sensors tell, as messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, Protocol

from geometry_msgs.msg import Transform, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, Imu, JointState, LaserScan
from std_msgs.msg import Bool, Header
from tf2_msgs.msg import TFMessage

from sim_action.core.geometry import Pose, Twist
from sim_action.robot.robot_model import RobotModel
from sim_action.ros.ros1.driving.robot_topics import JOINTS, ODOMETRY
from sim_action.ros.ros1.node.messages import header, in_frame_of, pose_message, twist_message
from sim_action.ros.ros1.node.publishing import Sender, Traffic
from sim_action.ros.ros1.node.sensor_messages import image_message, imu_message, scan_message
from sim_action.state.observation import Observation
from sim_action.state.readings import OdometryReading
from sim_action.world.scene import Fitting

# Hz, of what no sensor tells: as Gazebo's plugins are usually set.
_STATES_RATE: Final = 30.0
_ODOMETRY_FRAME: Final = "odom"


class Told(Protocol):
    """Something that nodes can hear of."""

    def tell(self, tick: int, seen: Observation) -> bool:
        """Says what is new at a tick; returns whether somebody listens."""


def open_topics(
    model: RobotModel, sensors: Sequence[Fitting], topics: Mapping[str, str], rate: float, traffic: Traffic
) -> list[Told]:
    """All topics of a robot; `topics`: what they are of -> topic; `rate`: ticks in a second."""
    period = max(1, round(rate / _STATES_RATE))
    found: list[Told] = [_Joints(Sender(topics[JOINTS], JointState, traffic), model, period)]
    if ODOMETRY in topics:
        found.append(_Truth(_Odometry(topics[ODOMETRY], model.root, traffic), period))
    return [*found, *_sensors(sensors, topics, model.root, traffic)]


def _sensors(sensors: Sequence[Fitting], topics: Mapping[str, str], base: str, traffic: Traffic) -> Iterator[Told]:
    is_first = True
    for sensor in sensors:
        if sensor.kind == "odometry":
            odometry = _Odometry(topics[sensor.name], base, traffic, moves_frames=is_first)
            is_first = False
            yield _Sensor(sensor.name, odometry.tell_reading)
        elif sensor.kind in _MESSAGES:
            kind, made = _MESSAGES[sensor.kind]
            yield _Sensor(sensor.name, _sending(Sender(topics[sensor.name], kind, traffic), made, sensor))


class _Joints:
    """Where joints are, and what their motors do."""

    def __init__(self, sender: Sender, model: RobotModel, period: int) -> None:
        self._sender, self._period = sender, period
        self._names = [joint.name for joint in model.moving_joints]

    def tell(self, tick: int, seen: Observation) -> bool:
        """See Told.tell."""
        if tick % self._period or not self._sender.is_heard or not self._names:
            return False
        positions, velocities, efforts = zip(*(seen.joints[name] for name in self._names), strict=True)
        self._sender.send(JointState(header(seen.time, ""), self._names, positions, velocities, efforts))
        return True


class _Odometry:
    """Where a base is said to be, as a message and as a frame."""

    def __init__(self, topic: str, base: str, traffic: Traffic, *, moves_frames: bool = True) -> None:
        self._base = base
        self._sender = Sender(topic, Odometry, traffic)
        self._frames = Sender("/tf", TFMessage, traffic) if moves_frames else None

    def tell(self, seconds: float, pose: Pose, twist: Twist) -> bool:
        """`twist`: in the frame of the base."""
        senders = [sender for sender in (self._sender, self._frames) if sender is not None and sender.is_heard]
        if not senders:
            return False
        message = Odometry(header=header(seconds, _ODOMETRY_FRAME), child_frame_id=self._base)
        message.pose.pose, message.twist.twist = pose_message(pose), twist_message(twist)
        self._sender.send(message)
        if self._frames is not None:
            moved = Transform(Vector3(*pose.position_xyz), message.pose.pose.orientation)
            self._frames.send(TFMessage([TransformStamped(message.header, self._base, moved)]))
        return True

    def tell_reading(self, reading: OdometryReading) -> bool:
        """Of a sensor."""
        return self.tell(reading.time, reading.pose, reading.twist)


class _Truth:
    """Odometry that never errs."""

    def __init__(self, odometry: _Odometry, period: int) -> None:
        self._odometry, self._period = odometry, period

    def tell(self, tick: int, seen: Observation) -> bool:
        """See Told.tell."""
        if tick % self._period:
            return False
        return self._odometry.tell(seen.time, seen.pose, in_frame_of(seen.pose, seen.twist))


class _Sensor:
    """A sensor of the scenario, each of whose readings is told once."""

    def __init__(self, name: str, send: Callable[[Any], bool]) -> None:
        self._name, self._send = name, send
        self._last: float | None = None

    def tell(self, tick: int, seen: Observation) -> bool:
        """See Told.tell."""
        reading = seen.sensors[self._name]
        if reading.time == self._last:
            return False
        self._last = reading.time
        return self._send(reading)


def _sending(sender: Sender, made: Callable[[Any, Header, Fitting], Any], sensor: Fitting) -> Callable[[Any], bool]:
    def send(reading: Any) -> bool:
        if not sender.is_heard:
            return False
        sender.send(made(reading, header(reading.time, sensor.link), sensor))
        return True

    return send


_MESSAGES: Final[Mapping[str, tuple[type[Any], Callable[[Any, Header, Fitting], Any]]]] = {
    "lidar": (LaserScan, lambda reading, head, sensor: scan_message(reading, head, 1 / sensor.rate)),
    "imu": (Imu, lambda reading, head, _: imu_message(reading, head)),
    "camera": (Image, lambda reading, head, _: image_message(reading, head)),
    "contact": (Bool, lambda reading, _, __: Bool(reading.touching)),
}
"""Kind of a sensor -> type of its messages, and what makes them."""
