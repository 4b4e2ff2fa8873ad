"""Which joints of a robot ros_control may move, and how: the `<transmission>` tags of its description.

wiki.ros.org/urdf/XML/Transmission; the interface is named at the joint, in older descriptions at the actuator.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.core.messages import did_you_mean
from sim_action.core.registry import Table
from sim_action.robot.robot_model import Reading

if TYPE_CHECKING:
    from sim_action.ros.ros1.node.control import Opener

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
            return f"the <transmission> of joint '{joint}' has {there}, but the controller needs {wanted}"
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


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where a joint is to be at a time in s, in rad (or m), and how fast, if that is said, in rad/s (or m/s)."""

    time: float
    position: float
    velocity: float | None = None


@dataclass(frozen=True, slots=True)
class JointCurve:
    """The way of one joint; `points`: in rising time, at least one. Before the first and after the last, it rests."""

    points: tuple[Waypoint, ...]

    def at(self, time: float) -> tuple[float, float]:
        """Position and velocity."""
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
    """Joint -> its way, from where it is now. `points`: time in s, positions and velocities, the latter maybe empty.

    Points that are in the past are left out. Raises ValueError if none is left, they are not in rising time, or not of
    all joints.
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
    """Hermite's, from one position and velocity to another."""
    span = last.time - first.time
    part = (time - first.time) / span
    way = last.position - first.position
    a, b = span * speed - way, way - span * end_speed
    # p + s way + s (1 - s) (a (1 - s) + b s), and how that grows with s.
    position = first.position + part * way + part * (1 - part) * (a * (1 - part) + b * part)
    growth = way + (1 - 2 * part) * (a * (1 - part) + b * part) + part * (1 - part) * (b - a)
    return position, growth / span


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
"""Type of a controller -> what does the same here."""
