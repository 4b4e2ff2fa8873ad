"""The parts of ros_control that need no rospy: transmissions, and the supported controllers.

wiki.ros.org/urdf/XML/Transmission; the interface is named at the joint, in older descriptions at the actuator.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass
from sim_action.core.registry import Table
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.robot_model import Reading
from sim_action.robot.reading.control_tags import interfaces_of

INTERFACES: Final[Mapping[Reading, str]] = {
    "position": "hardware_interface/PositionJointInterface",
    "velocity": "hardware_interface/VelocityJointInterface",
    "effort": "hardware_interface/EffortJointInterface",
}
"""Kind of command to a joint -> name of the interface in ros_control."""

_JOINTS: Final = "sim_action.ros.ros1.node.control.joint_controllers"

CONTROLLERS: Final[Table[Callable[[Any], Any]]] = Table(
    "controller",
    {
        "joint_state_controller/JointStateController": f"{_JOINTS}:open_joint_states",
        "diff_drive_controller/DiffDriveController": "sim_action.ros.ros1.node.control.diff_drive:open_diff_drive",
        "position_controllers/JointPositionController": f"{_JOINTS}:open_one",
        "position_controllers/JointGroupPositionController": f"{_JOINTS}:open_group",
        "velocity_controllers/JointVelocityController": f"{_JOINTS}:open_one",
        "velocity_controllers/JointGroupVelocityController": f"{_JOINTS}:open_group",
        "velocity_controllers/JointPositionController": f"{_JOINTS}:open_one",
        "effort_controllers/JointEffortController": f"{_JOINTS}:open_one",
        "effort_controllers/JointGroupEffortController": f"{_JOINTS}:open_group",
        "effort_controllers/JointPositionController": f"{_JOINTS}:open_one",
        "effort_controllers/JointGroupPositionController": f"{_JOINTS}:open_group",
        "effort_controllers/JointVelocityController": f"{_JOINTS}:open_one",
        "position_controllers/JointTrajectoryController": f"{_JOINTS}:open_trajectory",
        "velocity_controllers/JointTrajectoryController": f"{_JOINTS}:open_trajectory",
        "effort_controllers/JointTrajectoryController": f"{_JOINTS}:open_trajectory",
    },
)
"""Type of a controller -> function that opens its replacement. The type names the interface and the kind of command."""


@dataclass(frozen=True, slots=True)
class Transmissions:
    """Joint name -> its interfaces, as values of `INTERFACES`."""

    interfaces: Mapping[str, frozenset[str]]

    def why_not(self, joint: str, reading: Reading) -> str | None:
        """Return the reason why a joint cannot take this kind of command; None if it can."""
        interface = INTERFACES[reading]
        if joint not in self.interfaces:
            hint = did_you_mean(joint, self.interfaces)
            return f"joint '{joint}' has no <transmission> with {interface} in the robot's description{hint}"
        if interface not in self.interfaces[joint]:
            offered = ", ".join(sorted(self.interfaces[joint])) or "no interface"
            return f"the <transmission> of joint '{joint}' has {offered}, but the controller needs {interface}"
        return None


def transmissions_of(description: Element) -> Transmissions:
    """Return the transmissions of a robot in URDF."""
    interfaces: dict[str, frozenset[str]] = {}
    for transmission in description.iter("transmission"):
        for joint in transmission.findall("joint"):
            named = frozenset(interfaces_of(transmission, joint))
            name = joint.get("name", "")
            interfaces[name] = interfaces.get(name, frozenset()) | named
    return Transmissions(interfaces)
