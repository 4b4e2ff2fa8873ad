"""The paired test and its intervals, against sums of fractions, exact coverage and simulations."""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.statistics.paired import Interval, holm, mcnemar, paired_bootstrap, rate_change

PAIRS = 100
LEVEL = 0.05


def _splits(pairs: int, worse: float, better: float) -> Iterator[tuple[int, int, float]]:
    """Yield numbers of worse and better pairs, and the probability of both."""
    changed = worse + better
    for discordant in range(pairs + 1):
        some = comb(pairs, discordant) * changed**discordant * (1 - changed) ** (pairs - discordant)
        if some < 1e-12:
            continue
        for lost in range(discordant + 1):
            share = worse / changed
            yield (
                lost,
                discordant - lost,
                some * comb(discordant, lost) * share**lost * (1 - share) ** (discordant - lost),
            )


def _reported(worse: float, better: float) -> float:
    """Return the exact probability that the test reports a change."""
    return sum(chance for lost, won, chance in _splits(PAIRS, worse, better) if mcnemar(lost, won) <= LEVEL)


def _discordant(draws: random.Random, old: float, new: float, *, shared: bool) -> tuple[int, int]:
    """Return the numbers of worse and better pairs of two robots, with the same random numbers or with others."""
    worse = better = 0
    for _ in range(PAIRS):
        draw = draws.random()
        passed_before, passes_now = draw < old, (draw if shared else draws.random()) < new
        worse += passed_before and not passes_now
        better += passes_now and not passed_before
    return worse, better


def test_p_values_equal_sums_of_fractions() -> None:
    for n in range(31):
        for worse in range(n + 1):
            tail = sum(comb(n, i) for i in range(min(worse, n - worse) + 1))
            assert mcnemar(worse, n - worse) == pytest.approx(
                float(min(Fraction(1), Fraction(2 * tail, 2**n))), rel=1e-13
            )


def test_six_changes_to_the_worse_are_significant_and_five_are_not() -> None:
    assert (mcnemar(6, 0), mcnemar(0, 6), mcnemar(5, 0)) == pytest.approx((0.03125, 0.03125, 0.0625), rel=1e-13)
    assert (mcnemar(0, 0), mcnemar(3, 3)) == (1.0, 1.0)


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.9, 0.95, 0.99])
def test_no_change_is_reported_more_rarely_than_the_level(rate: float) -> None:
    apart = rate * (1 - rate)
    assert _reported(apart, apart) <= LEVEL


def test_a_planted_regression_is_found() -> None:
    # With the same random numbers, the new version loses 15 of 100 draws and wins none.
    assert _reported(0.15, 0.0) == pytest.approx(0.998, abs=0.001)
    # With 2 % of noise of its own to either side.
    assert _reported(0.17, 0.02) == pytest.approx(0.950, abs=0.001)
    # With other random numbers, each pair is two independent runs.
    assert _reported(0.95 * 0.2, 0.05 * 0.8) == pytest.approx(0.876, abs=0.001)


@pytest.mark.parametrize(("shared", "power"), [(True, 0.998), (False, 0.876)])
def test_simulated_regressions_are_found_as_often_as_computed(shared: bool, power: float) -> None:
    draws = random.Random(95)
    found = [mcnemar(*_discordant(draws, 0.95, 0.8, shared=shared)) <= LEVEL for _ in range(1_000)]
    assert sum(found) / len(found) == pytest.approx(power, abs=0.03)


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("shared", [True, False])
def test_identical_robots_are_rarely_reported_as_changed(rate: float, shared: bool) -> None:
    reported = [mcnemar(*_discordant(random.Random(seed), rate, rate, shared=shared)) <= LEVEL for seed in range(1_000)]
    assert sum(reported) <= LEVEL * len(reported)
    assert not (shared and any(reported))


@pytest.mark.parametrize("pairs", [20, 100])
@pytest.mark.parametrize(("worse", "better"), [(0.01, 0.01), (0.05, 0.05), (0.17, 0.02), (0.001, 0.15), (0.3, 0.3)])
def test_the_interval_of_a_rate_covers_its_change(pairs: int, worse: float, better: float) -> None:
    covered = 0.0
    for lost, won, chance in _splits(pairs, worse, better):
        interval = rate_change(lost, won, pairs, 0.95)
        covered += chance * (interval.low <= better - worse <= interval.high)
    assert covered >= 0.949


def test_intervals_of_a_rate() -> None:
    # By hand: shares 16/102 and 1/102, half width 1.959964 * sqrt((17/102 - (15/102)^2) / 102).
    change = rate_change(15, 0, 100, 0.95)
    assert (change.low, change.high) == pytest.approx((-0.220967, -0.073151), abs=1e-6)
    assert rate_change(0, 0, 100, 0.95).low == -rate_change(0, 0, 100, 0.95).high
    assert rate_change(2, 0, 2, 0.99).low == -1.0
    assert rate_change(0, 2, 2, 0.99).high == 1.0


@given(st.integers(0, 50), st.integers(0, 50), st.integers(1, 500), st.sampled_from((0.5, 0.8, 0.95, 0.99)))
def test_intervals_of_a_rate_are_symmetric(worse: int, better: int, same: int, confidence: float) -> None:
    pairs = worse + better + same
    change, mirrored = rate_change(worse, better, pairs, confidence), rate_change(better, worse, pairs, confidence)
    assert (change.low, change.high) == pytest.approx((-mirrored.high, -mirrored.low), abs=1e-15)
    assert change.low < change.high


