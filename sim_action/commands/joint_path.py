"""How a number moves through knots over time: along straight lines, smoothly, or in steps."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

Interpolation = Literal["linear", "minimum_jerk", "hold"]


@dataclass(frozen=True, slots=True)
class Blend:
    """The way from one knot to the next.

    Attributes:
        share: of the way, after a share of the time; both in [0, 1).
        peak: greatest speed, as a multiple of the mean speed; None where it jumps.
    """

    share: Callable[[float], float]
    peak: float | None

    @property
    def jumps(self) -> bool:
        """Whether it is a step, which no joint can follow."""
        return self.peak is None


def _minimum_jerk(share: float) -> float:
    """Of all ways from rest to rest the one with the least squared jerk (Flash and Hogan 1985)."""
    return share**3 * (10 + share * (6 * share - 15))


BLENDS: Final = MappingProxyType[Interpolation, Blend](
    {
        "linear": Blend(lambda share: share, 1.0),
        "minimum_jerk": Blend(_minimum_jerk, 1.875),
        "hold": Blend(lambda _: 0.0, None),
    }
)


@dataclass(frozen=True, slots=True)
class JointPath:
    """A number over time, through all of its knots; before the first and after the last, it is as there.

    Attributes:
        times: of the knots, in s, rising.
        values: at the knots.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    blend: Blend

    def value(self, time: float) -> float:
        """The number at a time in s."""
        after = bisect_right(self.times, time)
        if after == 0:
            return self.values[0]
        before = after - 1
        if after == len(self.times):
            return self.values[before]
        start, value = self.times[before], self.values[before]
        share = (time - start) / (self.times[after] - start)
        return value + (self.values[after] - value) * self.blend.share(share)
