"""The controllers of ros_control, as gazebo_ros_control runs them: from messages to joint targets at each tick.

The parameters of a controller are in the namespace of its name (wiki.ros.org/ros_control).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import rospy

from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import Reading
from sim_action.ros.ros1.node.plugins import Device, Mover, Wiring
from sim_action.ros.ros1.node.topics import Subscription
from sim_action.ros.ros1.ros_control import Transmissions


class BadController(Exception):
    """A controller that cannot be loaded; the message is for the author of its parameters."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """The parameters of a controller; `space`: its namespace, which its topics have as well."""

    space: str

    def get(self, *names: str, default: Any = None) -> Any:
        """Return the value of the first of these parameters that exists."""
        for name in names:
            if (value := rospy.get_param(f"{self.space}/{name}", None)) is not None:
                return value
        return default

    def number(self, name: str, default: float | None = None) -> float:
        """Return a parameter as a number. Raises BadController if it is none, or is missing without a default."""
        value = self.get(name, default=default)
        try:
            return float(value)
        except (TypeError, ValueError):
            raise BadController(f"{self.space}/{name} is {value!r}: expected a number") from None

    def names(self, name: str) -> tuple[str, ...]:
        """Return a parameter with one name or a list of names. Raises BadController."""
        value = self.get(name)
        joints = (value,) if isinstance(value, str) else value
        if not isinstance(joints, list | tuple) or not joints or not all(isinstance(joint, str) for joint in joints):
            raise BadController(f"{self.space}/{name} is {value!r}: expected the name of a joint, or a list of names")
        return tuple(joints)


@dataclass(frozen=True, slots=True)
class ControllerSetup:
    """The input of a controller when it is opened; `space`: namespace of the robot, "" or with a slash in front."""

    type: str
    parameters: Parameters
    space: str
    wiring: Wiring
    transmissions: Transmissions

    @property
    def interface(self) -> Reading:
        """The kind of command to joints: the type begins with it, as in effort_controllers/JointPositionController."""
        return cast(Reading, self.type.partition("_")[0])

    def topic(self, name: str) -> str:
        """Return the full name of a topic of the controller."""
        return f"{self.parameters.space}/{name}"

    def fitting(self, name: str, reading: Reading) -> tuple[str, ...]:
        """Return the joints that a parameter names. Raises BadController if one lacks the interface."""
        joints = self.parameters.names(name)
        for joint in joints:
            why = self.wiring.model.why_not_driven(joint) or self.transmissions.why_not(joint, reading)
            if why:
                raise BadController(f"controller '{self.parameters.space}': {why}")
        return joints


def _nothing() -> None:
    """Do nothing, for a controller without state."""


@dataclass(frozen=True, slots=True)
class Controller:
    """A loaded controller, and the joints that it alone moves while it runs; `begin` is called before each start."""

    interface: str
    joints: tuple[str, ...] = ()
    mover: Mover | None = None
    device: Device | None = None
    subscriptions: tuple[Subscription, ...] = ()
    begin: Callable[[], None] = _nothing
