"""Pass rates, pairs, quantiles and sequential tests, against sums of fractions, simulations and published figures."""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import product
from math import comb, log, nextafter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.statistics import (
    MAX_RUNS,
    Decision,
    Interval,
    QuantileBounds,
    SequentialTest,
    at_least,
    at_most,
    chances,
    holm,
    lower_bound,
    lower_rank,
    mcnemar,
    paired_bootstrap,
    passes_needed,
    passes_refuting,
    proves,
    quantile_bounds,
    rate_change,
    refutes,
    runs_for_power,
    runs_needed,
    runs_needed_for_quantile,
    upper_bound,
    upper_rank,
)

CONFIDENCES = (0.5, 0.8, 0.9, 0.95, 0.99, 0.999)


def _counts(most: int) -> st.SearchStrategy[tuple[int, int]]:
    """Return a strategy for a number of passes and the number of runs, at most `most`."""
    return st.integers(1, most).flatmap(lambda runs: st.tuples(st.integers(0, runs), st.just(runs)))


@pytest.mark.parametrize("eighths", range(9))
def test_tails_equal_sums_of_fractions(eighths: int) -> None:
    p = Fraction(eighths, 8)
    for n in range(31):
        terms = [comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(n + 1)]
        for k in range(-1, n + 2):
            upper, lower = sum(terms[max(0, k) :]), sum(terms[: k + 1])
            assert at_least(k, n, float(p)) == pytest.approx(float(upper), rel=1e-14, abs=0)
            assert at_most(k, n, float(p)) == pytest.approx(float(lower), rel=1e-14, abs=0)


@pytest.mark.parametrize("k", [1, 7_000, 7_500, 8_500, 9_750])
def test_tails_of_ten_thousand_trials_equal_whole_numbers(k: int) -> None:
    n = 10_000
    above, term = 0, comb(n, k) * 3**k
    for i in range(k, n + 1):
        above += term
        term = term * 3 * (n - i) // (i + 1)
    assert at_least(k, n, 0.75) == pytest.approx(float(Fraction(above, 4**n)), rel=1e-12, abs=0)


@given(_counts(10_000), st.floats(0, 1))
def test_a_tail_falls_with_its_count_and_grows_with_the_probability(count: tuple[int, int], p: float) -> None:
    k, n = count
    assert at_least(k + 1, n, p) <= at_least(k, n, p) <= at_least(k, n, p + (1.0 - p) / 2) + 1e-12
    assert at_least(k, n, p) + at_most(k - 1, n, p) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(
    ("passes", "runs", "lower", "upper"),
    # Quantiles of the beta distribution, from SciPy 1.17.
    [(0, 29, 0.0, 0.0981446), (29, 29, 0.9018554, 1.0), (57, 61, 0.8561950, 0.9772933), (5, 10, 0.2224411, 0.7775589)],
)
def test_bounds_are_quantiles_of_the_beta_distribution(passes: int, runs: int, lower: float, upper: float) -> None:
    assert lower_bound(passes, runs, 0.95) == pytest.approx(lower, abs=1e-7)
    assert upper_bound(passes, runs, 0.95) == pytest.approx(upper, abs=1e-7)


def test_what_no_run_or_any_run_proves() -> None:
    assert (lower_bound(0, 0, 0.95), upper_bound(0, 0, 0.95)) == (0.0, 1.0)
    assert (passes_needed(0, 0.9, 0.95), passes_refuting(0, 0.9, 0.95)) == (None, None)
    assert passes_needed(5, 0.0, 0.95) == 0
    assert passes_refuting(5, 0.0, 0.95) is None
    assert passes_needed(MAX_RUNS, 1.0, 0.95) is None
    assert passes_refuting(5, 1.0, 0.95) == 4
    # 1/2 to the third is 1 - 87.5 %; the sum of the tail has rounding errors.
    assert proves(3, 3, 0.5, 0.875)
    assert not refutes(0, 3, 0.5, 0.875)
    # 1 - 0.9 is less than 0.1 as a float.
    assert proves(1, 1, 0.1, 0.9)
    assert not refutes(0, 1, 0.9, 0.9)
    assert at_least(10_000, 10_000, 0.5) == 0.0
    assert at_most(0, 10_000, 0.5) == 0.0


@given(_counts(1_000), st.sampled_from(CONFIDENCES))
def test_bounds_enclose_the_share_and_grow_with_the_passes(count: tuple[int, int], confidence: float) -> None:
    passes, runs = count
    lower, upper = lower_bound(passes, runs, confidence), upper_bound(passes, runs, confidence)
    if confidence >= 0.8:
        assert lower <= passes / runs <= upper
    assert lower <= upper
    if passes:
        assert lower_bound(passes - 1, runs, confidence) < lower
        assert upper_bound(passes - 1, runs, confidence) < upper
    assert upper == pytest.approx(1.0 - lower_bound(runs - passes, runs, confidence), abs=1e-11)


