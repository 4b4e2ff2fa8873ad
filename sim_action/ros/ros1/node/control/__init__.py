"""Controllers of ros_control, as gazebo_ros_control runs them: what nodes tell joints, made joint targets at each tick.

One file a kind. What a controller needs is in parameters, in the namespace of its own name (wiki.ros.org/ros_control).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import rospy

from sim_action.robot.robot_model import Reading
from sim_action.ros.ros1.node.plugins import Device, Mover, Wiring
from sim_action.ros.ros1.node.topics import Subscription
from sim_action.ros.ros1.ros_control import Transmissions


class BadController(Exception):
    """A controller that cannot be loaded; the message is for whoever wrote its parameters."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """Those of a controller; `space`: the name that they are below, which its topics are below as well."""

    space: str

    def get(self, *names: str, default: Any = None) -> Any:
        """What the first of these says that is there."""
        for name in names:
            if (value := rospy.get_param(f"{self.space}/{name}", None)) is not None:
                return value
        return default

    def number(self, name: str, default: float | None = None) -> float:
        """Raises BadController for what is none, or is not there and has to be."""
        value = self.get(name, default=default)
        try:
            return float(value)
        except (TypeError, ValueError):
            raise BadController(f"{self.space}/{name} is {value!r}: expected a number") from None

    def names(self, name: str) -> tuple[str, ...]:
        """One name, or a list of them. Raises BadController."""
        value = self.get(name)
        found = (value,) if isinstance(value, str) else value
        if not isinstance(found, list | tuple) or not found or not all(isinstance(each, str) for each in found):
            raise BadController(f"{self.space}/{name} is {value!r}: expected the name of a joint, or a list of names")
        return tuple(found)


@dataclass(frozen=True, slots=True)
class Opening:
    """What controllers are opened with.

    Attributes:
        space: of the robot, "" or one that begins with a slash.
        transmissions: which joints have which interfaces.
    """

    parameters: Parameters
    space: str
    wiring: Wiring
    transmissions: Transmissions

    def topic(self, name: str) -> str:
        """One of the controller's own."""
        return f"{self.parameters.space}/{name}"

    def fitting(self, name: str, reading: Reading) -> tuple[str, ...]:
        """The joints that a parameter names. Raises BadController if one cannot be told this."""
        joints = self.parameters.names(name)
        for joint in joints:
            why = self.wiring.model.why_not_driven(joint) or self.transmissions.why_not(joint, reading)
            if why:
                raise BadController(f"controller '{self.parameters.space}': {why}")
        return joints


def _nothing() -> None:
    """What there is to be done for a controller that remembers nothing."""


@dataclass(frozen=True, slots=True)
class Controller:
    """One that is loaded.

    Attributes:
        interface: of the hardware, as ros_control calls it.
        joints: that it alone may move while it runs.
        mover: asked at every tick while it runs.
        device: tells nodes something while it runs.
        ears: on which it is told.
        begin: called before it runs, also when it has run before.
    """

    interface: str
    joints: tuple[str, ...] = ()
    mover: Mover | None = None
    device: Device | None = None
    subscriptions: tuple[Subscription, ...] = ()
    begin: Callable[[], None] = _nothing


class Opener(Protocol):
    """What the table's entries are."""

    def __call__(self, opening: Opening) -> Controller:
        """Opens a controller's topics. Raises BadController."""
