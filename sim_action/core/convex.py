"""The distance between two convex bodies, each given as the convex hull of points.

The difference of two convex bodies is convex, and its point nearest to the origin is as far away as the bodies are
apart. It is found by Wolfe's algorithm (1976), which moves from one small simplex of extreme points to the next.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

_FloatArray = NDArray[np.float64]
_MAX_ROUNDS: Final = 64
# Relative to the size of the bodies.
_ROUNDING: Final = 1e-12
_MIN_WEIGHT: Final = 1e-12


def hull_distance(one: _FloatArray, other: _FloatArray, enough: float = math.inf) -> float:
    """Return the distance in m of the hulls of points (P, 3) and (Q, 3), 0 if they overlap; exact up to `enough`."""
    corners = (one[0] - other[0])[None]
    weights = np.ones(1)
    scale = max(float(np.ptp(one, axis=0).max()), float(np.ptp(other, axis=0).max()), float(np.abs(corners).max()))
    nearest = corners[0]
    for _ in range(_MAX_ROUNDS):
        square = float(nearest @ nearest)
        if square <= (_ROUNDING * scale) ** 2:
            return 0.0
        extreme = one[int((one @ nearest).argmin())] - other[int((other @ nearest).argmax())]
        bound = float(nearest @ extreme)
        if bound > 0 and bound / math.sqrt(square) > enough:
            return bound / math.sqrt(square)
        if square - bound <= _ROUNDING * scale * scale or (corners == extreme).all(axis=1).any():
            return math.sqrt(square)
        corners, weights = _nearest_in(np.vstack((corners, extreme)), np.append(weights, 0.0))
        nearest = weights @ corners
        if len(corners) > 3:
            # The origin is inside a simplex.
            break
    return math.sqrt(float(nearest @ nearest))


def _nearest_in(corners: _FloatArray, weights: _FloatArray) -> tuple[_FloatArray, _FloatArray]:
    """Return the corners and weights of the point of a simplex nearest to the origin, without idle corners."""
    while True:
        best = _nearest_in_plane(corners)
        if (best > _MIN_WEIGHT).all():
            return corners, best
        falling = best <= _MIN_WEIGHT
        share = float(np.min(weights[falling] / np.maximum(weights[falling] - best[falling], _MIN_WEIGHT)))
        weights = weights + min(share, 1.0) * (best - weights)
        weights[falling & (weights <= weights[falling].min() + _MIN_WEIGHT)] = 0.0
        kept = weights > 0
        corners, weights = corners[kept], weights[kept] / weights[kept].sum()


def _nearest_in_plane(corners: _FloatArray) -> _FloatArray:
    """Return the weights, which add up to 1, of the point nearest to the origin in the plane through the corners."""
    count = len(corners)
    system = np.zeros((count + 1, count + 1))
    system[0, 1:] = system[1:, 0] = 1.0
    system[1:, 1:] = corners @ corners.T
    wanted = np.zeros(count + 1)
    wanted[0] = 1.0
    return np.asarray(np.linalg.lstsq(system, wanted, rcond=None)[0][1:], dtype=np.float64)
