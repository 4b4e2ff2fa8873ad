"""Points in time through which joints are to move, and the knots that they are for each joint."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import Field, model_validator

from sim_action.core import units
from sim_action.core.field_types import FrozenModel, JointEffort, JointPosition, JointVelocity, NonNegativeSeconds
from sim_action.robot.robot_model import Reading
from sim_action.world.scene import Scene


class JointPoint(FrozenModel):
    """Where some joints shall be, how fast they shall move or how hard their motors shall push at one time."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time; each point is later than the one before")]
    position: Annotated[dict[str, JointPosition], Field(description="of joints, by name")] = Field(default_factory=dict)
    velocity: Annotated[dict[str, JointVelocity], Field(description="of joints, by name")] = Field(default_factory=dict)
    effort: Annotated[dict[str, JointEffort], Field(description="of joints' motors, by name")] = Field(
        default_factory=dict
    )

    @model_validator(mode="after")
    def _names_a_joint(self) -> Self:
        if not any(targets for _, targets in self.groups()):
            raise ValueError("a point names at least one joint, below 'position', 'velocity' or 'effort'")
        return self

    def groups(self) -> Iterator[tuple[Reading, Mapping[str, float | str]]]:
        """What is wanted, and of which joints."""
        yield "position", self.position
        yield "velocity", self.velocity
        yield "effort", self.effort


@dataclass(frozen=True, slots=True)
class Knot:
    """What one point says of one joint, as it was written; `index`: of the point."""

    joint: str
    reading: Reading
    index: int
    time: float
    written: float | str

    @property
    def path(self) -> tuple[str | int, ...]:
        """The keys that lead to it."""
        return "joints", self.index, self.reading, self.joint


def knots(points: Iterable[JointPoint]) -> Iterator[Knot]:
    """All of them, point by point."""
    for index, point in enumerate(points):
        for reading, targets in point.groups():
            for joint, written in targets.items():
                yield Knot(joint, reading, index, point.at, written)


def in_si(scene: Scene, knot: Knot) -> float:
    """What is wanted, in rad and N m, or in m and N. Raises units.UnitError."""
    return units.parse(knot.written, scene.model.joints_by_name[knot.joint].dimension(knot.reading))
