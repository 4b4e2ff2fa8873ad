"""Columns of numbers as a replay stores them: whole steps from one moment to the next, which pack well."""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_action.core.field_types import FrozenModel

FloatArray = NDArray[np.float64]

MAX_MOMENTS: Final = 20_000
"""Of a column: eleven minutes at 30 Hz; what lasts longer has its moments further apart."""

# Sums and differences of these are exact in JavaScript, whose numbers have 53 bits.
_FARTHEST: Final = 2**50

Steps = Annotated[int, Field(ge=-(2**53), le=2**53)]
Index = Annotated[int, Field(ge=0, le=1_000_000)]
Scale = Annotated[float, Field(gt=0, le=1e300, allow_inf_nan=False)]


class Column(FrozenModel):
    """One number over N moments: value i is `scale * (first + the sum of deltas up to i)`.

    Attributes:
        scale: the unit of the column in a step.
        first: the first value, in steps.
        deltas: N - 1 of them, in steps; left out: it never changes.
        gaps: (first moment, how many) where there is no value; the deltas go on there.
    """

    scale: Scale
    first: Steps
    deltas: Annotated[tuple[Steps, ...], Field(max_length=MAX_MOMENTS)] = ()
    gaps: Annotated[tuple[tuple[Index, Index], ...], Field(max_length=MAX_MOMENTS)] = ()

    @classmethod
    def encoded(cls, values: FloatArray, scale: float) -> Column:
        """A column of values (N,), to the nearest step; what is not finite becomes a gap."""
        there = np.isfinite(values)
        steps = _steps(values, there, scale)
        deltas = np.diff(steps)
        return cls.model_construct(
            scale=scale,
            first=int(steps[0]),
            deltas=tuple(deltas.tolist()) if deltas.any() else (),
            gaps=() if there.all() else _runs(~there),
        )

    def decoded(self, count: int) -> FloatArray:
        """The values (N,) of `count` moments, NaN in gaps."""
        steps = np.full(count, self.first, dtype=np.int64)
        if self.deltas:
            steps[1:] += np.cumsum(np.array(self.deltas, dtype=np.int64))
        values = self.scale * steps.astype(np.float64)
        for start, length in self.gaps:
            values[start : start + length] = math.nan
        return values

    def fits(self, count: int) -> bool:
        """Whether it is a column of `count` moments."""
        in_range = all(start + length <= count for start, length in self.gaps)
        return in_range and len(self.deltas) in {0, count - 1}


def fine_scale(values: FloatArray) -> float:
    """A power of ten that tells at least 2,000 steps apart from the least of the values to the largest."""
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if len(finite) else 0.0
    reach = span or (float(np.abs(finite).max()) if len(finite) else 0.0)
    if not 1e-200 < reach < 1e200:
        return 1e-6
    return float(10.0 ** math.floor(math.log10(reach / 2_000)))


def _steps(values: FloatArray, there: NDArray[np.bool_], scale: float) -> NDArray[np.int64]:
    """In steps; in a gap, as before it."""
    if there.all():
        most = _FARTHEST * scale
        return np.rint(np.clip(values, -most, most) / scale).astype(np.int64)
    # The first gap stands as the first value does.
    first = int(np.argmax(there))
    rows = np.maximum.accumulate(np.where(there, np.arange(len(values)), first))
    return _steps(np.where(there[rows], values[rows], 0.0), np.ones_like(there), scale)


def _runs(flags: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """First moment and length of each run of true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    return tuple(zip(starts.tolist(), (ends - starts).tolist(), strict=True))
