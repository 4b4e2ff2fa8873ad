"""A robot model as data: links, joints, shapes, findings, and the pairs of links that may touch each other.

It does not depend on file formats or engines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Final, Literal, Self

from sim_action.core import geometry, units
from sim_action.core.errors import Location
from sim_action.core.geometry import ZERO, Pose, Quaternion, Vector3
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import Dimension
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.findings import Finding

if TYPE_CHECKING:
    from sim_action.robot.model.robot_spec import Robot


MESH_OF_TEXT: Final = "mjcf:"  # prefix in `Visual.file` of the name of a mesh that an MJCF text contains


MotorKind = Literal["position", "velocity", "effort", "voltage", "none"]


Reading = Literal["position", "velocity", "effort"]

FOLLOWED: Final[Mapping[MotorKind, tuple[Reading, ...]]] = {
    "position": ("position", "velocity"),
    "velocity": ("velocity",),
    "effort": ("effort",),
    "voltage": ("velocity", "effort"),
    "none": (),
}
"""Kind of a motor -> the quantities that it follows by its own control."""


@dataclass(frozen=True, slots=True)
class Motor:
    """The motor of a joint as an MJCF model states it. The engine simulates it with its own gains and limits."""

    actuator: str  # its name in the model
    # the quantity that its control sets: it is a position servo, a velocity servo, exerts an effort, or is a DC motor
    # at a voltage; "none": no command can set its control
    kind: MotorKind
    tendon: str = ""  # the fixed tendon on which it acts, together with its other joints; empty if it acts on the joint
    is_replaceable: bool = True  # True if an ideal servo acts in its place when a command asks for what it cannot do
    reason: str = ""  # why no command can set its control, to follow "it"

    @property
    def text(self) -> str:
        """Its kind, its name and its tendon."""
        names = {"effort": "motor", "voltage": "DC motor", "none": "actuator"}
        kind = names.get(self.kind, f"{self.kind} servo")
        return f"{kind} '{self.actuator}'{f' on tendon {self.tendon!r}' if self.tendon else ''}"

    def why_not(self, reading: Reading | None) -> str | None:
        """Return why it cannot be commanded, by a quantity if that is known; None if it can, or if a servo can."""
        if self.kind == "none":
            return f"{self.text} drives it, which no command can set, because it {self.reason}"
        able = FOLLOWED[self.kind]
        if self.is_replaceable or reading in {None, "effort", *able}:
            return None
        return f"{self.text} drives it, which cannot follow a {reading}; command its {' or '.join(able)}"


@dataclass(frozen=True, slots=True)
class Keyframe:
    """A state of the robot that an MJCF model names."""

    joints: Mapping[str, float]  # joint name -> rad (m if prismatic)
    base: Pose | None = None  # pose of the base link, world frame; None if it is fixed
    # actuator name -> its controls, in the actuator's own units; empty if the keyframe states none
    controls: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    place: Location | None = None  # where it stands; None if that is unknown
    flaw: str = ""  # the reason why it cannot be used; then it has no positions


def keyframe_of(keyframes: Mapping[str, Keyframe], name_or_number: str | int) -> Keyframe | None:
    """Return a keyframe by its name, or by its number in the file, from 0 on; None if there is none."""
    if str(name_or_number) in keyframes:
        return keyframes[str(name_or_number)]
    if isinstance(name_or_number, int) and name_or_number < len(keyframes):
        return list(keyframes.values())[name_or_number]
    return None


MeshBytes = tuple[bytes, bytes]
"""The points (P, 3) of a mesh as 32-bit floats, and its triangles (T, 3) as 32-bit integers."""


@dataclass(frozen=True, slots=True)
class FloorLook:
    """The look of the floor: one colour, or squares of two; red, green and blue from 0 to 1."""

    color: tuple[float, float, float]
    other: tuple[float, float, float] | None = None  # the colour of every other square; None without squares
    square: float = 1.0  # m, the side of a square


@dataclass(frozen=True, slots=True)
class Mjcf:
    """The input of MuJoCo for a model in its own format; it names no file."""

    text: str  # the model with its included files
    models: Mapping[str, bytes] = field(repr=False)  # name in the text -> text of each model to attach
    # mesh name -> its surface, for meshes that collide or have a mass
    meshes: Mapping[str, MeshBytes] = field(repr=False)
    looked_at: frozenset[str] = frozenset()  # geoms that are only drawn
    actuators: tuple[str, ...] = ()  # names of all actuators; joints without one are passive if there is any
    # m, height of the horizontal plane of the file, which is at the height 0 of the scenario; 0 without one
    floor: float = 0.0
    excluded: frozenset[frozenset[str]] = frozenset()  # pairs of bodies that <exclude> lets pass through each other
    # pairs of geoms that <pair> lets collide, independent of their contype and conaffinity
    paired: frozenset[frozenset[str]] = frozenset()
    floor_look: FloorLook | None = None  # how the file draws that plane; None if it does not say
    # name of an <adhesion> actuator -> its link, and the largest force in N
    adhesion: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    heaviness: float = 1.0  # a factor of all masses and inertias


READINGS: Final = {
    "position": (units.ANGLE, units.LENGTH),
    "velocity": (units.ANGULAR_SPEED, units.SPEED),
    "effort": (units.TORQUE, units.FORCE),
}
"""A quantity of a joint -> its dimension for a turning joint, and for a sliding joint."""

STOP_SLACK: Final = 1e-4  # rad or m: engines hold a joint that rests at its stop more closely
STOP_PLAY: Final = 5e-5  # rad or m from a limit to the stop of an engine: a servo at the limit carries the whole load

JointType = Literal["revolute", "continuous", "prismatic", "ball", "fixed"]
WORLD: Final = "world"  # a root link with this name is fixed to the world, as in Gazebo

MOVING_TYPES: Final[frozenset[JointType]] = frozenset({"revolute", "continuous", "prismatic"})
"""Types of joints with one degree of freedom, which a motor can move."""

_POLE: Final = 1 - 1e-12  # nearer to a quarter turn about y, the angles about x and z are ambiguous

# PyBullet adds this margin around every hull. Without a correction, a wheel would roll more than 2 % too far.
ENGINE_MARGIN_M: Final = 0.001

Color = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Shape:
    """A collision shape of a link."""

    kind: str  # "box", "cylinder", "sphere", "mesh", ...
    pose: Pose  # in the link's frame
    radius: float | None = None  # m, for cylinders, capsules and spheres
    lower_xyz: Vector3 = ZERO  # lower_xyz, upper_xyz: m, the corners of its bounding box, in its own frame
    upper_xyz: Vector3 = ZERO
    # the text of a clean mesh, as `sim_action.meshes` makes it; empty for other shapes, and in MJCF
    hulls: bytes = field(default=b"", repr=False)
    # the points (P, 3) of a mesh of MJCF in m, as 32-bit floats in its own frame; else empty
    corners: bytes = field(default=b"", repr=False)
    length: float | None = None  # m, of cylinders, and of capsules without their ends; not in MJCF


@dataclass(frozen=True, slots=True)
class Visual:
    """A visual shape of a link; it does not collide."""

    kind: str  # "box", "cylinder", "sphere", "capsule", or "mesh"
    pose: Pose  # in the link's frame; of its centre, or of the origin of a mesh
    # color, opacity: red, green, blue and alpha, each 0 to 1; None if the model does not state one
    color: Color | None = None
    size_xyz: Vector3 = ZERO  # m, size of the box around it; zero for a mesh
    # the absolute path of a mesh, or `MESH_OF_TEXT` and the name of a mesh in MJCF; empty for other shapes
    file: str = ""
    scale: Vector3 = (1.0, 1.0, 1.0)  # m per unit of that file, along each axis
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Surface:
    """The contact properties of a link."""

    # coefficient, multiplied by the other body's; the default is from Bullet's URDF importer
    friction: float = 0.5
    stiffness: float | None = None  # N/m, of a contact; None: as stiff as the engine allows
    damping: float = 1.0  # N s/m; used with a stiffness only
    # rolling, spinning: m, torque that resists rolling, or turning about the normal, per force and friction of the
    # other body
    rolling: float = 0.0
    spinning: float = 0.0
    adhesion: float = 0.0  # N, the force by which each contact resists separation; over a distance of `gap` in m
    gap: float = 0.0


Moments = tuple[float, float, float, float, float, float]  # kg m^2: xx, xy, xz, yy, yz, zz
MOMENTS: Final = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
"""The names of `Moments`, in their order -> their rows and columns in the tensor."""


@dataclass(frozen=True, slots=True)
class Inertial:
    """The mass and inertia of a link in an engine."""

    mass: float  # kg
    pose: Pose  # the centre of mass and the axes of the moments, in the link's frame
    moments: Moments  # about the centre of mass

    def scaled(self, factor: float) -> Self:
        """Return it with its mass and moments multiplied."""
        xx, xy, xz, yy, yz, zz = (factor * moment for moment in self.moments)
        return replace(self, mass=factor * self.mass, moments=(xx, xy, xz, yy, yz, zz))


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid part of the robot."""

    name: str
    mass: float | None  # kg; None if the model does not state one
    collisions: tuple[Shape, ...] = ()
    surface: Surface = Surface()
    centre_of_mass_xyz: Vector3 = ZERO  # m, in the link's frame
    visuals: tuple[Visual, ...] = ()  # its visual shapes
    inertial: Inertial | None = None  # repaired and completed; None in MJCF, and inside a ball joint

    @property
    def has_mesh(self) -> bool:
        """Return True if a shape of the link is a mesh file."""
        return any(shape.hulls for shape in self.collisions) or any(visual.file for visual in self.visuals)


