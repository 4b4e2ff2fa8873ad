"""What an expectation looked at over time, with its limits: the curves that reports draw."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from numpy.typing import NDArray


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
