"""Which outcomes reports show together, and which of them is the worst."""

from __future__ import annotations

import pytest

from sim_action.core.errors import Location
from sim_action.reports.scenario_groups import grouped_scenarios, nearest_expectation, relative_margin, worst_first
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, Status
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import like
from tests.reports.samples import SAMPLES


def expected(margin: float | None = None, limit: float | None = None, *, passed: bool = False) -> ExpectationOutcome:
    place, verdict = Location("a.sim.yml", 3, 1), Verdict(passed, None, limit, margin, "m", None, "told")
    return ExpectationOutcome(name="travel", assertion="travel", severity="error", location=place, verdict=verdict)


def outcome(
    name: str, *expectations: ExpectationOutcome, group: str | None = "a", status: Status = "failed"
) -> Outcome:
    return Outcome(name=name, file="a.sim.yml", group=group, status=status, expectations=expectations)


@pytest.mark.parametrize(
    ("margin", "limit", "relative"), [(-0.5, 2.0, -0.25), (-0.5, -2.0, -0.25), (-3.0, 0.0, -3.0), (None, 1.0, -1.0)]
)
def test_a_margin_is_relative_to_its_limit(margin: float | None, limit: float, relative: float) -> None:
    assert relative_margin(expected(margin, limit)) == relative


def test_variations_of_a_scenario_are_together_and_others_alone() -> None:
    alone = outcome("b", group=None)
    first, varied, last = grouped_scenarios([alone, outcome("a[x=1]"), outcome("a[x=2]"), alone])
    assert (varied.name, varied.varies, len(varied.outcomes)) == ("a", True, 2)
    assert [varied.values(each) for each in varied.outcomes] == ["[x=1]", "[x=2]"]
    for group in (first, last):
        assert (group.name, group.varies, len(group.outcomes), group.values(group.worst)) == ("b", False, 1, "")


def test_an_expectation_that_was_never_judged_explains_a_variation_that_did_not_pass() -> None:
    unjudged = like(expected(), verdict=Verdict(False, message="never checked", judged=Judged()))
    passed = outcome("a[x=1]", expected(0.1, 1.0, passed=True), status="passed")
    unread = outcome("a[x=2]", expected(0.001, 1.0, passed=True), unjudged, status="not_exercised")
    (group,) = grouped_scenarios([passed, unread])
    assert group.status == "not_exercised"
    assert group.worst_text == "[x=2], not exercised (travel)"
    broken = outcome("a[x=3]", unjudged, expected(-0.1, 1.0))
    (group,) = grouped_scenarios([passed, unread, broken])
    assert group.worst_text == "[x=3], margin -0.1 m (travel)"


def test_the_worst_missed_its_limit_by_most_and_what_has_no_verdict_is_worse() -> None:
    near, far = outcome("a[x=1]", expected(-0.1, 1.0)), outcome("a[x=2]", expected(-0.9, 10.0), expected(-0.2, 1.0))
    passed = outcome("a[x=3]", expected(5.0, 1.0, passed=True), status="passed")
    (group,) = grouped_scenarios([passed, near, far])
    assert group.worst is far
    assert group.passed == "1 of 3 passed"
    crash = Failure(kind="crash", title="SIGSEGV", message="gone")
    crashed = like(outcome("a[x=4]", status="error"), failures=(crash,))
    (group,) = grouped_scenarios([far, crashed, outcome("a[x=5]", status="skipped")])
    assert group.worst is crashed
    assert group.status == "error"
    assert group.passed == "0 of 3 passed, 1 not run"
    assert [each.status for each in group.worst_first()] == ["error", "failed", "skipped"]


