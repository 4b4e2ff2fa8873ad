"""`max_speed: {linear: 0.5 m/s}`: the robot is never faster."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action import units
from sim_action.assertions import Assertion, Monitor, State
from sim_action.assertions.bounds import Bounds
from sim_action.assertions.fold import joined
from sim_action.observation import Observation
from sim_action.quantities import NonNegativeMetresPerSecond, NonNegativeRadiansPerSecond
from sim_action.scene import Scene
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.trace import Trace


class MaxSpeed(Assertion):
    """Limits on how fast the base link's origin moves and how fast the base turns, in any direction."""

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
        return MaxSpeedMonitor(
            None if self.linear is None else Bounds("moved with", "m/s", None, self.linear),
            None if self.angular is None else Bounds("turned with", "rad/s", None, self.angular),
        )


@dataclass(frozen=True, slots=True)
class MaxSpeedMonitor:
    """Both limits, each where it was asked for."""

    linear: Bounds | None
    angular: Bounds | None

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return joined(*(bounds.state for bounds in self._asked()))

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(
            self,
            linear=self.linear and self.linear.observe(trace.time, trace.speed),
            angular=self.angular and self.angular.observe(trace.time, trace.turn_rate),
        )

    def verdict(self) -> Verdict:
        """The limit that was broken first, else the one that was come nearest to, as a part of it."""
        verdicts = [bounds.verdict() for bounds in self._asked()]
        nearest = min(verdicts, key=lambda v: (v.margin or 0.0) / (v.limit or 1.0))
        return min((v for v in verdicts if not v.passed), key=lambda v: v.time or 0.0, default=nearest)

    def _asked(self) -> tuple[Bounds, ...]:
        return tuple(bounds for bounds in (self.linear, self.angular) if bounds is not None)
