"""The comparison of two versions on the same draws: each draw is a pair of an old and a new result.

- `mcnemar` decides whether the pass rate changed. It is the exact form of the test (McNemar, Psychometrika 12, 1947):
  the share of wrong reports is at most the level at which p is compared, at any number of pairs.
- `holm` adjusts the p-values of several tests that are made at the same time.
- `rate_change` states the size of the change. It is the adjusted Wald interval of Bonett and Price (Journal of
  Educational and Behavioral Statistics 37, 2012). Its coverage at 95 % is exactly 0.949 or more for 20 to 300 pairs of
  14 kinds of robots. It can touch 0 where `mcnemar` finds a change, and the reverse: the test decides.
- `paired_bootstrap` states the change of a mean. It is the BCa interval (Efron, Journal of the American Statistical
  Association 82, 1987). Its coverage at 95 % is 0.91 to 0.97 from 100 pairs on, simulated for normal, exponential,
  log-normal, mostly zero, and rarely jumping differences. With 20 pairs it is 0.92 for normal differences, and 0.6 for
  differences that jump in one of 20 pairs.

All intervals have two sides. All functions raise ValueError for a count or confidence outside its range.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from random import Random
from statistics import NormalDist
from typing import Final

from sim_action.core.records import dataclass
from sim_action.core.statistics.binomial import at_most

RESAMPLES: Final = 10_000


@dataclass(frozen=True, slots=True)
class Interval:
    """An interval with both ends."""

    low: float
    high: float


def mcnemar(worse: int, better: int) -> float:
    """Return the two-sided p-value of no change of the pass rate.

    Args:
        worse: the number of pairs that passed with the old version and not with the new one.
        better: the number of pairs that passed with the new version and not with the old one.
    """
    if min(worse, better) < 0:
        raise ValueError(f"{worse} worse and {better} better pairs: neither number is negative")
    return min(1.0, 2.0 * at_most(min(worse, better), worse + better, 0.5))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return the p-values of several tests, adjusted by Holm's method (Scandinavian Journal of Statistics 6, 1979).

    If each adjusted value is compared with one level, the chance of any wrong report is at most this level, however the
    tests depend on each other.
    """
    adjusted = [0.0] * len(p_values)
    most = 0.0
    for rank, place in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        most = max(most, min(1.0, (len(p_values) - rank) * p_values[place]))
        adjusted[place] = most
    return adjusted


def rate_change(worse: int, better: int, pairs: int, confidence: float) -> Interval:
    """Return the interval of the new pass rate minus the old one; `worse` and `better` as for `mcnemar`."""
    if min(worse, better) < 0 or worse + better > pairs or pairs < 1:
        raise ValueError(f"{worse} worse and {better} better pairs are not part of {pairs} pairs")
    # One more pair of each kind.
    share_worse, share_better = (worse + 1) / (pairs + 2), (better + 1) / (pairs + 2)
    change = share_better - share_worse
    half = _upper_normal(confidence) * math.sqrt((share_worse + share_better - change**2) / (pairs + 2))
    return Interval(max(-1.0, change - half), min(1.0, change + half))


def paired_bootstrap(differences: Sequence[float], confidence: float, seed: int = 0) -> Interval:
    """Return the interval of the mean of at least two finite differences; it has no width if all are equal.

    The seed of the resamples is fixed: the same differences in the same order have the same interval.
    """
    stated = list(map(float, differences))
    if len(stated) < 2 or not all(map(math.isfinite, stated)):
        raise ValueError(f"an interval needs at least two differences, and finite ones: {len(stated)} are given")
    z = _upper_normal(confidence)
    if min(stated) == max(stated):
        return Interval(stated[0], stated[0])
    # A power of 2 changes no digit, and the powers of values up to 1 stay in the range of floats.
    exponent = math.frexp(max(map(abs, stated)))[1]
    values = [math.ldexp(value, -exponent) for value in stated]
    mean = math.fsum(values) / len(values)
    means = _means_of_resamples(values, seed)
    # Means that are equal but for rounding count half: differences with few distinct values have many of them.
    slack = 1e-12 * max(map(abs, values))
    share = (bisect_left(means, mean - slack) + bisect_right(means, mean + slack)) / (2.0 * len(means))
    bias = NormalDist().inv_cdf(min(max(share, 0.5 / RESAMPLES), 1.0 - 0.5 / RESAMPLES))
    deviations = [value - mean for value in values]
    cubes, squares = (math.fsum(each**power for each in deviations) for power in (3, 2))
    acceleration = cubes / (6.0 * squares**1.5)
    low, high = (_corrected(side, bias, acceleration) for side in (-z, z))
    return Interval(*(_restored(_quantile(means, share), exponent, values) for share in (low, high)))


def _means_of_resamples(values: Sequence[float], seed: int) -> list[float]:
    # Plain Python: `sim-action compare` runs where numpy is not installed.
    choices, size = Random(seed).choices, len(values)
    return sorted(sum(choices(values, k=size)) / size for _ in range(RESAMPLES))


def _restored(mean: float, exponent: int, values: Sequence[float]) -> float:
    # Its rounding may not leave the range of floats.
    return math.ldexp(min(max(mean, min(values)), max(values)), exponent)


def _quantile(ascending: Sequence[float], share: float) -> float:
    place = share * (len(ascending) - 1)
    below = min(int(place), len(ascending) - 2)
    return ascending[below] + (place - below) * (ascending[below + 1] - ascending[below])


def _corrected(side: float, bias: float, acceleration: float) -> float:
    shifted = bias + side
    return NormalDist().cdf(bias + shifted / (1.0 - acceleration * shifted))


def _upper_normal(confidence: float) -> float:
    if not 0.5 <= confidence < 1.0:
        raise ValueError(f"a confidence is at least 0.5 and below 1: {confidence}")
    return NormalDist().inv_cdf((1.0 + confidence) / 2.0)
