"""`max_speed: {linear: 0.5 m/s}`: limits on the speed of the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.bounds import AllLimits, Bounds, SignalMonitor
from sim_action.core import units
from sim_action.core.field_types import NonNegativeMetresPerSecond, NonNegativeRadiansPerSecond
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class MaxSpeed(Assertion):
    """The speed of the base link's origin never exceeds `linear`, its turn rate never exceeds `angular`."""

    key: ClassVar[str] = "max_speed"

    linear: Annotated[NonNegativeMetresPerSecond | None, Field(description="an invariant")] = None
    angular: Annotated[NonNegativeRadiansPerSecond | None, Field(description="an invariant")] = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.linear is None and self.angular is None:
            raise ValueError("give 'linear', 'angular' or both")
        return self

    @property
    def title(self) -> str:
        """See Assertion.title."""
        limits = ((self.linear, "m/s"), (self.angular, "rad/s"))
        return "max_speed " + ", ".join(units.display(limit, unit) for limit, unit in limits if limit is not None)

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        monitors = []
        if self.linear is not None:
            bounds = Bounds("moved with", "m/s", None, self.linear)
            monitors.append(SignalMonitor("speed", lambda trace: trace.speed, bounds))
        if self.angular is not None:
            bounds = Bounds("turned with", "rad/s", None, self.angular)
            monitors.append(SignalMonitor("turn rate", lambda trace: trace.turn_rate, bounds))
        return AllLimits(tuple(monitors))
