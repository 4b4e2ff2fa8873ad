"""A robot as its file states it: `audit` checks it, and `reading.building` repairs it and makes a `RobotModel` of it.

The readers of URDF and SDF make drafts. Their numbers are finite, but not yet checked for their meaning: links may be
missing, masses negative, axes of length 0. None stands for a value that the file does not state. Each place is the file
and line that a finding about the part names.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import ZERO, Pose, Vector3
from sim_action.core.records import dataclass, field
from sim_action.robot.model.robot_model import Color, CommandedJoint, Mimic, Moments, Plugin, Surface

if TYPE_CHECKING:
    from sim_action.meshes import CleanMesh

UNLIMITED: Final = 1e16
"""A limit this large means "no limit": exporters write it, and SDF before 1.9 has it as its default."""

BALLS: Final = ("spherical", "ball")
"""Types of ball joints in dialects of URDF: Bullet's and Drake's."""

SHAPES: Final[Mapping[str, tuple[str, ...]]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}
"""Shapes other than meshes -> their sizes."""

SERIES: Final[Mapping[str, tuple[str, ...]]] = {
    "planar": ("x", "y", "turn"),
    "universal": ("1", "2"),
    "floating": ("slide_x", "slide_y", "slide_z"),
}
"""Type of a joint with several motions -> the ends of the names of its parts; in "floating", a ball joint follows."""

MAX_PART_SIZE_M: Final = 50.0  # a part of a robot that is larger was probably drawn in millimetres

Paint = tuple[Color, float]  # a colour and its opacity


@dataclass(frozen=True, slots=True)
class OriginDraft:
    """The place of a part in the frame of its link, or of a joint in the frame of its parent link."""

    xyz: Vector3 | None = None  # m
    rpy: Vector3 | None = None  # rad, about the fixed axes x, y and z in turn
    place: Location | None = None  # None if it is not stated

    @property
    def pose(self) -> Pose:
        """The pose; the identity where nothing is stated."""
        return Pose(self.xyz or ZERO, geometry.quaternion_from_rpy(*(self.rpy or ZERO)))


def origin_at(pose: Pose, place: Location | None = None) -> OriginDraft:
    """Return the origin at a pose."""
    # + 0.0 turns -0.0 into 0.0.
    (x, y, z), (roll, pitch, yaw) = pose.position_xyz, geometry.rpy_from_quaternion(pose.orientation_xyzw)
    return OriginDraft((x + 0.0, y + 0.0, z + 0.0), (roll + 0.0, pitch + 0.0, yaw + 0.0), place)


@dataclass(frozen=True, slots=True)
class InertialDraft:
    """The mass of a link and its moments of inertia about its centre of mass, along the axes of `origin`."""

    origin: OriginDraft
    mass: float  # kg
    moments: Moments
    last_digit: float  # kg m^2, the largest place value of the last digits of the moments: 0.01 for 0.25; 0 for 25
    mass_place: Location
    moments_place: Location


def last_digit(text: str) -> float:
    """Return the place value of the last digit after the point of a number; 0 without one."""
    value = Decimal(text.strip())
    exponent = value.as_tuple().exponent
    return float(Decimal(1).scaleb(exponent)) if value and isinstance(exponent, int) and exponent < 0 else 0.0


@dataclass(frozen=True, slots=True)
class MeshDraft:
    """The mesh of a shape."""

    reference: str  # its path or URI as the file states it
    base: Path | None = None  # the file from which a relative path starts; None: the file of the model
    scale: Vector3 | None = None  # along each axis
    clean: CleanMesh | None = None  # of a collision: its clean copy, once it is resolved
    path: Path | None = None  # of a visual: its file, once it is resolved


@dataclass(frozen=True, slots=True)
class ShapeDraft:
    """A collision or visual shape of a link."""

    kind: str  # "box", "cylinder", "sphere", "capsule", "mesh", or a shape that is not supported
    origin: OriginDraft
    place: Location
    # "size": (x, y, z), "radius": (r,), "length": (l,), each in m; empty for a mesh, and for a visual with invalid ones
    sizes: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    mesh: MeshDraft | None = None
    paint: Paint | None = None  # of a visual

    @property
    def size_xyz(self) -> Vector3 | None:
        """The size in m of the box around a plain shape; None for others, and for one without a valid size."""
        if not self.sizes or min(map(min, self.sizes.values())) <= 0:
            return None
        if self.kind == "box":
            x, y, z = self.sizes["size"]
            return (x, y, z)
        across = 2 * self.sizes["radius"][0]
        (length,) = self.sizes.get("length", (0.0,))
        return (across, across, {"sphere": across, "cylinder": length, "capsule": length + across}[self.kind])

    @property
    def is_empty(self) -> bool:
        """True if all sizes are 0; a cylinder or capsule has none without a radius."""
        return bool(self.sizes) and not any(self.sizes.get("radius", next(iter(self.sizes.values()))))


@dataclass(frozen=True, slots=True)
class ContactDraft:
    """Bullet's <contact> of a link in URDF."""

    coefficients: Mapping[str, float] = field(default_factory=dict)  # tag -> value
    has_friction_anchor: bool = False
    inertia_scaling: float = 1.0  # a factor on the moments of inertia


