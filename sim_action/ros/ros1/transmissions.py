"""Which joints of a robot ros_control may move, and how: the `<transmission>` tags of its description.

wiki.ros.org/urdf/XML/Transmission; the interface is named at the joint, in older descriptions at the actuator.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.messages import did_you_mean
from sim_action.robot.robot_model import Reading

INTERFACES: Final[Mapping[Reading, str]] = {
    "position": "hardware_interface/PositionJointInterface",
    "velocity": "hardware_interface/VelocityJointInterface",
    "effort": "hardware_interface/EffortJointInterface",
}
"""What a joint can be told -> what ros_control calls that."""


@dataclass(frozen=True, slots=True)
class Transmissions:
    """Joint name -> its interfaces, each in the words of `INTERFACES`."""

    interfaces: Mapping[str, frozenset[str]]

    def why_not(self, joint: str, reading: Reading) -> str | None:
        """What to say of a joint that cannot be told this; None if it can."""
        wanted = INTERFACES[reading]
        if joint not in self.interfaces:
            hint = did_you_mean(joint, self.interfaces)
            return f"joint '{joint}' has no <transmission> with {wanted} in the robot's description{hint}"
        if wanted not in self.interfaces[joint]:
            there = ", ".join(sorted(self.interfaces[joint])) or "no interface"
            return f"the <transmission> of joint '{joint}' has {there}, and the controller needs {wanted}"
        return None


def transmissions_of(description: Element) -> Transmissions:
    """Those of a robot in URDF."""
    found: dict[str, frozenset[str]] = {}
    for transmission in description.iter("transmission"):
        for joint in transmission.findall("joint"):
            named = frozenset(_interfaces(transmission, joint))
            name = joint.get("name", "")
            found[name] = found.get(name, frozenset()) | named
    return Transmissions(found)


def _interfaces(transmission: Element, joint: Element) -> Iterator[str]:
    """With the package that old descriptions leave out."""
    at_joint = joint.findall("hardwareInterface")
    for tag in at_joint or transmission.findall("actuator/hardwareInterface"):
        name = (tag.text or "").strip()
        yield name if "/" in name else f"hardware_interface/{name}"
