"""`joint: {name: elbow, near: 90 deg, tolerance: 1 deg}`: what a joint must do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from sim_action import units
from sim_action.assertions import Assertion, Monitor, State
from sim_action.assertions.bounds import Bounds, SignalMonitor, check_order
from sim_action.assertions.fold import Goal
from sim_action.messages import did_you_mean
from sim_action.observation import Observation
from sim_action.quantities import JointQuantity, PositiveJointQuantity
from sim_action.scene import Scene, SpecProblems
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.trace import FloatArray, Trace

Reading = Literal["position", "velocity", "effort"]

_DIMENSIONS = {
    "position": (units.ANGLE, units.LENGTH),
    "velocity": (units.ANGULAR_SPEED, units.SPEED),
    "effort": (units.TORQUE, units.FORCE),
}
_UNITS = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "effort": ("N m", "N")}


class JointReading(Assertion):
    """A joint's position, velocity or motor effort reaches a bound or a value, or does not exceed a bound."""

    key: ClassVar[str] = "joint"

    name: Annotated[str, Field(min_length=1, description="of the joint in the model")]
    reading: Reading = "position"
    at_least: Annotated[JointQuantity | None, Field(description="a goal: must be reached")] = None
    at_most: Annotated[JointQuantity | None, Field(description="an invariant: must not be exceeded")] = None
    near: Annotated[JointQuantity | None, Field(description="a goal: must be reached within 'tolerance'")] = None
    tolerance: Annotated[PositiveJointQuantity | None, Field(description="goes with 'near'")] = None

    @model_validator(mode="after")
    def _asks_for_one_thing(self) -> Self:
        bounded = self.at_least is not None or self.at_most is not None
        if bounded == (self.near is not None):
            raise ValueError("give 'at_least' or 'at_most', or else 'near' with 'tolerance'")
        if (self.near is None) != (self.tolerance is None):
            raise ValueError("'near' and 'tolerance' go together")
        check_order(self.at_least, self.at_most)
        return self

    @field_validator("at_least", "at_most", "near", "tolerance", mode="before")
    @classmethod
    def _has_the_unit_of_its_reading(cls, value: object, info: ValidationInfo) -> object:
        if not isinstance(value, str) or "reading" not in info.data:
            return value
        try:
            return units.parse(value, *_DIMENSIONS[info.data["reading"]])
        except units.UnitError as error:
            raise ValueError(str(error)) from None

    @property
    def title(self) -> str:
        """See Assertion.title; the spec alone does not know whether the joint turns or slides."""
        asked = {"at least": self.at_least, "at most": self.at_most, "near": self.near}
        wanted = ", ".join(f"{word} {value:.4g}" for word, value in asked.items() if value is not None)
        return f"joint {self.name} {self.reading} {wanted}"

    def problems(self, scene: Scene) -> SpecProblems:
        """A joint that is not there."""
        moving = [joint.name for joint in scene.model.moving_joints]
        if self.name not in moving:
            yield ("name",), f"the model has no moving joint '{self.name}'{did_you_mean(self.name, moving)}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        slides = scene.model.joints_by_name[self.name].type == "prismatic"
        unit = _UNITS[self.reading][slides]
        if self.near is not None and self.tolerance is not None:
            return NearMonitor(self, unit, self.near, self.tolerance)
        return SignalMonitor(self.signal, Bounds(f"{self.name} had {self.reading}", unit, self.at_least, self.at_most))

    def signal(self, trace: Trace) -> FloatArray:
        """(T,) what is held against the bounds."""
        columns = {
            "position": trace.joint_position,
            "velocity": trace.joint_velocity,
            "effort": trace.joint_effort,
        }
        return columns[self.reading][:, trace.joint_names.index(self.name)]


@dataclass(frozen=True, slots=True)
class NearMonitor:
    """The fold of the distance to a value."""

    spec: JointReading
    unit: str
    near: float
    tolerance: float
    goal: Goal = Goal()
    end: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.goal.state

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        margin = self.tolerance - abs(self.spec.signal(trace) - self.near)
        return replace(self, goal=self.goal.observe(trace.time, margin), end=float(trace.time[-1]))

    def verdict(self) -> Verdict:
        """Measured is the least distance to the value, the limit its tolerance."""
        passed = self.state is State.HOLDS
        if self.goal.margin is None or self.goal.time is None:
            return Verdict(False, None, self.tolerance, None, self.unit, None, "no moment to measure")
        distance = self.tolerance - self.goal.margin
        near, value = units.display(distance, self.unit), units.display(self.near, self.unit)
        message = (
            f"{self.spec.name} came within {near} of {value} in {self.goal.time:.2f} s"
            if passed
            else f"{self.spec.name} came no nearer than {near} to {value} in {self.end:.1f} s; nearest at "
            f"{self.goal.time:.2f} s"
        )
        return Verdict(passed, distance, self.tolerance, self.goal.margin, self.unit, self.goal.time, message)
