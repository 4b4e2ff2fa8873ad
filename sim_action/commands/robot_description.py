"""The description of the robot that a controller gets before its first step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

from sim_action.core.lazy_numpy import Generator
from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import Joint, JointType
from sim_action.world.scene import Scene


@dataclass(frozen=True, slots=True)
class JointDescription:
    """A joint of the model.

    Attributes:
        type: "revolute", "continuous", "prismatic" or "fixed".
        moves: True if it has a position; only such joints are in `Observation.joints`.
        lower, upper: limits in rad (m if prismatic); None without a limit.
        max_effort: N m (N); None without a limit.
        max_velocity: rad/s (m/s); None without a limit.
        mimics: name of the joint that it mimics, which must be commanded instead; None: it moves independently.
    """

    type: JointType
    moves: bool
    lower: float | None = None
    upper: float | None = None
    max_effort: float | None = None
    max_velocity: float | None = None
    mimics: str | None = None

    @classmethod
    def of(cls, joint: Joint) -> Self:
        """Return the description of a joint."""
        limits = (joint.lower, joint.upper, joint.max_effort, joint.max_velocity)
        return cls(joint.type, joint.moves, *limits, joint.mimic.joint if joint.mimic else None)


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """The robot that a controller drives, and the rate of its steps.

    Attributes:
        name: the name in the model.
        base: the name of the base link.
        links: the names of all links.
        joints: joint name -> description, in the order of the model.
        rate: the rate of the controller's steps, in Hz of sim time.
        seed: the seed of the scenario.
        random: a random number generator that depends only on the seed, so that every run draws the same numbers.
    """

    name: str
    base: str
    links: tuple[str, ...]
    joints: Mapping[str, JointDescription]
    rate: float
    seed: int
    random: Generator

    @classmethod
    def of(cls, scene: Scene, rate: float, purpose: str) -> Self:
        """Return the robot of a scene; `purpose` selects the stream of random numbers."""
        model = scene.model
        joints = {joint.name: JointDescription.of(joint) for joint in model.joints}
        links, random = tuple(link.name for link in model.links), scene.generator(purpose)
        return cls(model.name, model.root, links, joints, rate, scene.seed, random)
