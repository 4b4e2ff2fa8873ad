"""Where a body of the world was over time: the part of a trace that is its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core.units import TIME_EPSILON

FRAME_RATE: Final = 30.0
"""Hz: how often bodies are looked at, and a replay shows them."""


def frame_stride(rate: float) -> int:
    """Physics steps at `rate` Hz from one look to the next."""
    return max(1, round(rate / FRAME_RATE))


@dataclass(frozen=True, eq=False)
class BodyRecord:
    """The poses of one body in the world frame, at N moments, 30 a second.

    Attributes:
        time: (N,) s, rising.
        position_xyz: (N, 3) m, of its frame's origin, as `pose` in its scenario.
        orientation_xyzw: (N, 4) unit quaternions.
    """

    time: NDArray[np.float64]
    position_xyz: NDArray[np.float64]
    orientation_xyzw: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Records of the same body, one after the other."""
        return cls(
            np.concatenate([record.time for record in records]),
            np.concatenate([record.position_xyz for record in records]),
            np.concatenate([record.orientation_xyzw for record in records]),
        )

    def between(self, start: float, end: float) -> Self:
        """The moments with start <= time <= end."""
        first, last = np.searchsorted(self.time, (start - TIME_EPSILON, end + TIME_EPSILON))
        return self.rows(slice(int(first), int(last)))

    def rows(self, wanted: slice | NDArray[np.intp]) -> Self:
        """Some of the moments."""
        return type(self)(self.time[wanted], self.position_xyz[wanted], self.orientation_xyzw[wanted])

    @property
    def is_whole(self) -> bool:
        """Whether its columns fit each other."""
        count = len(self.time)
        shapes = (self.time.shape, self.position_xyz.shape, self.orientation_xyzw.shape)
        return shapes == ((count,), (count, 3), (count, 4))
