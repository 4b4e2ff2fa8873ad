"""What one outcome says of what became of a scenario."""

from __future__ import annotations

from sim_action.core.errors import ExitCode, InvalidScenario, Location, Problem
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.state.verdict import Verdict


def test_what_was_named_and_holds_nothing_is_invalid() -> None:
    made = Outcome.of_nothing("no\npe*")
    assert (made.file, made.exit_code) == ("no\\npe*", ExitCode.INVALID)


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


def test_what_another_expectation_cut_off_comes_last() -> None:
    first, second, third = (
        ExpectationOutcome(
            name=name,
            assertion="travel",
            severity="error",
            location=Location("a.sim.yml", 9, 5),
            verdict=Verdict(False, cut_off=cut_off),
        )
        for name, cut_off in (("far", True), ("near", False), ("gentle", False))
    )
    made = Outcome(name="a", file="a.sim.yml", status="failed", expectations=(first, second, third))
    assert made.causes_first == (second, third, first)
    assert made.expectations == (first, second, third)
