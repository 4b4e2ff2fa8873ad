"""The plugin that moves a base over the ground; the drive is `PlanarMove`."""

from __future__ import annotations

from collections.abc import Iterable

from geometry_msgs.msg import Twist as TwistMessage

from sim_action.core.geometry import Twist
from sim_action.ros.ros1.gazebo_tags import Plugin
from sim_action.ros.ros1.node.devices import Device, Wiring
from sim_action.ros.ros1.node.devices.drive import odometry_device
from sim_action.ros.ros1.node.ears import Ear
from sim_action.ros.ros1.node.messages import twist_of
from sim_action.state.observation import Observation


def open_planar_move(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """gazebo_ros_planar_move; a command holds until the next one, unless `cmdTimeout` says for how long."""
    ear = wiring.ear(plugin.topic("commandTopic", default="cmd_vel"), TwistMessage, twist_of)
    wiring.moves(Lasting(ear, plugin.own.number("cmdTimeout", default=-1.0)))
    yield odometry_device(plugin, wiring, child="base_footprint", rate=20.0)


class Lasting:
    """A twist that is told, for some seconds of sim time from when it came; `timeout` negative: for ever."""

    def __init__(self, ear: Ear, timeout: float) -> None:
        self._ear, self._timeout = ear, timeout
        self._count = 0
        self._since = 0.0

    def __call__(self, seconds: float, _: Observation) -> Twist | None:
        """See Mover."""
        if self._ear.count != self._count:
            self._count, self._since = self._ear.count, seconds
        twist: Twist | None = self._ear.heard
        is_over = 0 <= self._timeout < seconds - self._since
        return Twist() if is_over and twist is not None else twist
