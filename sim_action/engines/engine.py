"""The `Engine` protocol of a physics engine.

An engine loads one scene and steps it. All engines follow the same conventions: poses refer to link frames,
quaternions are x, y, z, w, twists are in the world frame, the friction of a contact is the product of both surfaces,
links of the robot collide with each other only on request, and everything has a name instead of an index.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Protocol

from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import FloatArray
from sim_action.state.command import JointTargets
from sim_action.state.observation import Clash, Observation, Overlap
from sim_action.state.readings import EngineQueries
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ContactRecord
from sim_action.world import World
from sim_action.world.scene import Scene

NO_CHANNELS: Final = Channels()

UNLIMITED_EFFORT: Final = 1e6
"""N m or N: the effort limit of a motor whose model states none; ten times the limit of a mining truck's wheels."""


class RobotQueries(EngineQueries, Protocol):
    """One robot of a scene, as its controllers and sensors see it."""

    def observe(self, step: int, *, contacts: bool) -> Observation:
        """Return the present state as the state of step `step`; contacts, if requested, include the ground."""

    def collect(self) -> Trace:
        """Return the states after each step since the last call, with the requested contacts and clearances."""


def link_of(name: str, robots: Mapping[str, RobotQueries]) -> Pose | None:
    """Return the pose of a link of another robot, by its name ROBOT/LINK; None for other names."""
    robot, _, link = name.partition("/")
    return robots[robot].link_pose(link) if link and robot in robots else None


class Engine(RobotQueries, Protocol):
    """A physics engine that holds one scene; joints without a command are held, or free: see `held_joints`."""

    version: str  # name and version of the engine, such as "pybullet 3.2.7"

    solid_terrain: bool  # True if heightfields are solid below their surface

    actors: Mapping[str, RobotQueries]
    """The other robots of the world by name. The engine itself is the robot under test."""

    notes: tuple[str, ...] = ()  # the properties of the model that the engine had to change

    model_notes: tuple[str, ...] = ()  # notes on the robot model that every report shows

    def __init__(self, scene: Scene, channels: Channels = NO_CHANNELS) -> None:
        """Load a scene. `channels`: what traces hold in addition to the robot's state. Raises EngineError."""

    @staticmethod
    def warm_up() -> None:
        """Prepare what every scene needs, once for all processes that are forked from this one."""

    def advance(self, first_step: int, targets: Sequence[JointTargets | None]) -> None:
        """Step the scene once for each entry of `targets`, after passing that entry to the motors.

        An entry of None keeps the last command. A push of the base (`JointTargets.base`) is applied at every step
        until the next one replaces it; so are the wrenches on links (`JointTargets.wrenches`). `first_step` is the
        number of the state before the first step; the sim time of a state is its number over `physics.rate`. Bodies
        on paths, bodies that appear and disturbances act at their own steps.
        """

    def follow(self, world: World, time: float) -> None:
        """Move what happens in the world to the times of another world, which are later than the present.

        The worlds differ only in times of bodies, paths, patches and disturbances. Observations of clearances begin
        again at `time`, in s.
        """

    def link_contacts(self, step: int) -> Mapping[str, ContactRecord]:
        """Return the present contacts of the requested links, as contacts of step `step`."""

    def collect_bodies(self) -> FloatArray:
        """Return the poses (T, M, 7) of the bodies with a mass after each step since the last call.

        They have the order of the world: position, and unit quaternion x, y, z, w.
        """

    def touching(self) -> tuple[Overlap | Clash, ...]:
        """Return the contacts of the last step, some pairs several times; a negative depth is a gap."""

    def overlaps(self) -> tuple[Overlap, ...]:
        """Return the links that now overlap bodies or the ground; each pair once."""

    def clashes(self) -> tuple[Clash, ...]:
        """Return the bodies with a mass that now overlap other bodies or the ground; each pair once."""

    def close(self) -> None:
        """Free the engine."""
