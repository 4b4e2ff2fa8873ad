"""`joint_within: {position: {elbow: [0 deg, 90 deg]}}`: joints stay between bounds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.combined import short
from sim_action.assertions.intervals import Interval, IntervalsMonitor
from sim_action.assertions.joint_choice import as_written, chosen, name_problem, reading_of, unit_problem
from sim_action.core import units
from sim_action.core.field_types import JointEffort, JointPosition, JointVelocity
from sim_action.core.messages import FirstFew
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import READINGS, Reading
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation

Written = float | str

_BOUNDS = "an invariant: name, or pattern such as '*_wheel_joint', to [lower, upper]"


class JointWithin(Assertion):
    """An invariant: positions, velocities and motor efforts of joints stay between bounds.

    A pattern means every joint whose name it fits: `"*"` is all of them.
    """

    key: ClassVar[str] = "joint_within"

    position: Annotated[dict[str, tuple[JointPosition, JointPosition]], Field(description=_BOUNDS)] = Field(
        default_factory=dict
    )
    velocity: Annotated[dict[str, tuple[JointVelocity, JointVelocity]], Field(description=_BOUNDS)] = Field(
        default_factory=dict
    )
    effort: Annotated[dict[str, tuple[JointEffort, JointEffort]], Field(description=_BOUNDS)] = Field(
        default_factory=dict
    )

    @model_validator(mode="after")
    def _bounds_something(self) -> Self:
        if not any(True for _ in self.asked()):
            raise ValueError("give at least one joint in 'position', 'velocity' or 'effort'")
        for reading, name, (written_lower, written_upper) in self.asked():
            lower, upper = (units.parse(bound, *READINGS[reading]) for bound in (written_lower, written_upper))
            if lower >= upper:
                raise ValueError(
                    f"the bounds of '{name}' are the wrong way round: {written_lower} is not below {written_upper}"
                )
        return self

    def asked(self) -> Iterator[tuple[Reading, str, tuple[Written, Written]]]:
        """What is read, of which joints, and the bounds as they were written."""
        for name, bounds in self.position.items():
            yield "position", name, bounds
        for name, bounds in self.velocity.items():
            yield "velocity", name, bounds
        for name, bounds in self.effort.items():
            yield "effort", name, bounds

    @property
    def title(self) -> str:
        """See Assertion.title."""
        bounds = ((f"{name} {reading}", *map(as_written, bounds)) for reading, name, bounds in self.asked())
        return short(f"{self.key} " + ", ".join(f"{what} {lower} to {upper}" for what, lower, upper in bounds))

    def problems(self, scene: Scene) -> SpecProblems:
        """Joints that are not there, and units that are not those of a joint that turns, or slides."""
        hinted = FirstFew()
        for reading, name, bounds in self.asked():
            if (trouble := name_problem(scene.model, name, hinted)) is not None:
                yield (reading, name), trouble
            for joint in chosen(scene.model, (name,)):
                for index, written in enumerate(bounds):
                    if (misfit := unit_problem(joint, reading, written)) is not None:
                        yield (reading, name, index), misfit

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        intervals = self._intervals(scene)
        return IntervalsMonitor(tuple(side for each in intervals for side in each.sides(each.upper - each.lower)))

    def _intervals(self, scene: Scene) -> Iterator[Interval]:
        for reading, name, bounds in self.asked():
            for joint in chosen(scene.model, (name,)):
                dimension = joint.dimension(reading)
                lower, upper = (units.parse(bound, dimension) for bound in bounds)
                label = joint.name if reading == "position" else f"{joint.name} {reading}"
                yield Interval(label, dimension.si, lower, upper, reading_of(joint.name, reading))
