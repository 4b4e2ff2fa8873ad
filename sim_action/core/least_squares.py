"""Damped least squares on plain floats. Sums of products are rounded once, so every machine has the same result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul
from typing import Final

# The least square of a diagonal element, as a share of the damping: rounding may make it negative.
_LEAST_SHARE: Final = 1e-12


def damped_least_squares(columns: Sequence[Sequence[float]], error: Sequence[float], damping: float) -> list[float]:
    """Return x with the least |J x - e|^2 + damping |x|^2; `columns` are those of J.

    It is J' (J J' + damping)^-1 e, by the Cholesky decomposition of the matrix in brackets.
    """
    rows = list(zip(*columns, strict=True)) if columns else [()] * len(error)
    factor: list[list[float]] = []
    solved: list[float] = []
    for index, row in enumerate(rows):
        parts: list[float] = []
        for above, other in zip(factor, rows, strict=False):
            total = math.fsum(map(mul, row, other)) - math.fsum(map(mul, parts, above))
            parts.append(total / above[-1])
        total = math.fsum(map(mul, row, row)) + damping - math.fsum(map(mul, parts, parts))
        parts.append(math.sqrt(max(total, _LEAST_SHARE * damping)))
        factor.append(parts)
        solved.append((error[index] - math.fsum(map(mul, parts, solved))) / parts[-1])
    for index in reversed(range(len(rows))):
        below = [factor[row][index] for row in range(index + 1, len(rows))]
        solved[index] = (solved[index] - math.fsum(map(mul, below, solved[index + 1 :]))) / factor[index][index]
    return [math.fsum(map(mul, column, solved)) for column in columns]


def square_sum(parts: Sequence[float]) -> float:
    """Return the sum of the squares."""
    return math.fsum(map(mul, parts, parts))
