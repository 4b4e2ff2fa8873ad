"""Bounds of a quantile without an assumption about the distribution, by order statistics (Thompson 1936; David 1981).

X_(1) <= ... <= X_(n) are the sorted values of n independent runs, and x is a q-quantile: at most a share q of the
distribution lies below x, and at least a share q at or below it.

- X_(r) <= x holds if at least r values are at or below x. Their number is binomial with a probability of at least q. So
  the probability of X_(r) <= x is at least that of r or more successes with the probability q.
- x <= X_(r) holds if fewer than r values are below x. Their number is binomial with a probability of at most q. So the
  probability of x <= X_(r) is at least that of fewer than r successes with the probability q.

Both are equalities if the distribution is continuous at x. Ties and atoms make the bounds more careful, never wrong.
Every function raises ValueError for a q that is not between 0 and 1, and for a confidence below 50 % or of 100 %.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from sim_action.core.records import dataclass
from sim_action.core.statistics.binomial import passes_needed, runs_needed

Claim = Literal["at_least", "at_most"]
"""The direction of a claim about a quantile: its lower bound proves "at_least", its upper bound "at_most"."""


@dataclass(frozen=True, slots=True)
class QuantileBounds:
    """The lower and the upper bound of a quantile, each with the whole confidence; None: it has none."""

    lower: float | None
    upper: float | None


def lower_rank(n: int, q: float, confidence: float) -> int | None:
    """Return the largest r, from 1, with X_(r) <= q-quantile at the confidence; None if n values have none."""
    # The mirrored values have the quantile 1 - q, and the mirrored rank.
    mirrored = upper_rank(n, 1.0 - q, confidence)
    return None if mirrored is None else n + 1 - mirrored


def upper_rank(n: int, q: float, confidence: float) -> int | None:
    """Return the least r, from 1, with q-quantile <= X_(r) at the confidence; None if n values have none."""
    _check(q)
    # The least r for which r or more values below the quantile are no likelier than 1 - confidence.
    return passes_needed(n, q, confidence)


def quantile_bounds(values: Iterable[float], q: float, confidence: float, missing: int = 0) -> QuantileBounds:
    """Return both bounds of the q-quantile of the distribution that the values were drawn from.

    Args:
        values: one number of each run, in any order; none is NaN.
        q: the share of the distribution below the quantile, 0.05 for the 5 % quantile.
        confidence: the confidence of each bound.
        missing: the number of further runs without a value. They count against each bound: as the least values of all
            for the lower one, and as the greatest for the upper one.
    """
    ordered = sorted(values)
    n = len(ordered) + missing
    low, high = lower_rank(n, q, confidence), upper_rank(n, q, confidence)
    return QuantileBounds(
        lower=None if low is None or low <= missing else ordered[low - missing - 1],
        upper=None if high is None or high > len(ordered) else ordered[high - 1],
    )


def runs_needed_for_quantile(q: float, confidence: float, claim: Claim) -> int:
    """Return the least number of runs at which the bound of the q-quantile exists: it is then the worst run."""
    _check(q)
    return runs_needed(1.0 - q if claim == "at_least" else q, confidence)


def _check(q: float) -> None:
    if not 0.0 < q < 1.0:
        raise ValueError(f"a quantile lies between 0 and 1, and is neither: {q}")
