"""The parts of ros_control that need no rospy: transmissions, joint trajectories, and the supported controllers.

wiki.ros.org/urdf/XML/Transmission; the interface is named at the joint, in older descriptions at the actuator.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass
from sim_action.core.registry import Table
from sim_action.core.wording import did_you_mean
from sim_action.robot.control_tags import interfaces_of
from sim_action.robot.robot_model import Reading

if TYPE_CHECKING:
    from sim_action.ros.ros1.node.control import Opener

INTERFACES: Final[Mapping[Reading, str]] = {
    "position": "hardware_interface/PositionJointInterface",
    "velocity": "hardware_interface/VelocityJointInterface",
    "effort": "hardware_interface/EffortJointInterface",
}
"""Kind of command to a joint -> name of the interface in ros_control."""

_FORWARD: Final = "sim_action.ros.ros1.node.control.joint_controllers"

_JOINT_STATES: Final = "sim_action.ros.ros1.node.control.joint_controllers:open_joint_states"
_TRAJECTORY: Final = "sim_action.ros.ros1.node.control.trajectory"

CONTROLLERS: Final[Table[Opener]] = Table(
    "controller",
    {
        "joint_state_controller/JointStateController": _JOINT_STATES,
        "diff_drive_controller/DiffDriveController": "sim_action.ros.ros1.node.control.diff_drive:open_diff_drive",
        "position_controllers/JointPositionController": f"{_FORWARD}:open_position",
        "position_controllers/JointGroupPositionController": f"{_FORWARD}:open_group_position",
        "velocity_controllers/JointVelocityController": f"{_FORWARD}:open_velocity",
        "velocity_controllers/JointGroupVelocityController": f"{_FORWARD}:open_group_velocity",
        "velocity_controllers/JointPositionController": f"{_FORWARD}:open_servo_on_velocity",
        "effort_controllers/JointEffortController": f"{_FORWARD}:open_effort",
        "effort_controllers/JointGroupEffortController": f"{_FORWARD}:open_group_effort",
        "effort_controllers/JointPositionController": f"{_FORWARD}:open_servo",
        "effort_controllers/JointGroupPositionController": f"{_FORWARD}:open_group_servo",
        "effort_controllers/JointVelocityController": f"{_FORWARD}:open_motor",
        "position_controllers/JointTrajectoryController": f"{_TRAJECTORY}:open_on_position",
        "velocity_controllers/JointTrajectoryController": f"{_TRAJECTORY}:open_on_velocity",
        "effort_controllers/JointTrajectoryController": f"{_TRAJECTORY}:open_on_effort",
    },
)
"""Type of a controller -> function that opens its replacement."""


@dataclass(frozen=True, slots=True)
class Transmissions:
    """Joint name -> its interfaces, as values of `INTERFACES`."""

    interfaces: Mapping[str, frozenset[str]]

    def why_not(self, joint: str, reading: Reading) -> str | None:
        """Return the reason why a joint cannot take this kind of command; None if it can."""
        wanted = INTERFACES[reading]
        if joint not in self.interfaces:
            hint = did_you_mean(joint, self.interfaces)
            return f"joint '{joint}' has no <transmission> with {wanted} in the robot's description{hint}"
        if wanted not in self.interfaces[joint]:
            there = ", ".join(sorted(self.interfaces[joint])) or "no interface"
            return f"the <transmission> of joint '{joint}' has {there}, but the controller needs {wanted}"
        return None


def transmissions_of(description: Element) -> Transmissions:
    """Return the transmissions of a robot in URDF."""
    found: dict[str, frozenset[str]] = {}
    for transmission in description.iter("transmission"):
        for joint in transmission.findall("joint"):
            named = frozenset(interfaces_of(transmission, joint))
            name = joint.get("name", "")
            found[name] = found.get(name, frozenset()) | named
    return Transmissions(found)


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A position in rad (or m) at a time in s, and a velocity in rad/s (or m/s) if it is given."""

    time: float
    position: float
    velocity: float | None = None


@dataclass(frozen=True, slots=True)
class JointCurve:
    """The trajectory of one joint; `points`: at least one, at increasing times. It rests before and after them."""

    points: tuple[Waypoint, ...]

    def at(self, time: float) -> tuple[float, float]:
        """Return position and velocity at a time in s."""
        after = bisect_left([point.time for point in self.points], time)
        if after == 0:
            return self.points[0].position, 0.0
        if after == len(self.points):
            return self.points[-1].position, 0.0
        first, last = self.points[after - 1 : after + 1]
        if first.velocity is None or last.velocity is None:
            return _straight(first, last, time)
        return _cubic(first, first.velocity, last, last.velocity, time)


def joint_curves(
    names: Sequence[str], start: Sequence[Waypoint], points: Sequence[tuple[float, Sequence[float], Sequence[float]]]
) -> dict[str, JointCurve]:
    """Return joint -> its trajectory, from its current position.

    `points`: time in s, positions and velocities, which may be empty. Points in the past are left out. Raises
    ValueError if no point is left, times do not increase, or a point has not all joints.
    """
    points = [point for point in points if point[0] > start[0].time]
    times = [time for time, _, _ in points]
    if not points:
        raise ValueError("all its points are in the past")
    if any(later <= earlier for earlier, later in pairwise(times)):
        raise ValueError("the times of its points do not increase")
    if any(len(positions) != len(names) or len(speeds) not in (0, len(names)) for _, positions, speeds in points):
        raise ValueError(f"each point needs {len(names)} positions, and as many velocities or none")
    return {
        name: JointCurve(
            (
                start[index],
                *(
                    Waypoint(time, positions[index], speeds[index] if speeds else None)
                    for time, positions, speeds in points
                ),
            )
        )
        for index, name in enumerate(names)
    }


def _straight(first: Waypoint, last: Waypoint, time: float) -> tuple[float, float]:
    speed = (last.position - first.position) / (last.time - first.time)
    return first.position + speed * (time - first.time), speed


def _cubic(first: Waypoint, speed: float, last: Waypoint, end_speed: float, time: float) -> tuple[float, float]:
    """Return position and velocity on the cubic Hermite curve between two points."""
    span = last.time - first.time
    part = (time - first.time) / span
    way = last.position - first.position
    a, b = span * speed - way, way - span * end_speed
    # p + s way + s (1 - s) (a (1 - s) + b s), and its derivative by s.
    position = first.position + part * way + part * (1 - part) * (a * (1 - part) + b * part)
    growth = way + (1 - 2 * part) * (a * (1 - part) + b * part) + part * (1 - part) * (b - a)
    return position, growth / span
