"""Bounds of quantiles, against sums of fractions and simulated distributions with and without ties."""

from __future__ import annotations

import math
from fractions import Fraction
from math import comb

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.statistics.order_statistics import (
    QuantileBounds,
    lower_rank,
    quantile_bounds,
    runs_needed_for_quantile,
    upper_rank,
)

CONFIDENCES = (0.5, 0.8, 0.9, 0.95, 0.99)


def _fewer_than(r: int, n: int, q: Fraction) -> Fraction:
    return sum((comb(n, i) * q**i * (1 - q) ** (n - i) for i in range(r)), Fraction(0))


@pytest.mark.parametrize("q", [Fraction(1, 16), Fraction(1, 4), Fraction(1, 2), Fraction(15, 16)])
@pytest.mark.parametrize("confidence", [Fraction(1, 2), Fraction(7, 8), Fraction(31, 32)])
def test_ranks_equal_sums_of_fractions(q: Fraction, confidence: Fraction) -> None:
    for n in range(31):
        ranks = range(1, n + 1)
        lower = max((r for r in ranks if 1 - _fewer_than(r, n, q) >= confidence), default=None)
        upper = min((r for r in ranks if _fewer_than(r, n, q) >= confidence), default=None)
        assert lower_rank(n, float(q), float(confidence)) == lower
        assert upper_rank(n, float(q), float(confidence)) == upper


@given(st.integers(1, 10_000), st.floats(0.001, 0.999), st.sampled_from(CONFIDENCES))
def test_ranks_enclose_the_quantile_of_the_sample(n: int, q: float, confidence: float) -> None:
    lower, upper = lower_rank(n, q, confidence), upper_rank(n, q, confidence)
    assert (0 if lower is None else lower) <= n * q + 1
    assert (n + 1 if upper is None else upper) >= n * q
    assert (lower is None) == (n < runs_needed_for_quantile(q, confidence, "at_least"))
    assert (upper is None) == (n < runs_needed_for_quantile(q, confidence, "at_most"))


def test_published_numbers_of_runs() -> None:
    # Wilks 1941: 59 values for a one-sided tolerance limit of 95 % at 95 %, 299 of 99 % at 95 %, 459 of 99 % at 99 %.
    assert runs_needed_for_quantile(0.05, 0.95, "at_least") == 59
    assert runs_needed_for_quantile(0.95, 0.95, "at_most") == 59
    assert runs_needed_for_quantile(0.99, 0.95, "at_most") == 299
    assert runs_needed_for_quantile(0.01, 0.99, "at_least") == 459
    assert runs_needed_for_quantile(0.05, 0.95, "at_most") == 1
    assert runs_needed_for_quantile(0.5, 0.95, "at_least") == runs_needed_for_quantile(0.5, 0.95, "at_most") == 5


def test_the_worst_value_is_the_bound_of_the_fewest_runs() -> None:
    values = [float(value) for value in range(59)]
    assert quantile_bounds(reversed(values), 0.05, 0.95) == QuantileBounds(lower=0.0, upper=6.0)
    assert quantile_bounds(values[1:], 0.05, 0.95).lower is None
    assert quantile_bounds(values, 0.95, 0.95) == QuantileBounds(lower=52.0, upper=58.0)
    assert quantile_bounds([], 0.5, 0.95) == QuantileBounds(lower=None, upper=None)


def test_a_run_without_a_value_counts_against_each_bound() -> None:
    values = [float(value) for value in range(100)]
    bounds = quantile_bounds(values[:97], 0.5, 0.95, missing=3)
    assert bounds.lower == quantile_bounds([-math.inf] * 3 + values[:97], 0.5, 0.95).lower == 38.0
    assert bounds.upper == quantile_bounds(values[:97] + [math.inf] * 3, 0.5, 0.95).upper == 58.0
    assert quantile_bounds(values[:50], 0.5, 0.95, missing=50) == QuantileBounds(lower=None, upper=None)
    assert quantile_bounds([1.0] * 58, 0.05, 0.95, missing=1) == QuantileBounds(lower=None, upper=1.0)


@pytest.mark.parametrize("q", [0.0, 1.0, -0.1, float("nan")])
def test_a_quantile_out_of_range_is_refused(q: float) -> None:
    with pytest.raises(ValueError, match="a quantile lies between 0 and 1"):
        upper_rank(10, q, 0.95)
    with pytest.raises(ValueError, match="a quantile lies between 0 and 1"):
        lower_rank(10, q, 0.95)
    with pytest.raises(ValueError, match="a quantile lies between 0 and 1"):
        runs_needed_for_quantile(q, 0.95, "at_least")