@pytest.mark.parametrize("rate", [0.5, 0.9])
def test_verdicts_counts_and_bounds_agree(rate: float) -> None:
    confidence = 0.9
    for runs in range(1, 121):
        least, most = passes_needed(runs, rate, confidence), passes_refuting(runs, rate, confidence)
        for passes in range(runs + 1):
            proven, refuted = proves(passes, runs, rate, confidence), refutes(passes, runs, rate, confidence)
            assert proven == (least is not None and passes >= least)
            assert refuted == (most is not None and passes <= most)
            assert not (proven and refuted)
        # Both bounds grow with the passes: they agree everywhere if they do so at the two changes of the verdict.
        for passes in {least or 0, (least or runs + 1) - 1, -1 if most is None else most, (most or 0) + 1}:
            if runs % 4 == 1 and 0 <= passes <= runs:
                assert (lower_bound(passes, runs, confidence) >= rate) == proves(passes, runs, rate, confidence)
                assert (upper_bound(passes, runs, confidence) < rate) == refutes(passes, runs, rate, confidence)


@given(_counts(1_000), st.sampled_from(CONFIDENCES))
def test_a_bound_is_the_last_rate_of_its_verdict(count: tuple[int, int], confidence: float) -> None:
    passes, runs = count
    lower, upper = lower_bound(passes, runs, confidence), upper_bound(passes, runs, confidence)
    assert proves(passes, runs, lower, confidence)
    assert not proves(passes, runs, nextafter(lower, 2.0), confidence)
    assert not refutes(passes, runs, upper, confidence)
    assert upper == 1.0 or refutes(passes, runs, nextafter(upper, 2.0), confidence)


@pytest.mark.parametrize(
    ("rate", "runs"),
    [(0.8, (14, 22, 30, 37)), (0.9, (29, 46, 61, 76)), (0.95, (59, 93, 124, 153)), (0.99, (299, 473, 628, 773))],
)
def test_runs_needed_are_the_published_ones(rate: float, runs: tuple[int, ...]) -> None:
    assert tuple(runs_needed(rate, 0.95, failures) for failures in range(4)) == runs
    for failures, needed in enumerate(runs):
        assert passes_needed(needed, rate, 0.95) == needed - failures
        assert passes_needed(needed - 1, rate, 0.95) == (needed - failures if failures else None)


@pytest.mark.parametrize(
    ("true_rate", "runs", "passed"),
    [(0.95, 29, 0.23), (0.95, 61, 0.41), (0.95, 76, 0.47), (0.95, 100, 0.44), (0.99, 29, 0.75), (0.99, 76, 0.99)],
)
def test_a_good_robot_often_misses_a_gate(true_rate: float, runs: int, passed: float) -> None:
    assert chances(true_rate, runs, 0.9, 0.95).passed == pytest.approx(passed, abs=0.005)


@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.99])
@pytest.mark.parametrize("rate", [0.5, 0.9, 0.99])
def test_a_wrong_verdict_is_at_most_as_likely_as_stated(rate: float, confidence: float) -> None:
    # A robot at the rate, or just below it, is the worst case of each error: both tails grow towards the rate.
    for runs in range(1, 320, 3):
        assert chances(nextafter(rate, 0.0), runs, rate, confidence).passed <= (1.0 - confidence) * (1.0 + 1e-11)
        assert chances(rate, runs, rate, confidence).failed <= (1.0 - confidence) * (1.0 + 1e-11)


@pytest.mark.parametrize(("true_rate", "rate"), [(0.95, 0.9), (0.6, 0.5), (0.999, 0.99)])
def test_the_runs_for_a_power_are_the_least_ones(true_rate: float, rate: float) -> None:
    passed = [0.0] + [chances(true_rate, runs, rate, 0.9).passed for runs in range(1, 301)]
    for power in (0.1, 0.3, 0.5, 0.6, 0.7):
        expected = next((runs for runs, chance in enumerate(passed) if chance >= power), None)
        found = runs_for_power(true_rate, rate, 0.9, power)
        assert found == expected or (expected is None and found is not None and found > 300)


