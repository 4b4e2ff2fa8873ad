"""`stay_within: {x: [-1 m, 2 m], y: [-20 cm, 20 cm]}`: the robot, or a link, stays inside a box."""

from __future__ import annotations

from functools import partial
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import CREEP_M, Reference
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.bounds import Interval, IntervalsMonitor, bounds_formula, check_interval
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.core import units
from sim_action.core.field_types import Metres
from sim_action.core.lazy_numpy import FloatArray
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Mark, box, line, rectangle
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.robot_reach import LinkRange
from sim_action.world.scene import Scene

Range = tuple[Metres, Metres]


class StayWithin(MotionAssertion):
    """The origin of the base link, or of `link`, stays between the bounds of `x`, `y` and `z` in `frame`.

    An axis without bounds is not checked.
    """

    key: ClassVar[str] = "stay_within"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "invariant",
        "The robot was between the bounds at every step.",
        "The robot was outside a bound at a step.",
    )

    x: Annotated[Range | None, Field(description="an invariant: [lower, upper]")] = None
    y: Annotated[Range | None, Field(description="an invariant: [lower, upper]")] = None
    z: Annotated[Range | None, Field(description="an invariant: [lower, upper]")] = None

    @model_validator(mode="after")
    def _is_a_region(self) -> Self:
        if not self.intervals:
            raise ValueError("give at least one of 'x', 'y' and 'z'")
        for axis, (lower, upper) in self.intervals.items():
            check_interval(axis, lower, upper, "m")
        return self

    @property
    def intervals(self) -> dict[str, Range]:
        """The given bounds, by axis."""
        intervals = {"x": self.x, "y": self.y, "z": self.z}
        return {axis: interval for axis, interval in intervals.items() if interval is not None}

    has_truth: ClassVar[bool] = True

    @override
    def limits_motion(self, scene: Scene) -> bool:
        starts = {"x": scene.placement.x, "y": scene.placement.y}
        sides = ((starts[axis], *bounds) for axis, bounds in self.intervals.items() if axis in starts)
        return self.watches_base and any(at - CREEP_M < lower or upper < at + CREEP_M for at, lower, upper in sides)

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return self.z is not None or self.limits_motion(scene)

    @override
    def meaning(self, scene: Scene) -> str:
        sides = ((self.quantity(axis, axis), bounds) for axis, bounds in self.intervals.items())
        return " and ".join(bounds_formula(name, *bounds, goal=False) for name, bounds in sides)

    @override
    def range_claims(self, limits: LinkRange) -> Findings:
        if limits.is_within(self.intervals):
            most = f"{units.display(limits.radius, 'm')} from {limits.middle}"
            message = f"{limits.who} cannot leave these bounds: it is never more than {most}; give narrower bounds"
            yield ClaimFinding("unreachable-limit", (), message)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield bounds that the base does not come to in the time limit, if it comes to none of them."""
        yield from super().run_claims(run)
        if self.watches_base and run.verdict.passed:
            start = dict(zip("xyz", run.trace.base_position_xyz[0].tolist(), strict=True))
            away = min(abs(bound - start[axis]) for axis, bounds in self.intervals.items() for bound in bounds)
            yield from run.beyond_drive(away, "give narrower bounds, or more time")

    @override
    def title_of(self, watched: Watched) -> str:
        return f"{self.key_of(watched)} " + ", ".join(
            f"{axis} {units.display(lower, 'm')} to {units.display(upper, 'm')}"
            for axis, (lower, upper) in self.intervals.items()
        )

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        intervals = (
            Interval(axis, "m", *bounds, partial(_coordinate, "xyz".index(axis)))
            for axis, bounds in self.intervals.items()
        )
        return IntervalsMonitor(tuple(side for interval in intervals for side in interval.sides()))

    def marks_in(self, watched: Watched, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See MotionAssertion.marks_in. Returns a rectangle, the edges of a box, or lines for one axis."""
        if self.x is not None and self.y is not None:
            if self.z is not None:
                return tuple(box(self.x, self.y, self.z))
            return (rectangle(self.x, self.y),)
        x, y, _ = start.pose.position_xyz
        bounds = ((axis, at) for axis, both in self.intervals.items() if axis != "z" for at in both)
        return tuple(line(axis, at, (x, y)) for axis, at in bounds)


def _coordinate(column: int, trace: Trace) -> FloatArray:
    return trace.base_position_xyz[:, column]
