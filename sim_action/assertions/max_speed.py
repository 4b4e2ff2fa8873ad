"""`max_speed: {linear: 0.5 m/s}`: limits on the speed of the robot, or of a link."""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import CREEP_M_S, Reference
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.assertions.monitors.bounds import AllLimits, Bounds, BoundsMonitor, bounds_formula
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.core import units
from sim_action.core.field_types import NonNegativeMetresPerSecond, NonNegativeRadiansPerSecond
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.claims import UNSTABLE, Ceiling, ClaimFinding, Findings, JudgedRun
from sim_action.world.robot_reach import ROUNDING_M, LinkRange
from sim_action.world.scene import Scene


class MaxSpeed(MotionAssertion):
    """The speed of the origin of the base link, or of `link`, never exceeds `linear`; its turn rate never `angular`.

    Speeds are relative to `frame`. A base or link that moves further in one physics step than its velocity explains,
    for example because a script set its pose, has jumped: its speed is then the length of the jump over the time of the
    step.
    """

    key: ClassVar[str] = "max_speed"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "invariant",
        "Speed and turn rate were within the limits at every step. A robot that stands still passes.",
        "The speed or the turn rate exceeded its limit at a step, or the base jumped.",
    )
    ceilings: ClassVar[tuple[Ceiling, ...]] = (
        Ceiling("linear", "m/s", f"{UNSTABLE}max_speed", lambda setting: setting.physics.max_speed),
        Ceiling("angular", "rad/s", f"{UNSTABLE}max_turn_rate", lambda setting: setting.physics.max_turn_rate),
    )

    linear: Annotated[NonNegativeMetresPerSecond | None, Field(description="an invariant")] = None
    angular: Annotated[NonNegativeRadiansPerSecond | None, Field(description="an invariant")] = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.linear is None and self.angular is None:
            raise ValueError("give 'linear', 'angular' or both")
        return self

    has_truth: ClassVar[bool] = True

    @override
    def limits_motion(self, scene: Scene) -> bool:
        limits = [limit for limit in (self.linear, self.angular) if limit is not None]
        return self.watches_base and min(limits) <= CREEP_M_S

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return self.limits_motion(scene)

    @override
    def meaning(self, scene: Scene) -> str:
        limits = (("speed", self.linear), ("turn_rate", self.angular))
        parts = (bounds_formula(self.quantity(name, name), None, limit) for name, limit in limits)
        return " and ".join(part for part in parts if part)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a limit above the top speed of the base."""
        yield from super().run_claims(run)
        if self.watches_base and run.verdict.passed and self.linear is not None and self.linear > run.top_speed:
            most = units.display(run.top_speed, "m/s")
            message = f"a robot that runs away drives at less than {most}; give a smaller limit"
            yield ClaimFinding("limit-beyond-range", ("linear",), message)

    @override
    def title_of(self, watched: Watched) -> str:
        limits = ((self.linear, "m/s"), (self.angular, "rad/s"))
        shown = (units.display(limit, unit) for limit, unit in limits if limit is not None)
        return f"{self.key_of(watched)} {', '.join(shown)}"

    @override
    def range_claims(self, limits: LinkRange) -> Findings:
        if limits.radius <= ROUNDING_M:
            yield from limits.never_moves({"linear": self.linear})

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        motion = BaseMotion.of(scene, start)
        monitors = []
        if self.linear is not None:
            monitors.append(SpeedMonitor(Bounds("moved with", "m/s", None, self.linear), motion))
        if self.angular is not None:
            monitors.append(SpeedMonitor(Bounds("turned with", "rad/s", None, self.angular), motion, turns=True))
        return AllLimits(tuple(monitors))


@dataclass(frozen=True, slots=True)
class SpeedMonitor(BoundsMonitor):
    """The fold of the speed of the base, or of its turn rate (`turns`)."""

    is_momentary = True

    bounds: Bounds
    motion: BaseMotion
    turns: bool = False
    jump: str = ""  # the jump that broke the limit, as text; empty if no jump did

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. The step to the first moment of the window counts."""
        return replace(self, motion=self.motion.after(trace))

    @override
    def observe(self, trace: Trace) -> Self:
        values = self.values(trace)
        bounds, jump = self.bounds.observe(trace.time, values), self.jump
        if bounds.is_decided and not self.is_decided:
            step = int((trace.time == bounds.invariant.time).argmax())
            reported = trace.turn_rate if self.turns else trace.speed
            jump = self.motion.jump(trace, step, turns=self.turns) if values[step] != reported[step] else ""
        return replace(self, bounds=bounds, motion=self.motion.after(trace), jump=jump)

    @override
    def verdict(self) -> Verdict:
        verdict = self.bounds.verdict()
        return replace(verdict, message=f"{self.jump}: {verdict.message}") if self.jump else verdict

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        values = self._values(self.motion.of_stored(), trace)
        return (self.bounds.drawn("turn rate" if self.turns else "speed", trace.time, values),)

    @override
    def values(self, trace: Trace) -> FloatArray:
        return self._values(self.motion, trace)

    def _values(self, motion: BaseMotion, trace: Trace) -> FloatArray:
        return motion.turn_rate(trace) if self.turns else motion.speed(trace)