def test_more_runs_can_have_less_power() -> None:
    assert runs_for_power(0.95, 0.9, 0.95, 0.46) == 76
    assert chances(0.95, 75, 0.9, 0.95).passed < 0.46 > chances(0.95, 100, 0.9, 0.95).passed
    runs = runs_for_power(0.91, 0.9, 0.95, 0.8)
    assert runs == 5_354
    assert chances(0.91, runs, 0.9, 0.95).passed >= 0.8
    assert chances(0.91, runs - 1, 0.9, 0.95).passed < 0.8
    assert chances(0.95, 28, 0.9, 0.95).passed == 0.0
    one = chances(0.25, 1, 0.9, 0.8)
    assert (one.passed, one.failed, one.inconclusive) == (0.0, 0.75, 0.25)


@pytest.mark.parametrize("true_rate", [0.0, 0.5, 0.9, 0.901])
def test_no_number_of_runs_has_the_power(true_rate: float) -> None:
    assert runs_for_power(true_rate, 0.9, 0.95, 0.8) is None
    assert chances(true_rate, MAX_RUNS, 0.9, 0.95).passed < 0.8


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


def test_p_values_equal_sums_of_fractions() -> None:
    for n in range(31):
        for worse in range(n + 1):
            tail = sum(comb(n, i) for i in range(min(worse, n - worse) + 1))
            assert mcnemar(worse, n - worse) == pytest.approx(
                float(min(Fraction(1), Fraction(2 * tail, 2**n))), rel=1e-13
            )


def test_planted_regressions_are_found() -> None:
    assert (mcnemar(6, 0), mcnemar(0, 6), mcnemar(5, 0)) == pytest.approx((0.03125, 0.03125, 0.0625), rel=1e-13)
    assert (mcnemar(0, 0), mcnemar(3, 3)) == (1.0, 1.0)
    # With the same random numbers, the new version loses 15 of 100 draws and wins none.
    assert _reported(0.15, 0.0) == pytest.approx(0.998, abs=0.001)
    # With 2 % of noise of its own to either side.
    assert _reported(0.17, 0.02) == pytest.approx(0.950, abs=0.001)
    # With other random numbers, each pair is two independent runs.
    assert _reported(0.95 * 0.2, 0.05 * 0.8) == pytest.approx(0.876, abs=0.001)


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.9, 0.95, 0.99])
def test_no_change_is_reported_more_rarely_than_the_level(rate: float) -> None:
    apart = rate * (1 - rate)
    assert _reported(apart, apart) <= LEVEL


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
    monkeypatch.setattr("sim_action.core.statistics.RESAMPLES", 400)
    draws = np.random.default_rng(26)
    intervals = [paired_bootstrap(draw(draws).tolist(), 0.95) for _ in range(100)]
    assert sum(each.low <= mean <= each.high for each in intervals) >= 88


def test_adjusted_p_values_are_those_of_holm() -> None:
    # By hand: 3 * 0.01, then 2 * 0.02, then the larger of 1 * 0.03 and the value before.
    assert holm([0.03, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])
    assert holm([0.2, 0.9]) == pytest.approx([0.4, 0.9])
    assert (holm([0.04]), holm([0.7, 0.7]), holm([])) == ([0.04], [1.0, 1.0], [])


GATE = SequentialTest(reject=0.85, accept=0.95, confidence=0.95, most=200)
rates = st.floats(0.01, 0.99)
tests = st.builds(
    lambda pair, confidence, most: SequentialTest(min(pair), max(pair), confidence, most),
    st.tuples(rates, rates).filter(lambda pair: abs(pair[0] - pair[1]) > 0.01),
    st.sampled_from((0.6, 0.8, 0.9, 0.95, 0.99)),
    st.integers(1, 120),
)


def test_boundaries_of_the_documented_gate() -> None:
    assert [GATE.boundaries(runs) for runs in (1, 2, 3, 4, 10, 26, 27, 28, 200)] == [
        (None, None),
        (None, None),
        (0, None),
        (1, None),
        (6, None),
        (21, None),
        (22, 27),
        (22, 28),
        (179, 185),
    ]


@given(tests, st.integers(1, 200))
def test_boundaries_are_those_of_the_likelihood_ratio(test: SequentialTest, runs: int) -> None:
    limit = log(test.confidence / (1 - test.confidence))
    greatest, least = test.boundaries(runs)
    for passes in range(runs + 1):
        ratio = passes * log(test.accept / test.reject)
        ratio += (runs - passes) * log((1 - test.accept) / (1 - test.reject))
        if abs(abs(ratio) - limit) > 1e-6:
            assert (least is not None and passes >= least) == (ratio > limit)
            assert (greatest is not None and passes <= greatest) == (ratio < -limit)


