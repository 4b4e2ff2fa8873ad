"""Devices: what a plugin of Gazebo does for a robot, done here. One file a plugin, or a few that are alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from sim_action.geometry import Twist
from sim_action.observation import Observation
from sim_action.registry import Table
from sim_action.robot_model import RobotModel
from sim_action.ros1.gazebo_tags import Plugin
from sim_action.ros1.node.heard import HeardSensor
from sim_action.ros1.node.publishing import Sender, Traffic
from sim_action.sensors import Sensor
from sim_action.sensors.mounting import MountedSensor

TICKS: Final = 100
"""In a second of sim time: so often the clock is told and commands are taken. On slower ones rospy.Rate(10) errs."""


@dataclass(slots=True)
class Told:
    """What nodes have told the robot last: a twist of its base, which stands until they tell another.

    Attributes:
        is_latched: whether its publisher keeps it for those who come later.
        topics: on which they tell it.
    """

    twist: Twist | None = None
    is_latched: bool = False
    topics: set[str] = field(default_factory=set)

    def begin(self) -> None:
        """Forgets what was said before the clock started: whether it was heard depends on who came up first.

        What is latched is heard in any case.
        """
        if not self.is_latched:
            self.twist = None


@dataclass(frozen=True, slots=True)
class Wiring:
    """What plugins are opened with.

    Attributes:
        model: of the robot that they are of.
        told: where what nodes say to the robot goes to.
        traffic: counts messages.
        is_held: whether the clock is: who will listen is not known before it starts.
    """

    model: RobotModel
    told: Told
    traffic: Traffic
    is_held: Callable[[], bool]

    def sender(self, topic: str, kind: type[Any]) -> Sender:
        """A topic for what a plugin tells."""
        return Sender(topic, kind, self.traffic)

    def heard(self, sensor: Sensor, sender: Sender) -> Sensor:
        """A sensor that is read for those who listen to a topic."""
        return HeardSensor.of(sensor, lambda: sender.is_heard or self.is_held())


@dataclass(frozen=True, slots=True)
class Device:
    """The live half of a plugin, or of a part of it.

    Attributes:
        period: ticks from one call of `publish` to the next.
        senders: its topics.
        publish: tells nodes what there is to tell of a moment, at a sim time in s; called if a node listens.
        sensor: what it reads; its reading is in the observation.
        reads_links: whether it asks `world_states` about them.
    """

    period: int
    senders: tuple[Sender, ...]
    publish: Callable[[float, Observation], None]
    sensor: MountedSensor | None = None
    reads_links: bool = False

    def tell(self, tick: int, seconds: float, seen: Observation) -> bool:
        """Publishes, if it is time to; returns whether somebody listens."""
        if tick % self.period or not any(sender.is_heard for sender in self.senders):
            return False
        self.publish(seconds, seen)
        return True


class Opener(Protocol):
    """What the table's entries are."""

    def __call__(self, plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
        """Opens a plugin's topics."""


_DRIVE: Final = "sim_action.ros1.node.devices.drive:open_drive"
_LASER: Final = "sim_action.ros1.node.devices.laser:open_laser"
_IMU: Final = "sim_action.ros1.node.devices.imu:open_imu"

DEVICES: Final = Table[Opener](
    "plugin",
    {
        "gazebo_ros_diff_drive": _DRIVE,
        "gazebo_ros_skid_steer_drive": _DRIVE,
        "gazebo_ros_laser": _LASER,
        "gazebo_ros_gpu_laser": _LASER,
        "gazebo_ros_imu": _IMU,
        "gazebo_ros_imu_sensor": _IMU,
        "gazebo_ros_joint_state_publisher": "sim_action.ros1.node.devices.joint_states:open_joint_states",
        "gazebo_ros_p3d": "sim_action.ros1.node.devices.ground_truth:open_ground_truth",
    },
)
"""Name of a plugin's file, without "lib" and ".so" -> what does the same here."""


def period_of(rate: float) -> int:
    """Ticks from one message to the next, for a rate in Hz; 0 asks for as many as there can be."""
    return max(1, round(TICKS / rate)) if rate > 0 else 1
