"""Devices: what a plugin of Gazebo does for a robot, done here. One file a plugin, or a few that are alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Protocol

from sim_action.geometry import Twist
from sim_action.observation import Observation
from sim_action.registry import Table
from sim_action.robot_model import RobotModel
from sim_action.ros1.gazebo_tags import Plugin
from sim_action.sensors.mounting import MountedSensor

TICKS: Final = 100
"""In a second of sim time: so often the clock is told and commands are taken. On slower ones rospy.Rate(10) errs."""


@dataclass(slots=True)
class Told:
    """What nodes have told the robot last: a twist of its base, which stands until they tell another.

    Attributes:
        is_latched: whether its publisher keeps it for those who come later.
    """

    twist: Twist | None = None
    is_latched: bool = False

    def begin(self) -> None:
        """Forgets what was said before the clock started: whether it was heard depends on who came up first.

        What is latched is heard in any case.
        """
        if not self.is_latched:
            self.twist = None


@dataclass(frozen=True, slots=True)
class Device:
    """The live half of a plugin, or of a part of it.

    Attributes:
        period: ticks from one call of `publish` to the next.
        publish: tells nodes what there is to tell of a moment, at a sim time in s.
        sensor: what it reads; its reading is in the observation.
    """

    period: int
    publish: Callable[[float, Observation], None]
    sensor: MountedSensor | None = None


class Opener(Protocol):
    """What the table's entries are."""

    def __call__(self, plugin: Plugin, model: RobotModel, told: Told) -> Iterable[Device]:
        """Opens a plugin's topics. What is said on them to the robot goes to `told`."""


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