def test_a_boundary_at_a_whole_number_belongs_to_its_verdict() -> None:
    # The logarithms of the ratio and of the limit are equal: the first result decides.
    test = SequentialTest(reject=0.2, accept=0.8, confidence=0.8, most=5)
    assert test.boundaries(1) == (0, 1)
    assert test.decision([True]) == Decision("accepted", 1)
    assert test.decision([False]) == Decision("rejected", 1)


def test_decisions_stop_at_the_first_verdict() -> None:
    assert GATE.decision([True] * 200) == Decision("accepted", 27)
    assert GATE.decision([False] * 200) == Decision("rejected", 3)
    # A failure takes 1.0986 off the ratio and a pass adds 0.1112: it takes 37 of them to reach 2.944.
    assert GATE.decision([False] + [True] * 199) == Decision("accepted", 38)
    # Later results are not even asked for.
    results = iter([True] * 30)
    GATE.decision(results)
    assert len(list(results)) == 3
    # Too few or mixed results decide nothing, and runs without a verdict count against both.
    assert GATE.decision([]) == Decision(None, 0)
    assert GATE.decision([True] * 26) == Decision(None, 26)
    mixed = ([True] * 9 + [False]) * 30
    assert GATE.decision(mixed) == Decision(None, 200)
    assert SequentialTest(0.85, 0.95, 0.95, 20).decision([True] * 30) == Decision(None, 20)
    assert GATE.decision([None] * 200) == Decision(None, 200)
    assert GATE.decision([None] + [True] * 199) == Decision("accepted", 38)
    assert GATE.decision([None] + [False] * 199) == Decision("rejected", 4)


@pytest.mark.parametrize("rate", [Fraction(1, 4), Fraction(1, 2), Fraction(7, 8)])
def test_exact_figures_equal_an_enumeration(rate: Fraction) -> None:
    test = SequentialTest(reject=0.4, accept=0.7, confidence=0.8, most=10)
    shares = dict[str | None, Fraction]()
    mean_runs = Fraction(0)
    for results in product((True, False), repeat=test.most):
        probability = rate ** sum(results) * (1 - rate) ** (test.most - sum(results))
        decision = test.decision(results)
        shares[decision.verdict] = shares.get(decision.verdict, Fraction(0)) + probability
        mean_runs += probability * decision.runs
    exact = test.exact(float(rate))
    assert exact.accepted == pytest.approx(float(shares["accepted"]), rel=1e-13)
    assert exact.rejected == pytest.approx(float(shares["rejected"]), rel=1e-13)
    assert exact.undecided == pytest.approx(float(shares[None]), rel=1e-13)
    assert exact.mean_runs == pytest.approx(float(mean_runs), rel=1e-13)


@given(tests, st.floats(0, 1))
def test_a_better_robot_is_accepted_more_often(test: SequentialTest, rate: float) -> None:
    exact, better = test.exact(rate), test.exact(rate + (1.0 - rate) / 2)
    assert exact.accepted + exact.rejected + exact.undecided == pytest.approx(1.0, abs=1e-12)
    assert exact.accepted <= better.accepted + 1e-12
    assert exact.rejected >= better.rejected - 1e-12
    assert 1.0 <= exact.mean_runs <= test.most + 1e-9


def test_figures_of_the_documented_gate() -> None:
    good, bad, between = GATE.exact(0.95), GATE.exact(0.5), GATE.exact(0.9)
    assert (round(good.accepted, 3), round(good.mean_runs, 1)) == (0.961, 54.8)
    assert (round(bad.rejected, 3), round(bad.mean_runs, 1)) == (1.0, 6.7)
    assert round(between.undecided, 3) == 0.057


@given(tests)
def test_error_rates_are_within_the_bounds_of_wald(test: SequentialTest) -> None:
    error = 1.0 - test.confidence
    wrongly_accepted, wrongly_rejected = test.exact(test.reject).accepted, test.exact(test.accept).rejected
    assert max(wrongly_accepted, wrongly_rejected) <= error / test.confidence + 1e-9
    assert wrongly_accepted + wrongly_rejected <= 2.0 * error + 1e-9


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


