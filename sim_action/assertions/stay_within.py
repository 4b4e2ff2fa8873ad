"""`stay_within: {x: [-1 m, 2 m], y: [-20 cm, 20 cm]}`: the robot does not leave a box."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action import units
from sim_action.assertions import Assertion, Monitor, State
from sim_action.assertions.fold import Invariant
from sim_action.observation import Observation
from sim_action.quantities import Metres
from sim_action.scene import Scene
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.trace import Trace

Interval = tuple[Metres, Metres]


class StayWithin(Assertion):
    """The base link's origin stays between bounds, in the world frame; an axis left out is free."""

    key: ClassVar[str] = "stay_within"

    x: Annotated[Interval | None, Field(description="an invariant: [lower, upper]")] = None
    y: Annotated[Interval | None, Field(description="an invariant: [lower, upper]")] = None
    z: Annotated[Interval | None, Field(description="an invariant: [lower, upper]")] = None

    @model_validator(mode="after")
    def _is_a_region(self) -> Self:
        if not self.intervals:
            raise ValueError("give at least one of 'x', 'y' and 'z'")
        for axis, (lower, upper) in self.intervals.items():
            if lower >= upper:
                raise ValueError(f"the bounds of '{axis}' are the wrong way round: {lower:g} is not below {upper:g}")
        return self

    @property
    def intervals(self) -> dict[str, Interval]:
        """Axis -> bounds, of those that were given."""
        given = {"x": self.x, "y": self.y, "z": self.z}
        return {axis: interval for axis, interval in given.items() if interval is not None}

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return "stay_within " + ", ".join(
            f"{axis} {units.display(lower, 'm')} to {units.display(upper, 'm')}"
            for axis, (lower, upper) in self.intervals.items()
        )

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return StayWithinMonitor(
            tuple(
                Side(axis, sign, bound)
                for axis, (lower, upper) in self.intervals.items()
                for sign, bound in ((-1, lower), (1, upper))
            )
        )


@dataclass(frozen=True, slots=True)
class Side:
    """One face of the box; `sign` is -1 for a lower and 1 for an upper bound."""

    axis: str
    sign: int
    bound: float
    fold: Invariant = Invariant()

    def margin(self) -> float:
        """Infinite before the first moment."""
        return math.inf if self.fold.margin is None else self.fold.margin

    def time(self) -> float:
        """Of the margin; infinite before the first moment."""
        return math.inf if self.fold.time is None else self.fold.time

    def observe(self, trace: Trace) -> Self:
        """The side after these moments."""
        coordinate = trace.base_position_xyz[:, "xyz".index(self.axis)]
        return replace(self, fold=self.fold.observe(trace.time, self.sign * (self.bound - coordinate)))


@dataclass(frozen=True, slots=True)
class StayWithinMonitor:
    """All faces; the first that was passed speaks, else the one that was nearest."""

    sides: tuple[Side, ...]

    @property
    def state(self) -> State:
        """See Monitor.state."""
        broken = any(side.fold.state is State.BROKEN for side in self.sides)
        return State.BROKEN if broken else State.HOLDS

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, sides=tuple(side.observe(trace) for side in self.sides))

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        passed = self.state is State.HOLDS
        broken = [side for side in self.sides if side.fold.state is State.BROKEN]
        side = min(broken, key=Side.time) if broken else min(self.sides, key=Side.margin)
        margin, time = side.fold.margin, side.fold.time
        if margin is None or time is None:
            return Verdict(passed, None, None, None, "m", None, "no moment to measure")
        measured = side.bound - side.sign * margin
        where, limit = (f"{side.axis} = {text}" for text in units.display_apart(measured, side.bound, "m"))
        message = f"stayed within; nearest to {limit} with {where}" if passed else f"left past {limit}: {where}"
        return Verdict(passed, measured, side.bound, margin, "m", time, f"{message} at {time:.2f} s")
