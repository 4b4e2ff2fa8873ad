"""What one outcome says of what became of a scenario."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_action.assertions.no_collision import SelfCollision
from sim_action.core.errors import ExitCode, InvalidScenario, Location, MissingScenario, Problem
from sim_action.results.gates import over_variations
from sim_action.results.outcome import ExpectationOutcome, ExpectationStatus, Outcome, Scope, Status, status_of
from sim_action.scenario.model import Severity, Unexercised
from sim_action.scenario.selection import Unmatched
from sim_action.state.verdict import Judged, Verdict
from sim_action.world.claims import AuditWarning
from tests.scenarios import LEAST, expecting, load

PASSED, FAILED, NEVER = Verdict(True, judged=Judged(1, 0.0, 0.0)), Verdict(False), Verdict(False, judged=Judged())


def expectation(
    verdict: Verdict, severity: Severity = "error", unexercised: Unexercised = "error"
) -> ExpectationOutcome:
    where = Location("a.sim.yml", 9, 5)
    return ExpectationOutcome(
        name="far", assertion="travel", severity=severity, location=where, verdict=verdict, unexercised=unexercised
    )


def test_places_of_what_is_missing() -> None:
    # What was named and holds nothing is invalid.
    made = Outcome.of_nothing("no\npe*")
    assert (made.file, made.location, made.exit_code) == ("no\\npe*", None, ExitCode.INVALID)
    (failure,) = made.failures
    assert (failure.title, failure.location) == ("not found", None)
    assert failure.message == "no scenario found at 'no\\npe*'; correct the path or remove it"
    # A missing file has no place but the key that names it may have one.
    for place, shown in ((Location("a.sim.yml"), None), (key := Location("pyproject.toml", 3, 1), key)):
        made = Outcome.of_invalid("a.sim.yml", MissingScenario([Problem(place, "there is no file")]))
        assert (made.file, made.location, made.exit_code) == ("a.sim.yml", None, ExitCode.INVALID)
        assert [(failure.title, failure.location) for failure in made.failures] == [("not found", shown)]
    # What selects nothing is invalid and belongs to no file.
    broken = Problem(Location("b.sim.yml", 2, 1), "no YAML")
    made = Outcome.of_unmatched(Unmatched("--only", "no\npe*", "no scenario is named 'no\npe*'", (broken,)))
    assert (made.name, made.file, made.location, made.exit_code) == ("--only no\\npe*", "", None, ExitCode.INVALID)
    assert [(failure.message, failure.location) for failure in made.failures] == [
        ("no scenario is named 'no\\npe*'", None),
        ("no YAML", broken.location),
    ]


def test_an_invalid_file_has_a_failure_for_each_problem() -> None:
    problems = [Problem(Location("x/a.sim.yml", 1, 2), "first"), Problem(Location("x/a.sim.yml"), "second")]
    made = Outcome.of_invalid("x/a.sim.yml", InvalidScenario(problems))
    assert (made.name, made.file) == ("a.sim.yml", "x/a.sim.yml")
    assert (made.status, made.exit_code) == ("error", ExitCode.INVALID)
    assert [failure.message for failure in made.failures] == ["first", "second"]


def test_what_another_expectation_cut_off_comes_last() -> None:
    first, second, third = (
        expectation(Verdict(False, message=name, cut_off=cut_off))
        for name, cut_off in (("far", True), ("near", False), ("gentle", False))
    )
    made = Outcome(name="a", file="a.sim.yml", status="failed", expectations=(first, second, third))
    assert made.causes_first == (second, third, first)
    assert made.expectations == (first, second, third)


@pytest.mark.parametrize(
    ("verdict", "severity", "unexercised", "status"),
    [
        (PASSED, "error", "error", "passed"),
        (PASSED, "warning", "warn", "passed"),
        (FAILED, "error", "warn", "failed"),
        (FAILED, "warning", "error", "warned"),
        (NEVER, "error", "error", "not_exercised"),
        (NEVER, "error", "warn", "warned"),
        (NEVER, "warning", "error", "warned"),
    ],
)
def test_severity_and_unexercised_soften_a_verdict(
    verdict: Verdict, severity: Severity, unexercised: Unexercised, status: ExpectationStatus
) -> None:
    assert expectation(verdict, severity, unexercised).status == status


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [((PASSED, PASSED), "passed"), ((PASSED, NEVER), "not_exercised"), ((NEVER, FAILED, PASSED), "failed")],
)
def test_the_worst_expectation_gives_the_status_and_all_but_a_pass_exit_code_1(
    verdicts: tuple[Verdict, ...], status: Status
) -> None:
    expectations = tuple(expectation(verdict) for verdict in verdicts)
    assert status_of(expectations) == status
    outcome = Outcome(name="a", file="a.sim.yml", status=status, expectations=expectations)
    assert outcome.display_status == status
    assert outcome.exit_code is (ExitCode.PASSED if status == "passed" else ExitCode.FAILED)


def test_a_warning_of_the_audit_keeps_the_status_and_is_displayed() -> None:
    warning = AuditWarning(rule="never-moved", message="it did not move", location=Location("a.sim.yml", 9))
    outcome = Outcome(name="a", file="a.sim.yml", status="passed", warnings=(warning,))
    assert (outcome.display_status, outcome.exit_code) == ("warned", ExitCode.PASSED)
    assert outcome.model_copy(update={"status": "failed"}).display_status == "failed"
    assert str(warning) == "it did not move [never-moved]"


NEVER_HELD = AuditWarning(rule="premise-never-held", message="it never held", location=Location("a.sim.yml", 9))
OTHER = NEVER_HELD.model_copy(update={"location": Location("a.sim.yml", 10)})
STILL = AuditWarning(rule="never-moved", message="it did not move", location=Location("a.sim.yml", 4))
UNKNOWN = AuditWarning(rule="of-a-later-version", message="news", location=Location("a.sim.yml", 4))


def varied(*warnings: AuditWarning, group: str | None = "push", **changed: Any) -> Outcome:
    outcome = Outcome(name="push[x=1]", file="a.sim.yml", group=group, status="passed", warnings=warnings)
    return outcome.model_copy(update=changed)


def audited(*outcomes: Outcome) -> list[tuple[AuditWarning, ...]]:
    return [outcome.warnings for outcome in over_variations(outcomes, ())]


def test_a_premise_counts_only_if_it_held_in_no_variation() -> None:
    assert audited(varied(NEVER_HELD, STILL, UNKNOWN), varied()) == [(STILL, UNKNOWN), ()]
    assert audited(varied(), varied(NEVER_HELD)) == [(), ()]
    assert audited(varied(NEVER_HELD), varied(NEVER_HELD)) == [(NEVER_HELD,)] * 2
    assert audited(varied(NEVER_HELD, OTHER), varied(OTHER)) == [(OTHER,)] * 2
    # Other scenarios and scenarios without variations say nothing about it.
    assert audited(varied(NEVER_HELD), varied(group="pull"), varied(file="b.sim.yml")) == [(NEVER_HELD,), (), ()]
    assert audited(varied(NEVER_HELD, group=None), varied(group=None)) == [(NEVER_HELD,), ()]


@pytest.mark.parametrize(
    ("warnings", "others", "status"),
    [
        ((), (), "passed"),
        ((STILL,), (), "failed"),
        ((NEVER_HELD,), (NEVER_HELD,), "failed"),
        ((NEVER_HELD,), (), "passed"),
        ((NEVER_HELD, STILL), (), "failed"),
    ],
)
def test_a_strict_outcome_fails_by_the_warnings_that_count(
    warnings: tuple[AuditWarning, ...], others: tuple[AuditWarning, ...], status: Status
) -> None:
    one, other = varied(*warnings, strict=True), varied(*others, strict=True)
    alone = one.model_copy(update={"status": one.judged_status(is_varied=True)})
    assert alone.status == ("failed" if STILL in warnings else "passed")
    final = over_variations([alone, other], ())[0]
    assert (final.status, final.exit_code) == (status, ExitCode.FAILED if status == "failed" else ExitCode.PASSED)
    # Joined with other shards, the same outcome is judged anew.
    assert over_variations([final, varied(strict=True)], ())[0].status == alone.status
    assert over_variations([final.model_copy(update={"strict": False}), other], ())[0].status == status


@pytest.mark.parametrize(("warnings", "status"), [((STILL, OTHER), "failed"), ((OTHER,), "passed")])
def test_accepted_warnings_do_not_fail_a_strict_outcome(warnings: tuple[AuditWarning, ...], status: Status) -> None:
    found = varied(*warnings, notes=("a",)).judged_strictly(OTHER.rule)
    assert (found.status, found.strict, found.notes) == (status, True, ("a", str(OTHER)))
    assert found.warnings == tuple(warning for warning in warnings if warning is STILL)
    assert varied(*warnings, status="error").judged_strictly(OTHER.rule).status == "error"


@pytest.mark.parametrize(
    "changed", [{"status": "error"}, {"status": "skipped"}, {"status": "failed", "end": "expectation failed"}]
)
def test_a_variation_that_did_not_run_to_its_end_says_nothing_about_the_others(changed: dict[str, Any]) -> None:
    assert audited(varied(NEVER_HELD), varied(**changed), varied(NEVER_HELD)) == [(NEVER_HELD,), (), (NEVER_HELD,)]
    assert audited(varied(**changed)) == [()]


@pytest.mark.parametrize(
    ("expect", "scope"),
    [
        ("travel: {at_least: 1 m}", Scope()),
        ("travel: {at_least: 1 m}\n    after: 1 s\n    before: 4 s\n    for: 2 s", Scope(after=1, before=4, held=2)),
        ("settled: {for: 3 s}", Scope(held=3)),
        ("all_of: [{no_collision: {allow: [b, a]}}, upright]", Scope(allowed=("a", "b"))),
    ],
)
def test_the_scope_of_an_expectation_is_what_the_file_says(expect: str, scope: Scope, tmp_path: Path) -> None:
    world = "world: {objects: [{name: a, box: [1, 1, 1], pose: {x: 5}}, {name: b, box: [1, 1, 1], pose: {x: 9}}]}\n"
    loaded = load(tmp_path, expecting(expect) + world)
    found = Scope.of(loaded.scenario.expect[0], loaded.scenario)
    assert found.model_copy(update={"stated": {}, "end": None}) == scope


@pytest.mark.parametrize(
    ("expect", "more", "end"),
    [
        ("travel: {at_least: 1 m}", "", 30.0),
        ("travel: {at_least: 1 m}", "duration: 5 s\n", 30.0),
        ("upright", "", 30.0),
        ("upright", "duration: 5 s\n", 5.0),
        ("upright\n  - travel: {at_least: 1 m}", "", None),
    ],
)
def test_the_end_of_a_scope_is_the_latest_of_the_run(expect: str, more: str, end: float | None, tmp_path: Path) -> None:
    scenario = load(tmp_path, expecting(expect) + more).scenario
    assert Scope.of(scenario.expect[0], scenario).end == end


def test_scopes_of_combinations_and_pairs(tmp_path: Path) -> None:
    # A scope has what each part of a combination states.
    parts = "any_of: [{travel: {at_least: 50 cm}}, upright, {stay_within: {y: [-0.1, 0.1]}}]"
    scenario = load(tmp_path, expecting(parts)).scenario
    assert Scope.of(scenario.expect[0], scenario).stated == {
        "0": "travel",
        "0.travel.at_least": 0.5,
        "1": "upright",
        "2": "stay_within",
        "2.stay_within.y.0": -0.1,
        "2.stay_within.y.1": 0.1,
    }
    # The scope of self collision has the names of a pair in order.
    scenario = load(tmp_path, LEAST).scenario
    (expected,) = scenario.expect
    allowing = replace(expected, assertion=SelfCollision(allow=(("base_scan", "*_left_link"),)))
    assert Scope.of(allowing, scenario).allowed == ("*_left_link with base_scan",)
