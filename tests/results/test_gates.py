"""Verdicts of gates, from the outcomes of their runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ExitCode, Location
from sim_action.core.records import replace
from sim_action.core.statistics import chances
from sim_action.results.gates import RELATIVE_FIGURES, judged_gate, over_variations
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, Scope, Status
from sim_action.scenario.variations.gate import Gate, PlannedGate
from sim_action.state.verdict import Judged, Verdict

NINETY = {"passes": {"at_least": "90 %"}}
EARLY = {"stop_early": {"reject": 0.85, "accept": 0.95}}


def planned(gate: dict[str, Any], runs: int) -> PlannedGate:
    place, claims = Location("a.sim.yml", 9), Gate.model_validate(gate)
    return PlannedGate(name="slip", file="a.sim.yml", location=place, group="slip", gate=claims, runs=runs)


def run(status: Status = "passed", value: float | None = 1.5, kind: str = "crash") -> Outcome:
    failures = (Failure.model_validate({"kind": kind, "title": "a", "message": "told"}),) if status == "error" else ()
    verdict = Verdict(status == "passed", measured=value, limit=1.0, unit="m", judged=Judged(3, 0.0, 1.0))
    expected = ExpectationOutcome(
        name="drives", assertion="travel", severity="error", location=Location("a.sim.yml", 5), verdict=verdict
    )
    return Outcome(
        name="slip[x=1]",
        file="a.sim.yml",
        group="slip",
        gate="slip",
        status=status,
        failures=failures,
        expectations=() if status in ("error", "skipped") else (expected,),
        wall_time=0.5,
    )


PASS, FAIL, ERROR, UNJUDGED, SKIP = run(), run("failed"), run("error"), run("not_exercised"), run("skipped")


def messages(outcome: Outcome) -> list[str]:
    return [expected.verdict.message for expected in outcome.expectations]


@pytest.mark.parametrize(
    ("passes", "fails", "status", "message"),
    [
        (61, 0, "passed", "61 of 61 runs passed (100 %); with 95 % confidence at least 95.21 % do"),
        (59, 2, "passed", "59 of 61 runs passed (96.72 %); with 95 % confidence at least 90.04 % do"),
        (58, 3, "inconclusive", "at least 87.78 % and at most 98.65 % do: too few runs to tell"),
        (52, 9, "inconclusive", "too few runs to tell"),
        (48, 13, "failed", "with 95 % confidence at most 86.91 % do, less than 90 %"),
    ],
)
def test_the_rate_is_shown_refuted_or_open(passes: int, fails: int, status: Status, message: str) -> None:
    judged = judged_gate(planned(NINETY, 61), [PASS] * passes + [FAIL] * fails)
    assert judged.status == status
    assert message in messages(judged)[0]
    assert judged.exit_code is (ExitCode.PASSED if status == "passed" else ExitCode.FAILED)
    verdict = judged.expectations[0].verdict
    assert (verdict.limit, verdict.unit) == (90.0, "%")
    assert verdict.margin is not None
    assert (verdict.margin >= 0) == (status == "passed")
    assert (verdict.inconclusive == "statistical") == (status == "inconclusive")
    statistics = judged.statistics
    assert statistics is not None
    assert (statistics.planned, statistics.runs, statistics.passed, statistics.failed) == (61, 61, passes, fails)


def test_a_bound_next_to_the_limit_is_shown_with_enough_digits() -> None:
    judged = judged_gate(planned(NINETY, 289), [PASS] * 251 + [FAIL] * 38)
    assert "at most 89.9999 % do, less than 90 %" in messages(judged)[0]


def test_runs_without_a_verdict() -> None:
    # A run without a verdict counts against whatever is claimed.
    lenient = {**NINETY, "errors": {"at_most": 20}}
    kept = judged_gate(planned(lenient, 61), [PASS] * 58 + [ERROR] * 2 + [UNJUDGED])
    assert [expected.status for expected in kept.expectations] == ["inconclusive", "passed"]
    open_both_ways = judged_gate(planned(lenient, 61), [PASS] * 48 + [ERROR] * 13)
    assert open_both_ways.expectations[0].status == "inconclusive"
    statistics = kept.statistics
    assert statistics is not None
    assert (statistics.errors, statistics.not_exercised, statistics.without_verdict) == (2, 1, 3)
    # Too many runs without a verdict fail the gate.
    judged = judged_gate(planned(NINETY, 100), [PASS] * 99 + [ERROR])
    assert [expected.status for expected in judged.expectations] == ["passed", "failed"]
    assert judged.status == "failed"
    assert messages(judged)[1] == "1 run of 100 without a verdict; at most 0 may have none"
    # As many runs without a verdict as allowed are accepted.
    judged = judged_gate(planned({**NINETY, "errors": {"at_most": 1}}, 100), [PASS] * 99 + [ERROR])
    assert [expected.status for expected in judged.expectations] == ["passed", "passed"]


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("interrupted", ExitCode.INTERRUPTED),
        ("internal", ExitCode.INTERNAL),
        ("missing", ExitCode.INVALID),
        ("invalid", ExitCode.INVALID),
    ],
)
def test_runs_that_could_not_be_run_leave_no_verdict(kind: str, code: ExitCode) -> None:
    judged = judged_gate(planned(NINETY, 61), [PASS] * 60 + [run("error", kind=kind)])
    assert (judged.status, judged.exit_code) == ("error", code)
    assert judged.failures[0].message == "1 run of 61: told"


def test_lost_and_skipped_runs() -> None:
    # Lost runs leave no verdict.
    judged = judged_gate(planned(NINETY, 61), [PASS] * 60)
    assert judged.status == "error"
    assert judged.failures[0].message.startswith("1 of 61 runs have no result")
    # An early stop with lost runs has no verdict.
    # Nobody knows which runs are lost: those that are left are not the first ones.
    judged = judged_gate(planned(EARLY, 60), [PASS] * 40)
    assert (judged.status, judged.exit_code) == ("error", ExitCode.INVALID)
    assert judged.failures[0].message.startswith("20 of 60 runs have no result")
    assert judged_gate(planned(NINETY, 61), [PASS] * 30 + [SKIP] * 31).status == "skipped"
    # An early stop does not look beyond a run that was skipped.
    judged = judged_gate(planned(EARLY, 60), [PASS] * 20 + [SKIP] + [PASS] * 20 + [SKIP] * 19)
    assert judged.status == "skipped"


def test_an_early_stop_says_what_it_tells_apart() -> None:
    gate = planned(EARLY, 200)
    accepted = judged_gate(gate, [PASS] * 27 + [SKIP] * 173)
    assert accepted.status == "passed"
    assert messages(accepted) == [
        "27 of 27 runs passed (100 %); the test accepts 95 % against 85 % with 95 % confidence after 27 runs"
    ]
    assert accepted.statistics is not None
    assert (accepted.statistics.decision, accepted.statistics.lower) == ("accepted", None)
    rejected = judged_gate(gate, [FAIL] * 3 + [SKIP] * 197)
    assert (rejected.status, rejected.expectations[0].status) == ("failed", "failed")
    assert "rejects 95 % against 85 %" in messages(rejected)[0]


def test_an_early_stop_looks_at_runs_in_order_and_may_stay_open() -> None:
    # An early stop looks at runs in their order.
    gate = planned(EARLY, 200)
    decided = [PASS] * 27
    # What ran at the same time changes nothing.
    assert judged_gate(gate, [*decided, FAIL, FAIL, FAIL] + [SKIP] * 170) == judged_gate(
        gate, [*decided, PASS, PASS, FAIL] + [SKIP] * 170
    )
    # An early stop may stay open.
    results = [PASS] * 9 + [FAIL]
    judged = judged_gate(planned(EARLY, 60), results * 6)
    assert judged.status == "inconclusive"
    assert "neither accepts nor rejects 95 % against 85 % within 60 runs" in messages(judged)[0]


def quantile(bound: dict[str, Any], values: Sequence[float | None], of: str = "travel.measured") -> ExpectationOutcome:
    gate = planned({"quantile": {"of": of, "q": "5 %", **bound}}, len(values))
    (expected,) = judged_gate(gate, [run(value=value) for value in values]).expectations
    return expected


def test_a_quantile_by_order_statistics() -> None:
    values = [1.4 + number / 1000 for number in range(59)]
    assert quantile({"at_least": "1.4 m"}, values).status == "passed"
    assert quantile({"at_least": "139 cm"}, values, of="drives.measured").status == "passed"
    assert quantile({"at_least": "1.401 m"}, values).status == "inconclusive"
    assert quantile({"at_least": "1.46 m"}, values).status == "failed"
    assert quantile({"at_most": "1.3 m"}, values).status == "failed"
    told = quantile({"at_least": "1.4 m"}, values).verdict
    assert (told.measured, told.limit, told.unit) == (1.4, 1.4, "m")
    assert told.message.startswith("59 runs; with 95 % confidence the 5 % quantile is at least 1.4 m and at most 1.4")
    # A limit without a unit is in that of the value.
    plain = quantile({"at_least": 1.4}, [1.5] * 59)
    assert (plain.name, plain.status) == ("5 % quantile of travel.measured at least 1.4 m", "passed")


@pytest.mark.parametrize(
    ("bound", "share", "status"),
    [
        # With 95 % confidence, the 95 % quantile of these values is at least 1.452 m and at most 1.458 m.
        ({"at_most": "1.458 m"}, "95 %", "passed"),
        ({"at_most": "1.457 m"}, "95 %", "inconclusive"),
        ({"at_most": "1.452 m"}, "95 %", "inconclusive"),
        ({"at_most": "1.451 m"}, "95 %", "failed"),
        # The 5 % quantile is at least 1.4 m and at most 1.406 m.
        ({"at_least": "1.406 m"}, "5 %", "inconclusive"),
        ({"at_least": "1.407 m"}, "5 %", "failed"),
    ],
)
def test_a_quantile_is_refuted_beyond_its_other_bound(bound: dict[str, Any], share: str, status: str) -> None:
    values = [round(1.4 + number / 1000, 3) for number in range(59)]
    assert quantile({"q": share, **bound}, values).status == status


def test_values_that_are_not_known() -> None:
    # A value of several expectations or of an undecided one is not known.
    (expected,) = PASS.expectations
    cut_off = expected.model_copy(update={"verdict": Verdict(True, 1.5, 1.0, 0.5, "m", cut_off=True)})
    gate = planned({"quantile": {"of": "travel.measured", "q": "5 %", "at_least": "1.4 m"}}, 100)
    for expectations in ((expected, expected), (cut_off,)):
        runs = [PASS.model_copy(update={"expectations": expectations}) for _ in range(100)]
        assert "100 runs measured nothing" in messages(judged_gate(gate, runs))[0]
    # An invariant of a run that a failure ended, or that was crossed before its end, could have become worse.
    whole = PASS.model_copy(update={"end": "duration", "sim_time": 3.0})
    failing = expected.model_copy(update={"verdict": Verdict(False, 1.5, 1.6, -0.1, "m", time=2.0)})
    warning = failing.model_copy(update={"severity": "warning"})
    at_the_end = warning.model_copy(update={"verdict": replace(failing.verdict, time=3.0)})
    # The function of a user, which is called at the end.
    timeless = warning.model_copy(update={"verdict": replace(failing.verdict, time=None)})
    goal = expected.model_copy(update={"verdict": Verdict(True, 1.5, 1.0, 0.5, "m", time=2.0, goal=True)})
    for end, expectation, is_whole in (
        ("expectation failed", expected, False),
        ("expectation failed", at_the_end, False),
        ("expectation failed", goal, True),
        ("duration", failing, True),
        ("duration", warning, False),
        ("duration", at_the_end, True),
        ("duration", timeless, True),
        ("duration", expected, True),
    ):
        runs = [whole.model_copy(update={"end": end, "expectations": (expectation,)}) for _ in range(100)]
        assert ("100 runs measured nothing" in messages(judged_gate(gate, runs))[0]) != is_whole
    # A goal keeps the value with which it was met: it shows nothing beyond.
    for stated, of, claimed, is_whole in (
        ("at_least", "measured", "at_least", True),
        ("at_least", "measured", "at_most", False),
        ("moved.at_most", "measured", "at_least", False),
        ("gap", "measured", "at_most", True),
        ("gap", "margin", "at_most", False),
    ):
        met = goal.model_copy(update={"scope": Scope(stated={stated: 1.0})})
        beyond = planned({"quantile": {"of": f"travel.{of}", "q": "50 %", claimed: "1.5 m"}}, 100)
        judged = judged_gate(beyond, [whole.model_copy(update={"expectations": (met,)})] * 100)
        assert ("100 runs measured nothing" in messages(judged)[0]) != is_whole
    # A value that was not measured counts against the claim.
    values: list[float | None] = [1.5] * 100
    assert quantile({"at_least": "1.4 m"}, values).status == "passed"
    lost = quantile({"at_least": "1.4 m"}, [*values[:90], *[None] * 10])
    assert lost.status == "inconclusive"
    assert "10 runs measured nothing" in lost.verdict.message
    # A value that is no number was not measured.
    found = quantile({"at_least": "1.4 m"}, [float("nan"), *[1.5] * 99])
    assert "1 run measured nothing" in found.verdict.message


def test_the_bounds_of_the_rate_have_the_confidence_of_the_first_quantile() -> None:
    claim = {"of": "travel.measured", "q": "50 %", "at_least": "1 m"}
    claims = [claim | {"confidence": confidence} for confidence in ("90 %", "80 %")]
    statistics = judged_gate(planned({"quantile": claims}, 100), [PASS] * 100).statistics
    assert statistics is not None
    assert statistics.confidence == 0.9


def test_a_quantile_in_another_unit_is_no_verdict() -> None:
    gate = planned({"quantile": {"of": "travel.measured", "q": "5 %", "at_least": "1.4 s"}}, 100)
    judged = judged_gate(gate, [run(value=1.5)] * 100)
    assert (judged.status, judged.exit_code) == ("error", ExitCode.INVALID)
    assert judged.failures[0].message == "travel.measured is in m, and the limit is 1.4 s; write it in m"


def test_runs_that_are_one_run_show_nothing() -> None:
    """Such as noise of a sensor that nobody reads; results of older versions have digests only."""
    same = [PASS.model_copy(update={"digest": "a"})] * 61
    judged = judged_gate(planned(NINETY, 61), same)
    assert (judged.status, judged.exit_code) == ("error", ExitCode.INVALID)
    assert judged.failures[0].message.startswith("all 61 runs are the same run for the rate")
    other = PASS.model_copy(update={"digest": "b"})
    assert judged_gate(planned(NINETY, 61), [*same[1:], other]).status == "passed"
    # An expectation may judge what the robot does not react to, such as a noisy reading.
    noisy = run(value=1.6).model_copy(update={"digest": "a"})
    assert judged_gate(planned(NINETY, 61), [*same[1:], noisy]).status == "passed"


FIGURES = (2.0, *[0.5] * (RELATIVE_FIGURES - 1), 0.0, 0.0, 0.0, 1.0, 0.0)
"""Those of a motion: at last the place and the heading at its start."""


def moved(
    number: int,
    changed: Mapping[int, float] | None = None,
    *,
    value: float = 1.5,
    unit: str = "m",
    status: Status = "passed",
) -> Outcome:
    """Return run `number`; `changed`: figures of its motion by their places."""
    figures = list(FIGURES)
    for place, figure in (changed or {}).items():
        figures[place] = figure
    outcome = run(status, value)
    (expected,) = outcome.expectations
    verdict = replace(expected.verdict, measured=value, unit=unit)
    judged = expected.model_copy(update={"verdict": verdict})
    return outcome.model_copy(update={"digest": str(number), "motion": tuple(figures), "expectations": (judged,)})


CLAIMS = (
    NINETY,
    {"stop_early": {"reject": "50 %", "accept": "90 %"}},
    {"quantile": {"of": "travel.measured", "q": "50 %", "at_least": "1 m"}},
    {"quantile": {"of": "travel.margin", "q": "50 %", "at_least": "-9 m"}},
)


@pytest.mark.parametrize("claims", CLAIMS)
@given(
    seed=st.integers(0, 2**32),
    count=st.integers(29, 80),
    value=st.floats(-1e6, 1e6),
    status=st.sampled_from(["passed", "failed"]),
)
def test_runs_that_differ_by_rounding_are_one_sample(
    claims: dict[str, Any], seed: int, count: int, value: float, status: Status
) -> None:
    """Also if the limit lies between two of them."""
    runs, random = [], Random(seed)
    for number in range(count):
        figures = {place: figure + random.uniform(-4e-7, 4e-7) for place, figure in enumerate(FIGURES)}
        runs.append(moved(number, figures, value=value + random.uniform(-4e-7, 4e-7), status=status))
    judged = judged_gate(planned(claims, count), runs)
    assert judged.status == "error"
    assert judged.failures[0].message.startswith("all ")
    assert "same run for" in judged.failures[0].message


@pytest.mark.parametrize("place", range(RELATIVE_FIGURES))
def test_runs_of_which_one_moved_otherwise_are_samples(place: int) -> None:
    runs = [moved(number) for number in range(28)] + [moved(28, {place: FIGURES[place] + 1e-4})]
    assert judged_gate(planned(NINETY, 29), runs).status == "passed"


def test_another_place_to_start_is_no_sample_of_a_quantity_of_the_motion() -> None:
    """But it is one of where the robot collides."""
    started = RELATIVE_FIGURES
    runs = [moved(number, {started: number / 10}) for number in range(29)]
    assert judged_gate(planned(NINETY, 29), runs).status == "error"
    contacts = [moved(number, {started: number / 10}, value=0.0, unit="contacts") for number in range(29)]
    assert judged_gate(planned(NINETY, 29), contacts).status == "passed"
    measured = [moved(number, {started: number / 10}, value=1 + number / 10) for number in range(29)]
    assert judged_gate(planned(NINETY, 29), measured).status == "passed"


def test_a_quantile_of_what_is_the_same_in_all_runs_shows_nothing() -> None:
    """Although another expectation measured something else in each."""
    runs = []
    for number in range(29):
        one = moved(number)
        (expected,) = one.expectations
        other = expected.model_copy(
            update={"name": "sees", "assertion": "sensor", "verdict": replace(expected.verdict, measured=float(number))}
        )
        runs.append(one.model_copy(update={"expectations": (expected, other)}))
    assert judged_gate(planned(NINETY, 29), runs).status == "passed"
    claim = {"quantile": {"of": "travel.measured", "q": "50 %", "at_least": "1 m"}}
    judged = judged_gate(planned(NINETY | claim, 29), runs)
    assert "same run for travel.measured" in judged.failures[0].message


@pytest.mark.parametrize(("passes", "status"), [(0, "failed"), (14, "failed"), (15, "passed"), (29, "passed")])
def test_a_quantile_alone_does_not_hide_that_most_runs_fail(passes: int, status: Status) -> None:
    claim = {"quantile": {"of": "travel.measured", "q": "50 %", "at_least": "1 m"}}
    runs = [PASS] * passes + [FAIL] * (29 - passes)
    judged = judged_gate(planned(claim, 29), runs)
    assert judged.status == status
    allowed = planned(claim, 29).model_copy(update={"may_be_low": True})
    assert judged_gate(allowed, runs).status == "passed"
    if status == "failed":
        assert "a quantile alone says nothing about failed runs" in messages(judged)[1]


def test_more_runs_than_planned_leave_no_verdict() -> None:
    judged = judged_gate(planned(NINETY, 61), [PASS] * 62)
    assert (judged.status, judged.exit_code) == ("error", ExitCode.INVALID)
    assert judged.failures[0].message.startswith("62 runs belong to a gate of 61")


@pytest.mark.parametrize("rate", [0.80, 0.88, 0.90, 0.95])
def test_simulated_gates_are_wrong_as_seldom_as_stated(rate: float) -> None:
    """2,000 gates over Bernoulli robots of known rates: false verdicts within 1 - confidence."""
    random, gate, count = Random(f"gates {rate}"), planned(NINETY, 61), 2000
    passes = Counter(sum(random.random() < rate for _ in range(61)) for _ in range(count))
    verdicts = Counter[Status]()
    for passed, gates in passes.items():
        verdicts[judged_gate(gate, [PASS] * passed + [FAIL] * (61 - passed)).status] += gates
    # Of a robot at the limit itself, it is wrong to fail it.
    wrong = verdicts["passed" if rate < 0.9 else "failed"] / count
    assert wrong <= 0.05 + 3 * (0.05 * 0.95 / count) ** 0.5
    exact = chances(rate, 61, 0.9, 0.95)
    found = [verdicts["passed"], verdicts["failed"], verdicts["inconclusive"]]
    expected = [exact.passed, exact.failed, exact.inconclusive]
    assert [each / count for each in found] == pytest.approx(expected, abs=0.04)


def test_gates_among_outcomes() -> None:
    # A gate stands before its runs and counts alone.
    other = Outcome(name="b", file="a.sim.yml", status="skipped")
    found = over_variations([other, *[PASS] * 60, FAIL], [planned(NINETY, 61)])
    assert [outcome.statistics is not None for outcome in found[:3]] == [False, True, False]
    assert (len(found), found[1].status) == (63, "passed")
    assert found[-1].exit_code is ExitCode.PASSED
    assert over_variations(found, [planned(NINETY, 61)]) == found
    # A part of a gate is not judged.
    found = over_variations([PASS] * 20, [planned(NINETY, 61)], is_part=True)
    assert len(found) == 20
    assert over_variations([PASS] * 61, [planned(NINETY, 61)], is_part=True)[0].status == "passed"
    # Runs of an unknown gate count by themselves.
    # Otherwise nothing would judge them, and the call would pass.
    found = over_variations([PASS, FAIL], [])
    assert [outcome.is_sample for outcome in found] == [False, False]
    assert found[-1].exit_code is ExitCode.FAILED
