"""How near the robot came to bodies of the world, as columns: the part of a trace that belongs to one watch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core.units import TIME_EPSILON


class Nearness(NamedTuple):
    """How near something is: sim time in s, distance in m (negative inside), and what is nearest to what."""

    time: float
    distance: float
    link: str
    body: str


@dataclass(frozen=True, eq=False)
class ClearanceRecord:
    """Distances at N moments: at every step that came nearer than any before, or at all of them.

    Attributes:
        pairs: (link, body) that were nearest to each other at some moment.
        time: (N,) s, rising.
        distance: (N,) m, negative inside of each other.
        pair: (N,) which of `pairs` it was.
    """

    pairs: tuple[tuple[str, str], ...]
    time: NDArray[np.float64]
    distance: NDArray[np.float64]
    pair: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of(cls, found: Sequence[Nearness]) -> Self:
        """The record of these moments."""
        pairs = tuple(dict.fromkeys((one.link, one.body) for one in found))
        numbers = {pair: number for number, pair in enumerate(pairs)}
        return cls(
            pairs,
            np.array([one.time for one in found], dtype=np.float64),
            np.array([one.distance for one in found], dtype=np.float64),
            np.array([numbers[one.link, one.body] for one in found], dtype=np.int64),
        )

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Records of the same watch, one after the other."""
        pairs = tuple(dict.fromkeys(pair for record in records for pair in record.pairs))
        places = [np.array([pairs.index(pair) for pair in record.pairs], dtype=np.int64) for record in records]
        return cls(
            pairs,
            np.concatenate([record.time for record in records]),
            np.concatenate([record.distance for record in records]),
            np.concatenate([place[record.pair] for place, record in zip(places, records, strict=True)]),
        )

    def between(self, start: float, end: float) -> Self:
        """The moments with start <= time <= end."""
        first, last = np.searchsorted(self.time, (start - TIME_EPSILON, end + TIME_EPSILON))
        wanted = slice(int(first), int(last))
        return type(self)(self.pairs, self.time[wanted], self.distance[wanted], self.pair[wanted])

    @property
    def is_whole(self) -> bool:
        """Whether its columns fit each other."""
        shapes = {self.time.shape, self.distance.shape, self.pair.shape}
        return shapes == {(len(self.time),)} and bool(((self.pair >= 0) & (self.pair < len(self.pairs))).all())

    def at(self, index: int) -> Nearness:
        """One of the moments."""
        return Nearness(float(self.time[index]), float(self.distance[index]), *self.pairs[int(self.pair[index])])
