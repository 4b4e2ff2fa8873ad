"""`travel: {at_least: 1.5 m}` and `path_length: {at_most: 3 m}`: the distance from the start, and along the path."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import CREEP_M, Reference
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.bounds import (
    Bounds,
    BoundsMonitor,
    SignalMonitor,
    bounds_formula,
    bounds_title,
    check_bounds,
)
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.core.field_types import NonNegativeMetres, PositiveMetres
from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Circle, Mark, Signal
from sim_action.world.claims import UNSTABLE, Ceiling, Findings, JudgedRun
from sim_action.world.robot_reach import ROUNDING_M, LinkRange
from sim_action.world.scene import Scene


class LengthBounds(MotionAssertion):
    """The base class of assertions with two bounds on a length."""

    measured_unit: ClassVar[str | None] = "m"
    base_signal: ClassVar[str] = ""  # the signal of formulas that is this length of the base; empty if there is none

    at_least: Annotated[PositiveMetres | None, Field(description="a goal: must be reached")] = None
    at_most: Annotated[NonNegativeMetres | None, Field(description="an invariant: must not be exceeded")] = None

    @model_validator(mode="after")
    def _has_a_bound(self) -> Self:
        check_bounds(self.at_least, self.at_most, "m")
        return self

    @property
    @override
    def is_goal(self) -> bool:
        return self.at_least is not None

    @override
    def limits_motion(self, scene: Scene) -> bool:
        return self.watches_base and min(self.at_most or math.inf, self.at_least or math.inf) <= CREEP_M

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return self.limits_motion(scene)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a limit that the base does not exceed in the time limit. With a goal, `at_most` is a safety net."""
        yield from super().run_claims(run)
        part_failed = run.is_part and not run.verdict.passed
        key, limit = ("at_least", self.at_least) if part_failed else ("at_most", self.at_most)
        if limit is not None and self.watches_base and (part_failed or not self.is_goal):
            yield from run.beyond_drive(limit, "give a smaller limit, or more time", (key,))

    @override
    def meaning(self, scene: Scene) -> str:
        signal = self.base_signal if self.watches_base else ""
        return bounds_formula(self.quantity(self.key, signal), self.at_least, self.at_most)

    has_truth: ClassVar[bool] = True

    @override
    def title_of(self, watched: Watched) -> str:
        return f"{self.key_of(watched)} {bounds_title(self.at_least, self.at_most, 'm')}"


class Travel(LengthBounds):
    """The distance on the ground from the start position reaches `at_least`, or never exceeds `at_most`.

    It is the length of a straight line from the position in which the robot has settled, at t = 0. For a `link`, it is
    measured in the x-y plane of `frame`.
    """

    key: ClassVar[str] = "travel"
    base_signal: ClassVar[str] = "travel"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "`at_least`: goal; `at_most`: invariant",
        "The distance reached `at_least` at some step, and exceeded `at_most` at no step.",
        "The distance never reached `at_least`, or it exceeded `at_most` at a step.",
    )
    ceilings: ClassVar[tuple[Ceiling, ...]] = (
        Ceiling("at_most", "m", f"{UNSTABLE}max_distance", lambda setting: setting.physics.max_distance),
    )

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        x, y, _ = start.pose.position_xyz
        bounds = Bounds("travelled", "m", self.at_least, self.at_most)
        return SignalMonitor("travelled", lambda trace: trace.planar_distance_to(x, y), bounds)

    def marks_in(self, watched: Watched, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See MotionAssertion.marks_in. Returns a circle for each bound."""
        x, y, _ = start.pose.position_xyz
        return tuple(Circle(x, y, radius) for radius in (self.at_least, self.at_most) if radius)

    @override
    def range_claims(self, limits: LinkRange) -> Findings:
        if limits.joint:  # a free base has a ceiling
            yield from limits.too_wide(2 * limits.radius + ROUNDING_M, "its start", {"at_most": self.at_most})


class PathLength(LengthBounds):
    """The length of the driven path reaches `at_least`, or never exceeds `at_most`.

    It is the length of the path of the base link, or of `link`, in space since `after`, summed over every physics step.
    """

    key: ClassVar[str] = "path_length"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "`at_least`: goal; `at_most`: invariant",
        "The length reached `at_least`, and never exceeded `at_most`.",
        "The length never reached `at_least`, or it exceeded `at_most`.",
    )
    ceilings: ClassVar[tuple[Ceiling, ...]] = (
        Ceiling(
            "at_most",
            "m",
            "no path is longer at physics.max_speed until time_limit",
            lambda setting: setting.physics.max_speed * setting.time_limit,
        ),
    )

    @override
    def range_claims(self, limits: LinkRange) -> Findings:
        if limits.radius <= ROUNDING_M:
            yield from limits.never_moves({"at_most": self.at_most})

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        bounds = Bounds("covered", "m", self.at_least, self.at_most)
        return PathLengthMonitor(bounds, start.pose.position_xyz)


@dataclass(frozen=True, slots=True)
class PathLengthMonitor(BoundsMonitor):
    """The fold of the arc length so far, and the last position."""

    bounds: Bounds
    position_xyz: Vector3
    length: float = 0.0

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. The path before the window does not count."""
        return replace(self, position_xyz=_last_position(trace)) if len(trace) else self

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        lengths = self.values(trace)
        bounds = self.bounds.observe(trace.time, lengths)
        return replace(self, bounds=bounds, position_xyz=_last_position(trace), length=float(lengths[-1]))

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        return (self.bounds.drawn("path length", trace.time, self.values(trace)),)

    @override
    def values(self, trace: Trace) -> FloatArray:
        return trace.arc_length_from(self.position_xyz, self.length)


def _last_position(trace: Trace) -> Vector3:
    x, y, z = trace.base_position_xyz[-1].tolist()
    return (x, y, z)