def test_the_worst_among_failures() -> None:
    # What was cut off makes no variation the worst.
    cut = like(expected(), verdict=Verdict(False, None, 10.0, -9.0, "m", cut_off=True))
    near, far = outcome("a[x=1]", cut, expected(-0.1, 1.0)), outcome("a[x=2]", expected(-0.2, 1.0))
    (group,) = grouped_scenarios([near, far])
    assert group.worst is far
    # Scenarios with failures come first in the order of the call.
    passed, skipped = (outcome(name, group=None, status=name) for name in ("passed", "skipped"))
    groups = worst_first(grouped_scenarios([passed, outcome("failed", group=None), skipped]))
    assert [group.name for group in groups] == ["failed", "skipped", "passed"]


def held(margin: float, time: float | None = None, *, goal: bool = False, name: str = "travel") -> ExpectationOutcome:
    verdict = Verdict(True, None, 2.0, margin, "m", time, "told", goal=goal)
    return like(expected(), verdict=verdict, name=name)


def test_the_worst_and_its_margin() -> None:
    # Of those that passed the worst came nearest to its limit.
    far = outcome("a[x=1]", held(5.0), held(0.4, name="clearance"), status="passed")
    near = outcome("a[x=2]", held(5.0), held(0.1, name="clearance"), status="passed")
    (group,) = grouped_scenarios([far, near])
    assert group.worst is near
    assert group.worst_text == "[x=2], margin 0.1 m (clearance)"
    # A goal says nothing by its margin but by its time where there is nothing else.
    # It is met at its limit, whatever happens.
    goals = [outcome(f"a[x={time}]", held(1e-4 * time, time, goal=True), status="passed") for time in (1.0, 3.0, 2.0)]
    (group,) = grouped_scenarios(goals)
    assert group.worst_text == "[x=3.0], at 3.00 s (travel)"
    throughout = outcome("a[x=4]", held(1e-9, 9.0, goal=True), held(0.5, 1.0, name="upright"), status="passed")
    (group,) = grouped_scenarios([throughout, like(throughout, name="a[x=5]")])
    assert group.worst_text == "[x=4], margin 0.5 m (upright)"
    # What failed tells its own margin.
    (group,) = grouped_scenarios([outcome("a[x=1]", held(0.1), expected(-0.2, 1.0)), outcome("a[x=2]", held(0.01))])
    assert group.worst_text == "[x=1], margin -0.2 m (travel)"
    # Without a margin the worst is but named.
    passed = outcome("a[x=2]", expected(passed=True), status="passed")
    (group,) = grouped_scenarios([outcome("a[x=1]", expected()), passed])
    assert group.worst_text == "[x=1]"


def test_a_warning_of_several_variations_is_one() -> None:
    _, group = grouped_scenarios(SAMPLES["audited"].outcomes)
    (endless, once), (nothing, twice) = group.warnings
    assert (endless.rule, once, nothing.rule, twice) == ("segment-beyond-run", 1, "nothing-to-touch", 2)
    assert group.warning_text(endless, once).endswith("] (in 1 of 2 variations)")
    assert group.warning_text(nothing, twice).endswith("]")


def test_the_order_of_runs() -> None:
    # Runs are ordered by status and then by margin.
    near = outcome("a[x=1]", expected(0.1, 1.0, passed=True), status="passed")
    far = outcome("a[x=2]", expected(0.5, 1.0, passed=True), status="passed")
    short, shorter = outcome("a[x=3]", expected(-0.1, 1.0)), outcome("a[x=4]", expected(-0.2, 1.0))
    (group,) = grouped_scenarios([far, near, short, shorter])
    assert group.worst_first() == [shorter, short, near, far]
    assert group.worst is shorter
    # A count of contacts that holds says nothing about how near a run was.
    verdict = Verdict(True, 0.0, 0.0, 0.0, "contacts", 1.0, "touched nothing")
    untouched = like(expected(), name="no_collision", verdict=verdict)
    clearance = expected(0.3, 0.1, passed=True)
    assert nearest_expectation(outcome("a", untouched, clearance, status="passed")) is clearance
    assert nearest_expectation(outcome("a", untouched, status="passed")) is untouched