def test_bounds_of_quantiles() -> None:
    # Wilks 1941: 59 values for a one-sided tolerance limit of 95 % at 95 %, 299 of 99 % at 95 %, 459 of 99 % at 99 %.
    assert runs_needed_for_quantile(0.05, 0.95, "at_least") == 59
    assert runs_needed_for_quantile(0.95, 0.95, "at_most") == 59
    assert runs_needed_for_quantile(0.99, 0.95, "at_most") == 299
    assert runs_needed_for_quantile(0.01, 0.99, "at_least") == 459
    assert runs_needed_for_quantile(0.05, 0.95, "at_most") == 1
    assert runs_needed_for_quantile(0.5, 0.95, "at_least") == runs_needed_for_quantile(0.5, 0.95, "at_most") == 5
    # The worst value is the bound of the fewest runs.
    values = [float(value) for value in range(59)]
    assert quantile_bounds(reversed(values), 0.05, 0.95) == QuantileBounds(lower=0.0, upper=6.0)
    assert quantile_bounds(values[1:], 0.05, 0.95).lower is None
    assert quantile_bounds(values, 0.95, 0.95) == QuantileBounds(lower=52.0, upper=58.0)
    assert quantile_bounds([], 0.5, 0.95) == QuantileBounds(lower=None, upper=None)
    # A run without a value counts against each bound.
    values = [float(value) for value in range(100)]
    bounds = quantile_bounds(values[:97], 0.5, 0.95, missing=3)
    assert bounds.lower == quantile_bounds([-math.inf] * 3 + values[:97], 0.5, 0.95).lower == 38.0
    assert bounds.upper == quantile_bounds(values[:97] + [math.inf] * 3, 0.5, 0.95).upper == 58.0
    assert quantile_bounds(values[:50], 0.5, 0.95, missing=50) == QuantileBounds(lower=None, upper=None)
    assert quantile_bounds([1.0] * 58, 0.05, 0.95, missing=1) == QuantileBounds(lower=None, upper=1.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: lower_bound(6, 5, 0.95), "6 passes of 5 runs"),
        (lambda: upper_bound(-1, 5, 0.95), "-1 passes of 5 runs"),
        (lambda: passes_needed(5, 1.1, 0.95), "a rate lies between 0 and 1: 1.1"),
        (lambda: passes_needed(5, math.nan, 0.95), "a rate lies between 0 and 1: nan"),
        (lambda: at_least(1, 2, -0.1), "a rate lies between 0 and 1: -0.1"),
        (lambda: chances(0.5, 5, 0.9, 1.0), "below 1: 1.0"),
        (lambda: lower_bound(1, 5, 0.49), "at least 0.5 and below 1: 0.49"),
        (lambda: runs_needed(1.0, 0.95), "no number of runs proves the rate 1.0"),
        (lambda: runs_needed(0.9, 0.95, -1), "with -1 failures"),
        (lambda: runs_for_power(0.95, 0.9, 0.95, 1.0), "a power lies between 0 and 1"),
        (lambda: mcnemar(-1, 3), "-1 worse and 3 better pairs: neither"),
        (lambda: rate_change(3, 3, 5, 0.95), "3 worse and 3 better pairs are not part of 5 pairs"),
        (lambda: rate_change(-1, 3, 5, 0.95), "-1 worse and 3 better pairs are not part"),
        (lambda: rate_change(0, 0, 0, 0.95), "of 0 pairs"),
        (lambda: rate_change(1, 1, 5, 1.0), "below 1: 1.0"),
        (lambda: paired_bootstrap([1.0], 0.95), "at least two differences, and finite ones: 1 are given"),
        (lambda: paired_bootstrap([1.0, math.nan], 0.95), "finite"),
        (lambda: paired_bootstrap([1.0, 2.0], 0.4), "at least 0.5 and below 1: 0.4"),
        (lambda: SequentialTest(0.95, 0.85, 0.95, 200), "the rates 0.95 and 0.85 must grow"),
        (lambda: SequentialTest(0.9, 0.9, 0.95, 200), "must grow"),
        (lambda: SequentialTest(0.9, 1.0, 0.95, 200), "lie between 0 and 1"),
        (lambda: SequentialTest(0.0, 0.9, 0.95, 200), "lie between 0 and 1"),
        (lambda: SequentialTest(0.8, 0.9, 0.5, 200), "above 0.5 and below 1: 0.5"),
        (lambda: SequentialTest(0.8, 0.9, 1.0, 200), "above 0.5 and below 1: 1.0"),
        (lambda: SequentialTest(0.8, 0.9, 0.95, 0), "at least one run, not 0"),
        (lambda: GATE.exact(1.5), "a rate lies between 0 and 1: 1.5"),
        *(
            (call, "a quantile lies between 0 and 1")
            for q in (0.0, 1.0, -0.1, math.nan)
            for call in (
                partial(upper_rank, 10, q, 0.95),
                partial(lower_rank, 10, q, 0.95),
                partial(runs_needed_for_quantile, q, 0.95, "at_least"),
            )
        ),
    ],
)
def test_arguments_out_of_range_are_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
