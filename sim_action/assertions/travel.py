"""`travel: {at_least: 1.5 m}`: the distance of the robot from its start position."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.bounds import Bounds, SignalMonitor, bounds_title, check_bounds
from sim_action.core.field_types import NonNegativeMetres, PositiveMetres
from sim_action.state.verdict import Circle, Mark
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class LengthBounds(Assertion):
    """The base class of assertions with two bounds on a length."""

    at_least: Annotated[PositiveMetres | None, Field(description="a goal: must be reached")] = None
    at_most: Annotated[NonNegativeMetres | None, Field(description="an invariant: must not be exceeded")] = None

    @model_validator(mode="after")
    def _has_a_bound(self) -> Self:
        check_bounds(self.at_least, self.at_most, "m")
        return self

    @property
    def is_goal(self) -> bool:
        """See Assertion.is_goal."""
        return self.at_least is not None

    @property
    def has_truth(self) -> bool:
        """See Assertion.has_truth."""
        return True

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return f"{self.key} {bounds_title(self.at_least, self.at_most, 'm')}"


class Travel(LengthBounds):
    """The distance on the ground from the start position reaches `at_least`, or never exceeds `at_most`.

    It is the length of a straight line from the position in which the robot has settled, at t = 0.
    """

    key: ClassVar[str] = "travel"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        x, y, _ = start.pose.position_xyz
        bounds = Bounds("travelled", "m", self.at_least, self.at_most)
        return SignalMonitor("travelled", lambda trace: trace.planar_distance_to(x, y), bounds)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks. Returns a circle for each bound."""
        x, y, _ = start.pose.position_xyz
        return tuple(Circle(x, y, radius) for radius in (self.at_least, self.at_most) if radius)
