"""The scene: the robot with its loaded model and the world, as engines, drives and assertions get it."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from typing import Any, Final

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel, Placement
from sim_action.core.geometry import Pose, rpy_from_quaternion
from sim_action.core.lazy_numpy import Generator, np
from sim_action.core.records import dataclass, field
from sim_action.core.workspace import Workspace
from sim_action.robot.model.joint_selection import joints_set_by
from sim_action.robot.model.kinematics import Mobility, link_poses, why_no_link
from sim_action.robot.model.robot_model import WORLD, Keyframe, RobotModel, keyframe_of
from sim_action.robot.model.robot_spec import Robot
from sim_action.world import Body, Physics, World
from sim_action.world.parts import Part

EGO: Final = "robot"  # the name of the robot under test for the other robots of the world

MAX_RAISED_M: Final = 0.05
"""A robot that a keyframe puts at most this deep into the ground is raised, so that it stands on the ground."""


@dataclass(frozen=True, slots=True)
class Fitting:
    """The name, kind, link and rate of a sensor, for code that passes its readings on."""

    name: str
    kind: str  # its YAML key
    link: str  # link of the robot that carries it
    rate: float  # readings per second, in Hz
    pose: Pose = Pose()  # of the sensor in the frame of the link
    keys: FrozenModel | None = None  # its own YAML keys, such as the noise; a `Sensor`


@dataclass(frozen=True, slots=True)
class WorldPlaces:
    """The places of models in the world file of a scenario."""

    bodies: Mapping[str, Location] = field(default_factory=dict)  # name of a body of the file -> its place
    robot: Location | None = None  # the place of the model that is the robot, if `robot.pose` is from the file


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that is simulated, with names resolved and files read."""

    robot: Robot
    model: RobotModel
    world: World
    physics: Physics
    workspace: Workspace
    seed: int = 0  # of the scenario; `generator` draws random numbers from it
    # joint -> reflected inertia of its motor in kg m^2; missing joints have none
    rotors: Mapping[str, float] = field(default_factory=dict)
    # links of wheels that slip sideways whenever the robot turns; PyBullet computes their friction better
    scrubbing: frozenset[str] = frozenset()
    mobility: Mobility = field(default_factory=Mobility)  # the motions that the drive allows, if there is one
    # name of a body -> its parts, for bodies whose shapes were read from files
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    sensors: tuple[Fitting, ...] = ()  # of the scenario
    # number of a command source among all sources that run the same code; each draws its own random numbers
    namesake: int = 0
    owner: str = ""  # name of another robot whose scene this is; it draws its own random numbers, too
    file: str = ""  # path of the scenario, as in reports
    variation: str = ""  # suffix that distinguishes this variation in file names; or empty
    acted_on: bool = False  # True if commands or disturbances act on the robot
    places: WorldPlaces = field(default_factory=WorldPlaces)  # of the models of the world file
    # joints that faults hold at a time, with an effort that may exceed the limit of their motors
    stuck: frozenset[str] = frozenset()
    # name -> the scene of another robot, in which that robot takes the place of the one under test
    actors: Mapping[str, Scene] = field(default_factory=dict)
    # what the command sources of all robots have in common while they are open
    shared: dict[str, Any] = field(default_factory=dict)

    @property
    def frames(self) -> dict[str, tuple[str, str]]:
        """Name of each other robot, and NAME/LINK of each of its links -> the robot and the link."""
        roots = {actor: (actor, scene.model.root) for actor, scene in self.actors.items()}
        return roots | {
            f"{actor}/{link}": (actor, link)
            for actor, scene in self.actors.items()
            for link in scene.model.links_by_name
        }

    @property
    def bolted(self) -> bool:
        """True if the base is fixed, by the scenario or else by the name of the model's root link."""
        base = self.robot.base or ("fixed" if self.model.root == WORLD else "free")
        return base == "fixed"

    @property
    def bolted_links(self) -> frozenset[str]:
        """The links that cannot move: a fixed base, or one with a mass of 0, and all links fixed to it."""
        if not self.bolted and self.model.links_by_name[self.model.root].mass != 0:
            return frozenset()
        bolted = {self.model.root}
        waiting = [self.model.root]
        while waiting:
            parent = waiting.pop()
            held = [joint.child for joint in self.model.joints if joint.parent == parent and not joint.moves]
            bolted.update(held)
            waiting += held
        return frozenset(bolted)

    @property
    def load_link(self) -> str:
        """The link that bears a payload by default: the base, or the last link that moves if the base is bolted.

        If several chains of joints are the longest, such as the fingers of a gripper, it is the link that carries them.
        """
        bolted, root = self.bolted_links, self.model.root
        movable = [link.name for link in self.model.links if link.mass and link.name not in bolted]
        if not bolted or not movable:
            return root
        moved_by = {name: self._joints_before(name) for name in movable}
        longest = max(map(len, moved_by.values()))
        chains = [joints for joints in moved_by.values() if len(joints) == longest]
        while any(joints != chains[0] for joints in chains):
            chains = [joints[:-1] for joints in chains]
        return next((name for name in reversed(movable) if moved_by[name] == chains[0]), movable[-1])

    def _joints_before(self, link: str) -> list[str]:
        """Return the names of the joints that move a link, from the root on."""
        above = {joint.child: joint for joint in self.model.joints}
        joints: list[str] = []
        while link in above:
            joint = above[link]
            if joint.moves:
                joints.append(joint.name)
            link = joint.parent
        return joints[::-1]

    def why_not_moved(self, link: str) -> str | None:
        """Return a message if no force can move a link, or if there is no such link; None if a force can."""
        if (problem := why_no_link(self.model, link)) is not None:
            return problem
        between = next((joint for joint in self.model.joints if joint.child == joint.name == link), None)
        if between is not None and (between.ball or between.series):
            return f"'{link}' is a part of joint '{between.ball or between.series}', not a link of the model"
        return f"link '{link}' is fixed to the world, so nothing moves it" if link in self.bolted_links else None

    @property
    def keyframe(self) -> Keyframe | None:
        """The keyframe of the model at which the robot begins, if the scenario names one."""
        if self.robot.keyframe is None:
            return None
        return keyframe_of(self.model.keyframes, self.robot.keyframe)

    @property
    def is_at_keyframe_height(self) -> bool:
        """True if a keyframe alone states the height of a base that moves freely."""
        at = None if self.keyframe is None else self.keyframe.base
        return at is not None and self.robot.pose.z is None and at.position_xyz[2] > 0 and not self.bolted

    @property
    def placement(self) -> Placement:
        """The initial placement of the base link, if stated by pose or keyframe; z is None on the ground."""
        pose = self.robot.pose
        at = None if self.keyframe is None else self.keyframe.base
        if at is not None:
            if not {"roll", "pitch", "yaw"} & pose.model_fields_set:
                roll, pitch, yaw = rpy_from_quaternion(at.orientation_xyzw)
                # A yaw that is not stated is 0, but for a repetition with another start.
                pose = pose.model_copy(update={"roll": roll, "pitch": pitch, "yaw": yaw + pose.yaw})
            # A file without its floor may have the base of a keyframe below the ground.
            height = at.position_xyz[2] if at.position_xyz[2] > 0 else None
            return pose if pose.z is not None else pose.model_copy(update={"z": height})
        at_origin = pose.z is None and self.bolted and self.model.root == WORLD
        floor = 0.0 if self.model.mjcf is None else self.model.mjcf.floor
        return pose.model_copy(update={"z": 0.0 - floor}) if at_origin else pose

    @property
    def joint_positions(self) -> dict[str, float]:
        """The initial position of each moving joint in rad, or m if prismatic. Raises units.UnitError."""
        stated = self._stated_positions()
        key = {} if self.keyframe is None else self.keyframe.joints
        positions = self.model.positions({**key, **stated})
        # A keyframe also states followers, which may depend on their leaders in a nonlinear way.
        return {
            name: key[name] if name in key and not self.model.leaders(name) & stated.keys() else position
            for name, position in positions.items()
        }

    @property
    def controls(self) -> dict[str, tuple[float, ...]]:
        """The initial controls that the keyframe states, without motors of joints in `robot.joints`."""
        if self.keyframe is None:
            return {}
        stated = self._stated_positions().keys()
        moved = {
            joint.motor.actuator
            for joint in self.model.moving_joints
            if joint.motor is not None and self.model.leaders(joint.name) & stated
        }
        return {name: controls for name, controls in self.keyframe.controls.items() if name not in moved}

    def _stated_positions(self) -> dict[str, float]:
        if not self.robot.joints:
            return {}
        joints, written = self.model.joints_by_name, self.robot.joints
        return {
            joint: units.parse(written[name], joints[joint].dimension("position"))
            for name, names in joints_set_by(self.model, written).items()
            for joint in names
            if joint in joints
        }

    def parts_of(self, body: Body) -> Sequence[Part]:
        """Return the parts of a body of the world."""
        return self.parts[body.name] if body.is_read else body.parts()

    @property
    def extent(self) -> float:
        """An upper bound in m on the distance of the robot's shapes from the origin of its base link at the start."""
        poses = link_poses(self.model, self.joint_positions)
        ends = [0.0]
        for link in self.model.links:
            at = math.hypot(*poses[link.name].position_xyz)
            for shape in link.collisions:
                corner = max(math.hypot(*shape.lower_xyz), math.hypot(*shape.upper_xyz))
                ends.append(at + math.hypot(*shape.pose.position_xyz) + corner)
        return max(ends)

    def generator(self, purpose: str) -> Generator:
        """Return a random generator for one purpose, independent of all others."""
        purpose = f"{purpose} ({self.namesake + 1})" if self.namesake else purpose
        purpose = f"{self.owner}: {purpose}" if self.owner else purpose
        return np.random.default_rng((self.seed, zlib.crc32(purpose.encode())))
