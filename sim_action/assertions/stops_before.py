"""`stops_before: {body: wall, gap: [20 cm, 60 cm]}`: the robot comes to rest before a body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Monitor
from sim_action.assertions.at_rest import AtRest
from sim_action.assertions.bounds import check_interval
from sim_action.core import units
from sim_action.core.field_types import NonNegativeMetres
from sim_action.core.messages import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class StopsBefore(AtRest):
    """A goal: the robot comes to rest before a body, with a gap between two bounds; an invariant: it does not touch it.

    The gap is the least distance of any link to the body. It counts while the robot rests, so on its way there it may
    have been less: add `clearance` where it must not. What the robot does after its rest is not asked.
    """

    key: ClassVar[str] = "stops_before"

    body: Annotated[str, Field(min_length=1, description="name of the object")]
    gap: Annotated[tuple[NonNegativeMetres, NonNegativeMetres], Field(description="a goal: [lower, upper]")]

    @model_validator(mode="after")
    def _is_a_gap(self) -> Self:
        check_interval("gap", *self.gap, "m")
        return self

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return f"{self.key} {self.body} with a gap of {' to '.join(units.display(bound, 'm') for bound in self.gap)}"

    @property
    def near(self) -> ClearanceWatch:
        """Tells the gap whenever it is no more than it may be."""
        return ClearanceWatch(bodies=(self.body,), within=self.gap[1], always=True)

    @property
    def far(self) -> ClearanceWatch:
        """Tells the least gap, for a robot that stays too far away."""
        return ClearanceWatch(bodies=(self.body,))

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels(contacts=True, clearances=frozenset({self.near, self.far}))

    def problems(self, scene: Scene) -> SpecProblems:
        """A body that is not there."""
        bodies = [body.name for body in scene.world.objects]
        if self.body not in bodies:
            yield ("body",), f"the world has no body '{self.body}'{did_you_mean(self.body, bodies)}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.stops_before_monitor import StopsBeforeMonitor
        from sim_action.assertions.stretch import Stretch

        return StopsBeforeMonitor(self, Stretch(self.span))