@pytest.mark.parametrize("values", [[0.0, 0.0, 0.0], [0.1] * 300])
def test_equal_differences_have_an_interval_without_width(values: list[float]) -> None:
    assert paired_bootstrap(values, 0.95) == Interval(values[0], values[0])


def test_the_interval_of_a_mean_depends_on_the_seed_alone() -> None:
    values = [random.Random(1).gauss(0.0, 1.0) for _ in range(50)]
    values = [value + index / 50 for index, value in enumerate(values)]
    assert paired_bootstrap(values, 0.95) == paired_bootstrap(values, 0.95)
    assert paired_bootstrap(values, 0.95, seed=1) != paired_bootstrap(values, 0.95, seed=2)
    assert paired_bootstrap(values, 0.99).low < paired_bootstrap(values, 0.95).low


def test_the_interval_of_a_mean_follows_a_shift_and_a_scale() -> None:
    draws = np.random.default_rng(3)
    values = draws.normal(0.0, 1.0, 300)
    interval = paired_bootstrap(values.tolist(), 0.95)
    half = 1.96 * values.std() / 300**0.5
    assert (interval.low, interval.high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.01)
    moved = paired_bootstrap((2.0 * values + 5.0).tolist(), 0.95)
    assert (moved.low, moved.high) == pytest.approx((2.0 * interval.low + 5.0, 2.0 * interval.high + 5.0), abs=1e-9)


@pytest.mark.parametrize("exponent", [-1070, -400, 300, 1020])
def test_the_interval_of_a_mean_has_the_scale_of_its_values(exponent: int) -> None:
    """Their squares and cubes, and even their sum, may leave the range of floats."""
    values = [math.ldexp(float(value), exponent) for value in (*range(1, 9), 15)]
    interval, expected = paired_bootstrap(values, 0.95), paired_bootstrap([*map(float, range(1, 9)), 15.0], 0.95)
    scaled = (math.ldexp(expected.low, exponent), math.ldexp(expected.high, exponent))
    assert (interval.low, interval.high) == pytest.approx(scaled, rel=1e-9, abs=1e-323)
    assert values[0] < interval.low < interval.high < values[-1]


def test_the_interval_of_the_largest_floats_is_finite() -> None:
    values = [sys.float_info.max, *[sys.float_info.max * (1 - 1e-16)] * 20]
    assert paired_bootstrap(values, 0.95).high <= sys.float_info.max


def test_the_interval_of_a_skewed_mean_reaches_further_to_the_long_tail() -> None:
    values = np.random.default_rng(8).exponential(1.0, 100)
    interval = paired_bootstrap(values.tolist(), 0.95)
    mirrored = paired_bootstrap((-values).tolist(), 0.95)
    assert interval.high - values.mean() > 1.1 * (values.mean() - interval.low)
    assert (mirrored.low, mirrored.high) == pytest.approx((-interval.high, -interval.low), abs=0.01)


@pytest.mark.parametrize(
    ("draw", "mean"),
    [
        (lambda draws: draws.normal(0.0, 1.0, PAIRS), 0.0),
        (lambda draws: draws.exponential(1.0, PAIRS), 1.0),
        # As of scripted robots: nine of ten draws make no difference.
        (lambda draws: np.where(draws.random(PAIRS) < 0.9, 0.0, draws.normal(1.0, 1.0, PAIRS)), 0.1),
    ],
)
def test_the_interval_of_a_mean_covers_it(
    draw: Callable[[np.random.Generator], np.ndarray], mean: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sim_action.core.statistics.paired.RESAMPLES", 1_000)
    draws = np.random.default_rng(26)
    intervals = [paired_bootstrap(draw(draws).tolist(), 0.95) for _ in range(100)]
    assert sum(each.low <= mean <= each.high for each in intervals) >= 88


def test_adjusted_p_values_are_those_of_holm() -> None:
    # By hand: 3 * 0.01, then 2 * 0.02, then the larger of 1 * 0.03 and the value before.
    assert holm([0.03, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])
    assert holm([0.2, 0.9]) == pytest.approx([0.4, 0.9])
    assert (holm([0.04]), holm([0.7, 0.7]), holm([])) == ([0.04], [1.0, 1.0], [])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mcnemar(-1, 3), "-1 worse and 3 better pairs: neither"),
        (lambda: rate_change(3, 3, 5, 0.95), "3 worse and 3 better pairs are not part of 5 pairs"),
        (lambda: rate_change(-1, 3, 5, 0.95), "-1 worse and 3 better pairs are not part"),
        (lambda: rate_change(0, 0, 0, 0.95), "of 0 pairs"),
        (lambda: rate_change(1, 1, 5, 1.0), "below 1: 1.0"),
        (lambda: paired_bootstrap([1.0], 0.95), "at least two differences, and finite ones: 1 are given"),
        (lambda: paired_bootstrap([1.0, float("nan")], 0.95), "finite"),
        (lambda: paired_bootstrap([1.0, 2.0], 0.4), "at least 0.5 and below 1: 0.4"),
    ],
)
def test_arguments_out_of_range_are_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
