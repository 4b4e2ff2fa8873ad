"""Position targets of joints as functions of time: piecewise polynomials that the servos follow step by step.

A source of commands answers with a motion once, for as long as it is known: `JointTargets(motions=(motion,))`. The loop
computes from it a target for each physics step, until the source names the joints again. Ways to make one:

- Rows of a log, or points of a trajectory: `JointMotion.through(names, times, positions, velocities, accelerations)`.
- Curves with other knots for each joint: `JointMotion.of({joint: Curve})`, from `straight`, `held` or `Curve.through`.

Times are sim times in s, values rad and rad/s (m and m/s). Before its first knot, a joint rests at the first position,
and after its last one at the last position. What should be a step is a jump of the curve, as `held` makes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, Final, Self

from sim_action.core.geometry import number
from sim_action.core.lazy_numpy import ArrayLike, FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S

RAMP_S: Final = 0.02
"""The time in s in which a straight motion changes its speed at a point; less where points are closer together."""

# A jump of a curve that is greater than this, in rad or m, is a step of the target; a smaller one is rounding.
_STEP: Final = 1e-6

# Points that differ from regular times by less than this in s, and than this share of a period, may have jitter.
_JITTER_S: Final = 5e-3
_JITTER_SHARE: Final = 0.45
_LEAST_REGULAR: Final = 10
_SMOOTHER: Final = 0.9  # jitter roughens a motion: without it, changes of the velocity add up to less than this share
_QUINTIC: Final = 6  # the number of coefficients of a polynomial


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A number over time: polynomials between knots, constant before the first knot and after the last one."""

    times: FloatArray  # (K,) s, rising
    coefficients: FloatArray  # (K, 6) the polynomial from each knot on, in ascending powers of the time since the knot
    # start and end in s of pieces that stand for a step, such as one between two rows of a log
    sudden: tuple[tuple[float, float], ...] = ()

    @classmethod
    def through(
        cls,
        times: ArrayLike,
        values: ArrayLike,
        velocities: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
    ) -> Self:
        """Return a smooth curve through points (K,), without overshoot where velocities are unknown: None or NaN."""
        at, value = _numbers(times), _numbers(values)
        speed = np.full(len(at), np.nan) if velocities is None else _numbers(velocities).copy()
        if (unknown := np.isnan(speed)).any():
            speed[unknown] = _slopes(at, value)[unknown]
        span = np.diff(at)
        way, v0, v1 = np.diff(value), speed[:-1] * span, speed[1:] * span
        pieces = np.zeros((len(at), _QUINTIC))
        pieces[:, 0], pieces[:-1, 1] = value, v0
        if accelerations is None:
            pieces[:-1, 2], pieces[:-1, 3] = 3 * way - 2 * v0 - v1, v0 + v1 - 2 * way
        else:
            bend = _numbers(accelerations)
            a0, a1 = bend[:-1] * span**2, bend[1:] * span**2
            pieces[:-1, 2] = a0 / 2
            pieces[:-1, 3] = 10 * way - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
            pieces[:-1, 4] = -15 * way + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
            pieces[:-1, 5] = 6 * way - 3 * (v0 + v1) - 0.5 * (a0 - a1)
        pieces[:-1, 1:] /= span[:, None] ** np.arange(1, _QUINTIC)
        return cls(at, pieces)

    def scaled(self, factor: float, about: float) -> Self:
        """Return the curve with all distances from a value multiplied."""
        pieces = factor * self.coefficients
        pieces[:, 0] += (1 - factor) * about
        return replace(self, coefficients=pieces)

    @property
    def jumps(self) -> FloatArray:
        """(K - 1,) True where the curve jumps to the value at the next knot."""
        powers = np.diff(self.times)[:, None] ** np.arange(_QUINTIC)
        ends = (self.coefficients[:-1] * powers).sum(axis=1)
        return np.asarray(np.abs(self.coefficients[1:, 0] - ends) > _STEP)

    def samples(self) -> FloatArray:
        """Return the times of all knots, and of points between them that show how far a piece overshoots."""
        between = self.times[:-1, None] + np.diff(self.times)[:, None] * np.arange(8) / 8
        return np.append(between, self.times[-1])

    def at(self, time: float) -> tuple[float, float, float]:
        """Return the value, its velocity and its acceleration at a time in s."""
        value, velocity, acceleration = self.states(np.array([time]))
        return float(value[0]), float(velocity[0]), float(acceleration[0])

    def states(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the values (T,), their velocities and their accelerations at times in s."""
        piece = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, None)
        since = np.maximum(times - self.times[piece], 0.0)
        moving = np.where(times < self.times[0], 0.0, 1.0)
        powers = self.coefficients[piece].T
        value, velocity, acceleration = (np.zeros_like(since) for _ in range(3))
        for power in range(_QUINTIC - 1, -1, -1):
            acceleration = acceleration * since + 2 * velocity
            velocity = velocity * since + value
            value = value * since + powers[power]
        return value, velocity * moving, acceleration * moving


def regular(times: FloatArray, values: FloatArray) -> FloatArray:
    """Return the times (K,) of points without the jitter of their recording, if the motion is smoother then."""
    if len(times) < _LEAST_REGULAR:
        return times
    period, first = float(np.median(np.diff(times))), float(times[0])
    count = np.cumsum(np.round(np.diff(times, prepend=first) / period))
    # The second time, errors of the first period do not add up.
    for _ in range(2):
        about = count - count.mean()
        period = float(about @ times / (about @ about))
        first = float(times.mean() - period * count.mean())
        count = np.round((times - first) / period)
    even = first + period * count
    if (np.diff(count) < 1).any() or np.abs(even - times).max() > min(_JITTER_S, _JITTER_SHARE * period):
        return times
    before, after = (np.abs(np.diff(np.diff(values) / np.diff(at))).sum() for at in (times, even))
    return even if after < _SMOOTHER * before else times


def held(times: ArrayLike, values: ArrayLike) -> Curve:
    """Return the curve (K,) that jumps to each value at its time."""
    pieces = np.zeros((len(_numbers(times)), _QUINTIC))
    pieces[:, 0] = _numbers(values)
    return Curve(_numbers(times), pieces)


def resting(times: ArrayLike, values: ArrayLike) -> Curve:
    """Return the curve of minimum jerk that comes to rest at each point (K,)."""
    still = np.zeros(len(_numbers(times)))
    return Curve.through(times, values, still, still)


def straight(times: ArrayLike, values: ArrayLike, first: float = 0.0, last: float = 0.0) -> Curve:
    """Return the curve through points (K,) with a constant speed between them, but for a short ramp at each point.

    At a point between two ways in the same direction, it has the lower of their two speeds, else it rests there.
    `first`: the velocity at the first point; `last`: the velocity before the last point.
    """
    at, value = _numbers(times), _numbers(values)
    span = np.diff(at)
    mean = np.diff(value) / span
    least = np.minimum(np.abs(mean[:-1]), np.abs(mean[1:]))
    through = np.where(mean[:-1] * mean[1:] > 0, np.sign(mean[1:]) * least, 0.0)
    speeds = np.concatenate(([first], through, [last]))
    ramp = np.minimum(RAMP_S, span / 2)
    cruise = (mean * span - ramp * (speeds[:-1] + speeds[1:]) / 2) / (span - ramp)
    pieces = np.zeros((3 * len(span) + 1, _QUINTIC))
    pieces[:-1:3, 0], pieces[:-1:3, 1], pieces[:-1:3, 2] = value[:-1], speeds[:-1], (cruise - speeds[:-1]) / ramp / 2
    pieces[1::3, 0], pieces[1::3, 1] = value[:-1] + ramp * (speeds[:-1] + cruise) / 2, cruise
    pieces[2::3, 0], pieces[2::3, 1] = value[1:] - ramp * (speeds[1:] + cruise) / 2, cruise
    pieces[2::3, 2], pieces[-1, 0] = (speeds[1:] - cruise) / ramp / 2, value[-1]
    knots = np.repeat(at, 3)[:-2]
    knots[1::3] += ramp
    knots[2::3] = at[1:] - ramp
    return Curve(knots, pieces)


@dataclass(frozen=True, eq=False)
class JointMotion:
    """The motion of the position targets of joints."""

    names: tuple[str, ...]  # of the J joints
    curves: tuple[Curve, ...]  # one for each joint
    lower: tuple[float, ...] = ()  # lower, upper: limits of the targets; empty: no limits
    upper: tuple[float, ...] = ()

    @classmethod
    def of(cls, curves: Mapping[str, Curve]) -> Self:
        """Return the motion along a curve for each joint."""
        return cls(tuple(curves), tuple(curves.values()))

    @classmethod
    def through(
        cls,
        names: Iterable[str],
        times: ArrayLike,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
    ) -> Self:
        """Return the motion through (K, J) rows at times (K,) in s; see `Curve.through`. Raises ValueError."""
        joints = tuple(names)
        at = _numbers(times)
        tables: list[Any] = [
            None if table is None else _numbers(table) for table in (positions, velocities, accelerations)
        ]
        for table in tables:
            if table is not None and table.shape != (len(at), len(joints)):
                raise ValueError(f"a table has the shape {table.shape}, not {len(at)} rows of {len(joints)} joints")
        if not len(at) or not np.isfinite(at).all() or (np.diff(at) <= 0).any():
            raise ValueError("a motion needs at least one row, and times that rise")
        if not np.isfinite(tables[0]).all() or (tables[2] is not None and not np.isfinite(tables[2]).all()):
            raise ValueError("a motion needs finite positions and accelerations")
        if tables[1] is not None and np.isinf(tables[1]).any():
            raise ValueError("a velocity of a motion is infinite; write NaN for one that is not known")
        position, *more = tables
        curves = (
            Curve.through(at, position[:, j], *(None if table is None else table[:, j] for table in more))
            for j in range(len(joints))
        )
        return cls(joints, tuple(curves))

    @property
    def end(self) -> float:
        """The time in s from which all joints rest."""
        return max(float(curve.times[-1]) for curve in self.curves)

    @cached_property
    def extremes(self) -> tuple[dict[str, float], dict[str, float]]:
        """The least and the greatest position of each joint."""
        values = [curve.states(curve.samples())[0] for curve in self.curves]
        least, greatest = ([float(of(positions)) for positions in values] for of in (np.min, np.max))
        return dict(zip(self.names, least, strict=True)), dict(zip(self.names, greatest, strict=True))

    def only(self, names: Iterable[str]) -> Self:
        """Return the motion of some of its joints, in its order."""
        kept_names = set(names)
        if kept_names.issuperset(self.names):
            return self
        kept = [index for index, name in enumerate(self.names) if name in kept_names]

        def chosen(values: Sequence[float]) -> tuple[float, ...]:
            return tuple(values[index] for index in kept) if values else ()

        curves = tuple(self.curves[index] for index in kept)
        return replace(
            self,
            names=tuple(self.names[index] for index in kept),
            curves=curves,
            lower=chosen(self.lower),
            upper=chosen(self.upper),
        )

    def targets(self, times: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions (T, J) and velocities (T, J) for T physics steps, and (T, J) where a jump led to a position.

        A servo that gets both follows the motion without lag: the position is that at the start of a step, and the
        velocity the mean until its end. `times`: (T + 1,) the start of each step, and the end of the last one, in s;
        `step_s`: the duration of a step in s.
        """
        knots, first, coefficients, jumps = self._table
        at = [np.maximum(np.searchsorted(knot, times + TIME_EPSILON_S, side="right") - 1, 0) for knot in knots]
        pieces = np.stack(at, axis=1) + first
        since = np.maximum(times[:, None] - np.stack([knot[k] for knot, k in zip(knots, at, strict=True)], axis=1), 0.0)
        polynomials = coefficients[pieces]
        values = polynomials[:, :, -1]
        for power in range(_QUINTIC - 2, -1, -1):
            values = values * since + polynomials[:, :, power]
        if self.lower:
            values = np.clip(values, self.lower, self.upper)
        stepped = np.diff(jumps[pieces], axis=0) > 0
        speeds = np.where(stepped, 0.0, np.diff(values, axis=0) / step_s)
        return values[:-1], speeds, np.vstack((np.zeros_like(stepped[:1]), stepped[:-1]))

    @cached_property
    def _table(self) -> tuple[list[FloatArray], FloatArray, FloatArray, FloatArray]:
        """The knots of each joint, its first row among all pieces, all pieces, and the jumps up to each of them."""
        counts = [len(curve.times) for curve in self.curves]
        jumps = [np.concatenate(([0], np.cumsum(curve.jumps))) for curve in self.curves]
        pieces = np.concatenate([curve.coefficients for curve in self.curves])
        return [curve.times for curve in self.curves], np.cumsum([0, *counts[:-1]]), pieces, np.concatenate(jumps)

    def __deepcopy__(self, _: object) -> Self:
        """Return the motion itself, which nothing changes."""
        return self


def _numbers(values: ArrayLike) -> FloatArray:
    if getattr(values, "dtype", None) != np.float64:
        for value in np.asarray(values, dtype=np.object_).flat:
            number(value)
    return np.asarray(values, dtype=np.float64)


def _slopes(times: FloatArray, values: FloatArray) -> FloatArray:
    """Return the velocities (K,) of the natural cubic spline, limited where it would overshoot a jump of the values."""
    span = np.diff(times)
    count = len(times)
    if count < 3:
        return np.zeros(count)
    mean = np.diff(values) / span
    # The tridiagonal equations of the spline, from the first row to the last one.
    above, right = [0.5], [1.5 * mean[0]]
    for k in range(1, count - 1):
        h0, h1 = span[k - 1], span[k]
        pivot = 2 * (h0 + h1) - h1 * above[-1]
        above.append(h0 / pivot)
        right.append((3 * (h1 * mean[k - 1] + h0 * mean[k]) - h1 * right[-1]) / pivot)
    slopes = np.empty(count)
    slopes[-1] = (3 * mean[-1] - right[-1]) / (2 - above[-1])
    for k in range(count - 2, -1, -1):
        slopes[k] = right[k] - above[k] * slopes[k + 1]
    # No more than three times the lower slope on both sides, except near a smooth extremum.
    bend = np.diff(mean) / (span[:-1] + span[1:]) * 2
    same = np.where(bend[:-1] * bend[1:] > 0, np.minimum(np.abs(bend[:-1]), np.abs(bend[1:])), 0.0)
    smooth = np.maximum(np.concatenate(([0.0], same)), np.concatenate((same, [0.0]))) if count > 3 else np.zeros(1)
    lower = np.where(mean[:-1] * mean[1:] > 0, np.minimum(np.abs(mean[:-1]), np.abs(mean[1:])), 0.0)
    most = np.maximum(3 * lower, 1.5 * np.maximum(span[:-1], span[1:]) * smooth)
    limited = np.clip(slopes[1:-1], -most, most)
    # The ends bend as in a spline through the limited slopes, so that a jump does not shake the first and last rows.
    slopes[[0, -1]] += (slopes[[1, -2]] - limited[[0, -1]]) / 2
    slopes[1:-1] = limited
    return slopes
