"""A robot model as data: links, joints, shapes, findings. No file format and no engine in sight."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Final, Literal

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.geometry import ZERO, Pose, Vector3
from sim_action.core.messages import did_you_mean
from sim_action.core.units import Dimension

Reading = Literal["position", "velocity", "effort"]

READINGS: Final = MappingProxyType(
    {
        "position": (units.ANGLE, units.LENGTH),
        "velocity": (units.ANGULAR_SPEED, units.SPEED),
        "effort": (units.TORQUE, units.FORCE),
    }
)
"""What joints can be asked for -> its dimension if the joint turns, and if it slides."""

JointType = Literal["revolute", "continuous", "prismatic", "fixed"]

WORLD: Final = "world"
"""A root link of this name is bolted to the world, as Gazebo has it."""

MOVING_TYPES: Final[frozenset[JointType]] = frozenset({"revolute", "continuous", "prismatic"})
"""Of joints that a motor could turn or slide: they have one number for a position."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A collision shape of a link.

    Attributes:
        kind: "box", "cylinder", "sphere", "mesh", ...
        pose: in the link's frame.
        radius: m, for cylinders, capsules and spheres.
        lower_xyz, upper_xyz: m, the corners of the box around it, in its own frame.
        hulls: the file of a mesh, as `models.meshes` writes it; empty for what has none.
    """

    kind: str
    pose: Pose
    radius: float | None = None
    lower_xyz: Vector3 = ZERO
    upper_xyz: Vector3 = ZERO
    hulls: str = ""


Color = tuple[float, float, float]
"""Red, green and blue, each 0 to 1."""


@dataclass(frozen=True, slots=True)
class Visual:
    """What a link looks like, or a part of it; nothing touches it.

    Attributes:
        kind: "box", "cylinder", "sphere", "capsule", or "mesh".
        pose: in the link's frame; of its middle, or of a mesh's own origin.
        color: None where the model does not say.
        size_xyz: m, of the box around it; of a mesh, nothing.
        file: of a mesh, absolute; of one that is in MJCF text, its name there; empty for what is none.
        scale: m in a unit of that file, along each axis.
    """

    kind: str
    pose: Pose
    color: Color | None = None
    size_xyz: Vector3 = ZERO
    file: str = ""
    scale: Vector3 = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Surface:
    """How a link touches.

    Attributes:
        friction: coefficient, multiplied with that of what is touched; left out: as Bullet's URDF importer has it.
        stiffness: N/m, of a contact; None: as hard as the engine can.
        damping: N s/m, of a contact with a stiffness.
    """

    friction: float = 0.5
    stiffness: float | None = None
    damping: float = 1.0


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid part.

    Attributes:
        mass: kg; None where the model does not say.
        centre_of_mass_xyz: m, in the link's frame.
        visuals: what it looks like, where the model says so.
    """

    name: str
    mass: float | None
    collisions: tuple[Shape, ...] = ()
    surface: Surface = Surface()
    centre_of_mass_xyz: Vector3 = ZERO
    visuals: tuple[Visual, ...] = ()

    @property
    def has_mesh(self) -> bool:
        """Whether something of it is in a file of its own."""
        return any(shape.hulls for shape in self.collisions) or any(visual.file for visual in self.visuals)


@dataclass(frozen=True, slots=True)
class Mimic:
    """What a joint does that has no motor of its own: its position is `multiplier` times another's, plus `offset`."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """What holds two links together.

    Attributes:
        origin: the child link's frame in the parent link's, at joint position zero.
        axis_xyz: unit vector in the child link's frame.
        lower, upper: limits in rad (m if prismatic); None where nothing stops it.
        max_effort: N m (N); None without a limit.
        max_velocity: rad/s (m/s); None without a limit.
        mimic: the joint that it follows; None if it moves by itself.
        anchor_xyz: m, a point that the axis goes through, in the child link's frame; URDF has it at the origin.
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
    mimic: Mimic | None = None
    anchor_xyz: Vector3 = ZERO

    def dimension(self, reading: Reading) -> Dimension:
        """What a reading of it is measured in: it slides or turns."""
        turning, sliding = READINGS[reading]
        return sliding if self.type == "prismatic" else turning

    @property
    def home(self) -> float:
        """Where it begins if nobody says where, in rad, or m: at 0, or amid limits that 0 is beyond.

        So does ROS's joint_state_publisher. What is limited one way only begins at that limit.
        """
        lower = -math.inf if self.lower is None else self.lower
        upper = math.inf if self.upper is None else self.upper
        if lower > upper or lower <= 0 <= upper:
            return 0.0
        middle = (lower + upper) / 2
        return middle if math.isfinite(middle) else max(lower, min(upper, 0.0))

    @property
    def moves(self) -> bool:
        """Whether a motor could turn or slide it."""
        return self.type in MOVING_TYPES


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


@dataclass(frozen=True, slots=True)
class Plugin:
    """Code that a model asks Gazebo to load; `parameters`: (tag, text), in the order of the file."""

    name: str
    parameters: tuple[tuple[str, str], ...]

    def texts(self, tag: str) -> tuple[str, ...]:
        """What all tags of one name hold."""
        return tuple(text for name, text in self.parameters if name == tag)


@dataclass(frozen=True)
class RobotModel:
    """A loaded robot.

    Attributes:
        name: what the model calls itself.
        source: the file it came from, absolute.
        urdf: clean, absolute, pretty-printed URDF text for the engine; empty if the file is no URDF.
        findings: what is odd about it, or was let go.
        plugins: what it asks Gazebo to load.
        mjcf: the same as MJCF text that names no file, for the one engine that takes it; empty if the file is none.
    """

    name: str
    source: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    urdf: str
    findings: tuple[Finding, ...] = ()
    plugins: tuple[Plugin, ...] = ()
    mjcf: str = ""

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

    def why_not_driven(self, name: str) -> str | None:
        """What to say of a joint, or what is none, that no motor can move; None if one can."""
        joint = self.joints_by_name.get(name)
        if joint is None or not joint.moves:
            moving = [joint.name for joint in self.moving_joints]
            return f"the model has no moving joint '{name}'{did_you_mean(name, moving)}"
        if joint.mimic is not None:
            return f"joint '{name}' cannot be told where to go: it mimics '{joint.mimic.joint}', tell that one"
        return None

    def positions(self, stated: Mapping[str, float]) -> dict[str, float]:
        """Where each moving joint is, in rad, or m: where that is stated, else at home; a follower where it must be."""
        return {joint.name: self._position(joint, stated) for joint in self.moving_joints}

    def _position(self, joint: Joint, stated: Mapping[str, float]) -> float:
        if joint.mimic is None:
            return stated.get(joint.name, joint.home)
        leader = self._position(self.joints_by_name[joint.mimic.joint], stated)
        return joint.mimic.multiplier * leader + joint.mimic.offset

    @property
    def mass(self) -> float:
        """Total mass in kg of the links that state one."""
        return sum(link.mass or 0.0 for link in self.links)