@dataclass(frozen=True, slots=True)
class Mimic:
    """A coupling of a joint to another: its position is `multiplier` times the position of `joint`, plus `offset`."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between a parent link and a child link."""

    name: str
    type: JointType
    parent: str
    child: str
    origin: Pose  # the child link's frame in the parent link's, at joint position zero
    axis_xyz: Vector3  # unit vector in the child link's frame
    lower: float | None = None  # lower, upper: limits in rad (m if prismatic); None without a limit
    upper: float | None = None
    max_effort: float | None = None  # N m (N); None without a limit
    max_velocity: float | None = None  # rad/s (m/s); None without a limit
    mimic: Mimic | None = None  # its coupling to another joint; None if it moves independently
    anchor_xyz: Vector3 = ZERO  # m, a point on the axis, in the child link's frame; the origin in URDF
    reference: float = 0.0  # rad (m), the position in which the model is drawn; 0 in URDF
    stiffness: float = 0.0  # of a spring, in N m/rad (N/m); 0 without one. No motor holds a joint with a spring.
    spring_reference: float = 0.0  # rad (m), the position at which the spring is at rest
    damping: float = 0.0  # N m s/rad (N s/m)
    friction: float = 0.0  # N m (N), independent of the speed
    series: str = ""  # the joint with several motions of which this is one; empty for other joints. No motor holds it.
    ball: str = ""  # the ball joint of which this is the rotation about one axis; empty for other joints
    # the motor that the model states; None: an ideal servo moves the joint when it is commanded
    motor: Motor | None = None
    start: float | None = None  # rad (m), the initial position that the model states; None without one

    def dimension(self, reading: Reading) -> Dimension:
        """Return the dimension of a reading: it depends on whether the joint turns or slides."""
        turning, sliding = READINGS[reading]
        return sliding if self.type == "prismatic" else turning

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest position in rad (m), infinite without a limit. Reversed limits limit nothing."""
        lower = -math.inf if self.lower is None else self.lower
        upper = math.inf if self.upper is None else self.upper
        return (lower, upper) if lower <= upper else (-math.inf, math.inf)

    @property
    def home(self) -> float:
        """The initial position in rad (m) by default: `start`, or else `reference`, or the middle of the limits.

        The middle counts if the limits exclude `reference`, as for ROS's joint_state_publisher. With a single limit
        that excludes it, it is that limit.
        """
        if self.start is not None:
            return self.start
        lower, upper = self.range
        if lower <= self.reference <= upper:
            return self.reference
        middle = (lower + upper) / 2
        return middle if math.isfinite(middle) else max(lower, min(upper, self.reference))

    @property
    def is_limited_angle(self) -> bool:
        """True if it turns, but not by a full turn."""
        return self.type == "revolute" and self.lower is not None and self.upper is not None

    @property
    def moves(self) -> bool:
        """Return True if the joint has a position."""
        return self.type in MOVING_TYPES or self.type == "ball"


def ball_joints(
    name: str, parent: str, child: str, origin: Pose, anchor_xyz: Vector3 = ZERO, *, damping: float = 0.0
) -> tuple[tuple[Joint, Joint, Joint], tuple[Link, Link]]:
    """Return a ball joint as three joints in series, about x, y and z, and the two massless links between them.

    Their positions are angles that together give the orientation of the child link. Their velocities are the components
    of its angular velocity in its own frame, relative to the parent link.
    """
    first, second = f"{name}_x", f"{name}_y"
    joints = (
        Joint(first, "ball", parent, first, origin, (1.0, 0.0, 0.0)),
        Joint(second, "ball", first, second, Pose(), (0.0, 1.0, 0.0)),
        Joint(f"{name}_z", "ball", second, child, Pose(), (0.0, 0.0, 1.0)),
    )
    x, y, z = (replace(joint, anchor_xyz=anchor_xyz, ball=name, damping=damping) for joint in joints)
    return (x, y, z), (Link(first, None), Link(second, None))


def ball_angles(orientation_xyzw: Quaternion) -> Vector3:
    """Return the positions in rad of the three joints of a ball joint, from the orientation of its child link."""
    x, y, z, w = orientation_xyzw
    sine = 2 * (x * z + w * y)
    if abs(sine) > _POLE:
        return (0.0, math.copysign(math.pi / 2, sine), math.atan2(2 * (x * y + w * z), 1 - 2 * (x * x + z * z)))
    about_x = math.atan2(2 * (w * x - y * z), 1 - 2 * (x * x + y * y))
    return (about_x, math.asin(sine), math.atan2(2 * (w * z - x * y), 1 - 2 * (y * y + z * z)))


def ball_orientation(positions: Vector3) -> Quaternion:
    """Return the orientation of the child link of a ball joint, from the positions in rad of its three joints."""
    x, y, z = positions
    about_y, about_z = (0.0, math.sin(y / 2), 0.0, math.cos(y / 2)), (0.0, 0.0, math.sin(z / 2), math.cos(z / 2))
    return geometry.multiply((math.sin(x / 2), 0.0, 0.0, math.cos(x / 2)), geometry.multiply(about_y, about_z))


@dataclass(frozen=True, slots=True)
class Plugin:
    """A plugin that the model asks Gazebo to load, or a controller in a parameter file that such a plugin names."""

    name: str  # its file, without "lib" and ".so"; or the type of a controller, such as "package/Class"
    # (tag, text), in the order of the file; a list in a parameter file is several of them
    parameters: tuple[tuple[str, str], ...]
    title: str = ""  # its own name; in gz-sim that is the class, such as "gz::sim::systems::DiffDrive"
    location: Location | None = None  # where it stands; None if that is unknown
    unread: tuple[str, ...] = ()  # the reasons why its parameter files are not read

    def texts(self, tag: str) -> tuple[str, ...]:
        """Return the texts of all parameters with one tag."""
        return tuple(text for name, text in self.parameters if name == tag)


@dataclass(frozen=True, slots=True)
class CommandedJoint:
    """A joint with command interfaces, and so with a motor."""

    joint: str  # its name
    interfaces: frozenset[str]  # "position", "velocity", "effort", or another word in lower case
    tag: str  # "ros2_control" or "transmission"
    location: Location  # where that is stated


@dataclass(frozen=True)
class Srdf:
    """The content of an SRDF."""

    # group name -> its joints, in the order of the model
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    disabled: frozenset[frozenset[str]] = frozenset()  # pairs of links that pass through each other


@dataclass(frozen=True)
class RobotModel:
    """A loaded robot."""

    name: str  # the name in the model
    source: str  # the absolute path of its file
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    urdf: str  # clean URDF text for the engine, which names meshes as in `hull_files`; empty for MJCF
    findings: tuple[Finding, ...] = ()  # warnings of the audit, and errors that `robot.allow` accepted
    # the plugins that it asks Gazebo to load, and then the controllers in their parameter files
    plugins: tuple[Plugin, ...] = ()
    mjcf: Mjcf | None = None  # the input of MuJoCo; None for other formats
    commanded: tuple[CommandedJoint, ...] = ()  # the joints that <ros2_control> or a <transmission> drives
    keyframes: Mapping[str, Keyframe] = field(default_factory=dict)  # name -> state, in MJCF
    srdf: Srdf | None = None  # the content of its SRDF; None without one
    harmless: tuple[Finding, ...] = ()  # the parts that are not read and without which the motion is the same

    @cached_property
    def hull_files(self) -> dict[str, bytes]:
        """File name in `urdf` -> text of each clean mesh."""
        texts = {shape.hulls for link in self.links for shape in link.collisions if shape.hulls}
        if not texts:
            return {}
        from sim_action.meshes.collision_hulls import hull_file_name  # a usual run does without it

        return {hull_file_name(text): text for text in texts}

    @cached_property
    def moving_joints(self) -> tuple[Joint, ...]:
        """The joints with a position, in the order of the file; ball joints come last."""
        return (*self.motor_joints, *(joint for joint in self.joints if joint.type == "ball"))

    @cached_property
    def motor_joints(self) -> tuple[Joint, ...]:
        """The joints that a motor can move, or that mimic another, in the order of the file."""
        return tuple(joint for joint in self.joints if joint.type in MOVING_TYPES)

    @cached_property
    def balls(self) -> tuple[str, ...]:
        """The names of the ball joints, in the order of the file."""
        return tuple(dict.fromkeys(joint.ball for joint in self.joints if joint.ball))

    @cached_property
    def joints_by_name(self) -> dict[str, Joint]:
        """Joint name -> joint."""
        return {joint.name: joint for joint in self.joints}

    @cached_property
    def joints_to(self) -> dict[str, tuple[Joint, ...]]:
        """Link name -> the joints in series from its parent link to it; the base link is missing."""
        children = dict.fromkeys(joint.child for joint in self.joints)
        return {link: tuple(joint for joint in self.joints if joint.child == link) for link in children}

    @cached_property
    def links_by_name(self) -> dict[str, Link]:
        """Link name -> link."""
        return {link.name: link for link in self.links}

    @cached_property
    def root(self) -> str:
        """The name of the base link, which is not the child of a joint."""
        return next(link.name for link in self.links if link.name not in self.joints_to)

    def link_of(self, name: str) -> str:
        """Return the link of an <adhesion> actuator of MJCF; any other name is the name of a link."""
        return self.mjcf.adhesion.get(name, (name,))[0] if self.mjcf else name

    def why_not_driven(self, name: str, reading: Reading | None = None) -> str | None:
        """Return why no motor can move a joint, by a quantity (None: unknown); None if one can."""
        joint = self.joints_by_name.get(name)
        ball = name if name in self.balls else joint.ball if joint else ""
        if ball:
            return f"joint '{ball}' is a ball joint: it swings freely and has no motor"
        if joint is None or not joint.moves:
            moving = [joint.name for joint in self.motor_joints]
            return f"the model has no moving joint '{name}'{did_you_mean(name, moving)}"
        if joint.mimic is not None:
            return f"joint '{name}' cannot be commanded: it mimics '{joint.mimic.joint}'; command that joint"
        if joint.motor is not None and (trouble := joint.motor.why_not(reading)) is not None:
            return f"joint '{name}' cannot be commanded: {trouble}"
        return None

    def leaders(self, name: str) -> set[str]:
        """Return a joint, and all joints that it follows."""
        joints = {name}
        mimic = self.joints_by_name[name].mimic
        while mimic is not None and mimic.joint not in joints:
            joints.add(mimic.joint)
            mimic = self.joints_by_name[mimic.joint].mimic
        return joints

    def gear(self, name: str) -> Mimic:
        """Return the coupling of a joint to the independent joint that moves it in the end: itself, if it is one."""
        multiplier, offset, joint = 1.0, 0.0, self.joints_by_name[name]
        while joint.mimic is not None:
            offset += multiplier * joint.mimic.offset
            multiplier *= joint.mimic.multiplier
            joint = self.joints_by_name[joint.mimic.joint]
        return Mimic(joint.name, multiplier, offset)

    def reach(self, name: str) -> tuple[float, float]:
        """Return the lowest and highest position in rad (m) that coupled joints allow; reversed if they allow none."""
        own, lower, upper = self.gear(name), -math.inf, math.inf
        for joint in self.motor_joints:
            gear = self.gear(joint.name)
            if gear.joint == own.joint and gear.multiplier:
                ends = sorted((end - gear.offset) / gear.multiplier for end in joint.range)
                lower, upper = max(lower, ends[0]), min(upper, ends[1])
        first, last = own.multiplier * lower + own.offset, own.multiplier * upper + own.offset
        return (first, last) if own.multiplier > 0 else (last, first)

    def positions(self, stated: Mapping[str, float]) -> dict[str, float]:
        """Return joint -> position in rad (m): as stated by name, else at home; mimicking joints follow others."""
        return {joint.name: self._position(joint, stated) for joint in self.moving_joints}

    def _position(self, joint: Joint, stated: Mapping[str, float]) -> float:
        if joint.mimic is None:
            return stated.get(joint.name, joint.home)
        leader = self._position(self.joints_by_name[joint.mimic.joint], stated)
        return joint.mimic.multiplier * leader + joint.mimic.offset

    @property
    def mass(self) -> float:
        """The total mass in kg of the links that state one."""
        return sum(link.mass or 0.0 for link in self.links)


LinkPair = tuple[str, str]  # the names of two links, in the order of the model

NO_PAIRS = (
    "no two links of the robot can touch each other: each pair lacks a collision shape, is joined by one joint, or is "
    "disabled by the SRDF or by <exclude> of the model"
)


def touchable_pairs(model: RobotModel) -> Iterator[LinkPair]:
    """Yield the pairs of links that may touch each other.

    Left out are links without collision shapes, links that fixed joints hold together, neighbours (the two rigid bodies
    that a joint connects), and pairs that the SRDF or `<exclude>` of MJCF disables.
    """
    holders = rigid_bodies(model)
    # The pairs of rigid bodies that one joint connects; a joint with several motions counts as one.
    above = {joint.child: joint for joint in model.joints if joint.moves}
    neighbours = set[frozenset[str]]()
    for joint in above.values():
        top = joint
        while (upper := above.get(top.parent)) is not None and _names(joint) & _names(upper):
            top = upper
        neighbours.add(frozenset((holders[joint.child], holders[top.parent])))
    disabled = frozenset[frozenset[str]]() if model.mjcf is None else model.mjcf.excluded
    disabled |= frozenset[frozenset[str]]() if model.srdf is None else model.srdf.disabled
    shaped = [link.name for link in model.links if link.collisions]
    for one, other in combinations(shaped, 2):
        bodies = holders[one], holders[other]
        if bodies[0] != bodies[1] and frozenset(bodies) not in neighbours and frozenset((one, other)) not in disabled:
            yield one, other


def rigid_bodies(model: RobotModel) -> dict[str, str]:
    """Return link -> the first link of its rigid body, whose links fixed joints hold together."""
    above = {joint.child: joint for joint in model.joints if not joint.moves}
    holders: dict[str, str] = {}
    for link in model.links:
        way = [link.name]
        while way[-1] not in holders and way[-1] in above:
            way.append(above[way[-1]].parent)
        holders |= dict.fromkeys(way, holders.get(way[-1], way[-1]))
    return holders


def _names(joint: Joint) -> set[str]:
    return {joint.series, joint.ball} - {""}


def has_limb(model: RobotModel, *, bolted: bool) -> bool:
    """Return True if the robot has an arm or a leg: motors that follow each other from the base to a link.

    They are at least two on a base that is fixed, and three on another one, which may carry a gripper. The last joint
    of a chain does not count if it turns without limits: it is a wheel or a rotor.
    """
    least = 2 if bolted else 3
    above = {joint.child: joint for joint in model.joints}
    carrying = {joint.parent for joint in model.joints}
    for link in model.links:
        name, count = link.name, 0
        while name in above and count < least:
            joint = above[name]
            is_rotor = joint.type == "continuous" and joint.child not in carrying
            count += joint.type in MOVING_TYPES and joint.mimic is None and not is_rotor
            name = joint.parent
        if count == least:
            return True
    return False


def unwatched_note(model: RobotModel, robot: Robot, *, bolted: bool) -> str | None:
    """Return a note if the links of an arm or leg can pass through each other, and the scenario leaves that open."""
    if "self_collision" in robot.model_fields_set or not has_limb(model, bolted=bolted):
        return None
    pair = next(touchable_pairs(model), None)
    if pair is None:
        return None
    problem = f"links of the robot pass through each other, such as '{pair[0]}' and '{pair[1]}'"
    return (
        f"{problem}: set robot.self_collision: true, or expect self_collision; robot.self_collision: false accepts it"
    )
