"""Wald's test: its boundaries, its decisions, and exact figures against an enumeration and simulations."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import log

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.statistics.sequential import Decision, SequentialTest

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


def test_too_few_results_decide_nothing() -> None:
    assert GATE.decision([]) == Decision(None, 0)
    assert GATE.decision([True] * 26) == Decision(None, 26)


def test_the_last_run_can_leave_the_test_open() -> None:
    mixed = ([True] * 9 + [False]) * 30
    assert GATE.decision(mixed) == Decision(None, 200)
    assert SequentialTest(0.85, 0.95, 0.95, 20).decision([True] * 30) == Decision(None, 20)


def test_a_run_without_a_verdict_counts_against_both() -> None:
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


@pytest.mark.parametrize(
    ("reject", "accept", "confidence", "most", "message"),
    [
        (0.95, 0.85, 0.95, 200, "the rates 0.95 and 0.85 must grow"),
        (0.9, 0.9, 0.95, 200, "must grow"),
        (0.9, 1.0, 0.95, 200, "lie between 0 and 1"),
        (0.0, 0.9, 0.95, 200, "lie between 0 and 1"),
        (0.8, 0.9, 0.5, 200, "above 0.5 and below 1: 0.5"),
        (0.8, 0.9, 1.0, 200, "above 0.5 and below 1: 1.0"),
        (0.8, 0.9, 0.95, 0, "at least one run, not 0"),
    ],
)
def test_a_test_that_cannot_be_is_refused(
    reject: float, accept: float, confidence: float, most: int, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        SequentialTest(reject, accept, confidence, most)


def test_a_true_rate_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a rate lies between 0 and 1: 1\.5"):
        GATE.exact(1.5)
