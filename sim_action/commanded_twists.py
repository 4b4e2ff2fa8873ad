"""The twists that a base was told, and when."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


def _none(width: int) -> NDArray[np.float64]:
    return np.empty((0, width))


@dataclass(frozen=True, eq=False)
class CommandedTwists:
    """N commands, in the order in which they were given.

    Attributes:
        time: (N,) s, rising.
        values: (N, 6) linear x, y, z in m/s and angular x, y, z in rad/s, in the frame of the base.
    """

    time: NDArray[np.float64] = field(default_factory=lambda: _none(1)[:, 0])
    values: NDArray[np.float64] = field(default_factory=lambda: _none(6))

    def __len__(self) -> int:
        return len(self.time)
