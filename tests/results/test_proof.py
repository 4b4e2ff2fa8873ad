"""The exit code and the file of a proof."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest

from sim_action.app.schema import proof_schema
from sim_action.core.errors import ExitCode, Location
from sim_action.results.output_folder import is_proof
from sim_action.results.proof import Finding, MutantResult, PathChange, Proof, ProvenExpectation, ProvenScenario
from sim_action.results.results_json import write_json


def proof(*scenarios: ProvenScenario) -> Proof:
    return Proof(sim_action="1.0.0", runs=3, wall_time=1.0, scenarios=scenarios)


def scenario(finding: Finding = "notices", reason: str = "", exit_code: int = 0) -> ProvenScenario:
    place = Location("a.sim.yml", 8, 5)
    expected = ProvenExpectation(name="travel", assertion="travel", severity="error", location=place, finding=finding)
    change = PathChange(text="the robot was 0.80 m further left", distance=0.8, angle=0.0)
    return ProvenScenario(
        name="a",
        file="a.sim.yml",
        reason=reason,
        exit_code=exit_code,
        expectations=(expected,),
        mutants=(MutantResult(name="wall", words="a wall", status="survived", change=change),),
    )


@pytest.mark.parametrize(
    ("made", "code", "strict"),
    [
        (proof(), ExitCode.NO_SCENARIO, ExitCode.NO_SCENARIO),
        (proof(scenario()), ExitCode.PASSED, ExitCode.PASSED),
        (proof(scenario("unknown")), ExitCode.PASSED, ExitCode.FAILED),
        (proof(scenario("checks nothing")), ExitCode.PASSED, ExitCode.FAILED),
        (proof(scenario(), scenario(reason="failed", exit_code=1)), ExitCode.PASSED, ExitCode.FAILED),
        (proof(scenario(reason="invalid", exit_code=2)), ExitCode.INVALID, ExitCode.INVALID),
        (proof(scenario(reason="interrupted", exit_code=130)), ExitCode.INTERRUPTED, ExitCode.INTERRUPTED),
    ],
)
def test_exit_codes(made: Proof, code: ExitCode, strict: ExitCode) -> None:
    assert (made.exit_code(strict=False), made.exit_code(strict=True)) == (code, strict)


def test_the_file_is_as_its_schema_says(tmp_path: Path) -> None:
    path = tmp_path / "proof.json"
    made = proof(scenario("checks nothing"))
    write_json(made, path)
    written = json.loads(path.read_text())
    jsonschema.validate(written, proof_schema())
    assert Proof.model_validate_json(path.read_bytes()) == made
    assert is_proof(path.read_bytes())
    assert written["version"] == 1
