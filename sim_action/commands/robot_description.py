"""What a controller is told of its robot before it is asked for the first time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from sim_action.robot.robot_model import Joint, JointType
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from numpy.random import Generator


@dataclass(frozen=True, slots=True)
class JointDescription:
    """One joint of the model.

    Attributes:
        type: "revolute", "continuous", "prismatic" or "fixed".
        moves: whether it has a position; those that do are in `Observation.joints`.
        lower, upper: limits in rad (m if prismatic); None where nothing stops it.
        max_effort: N m (N); None without a limit.
        max_velocity: rad/s (m/s); None without a limit.
        mimics: name of the joint that it follows, which is the one to be told where to go; None: it moves by itself.
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
        """What a model says of a joint."""
        return cls(
            type=joint.type,
            moves=joint.moves,
            lower=joint.lower,
            upper=joint.upper,
            max_effort=joint.max_effort,
            max_velocity=joint.max_velocity,
            mimics=joint.mimic.joint if joint.mimic else None,
        )


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """The robot that a controller drives, and how it is asked.

    Attributes:
        name: what the model calls itself.
        base: name of the base link.
        links: names of all links.
        joints: joint name -> description, in the order of the model.
        rate: how often the controller is asked, in Hz of sim time.
        seed: of the scenario.
        random: random numbers that depend on the seed; every run draws the same.
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
        """The robot of a scene; `purpose` tells its random numbers from those of others."""
        model = scene.model
        return cls(
            name=model.name,
            base=model.root,
            links=tuple(link.name for link in model.links),
            joints={joint.name: JointDescription.of(joint) for joint in model.joints},
            rate=rate,
            seed=scene.seed,
            random=scene.generator(purpose),
        )
