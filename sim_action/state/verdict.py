"""The result of an assertion: its verdict, and the curves and marks in the world that explain it in reports."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, Literal, Self, TypeAlias

from sim_action.core.geometry import AXES, Quaternion, rotate
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S

VerdictStatus = Literal["passed", "failed", "inconclusive", "not_exercised"]
"""The status of a verdict.

- inconclusive: the runs of a gate, or the repetitions of a run, neither show nor refute the claim.
- not_exercised: the quantity was not defined at any moment, so nothing was checked.
"""

VERBS: Final[dict[VerdictStatus, str]] = {
    "passed": "passes",
    "not_exercised": "is not exercised",
    "inconclusive": "is inconclusive",
    "failed": "fails",
}
"""The statuses of a verdict as verbs, the best first."""


@dataclass(frozen=True, slots=True)
class Judged:
    """The moments at which an assertion was judged: the steps or readings at which its quantity is defined.

    Attributes:
        moments: their number.
        first, last: the sim times in s of the first and the last one; None if there is none.
    """

    moments: int = 0
    first: float | None = None
    last: float | None = None

    def followed_by(self, time: NDArray[Any]) -> Judged:
        """Return the moments with later ones, at (N,) s of sim time."""
        if not len(time):
            return self
        first = float(time[0]) if self.first is None else self.first
        return Judged(self.moments + len(time), first, float(time[-1]))


@dataclass(frozen=True, slots=True)
class Verdict:
    """The measured value of an assertion, and the limit that it was compared with.

    Attributes:
        passed: True if the assertion was judged at least once and held.
        measured: the value that decided it, in `unit`; None if there was nothing to measure.
        limit: the limit for the value, in `unit`.
        margin: the distance to the limit, in `unit`; positive on the passing side.
        unit: an SI symbol, empty for a count.
        time: the sim time in s of the decision, or of the smallest margin of an invariant.
        message: one sentence for people.
        cut_off: True if it failed only because another failure ended the run before its decision.
        goal: True if it had to become true once; its margin then belongs to that moment, and says little.
        judged: the moments at which it was judged; None if they were not counted, as in ROS tests and old results.
        inconclusive: the reason why there is no decision; "statistical": there are too few runs for the confidence;
            "numerical": the step, the start or the engine changes more than the margin.
        body: the body that decided it, because the robot touched it or came near to it; empty if there is none.
        joint: the joint whose reading decided it; empty if it is about no single joint.
        extreme: the margin that is farthest on the side of the verdict, in a run whose confidence is found: of a goal
            that was met the best one, of an invariant that failed the worst one; None if it is unknown.
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
    judged: Judged | None = None
    inconclusive: Literal["statistical", "numerical"] | None = None
    body: str = ""
    joint: str = ""
    extreme: float | None = None

    @property
    def status(self) -> VerdictStatus:
        """The status: an assertion without a moment to judge is neither passed nor failed."""
        if self.judged is not None and self.judged.moments <= 0:
            return "not_exercised"
        return "passed" if self.passed else "failed" if self.inconclusive is None else "inconclusive"

    @property
    def texts(self) -> tuple[str, ...]:
        """All texts, which user code may have written."""
        return self.message, self.unit, self.body, self.joint

    def with_texts(self, changed: Callable[[str], str]) -> Verdict:
        """Return the verdict with each text replaced by `changed(text)`."""
        message, unit, body, joint = map(changed, self.texts)
        return replace(self, message=message, unit=unit, body=body, joint=joint)

    def counted(self, steps: Judged) -> Verdict:
        """Return the verdict with the moments at which it was judged; `steps`: the moments of the run, the default.

        This is the one place that decides which verdicts are not exercised: without a moment, none passes.
        """
        judged = steps if self.judged is None else self.judged
        return replace(self, judged=judged, passed=self.passed and judged.moments > 0)

    def with_extreme(self, signals: Iterable[Signal]) -> Verdict:
        """Return the verdict with its extreme margin; `signals`: the curves of the run and of some time after it."""
        if self.goal != self.passed or self.margin is None or self.limit is None or self.unit == "contacts":
            return self
        curves = [signal for signal in signals if signal.unit == self.unit and self.limit in signal.limits]
        margins = [margin for signal in curves for margin in signal.margins().tolist() if math.isfinite(margin)]
        return replace(self, extreme=(max if self.passed else min)(margins, default=self.margin))

    def contrary(self) -> Verdict:
        """Return the verdict of the negated assertion: the margin has the opposite sign.

        The limit of a count of contacts becomes the other count, 0 or 1, so the margin is one less.
        """
        margin = None if self.margin is None else (-1.0 if self.unit == "contacts" else 0.0) - self.margin
        return replace(self, passed=not self.passed, limit=_opposite(self.limit, self.unit), margin=margin)


