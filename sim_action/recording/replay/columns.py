"""Columns of numbers in a replay: differences in whole steps from moment to moment, which compress well."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_action.core.field_types import FrozenModel

FloatArray = NDArray[np.float64]
MAX_MOMENTS: Final = 20_000  # The largest number of moments: eleven minutes at 30 Hz. Longer runs have a lower rate.
_MAX_STEPS: Final = 2**50  # sums and differences of such numbers are exact in JavaScript, whose numbers have 53 bits
_MAX_MOTION_SCALE: Final = 1.0  # a motion is stored in steps of at most 1 mm or 1 mrad
_MAX_TIME_S: Final = 1e9  # Thirty years. Between much larger times a computer knows no fractions of a second.
Steps = Annotated[int, Field(ge=-(2**53), le=2**53)]
Index = Annotated[int, Field(ge=0, le=1_000_000)]
Scale = Annotated[float, Field(gt=0, le=1e300, allow_inf_nan=False)]


class Column(FrozenModel):
    """One number over N moments: value i is `scale * (first + the sum of deltas up to i)`."""

    scale: Scale  # the size of a step in the unit of the column
    first: Steps  # the first value in steps
    # the N - 1 differences in steps; empty if the value never changes
    deltas: Annotated[tuple[Steps, ...], Field(max_length=MAX_MOMENTS)] = ()
    # (first moment, number of moments) without a value; the deltas continue there
    gaps: Annotated[tuple[tuple[Index, Index], ...], Field(max_length=MAX_MOMENTS)] = ()

    @classmethod
    def encoded(cls, values: FloatArray, scale: float) -> Column:
        """Return the column of values (N,), rounded to steps; values that are not finite become gaps."""
        measured = np.isfinite(values)
        steps = _steps(values, measured, scale)
        deltas = steps[1:] - steps[:-1]
        return cls.model_construct(
            scale=scale,
            first=int(steps[0]),
            deltas=tuple(deltas.tolist()) if deltas.any() else (),
            gaps=() if measured.all() else _runs(~measured),
        )

    def decoded(self, count: int) -> FloatArray:
        """Return the values (N,) of `count` moments, NaN in gaps."""
        return _decoded(self, np.array(self.deltas, dtype=np.int64), count)

    def fits(self, count: int) -> bool:
        """Return True if the column is valid for `count` moments."""
        return len(self.deltas) in {0, count - 1} and _are_within(self.gaps, count)

    @property
    def rises(self) -> bool:
        """True if these can be times in s: each is later than the one before, and the last one is a time."""
        end = self.scale * (abs(self.first) + sum(self.deltas))
        return not self.gaps and end <= _MAX_TIME_S and min(self.deltas, default=1) > 0

    @property
    def is_motion(self) -> bool:
        """True if there is a value at each moment, and none is beyond what can be computed with."""
        return not self.gaps and self.scale <= _MAX_MOTION_SCALE


_FIRST_CHARACTER: Final = 0x20  # the first character of a text of differences; JSON escapes those before it
MAX_DELTA: Final = 20_000  # the largest difference in a `TextColumn`; with `fine_scale` no difference is larger


class TextColumn(FrozenModel):
    """One number over N moments, as a `Column`, but with its differences as text: a report carries it unread."""

    scale: Scale  # the size of a step in the unit of the column
    first: Steps  # the first value in steps
    # the N - 1 differences in steps, one character each: U+0020 and on stand for 0, -1, 1, -2, 2 and so on; empty if
    # the value never changes
    deltas: Annotated[str, Field(max_length=MAX_MOMENTS)] = ""
    # (first moment, number of moments) without a value; the deltas continue there
    gaps: Annotated[tuple[tuple[Index, Index], ...], Field(max_length=MAX_MOMENTS)] = ()

    @classmethod
    def encoded(cls, values: FloatArray, scale: float) -> TextColumn:
        """Return the column of values (N,), with differences cut at `MAX_DELTA` steps, and gaps where not finite."""
        measured = np.isfinite(values)
        steps = _steps(values, measured, scale)
        deltas = np.minimum(np.maximum(steps[1:] - steps[:-1], -MAX_DELTA), MAX_DELTA)
        codes = np.where(deltas < 0, -2 * deltas - 1, 2 * deltas) + _FIRST_CHARACTER
        return cls.model_construct(
            scale=scale,
            first=int(steps[0]),
            deltas=codes.astype("<u2").tobytes().decode("utf-16-le") if deltas.any() else "",
            gaps=() if measured.all() else _runs(~measured),
        )

    @property
    def count(self) -> int:
        """The number of moments, if the value changes."""
        return 1 + len(self.deltas)

    def decoded(self, count: int) -> FloatArray:
        """Return the values (N,) of `count` moments, NaN in gaps."""
        codes = np.frombuffer(self.deltas.encode("utf-32-le"), dtype="<u4").astype(np.int64) - _FIRST_CHARACTER
        deltas = np.where(codes % 2 == 1, -(codes + 1) // 2, codes // 2)
        return _decoded(self, deltas, count)

    def fits(self, count: int) -> bool:
        """Return True if the column is valid for `count` moments."""
        return len(self.deltas) in {0, count - 1} and _are_within(self.gaps, count)

    @property
    def rises(self) -> bool:
        """True if each value is larger than the one before."""
        return not self.gaps and all(ord(code) > _FIRST_CHARACTER and ord(code) % 2 == 0 for code in set(self.deltas))


def steady(orientation_xyzw: FloatArray) -> FloatArray:
    """Return equivalent quaternions (N, 4) without sign changes between successive rows."""
    dots = np.einsum("ij,ij->i", orientation_xyzw[1:], orientation_xyzw[:-1])
    signs = np.cumprod(np.concatenate(([1.0], np.where(dots < 0, -1.0, 1.0))))
    return orientation_xyzw * signs[:, None]


def poses_at(
    time: FloatArray, sample_time: FloatArray, position_xyz: FloatArray, orientation_xyzw: FloatArray
) -> FloatArray:
    """Return poses (T, 7) at some times, interpolated linearly between those at the sample times (N,)."""
    rows = np.column_stack((position_xyz, steady(orientation_xyzw)))
    poses = np.column_stack([np.interp(time, sample_time, column) for column in rows.T])
    poses[:, 3:] /= np.maximum(np.linalg.norm(poses[:, 3:], axis=1, keepdims=True), 1e-12)
    return poses


def fine_scale(values: FloatArray) -> float:
    """Return a power of ten that divides the range of the values into at least 2,000 steps."""
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if len(finite) else 0.0
    reach = span or (float(np.abs(finite).max()) if len(finite) else 0.0)
    if not 1e-200 < reach < 1e200:
        return 1e-6
    return float(10.0 ** math.floor(math.log10(reach / 2_000)))


def _steps(values: FloatArray, measured: NDArray[np.bool_], scale: float) -> NDArray[np.int64]:
    """Return the values in steps; a gap repeats the value before it."""
    if measured.all():
        most = _MAX_STEPS * scale
        # For few values a call of `clip` or `diff` takes longer than all of this.
        return np.rint(np.minimum(np.maximum(values, -most), most) / scale).astype(np.int64)
    # A gap at the beginning repeats the first value.
    first = int(np.argmax(measured))
    rows = np.maximum.accumulate(np.where(measured, np.arange(len(values)), first))
    return _steps(np.where(measured[rows], values[rows], 0.0), np.ones_like(measured), scale)


def _decoded(column: Column | TextColumn, deltas: NDArray[np.int64], count: int) -> FloatArray:
    steps = np.full(count, column.first, dtype=np.int64)
    if len(deltas):
        steps[1:] += np.cumsum(deltas)
    values = column.scale * steps.astype(np.float64)
    for start, length in column.gaps:
        values[start : start + length] = math.nan
    return values


def _are_within(gaps: Sequence[tuple[int, int]], count: int) -> bool:
    return all(start + length <= count for start, length in gaps) and sum(length for _, length in gaps) <= count


def _runs(flags: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    return tuple(zip(starts.tolist(), (ends - starts).tolist(), strict=True))
