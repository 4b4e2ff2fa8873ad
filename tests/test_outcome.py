"""What one outcome and all of them say to the process that called."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.errors import ExitCode, InvalidScenario, UsageError
from sim_action.location import Location, Problem
from sim_action.outcome import ExpectationOutcome, Failure, FailureKind, Outcome, Results
from sim_action.verdict import Verdict


def outcome(name: str = "a", kind: FailureKind | None = None, *, passed: bool = True) -> Outcome:
    if kind is None:
        return Outcome(name=name, file=f"{name}.sim.yml", status="passed" if passed else "failed", travelled=1.5)
    failure = Failure(kind=kind, title=kind, message="why")
    return Outcome(name=name, file=f"{name}.sim.yml", status="error", failures=(failure,))


def results(*outcomes: Outcome) -> Results:
    return Results(sim_action="0", python="3.11", platform="here", wall_time=1.0, outcomes=outcomes)


@pytest.mark.parametrize(
    ("outcomes", "code", "conclusion"),
    [
        ([outcome()], 0, "success"),
        ([outcome(), outcome(passed=False)], 1, "failure"),
        ([outcome(kind="crash")], 1, "failure"),
        ([outcome(passed=False), outcome(kind="invalid")], 2, "failure"),
        ([outcome(kind="invalid"), outcome(kind="internal")], 3, "failure"),
        ([outcome(kind="internal"), outcome(kind="interrupted"), outcome(passed=False)], 130, "cancelled"),
        ([], 5, "failure"),
    ],
)
def test_the_worst_outcome_makes_the_exit_code(outcomes: list[Outcome], code: int, conclusion: str) -> None:
    assert results(*outcomes).exit_code == code
    assert results(*outcomes).conclusion == conclusion


def test_results_are_read_as_they_were_written(tmp_path: Path) -> None:
    verdict = Verdict(False, 1.12, 1.5, -0.38, "m", 30.0, "travelled 1.12 m of 1.5 m in 30.0 s")
    expectation = ExpectationOutcome(
        name="far", assertion="travel", severity="error", location=Location("a.sim.yml", 9, 5), verdict=verdict
    )
    written = results(
        outcome(passed=False).model_copy(update={"expectations": (expectation,)}), outcome("b", kind="wall limit")
    )
    assert Results.read(written.write(tmp_path)) == written


@pytest.mark.parametrize("text", ["", "{}", '{"version": 2}', "[1, 2]"])
def test_what_is_no_results_file_is_a_usage_error(tmp_path: Path, text: str) -> None:
    (tmp_path / "results.json").write_text(text)
    with pytest.raises(UsageError, match=r"results\.json is no results file"):
        Results.read(tmp_path / "results.json")


def test_an_invalid_file_has_a_failure_for_each_problem() -> None:
    error = InvalidScenario(
        [Problem(Location("x/a.sim.yml", 1, 2), "first"), Problem(Location("x/a.sim.yml"), "second")]
    )
    made = Outcome.of_invalid("x/a.sim.yml", error)
    assert (made.name, made.file, made.status, made.exit_code) == (
        "a.sim.yml",
        "x/a.sim.yml",
        "error",
        ExitCode.INVALID,
    )
    assert [failure.message for failure in made.failures] == ["first", "second"]


def test_the_worst_come_first() -> None:
    given = results(outcome("fine"), outcome("failed", passed=False), outcome("broken", kind="crash"))
    assert [found.name for found in given.worst_first()] == ["broken", "failed", "fine"]


def test_how_far_the_robot_came_is_told_for_one_scenario_alone() -> None:
    assert results(outcome()).travelled == 1.5
    assert results(outcome(), outcome()).travelled is None