@dataclass(frozen=True, eq=False)
class Signal:
    """A curve that an assertion observed, with its limits.

    Attributes:
        name: the name of the quantity, such as "travelled" or "tilt".
        unit: the SI symbol of values and limits, as in `Verdict.unit`.
        time: (N,) sim time in s, rising; each signal has its own rate.
        values: (N,) in `unit`; NaN: no value.
        lower: the lower limit of the values (for a goal: at some moment of the window); None: no limit.
        upper: the upper limit; if it is less than `lower`, one of the two limits is enough.
        start, end: the window of the limits, in s of sim time; if equal, the limits hold at that moment only.
    """

    name: str
    unit: str
    time: NDArray[Any]
    values: NDArray[Any]
    lower: float | None = None
    upper: float | None = None
    start: float = 0.0
    end: float = math.inf

    @property
    def limits(self) -> tuple[float, ...]:
        """The limits that there are."""
        return tuple(limit for limit in (self.lower, self.upper) if limit is not None)

    def margins(self) -> NDArray[Any]:
        """Return (M,) the distances in `unit` to the nearer limit in the window, positive on the allowed side."""
        seen = self.values[(self.time >= self.start - TIME_EPSILON_S) & (self.time <= self.end + TIME_EPSILON_S)]
        above, below = (seen - (self.lower or 0.0)), ((self.upper or 0.0) - seen)
        if self.lower is None or self.upper is None:
            return below if self.lower is None else above
        return np.maximum(above, below) if self.upper < self.lower else np.minimum(above, below)

    def at_end(self) -> Self:
        """Return the curve with limits that hold at the end only."""
        return replace(self, start=math.inf)

    def contrary(self) -> Self:
        """Return the curve of the negated assertion: lower and upper limit change places."""
        return replace(self, lower=_opposite(self.upper, self.unit), upper=_opposite(self.lower, self.unit))

    def within(self, start: float, end: float) -> Self:
        """Return the curve with limits that hold from `start` to `end` in s; limits for the end hold at `end`."""
        start = max(start, min(self.start, end))
        return replace(self, start=start, end=max(start, min(end, self.end)))


def _opposite(limit: float | None, unit: str) -> float | None:
    return 1.0 - limit if limit is not None and unit == "contacts" else limit


_HALF_LENGTH_M: Final = 5.0  # half the drawn length of an infinite line, in m


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle on the ground plane, or at the height `z`."""

    x: float
    y: float
    radius: float
    z: float = 0.0
    link: str = ""


@dataclass(frozen=True, slots=True)
class Polygon:
    """An area of the ground plane, given by its corners."""

    points: tuple[tuple[float, float], ...]
    link: str = ""


@dataclass(frozen=True, slots=True)
class Polyline:
    """A path from point to point.

    Attributes:
        tolerance: the distance from it that is allowed, in m.
        is_aside: True if a view need not show all of it.
    """

    points: tuple[tuple[float, float, float], ...]
    link: str = ""
    tolerance: float = 0.0
    is_aside: bool = False


@dataclass(frozen=True, slots=True)
class Arrow:
    """A heading at a place on the ground plane: `yaw` in rad about the z axis; `tolerance` in rad to both sides."""

    x: float
    y: float
    yaw: float
    link: str = ""
    tolerance: float = 0.0


Mark: TypeAlias = Circle | Polygon | Polyline | Arrow
"""A place in the 3-D view: in the world frame, or in the frame of `link`, with which it moves."""


def rectangle(x: tuple[float, float], y: tuple[float, float]) -> Polygon:
    """Return the area between two bounds for x and two for y."""
    return Polygon(((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])))


def outline(x: tuple[float, float], y: tuple[float, float], z: float) -> Polyline:
    """Return the outline of the area between two bounds for x and two for y, at a height."""
    corners = rectangle(x, y).points
    return Polyline(tuple((at_x, at_y, z) for at_x, at_y in (*corners, corners[0])))


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Iterator[Polyline]:
    """Yield the edges of a box between two bounds for each axis."""
    yield from (outline(x, y, height) for height in z)
    yield from (Polyline(((*corner, z[0]), (*corner, z[1]))) for corner in rectangle(x, y).points)


def line(axis: str, at: float, middle_xy: tuple[float, float]) -> Polyline:
    """Return the line of all places with one x, or one y; it is drawn for some metres around `middle_xy`."""
    x, y = middle_xy
    if axis == "x":
        return Polyline(((at, y - _HALF_LENGTH_M, 0.0), (at, y + _HALF_LENGTH_M, 0.0)))
    return Polyline(((x - _HALF_LENGTH_M, at, 0.0), (x + _HALF_LENGTH_M, at, 0.0)))


_AXIS_M: Final = 0.1  # the drawn length of an axis, in m


def goal(
    x: float,
    y: float,
    z: float | None,
    tolerance: float,
    facing: float | Quaternion | None = None,
    *,
    angle_tolerance: float = 0.0,
) -> Iterator[Mark]:
    """Yield the marks of a goal: circle, and yaw within `angle_tolerance` in rad, or x and z axis."""
    height = z or 0.0
    yield Circle(x, y, tolerance, height)
    if isinstance(facing, tuple):
        for axis in (AXES[0], AXES[2]):
            dx, dy, dz = rotate(facing, axis)
            yield Polyline(((x, y, height), (x + _AXIS_M * dx, y + _AXIS_M * dy, height + _AXIS_M * dz)))
    elif facing is not None and math.isfinite(facing):
        yield Arrow(x, y, facing, tolerance=angle_tolerance)
