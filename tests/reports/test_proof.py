"""The report of a proof on a terminal."""

from __future__ import annotations

import io

import pytest

from sim_action.reports.proof import finding_text, headline, print_proof
from sim_action.results.proof import ProvenScenario
from tests.outcomes import like
from tests.reports.proofs import PROOF, PROVEN, UNKNOWN, expected

GOOD = like(PROVEN, expectations=PROVEN.expectations[:1])


def test_the_report() -> None:
    stream = io.StringIO()
    print_proof(PROOF, {}, stream)
    assert stream.getvalue().splitlines() == [
        "burger turns  a.sim.yml:3",
        "  ✓ reach: notices 8 of 9: a, b, c, d, e, f and 2 more; 25% from its limit",
        "  ✗ upright: checks nothing here: 5 mutants changed the run, 2 of them noticed by others; not exercised in: h",
        "      a.sim.yml:8:5",
        "  ! b: b fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "  ! g: g fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "      this expectation would have noticed them:",
        "        - reach: {x: 1}",
        "          before: 2",
        "  ! f: f fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "      no expectation was found that would have noticed it",
        "  unnoticed, with little other motion: c",
        "  no effect: d",
        "  could not run: e: script error: stuck",
        "  2 mutants left out",
        "",
        "burger fails  b.sim.yml",
        "  not mutated: failed (travelled 1 m)",
        "      b.sim.yml:6:5",
        "",
        "lamp  c.sim.yml",
        "  · settled: unknown: no mutant changed the run",
        "",
        headline(PROOF),
    ]


@pytest.mark.parametrize(
    ("keys", "counts", "reason"),
    [
        ({}, {}, "no mutant changed the run"),
        ({"not_exercised": ("doubled",)}, {}, "no other mutant changed the run; not exercised in: doubled"),
        ({"changed": 1}, {"left_out": 8}, "it noticed none of 1 mutant that changed the run; 8 mutants were left out"),
        (
            {},
            {"left_out": 1, "unfinished": 2},
            "no mutant changed the run; 1 mutant was left out; 2 mutants had not ended",
        ),
        ({"passed": False}, {"left_out": 1}, "it did not pass without a mutant either"),
    ],
)
def test_the_reason_why_nothing_is_known(keys: dict[str, object], counts: dict[str, int], reason: str) -> None:
    settled = expected("settled", finding="unknown", **keys)
    assert finding_text(settled, like(UNKNOWN, **counts)) == f"unknown: {reason}"


def test_a_limit_that_is_far_away_has_no_exact_share() -> None:
    near, far = (expected("reach", finding="notices", sensitivity=share) for share in (10.0, 12.5))
    assert finding_text(near, UNKNOWN).endswith("; 1000% from its limit")
    assert finding_text(far, UNKNOWN).endswith("; more than 1000% from its limit")


def test_symbols_that_a_stream_cannot_show_are_letters() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    print_proof(PROOF, {}, stream)
    stream.seek(0)
    assert "  x upright: checks nothing here" in stream.read()


def test_a_headline_without_scenarios() -> None:
    empty = like(PROOF, scenarios=())
    assert headline(empty) == "0 expectations check nothing, 0 notice something"


def test_the_headline_counts_everything() -> None:
    told = headline(PROOF)
    assert told.startswith("1 expectation checks nothing, 1 notices something, 1 unknown, ")
    assert told.endswith(", 3 other motions unnoticed; 1 scenario not mutated")


def test_an_interruption_is_told() -> None:
    stream = io.StringIO()
    scenario = like(PROVEN, unfinished=3)
    interrupted = like(PROOF, interrupted=True, scenarios=(scenario,))
    print_proof(interrupted, {}, stream)
    assert "  3 mutants had not ended when the call was interrupted\n" in stream.getvalue()
    assert headline(interrupted).startswith("interrupted before 3 mutants had ended: 1 expectation checks nothing")
    complete = like(PROOF, interrupted=True)
    assert headline(complete).startswith("interrupted: 1 expectation")


@pytest.mark.parametrize(
    ("scenarios", "colour"), [((PROVEN,), "1;31"), ((UNKNOWN,), "33"), ((), "33"), ((GOOD,), "32")]
)
def test_the_headline_is_green_only_if_every_expectation_notices(
    scenarios: tuple[ProvenScenario, ...], colour: str
) -> None:
    stream = io.StringIO()
    print_proof(like(PROOF, scenarios=scenarios), {"FORCE_COLOR": "1"}, stream)
    assert stream.getvalue().splitlines()[-1].startswith(f"\x1b[{colour}m")
