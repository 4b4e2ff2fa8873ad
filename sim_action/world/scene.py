"""A scene: the robot, its loaded model and what surrounds it, as engines, drives and assertions get to see it."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sim_action.core import units
from sim_action.core.field_types import Placement
from sim_action.core.workspace import Workspace
from sim_action.robot.kinematics import Mobility
from sim_action.robot.robot_model import WORLD, RobotModel
from sim_action.robot.spec import Robot
from sim_action.world import Body, Physics, World

if TYPE_CHECKING:
    from numpy.random import Generator

    from sim_action.world.parts import Part


@dataclass(frozen=True, slots=True)
class Fitting:
    """A sensor of the robot, as those know it who pass on what it tells.

    Attributes:
        kind: its key in YAML.
        link: of the robot, that it sits on.
        rate: Hz, at which it is read.
    """

    name: str
    kind: str
    link: str
    rate: float


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that is simulated, with names resolved and files read.

    Attributes:
        seed: of the scenario; `generator` makes what is drawn from it.
        rotors: joint -> inertia of its motor in kg m^2, as the joint feels it through the gears; left out: none.
        mobility: what its drive can do, if it has one.
        parts: name of a body -> what it is made of, for bodies whose shapes were read from files.
        sensors: of the scenario.
        namesake: of several sources of commands that run the same code, which one is to see it: each draws numbers of
            its own.
        file: of the scenario, as reports show it.
        variation: what tells it from the others that the scenario varies into, as part of a file's name; or empty.
    """

    robot: Robot
    model: RobotModel
    world: World
    physics: Physics
    workspace: Workspace
    seed: int = 0
    rotors: Mapping[str, float] = field(default_factory=dict)
    mobility: Mobility = field(default_factory=Mobility)
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    sensors: tuple[Fitting, ...] = ()
    namesake: int = 0
    file: str = ""
    variation: str = ""

    @property
    def bolted(self) -> bool:
        """Whether the base cannot move: by the scenario, or else by the name of the model's root link."""
        base = self.robot.base or ("fixed" if self.model.root == WORLD else "free")
        return base == "fixed"

    @property
    def bolted_links(self) -> frozenset[str]:
        """What no force moves: a base that cannot move, and all that is fixed to it."""
        if not self.bolted:
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
    def placement(self) -> Placement:
        """Where the base link begins; z is None if the robot is to stand on the ground."""
        pose = self.robot.pose
        at_origin = pose.z is None and self.bolted and self.model.root == WORLD
        return pose.model_copy(update={"z": 0.0}) if at_origin else pose

    @property
    def joint_positions(self) -> dict[str, float]:
        """Where each moving joint begins, in rad, or m if prismatic. Raises units.UnitError."""
        joints = self.model.joints_by_name
        stated = {
            name: units.parse(written, joints[name].dimension("position"))
            for name, written in self.robot.joints.items()
            if name in joints
        }
        return self.model.positions(stated)

    def parts_of(self, body: Body) -> Sequence[Part]:
        """What a body of the world is made of."""
        return self.parts[body.name] if body.is_read else body.parts()

    def generator(self, purpose: str) -> Generator:
        """Random numbers for one purpose: what others draw, and how many others there are, changes none of them."""
        import numpy as np

        purpose = f"{purpose} ({self.namesake + 1})" if self.namesake else purpose
        return np.random.default_rng((self.seed, zlib.crc32(purpose.encode())))
