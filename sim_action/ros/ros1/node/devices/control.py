"""The plugin that lets ros_control move joints."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import rospy

from sim_action.ros.ros1.gazebo_tags import Plugin
from sim_action.ros.ros1.node.control.manager import ControllerManager
from sim_action.ros.ros1.node.devices import Device, Wiring
from sim_action.ros.ros1.transmissions import transmissions_of
from sim_action.state.observation import Observation


@dataclass(frozen=True, slots=True)
class Managed(Device):
    """Whatever controllers tell."""

    teller: Callable[[int, float, Observation], bool] = lambda _tick, _seconds, _seen: False

    def tell(self, tick: int, seconds: float, seen: Observation) -> bool:
        """See Device.tell."""
        return self.teller(tick, seconds, seen)


def open_control(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """gazebo_ros_control. Its namespace is the robot's, as spawn_model says it."""
    space = plugin.space
    manager = ControllerManager(space, wiring, transmissions_of(_description(plugin, wiring.description)))
    wiring.moves(manager.move)
    manager.offer()
    yield Managed(1, (), lambda _seconds, _seen: None, teller=manager.tell)


def _description(plugin: Plugin, spawned: Element) -> Element:
    """Of a robot in SDF, transmissions are in a parameter, which is in URDF."""
    if spawned.tag == "robot":
        return spawned
    name = plugin.own.text("robotParam", default="robot_description")
    text = str(rospy.get_param(name if name.startswith("/") else f"{plugin.space}/{name}", default="<robot/>"))
    try:
        return ET.fromstring(text)  # noqa: S314 - of the robot that is simulated
    except ET.ParseError:
        return ET.Element("robot")
