"""A proof with every kind of finding."""

from __future__ import annotations

from sim_action.core.errors import Location
from sim_action.results.proof import MutantResult, PathChange, Proof, ProvenExpectation, ProvenScenario

PLACE = Location("a.sim.yml", 8, 5)
CHANGE = PathChange(text="the robot was 0.80 m further left at 3.1 s", distance=0.8, angle=0.0)


def expected(name: str, **keys: object) -> ProvenExpectation:
    stated = {"name": name, "assertion": name, "severity": "error", "location": PLACE}
    return ProvenExpectation.model_validate(stated | keys)


SOONER = "- reach: {x: 1}\n  before: 2"
PROVEN = ProvenScenario(
    name="burger\nturns",
    file="a.sim.yml",
    line=3,
    expectations=(
        expected("reach", finding="notices", noticed=(*"abcdefgh",), changed=9, sensitivity=0.25),
        expected("upright", finding="checks nothing", missed=("a", "b"), not_exercised=("h",), changed=5),
    ),
    mutants=(
        MutantResult(name="a", words="a fault", status="noticed", noticed_by=(0,)),
        MutantResult(name="b", words="b fault", status="survived", change=CHANGE, suggestion=SOONER),
        MutantResult(name="c", words="c fault", status="survived"),
        MutantResult(name="f", words="f fault", status="survived", change=CHANGE),
        MutantResult(name="g", words="g fault", status="survived", change=CHANGE, suggestion=SOONER),
        MutantResult(name="d", words="d fault", status="no effect"),
        MutantResult(name="e", words="e fault", status="could not run", reason="script error: stuck"),
    ),
    left_out=2,
)
FAILED = ProvenScenario(
    name="burger fails",
    file="b.sim.yml",
    reason="failed (travelled 1 m)",
    location=Location("b.sim.yml", 6, 5),
    exit_code=1,
)
INVALID = ProvenScenario(
    name="burger is invalid",
    file="d.sim.yml",
    reason="invalid scenario: expect: unknown key 'nonsense'",
    location=Location("d.sim.yml", 3, 9),
    exit_code=2,
)
UNKNOWN = ProvenScenario(name="lamp", file="c.sim.yml", expectations=(expected("settled", finding="unknown"),))
PROOF = Proof(sim_action="1.0.0", runs=9, wall_time=1.0, scenarios=(PROVEN, FAILED, UNKNOWN))
