"""The twists that a base was told, and when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Twist


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

    @classmethod
    def of(cls, told: Sequence[tuple[float, Twist]]) -> Self:
        """From times in s and twists."""
        values = [[*twist.linear_xyz, *twist.angular_xyz] for _, twist in told]
        return cls(np.array([time for time, _ in told]), np.array(values).reshape(-1, 6))

    def __len__(self) -> int:
        return len(self.time)
