"""The report of a proof on a terminal."""

from __future__ import annotations

import io

from sim_action.core.errors import Location
from sim_action.reports.proof import headline, print_proof
from sim_action.results.proof import MutantResult, PathChange, Proof, ProvenExpectation, ProvenScenario

PLACE = Location("a.sim.yml", 8, 5)
CHANGE = PathChange(text="the robot was 0.80 m further left at 3.1 s", distance=0.8, angle=0.0)


def expected(name: str, **keys: object) -> ProvenExpectation:
    return ProvenExpectation.model_validate(
        {"name": name, "assertion": name, "severity": "error", "location": PLACE, **keys}
    )


PROVEN = ProvenScenario(
    name="burger\nturns",
    file="a.sim.yml",
    line=3,
    expectations=(
        expected("reach", finding="notices", noticed=(*"abcdefgh",), sensitivity=0.25),
        expected("upright", finding="checks nothing", missed=("a", "b")),
    ),
    mutants=(
        MutantResult(name="a", words="a fault", status="noticed", noticed_by=(0,)),
        MutantResult(
            name="b", words="b fault", status="survived", change=CHANGE, suggestion="- reach: {x: 1}\n  before: 2"
        ),
        MutantResult(name="c", words="c fault", status="survived"),
        MutantResult(name="f", words="f fault", status="survived", change=CHANGE),
        MutantResult(
            name="g", words="g fault", status="survived", change=CHANGE, suggestion="- reach: {x: 1}\n  before: 2"
        ),
        MutantResult(name="d", words="d fault", status="no effect"),
        MutantResult(name="e", words="e fault", status="could not run", reason="script error: stuck"),
    ),
    left_out=2,
)
FAILED = ProvenScenario(name="burger fails", file="b.sim.yml", reason="failed (travelled 1 m)", exit_code=1)
UNKNOWN = ProvenScenario(name="lamp", file="c.sim.yml", expectations=(expected("settled", finding="unknown"),))
PROOF = Proof(sim_action="1.0.0", runs=9, wall_time=1.0, scenarios=(PROVEN, FAILED, UNKNOWN))


def test_the_report() -> None:
    stream = io.StringIO()
    print_proof(PROOF, {}, stream)
    assert stream.getvalue().splitlines() == [
        "burger turns  a.sim.yml:3",
        "  ✓ reach: notices 8 of 5: a, b, c, d, e, f and 2 more; 25% from its limit",
        "  ✗ upright: checks nothing here: 5 mutants changed the run, 2 of them noticed by others",
        "      a.sim.yml:8:5",
        "  ! b: b fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "  ! g: g fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "      this expectation would have noticed them:",
        "        - reach: {x: 1}",
        "          before: 2",
        "  ! f: f fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "  unnoticed, with little other motion: c",
        "  no effect: d",
        "  could not run: e: script error: stuck",
        "  2 mutants left out: over the budget",
        "",
        "burger fails  b.sim.yml",
        "  not mutated: failed (travelled 1 m)",
        "",
        "lamp  c.sim.yml",
        "  · settled: nothing is known: no mutant changed the run",
        "",
        headline(PROOF),
    ]


def test_symbols_that_a_stream_cannot_show_are_letters() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    print_proof(PROOF, {}, stream)
    stream.seek(0)
    assert "  x upright: checks nothing here" in stream.read()


def test_a_headline_without_scenarios() -> None:
    empty = PROOF.model_copy(update={"scenarios": ()})
    assert headline(empty) == "0 expectations check nothing, 0 notice something"


def test_the_headline_counts_everything() -> None:
    told = headline(PROOF)
    assert told.startswith("1 expectation checks nothing, 1 notices something, 1 unknown, ")
    assert told.endswith(", 3 other motions unnoticed; 1 scenario not mutated")