@dataclass(frozen=True, slots=True)
class LinkDraft:
    """A link."""

    name: str
    place: Location
    inertial: InertialDraft | None = None
    collisions: tuple[ShapeDraft, ...] = ()
    visuals: tuple[ShapeDraft, ...] = ()
    contact: ContactDraft | None = None
    surface: Surface = Surface()
    is_massless: bool = False  # True for a link inside a joint with several motions

    @property
    def is_bare(self) -> bool:
        """True if it is a frame only."""
        return self.inertial is None and self.contact is None and not (self.collisions or self.visuals)


@dataclass(frozen=True, slots=True)
class LimitDraft:
    """The limits of a motion."""

    place: Location
    lower: float | None = None  # lower, upper: rad (m if it slides)
    upper: float | None = None
    effort: float | None = None  # N m (N)
    velocity: float | None = None  # rad/s (m/s)


@dataclass(frozen=True, slots=True)
class MotionDraft:
    """The motion of a joint about or along one axis."""

    axis_xyz: Vector3 | None = None  # in the frame of the child link, of any length
    axis_place: Location | None = None
    limit: LimitDraft | None = None
    damping: float | None = None  # N m s/rad (N s/m)
    friction: float | None = None  # N m (N)
    spring: tuple[float, float] = (0.0, 0.0)  # its stiffness in N m/rad (N/m), and its position at rest; 0, 0: none

    @property
    def direction(self) -> Vector3:
        """The unit vector of the axis; the x axis without one."""
        x, y, z = self.axis_xyz or (1.0, 0.0, 0.0)
        # Scale by the largest component first: squares of small numbers would underflow.
        largest = max(abs(x), abs(y), abs(z)) or 1.0
        x, y, z = x / largest, y / largest, z / largest
        length = math.hypot(x, y, z)
        return (x / length, y / length, z / length) if length else (1.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class JointDraft:
    """A joint."""

    name: str
    type: str  # of URDF: "revolute", "continuous", "prismatic", "fixed", "floating", "planar", "universal", or a ball
    parent: str
    child: str
    place: Location
    origin: OriginDraft
    motion: MotionDraft = MotionDraft()
    second: MotionDraft | None = None  # the second axis of a universal joint
    mimic: Mimic | None = None
    series: str = ""  # the joint with several motions of which this is one

    @property
    def limits(self) -> tuple[float | None, float | None]:
        """Its limits in rad (m), None for "no limit"; as in URDF, one that is missing is 0."""
        limit = self.motion.limit
        if limit is None or self.type == "continuous" or (limit.lower, limit.upper) == (None, None):
            return None, None
        lower, upper = limit.lower or 0.0, limit.upper or 0.0
        return (lower if lower > -UNLIMITED else None), (upper if upper < UNLIMITED else None)


def part_names(joint: JointDraft) -> tuple[str, ...]:
    """Return the names of the joints in series that replace a joint; massless links have the same names."""
    return tuple(f"{joint.name}_{end}" for end in SERIES.get(joint.type, ()))


@dataclass(frozen=True)
class RobotDraft:
    """A robot."""

    name: str
    place: Location
    links: tuple[LinkDraft, ...]
    joints: tuple[JointDraft, ...]
    plugins: tuple[Plugin, ...] = ()  # the plugins that it asks Gazebo to load
    commanded: tuple[CommandedJoint, ...] = ()
    starts: Mapping[str, float] = field(default_factory=dict)  # joint -> its initial position in rad (m)

    @cached_property
    def joints_by_name(self) -> Mapping[str, JointDraft]:
        """Joint name -> joint; of several with one name, the last."""
        return {joint.name: joint for joint in self.joints}
