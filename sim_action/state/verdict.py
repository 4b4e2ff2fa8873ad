"""The result of an assertion: its verdict, and the curves and marks in the world that explain it in reports."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Self, TypeAlias

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was measured against what was asked.

    Attributes:
        passed: whether the assertion held.
        measured: the value that decided it, in `unit`; None if nothing was there to measure.
        limit: what it was held against, in `unit`.
        margin: distance to the limit, in `unit`; positive on the good side.
        unit: SI symbol, empty for a count.
        time: sim time in s at which it was decided, or at which an invariant came nearest to its limit.
        message: one sentence for people.
        cut_off: whether it failed as something else ended the run before it was decided: not the reason to look for.
        goal: whether it had to come true once; its margin is that of the moment it did, and says little.
    """

    passed: bool
    measured: float | None = None
    limit: float | None = None
    margin: float | None = None
    unit: str = ""
    time: float | None = None
    message: str = ""
    cut_off: bool = False
    goal: bool = False


@dataclass(frozen=True, eq=False)
class Signal:
    """One curve of an expectation.

    Attributes:
        name: what people call it: "travelled", "tilt".
        unit: of values and limits, an SI symbol as in `Verdict.unit`.
        time: (N,) s of sim time, rising; its own, as readings and contacts come at a rate of theirs.
        values: (N,) in `unit`; NaN: nothing is there.
        lower: what the values have to be above (a goal: at some moment of the window); None: no such limit.
        upper: what they have to be below; where it is less than `lower`, either of both is enough.
        start, end: s of sim time, the window that the limits hold for; the same: they hold at that moment alone.
    """

    name: str
    unit: str
    time: NDArray[Any]
    values: NDArray[Any]
    lower: float | None = None
    upper: float | None = None
    start: float = 0.0
    end: float = math.inf

    def at_end(self) -> Self:
        """The curve whose limits hold when all is over."""
        return replace(self, start=math.inf)

    def contrary(self) -> Self:
        """The curve of what must not hold: what had to be above has to be below."""
        return replace(self, lower=self.upper, upper=self.lower)

    def within(self, start: float, end: float) -> Self:
        """The curve whose limits hold from `start` to `end`, in s; those that hold at the end alone, at this one."""
        start = max(start, min(self.start, end))
        return replace(self, start=start, end=max(start, min(end, self.end)))


# How far a bound that goes on for ever is drawn, either way.
_FAR: Final = 5.0


@dataclass(frozen=True, slots=True)
class Circle:
    """On the ground plane, or as high as `z`."""

    x: float
    y: float
    radius: float
    z: float = 0.0


@dataclass(frozen=True, slots=True)
class Polygon:
    """An area of the ground plane, as its corners."""

    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Polyline:
    """A way from point to point."""

    points: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, slots=True)
class Arrow:
    """A heading at a place on the ground plane: `yaw` in rad about the z axis."""

    x: float
    y: float
    yaw: float


Mark: TypeAlias = Circle | Polygon | Polyline | Arrow


def rectangle(x: tuple[float, float], y: tuple[float, float]) -> Polygon:
    """The area between two bounds each."""
    return Polygon(((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])))


def line(axis: str, at: float, middle_xy: tuple[float, float]) -> Polyline:
    """All places of the ground plane with one x, or one y; drawn for some metres about `middle_xy`."""
    x, y = middle_xy
    if axis == "x":
        return Polyline(((at, y - _FAR, 0.0), (at, y + _FAR, 0.0)))
    return Polyline(((x - _FAR, at, 0.0), (x + _FAR, at, 0.0)))


def goal(x: float, y: float, z: float | None, tolerance: float, yaw: float | None) -> Iterator[Mark]:
    """A place to come to, and how to head there."""
    yield Circle(x, y, tolerance, z or 0.0)
    if yaw is not None and math.isfinite(yaw):
        yield Arrow(x, y, yaw)
