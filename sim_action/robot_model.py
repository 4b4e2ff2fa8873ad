"""A robot model as data: links, joints, shapes, findings. No file format and no engine in sight."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Final, Literal

from sim_action import units
from sim_action.geometry import Pose, Vector3
from sim_action.location import Location
from sim_action.units import Dimension

Reading = Literal["position", "velocity", "effort"]

READINGS: Final = MappingProxyType(
    {
        "position": (units.ANGLE, units.LENGTH),
        "velocity": (units.ANGULAR_SPEED, units.SPEED),
        "effort": (units.TORQUE, units.FORCE),
    }
)
"""What joints can be asked for -> its dimension if the joint turns, and if it slides."""

JointType = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]


@dataclass(frozen=True, slots=True)
class Shape:
    """A collision shape of a link.

    Attributes:
        kind: "box", "cylinder", "sphere", "mesh", ...
        pose: in the link's frame.
        radius: m, for cylinders, capsules and spheres.
        lower_xyz, upper_xyz: m, the corners of the box around it, in its own frame; None where they are not known.
    """

    kind: str
    pose: Pose
    radius: float | None = None
    lower_xyz: Vector3 | None = None
    upper_xyz: Vector3 | None = None


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid part; `mass` in kg is None where the model does not say."""

    name: str
    mass: float | None
    collisions: tuple[Shape, ...] = ()


@dataclass(frozen=True, slots=True)
class Joint:
    """What holds two links together.

    Attributes:
        origin: the child link's frame in the parent link's, at joint position zero.
        axis_xyz: unit vector in the child link's frame.
        lower, upper: limits in rad (m if prismatic); None without limits.
        max_effort: N m (N); None without a limit.
        max_velocity: rad/s (m/s); None without a limit.
    """

    name: str
    type: JointType
    parent: str
    child: str
    origin: Pose
    axis_xyz: Vector3
    lower: float | None = None
    upper: float | None = None
    max_effort: float | None = None
    max_velocity: float | None = None

    def dimension(self, reading: Reading) -> Dimension:
        """What a reading of it is measured in: it slides or turns."""
        turning, sliding = READINGS[reading]
        return sliding if self.type == "prismatic" else turning

    @property
    def moves(self) -> bool:
        """Whether a motor could turn or slide it."""
        return self.type in ("revolute", "continuous", "prismatic")


Level = Literal["fatal", "error", "warning"]
"""fatal: no engine could take it; error: it would not be the robot that was meant, unless allowed; warning: odd."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule of the audit that does not hold, and where."""

    rule: str
    level: Level
    message: str
    location: Location

    def __str__(self) -> str:
        return f"{self.location}: {self.message} [{self.rule}]"


@dataclass(frozen=True)
class RobotModel:
    """A loaded robot.

    Attributes:
        name: what the model calls itself.
        source: the file it came from, absolute.
        urdf: clean, absolute, pretty-printed URDF text for the engine.
        findings: what is odd about it, or was let go.
    """

    name: str
    source: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    urdf: str
    findings: tuple[Finding, ...] = ()

    @cached_property
    def moving_joints(self) -> tuple[Joint, ...]:
        """The joints that have a position, in the order of the file."""
        return tuple(joint for joint in self.joints if joint.moves)

    @cached_property
    def joints_by_name(self) -> dict[str, Joint]:
        """Joint name -> joint."""
        return {joint.name: joint for joint in self.joints}

    @cached_property
    def links_by_name(self) -> dict[str, Link]:
        """Link name -> link."""
        return {link.name: link for link in self.links}

    @cached_property
    def root(self) -> str:
        """Name of the base link: the one that is no joint's child."""
        children = {joint.child for joint in self.joints}
        return next(link.name for link in self.links if link.name not in children)

    @property
    def mass(self) -> float:
        """Total mass in kg of the links that state one."""
        return sum(link.mass or 0.0 for link in self.links)
