"""A scenario that checks less than before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ExitCode, Location
from sim_action.results.comparison import Change, compare_outcomes
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, Scope, status_of
from sim_action.results.weaker_checks import ClaimChange, claim_changes, loosened_times, newly_allowed, weaker_checks
from sim_action.scenario.variations.gate import Gate
from sim_action.state.verdict import Judged, Verdict


def expected(name: str = "clear", assertion: str = "clearance", **fields: Any) -> ExpectationOutcome:
    """The clearance is 0.5 m, and the limit 0.3 m."""
    kept = {key: fields.pop(key) for key in ("severity", "unexercised", "scope") if key in fields}
    told = {"passed": True, "measured": 0.5, "limit": 0.3, "margin": 0.2, "unit": "m", **fields}
    return ExpectationOutcome(
        name=name,
        assertion=assertion,
        location=Location("a.sim.yml", 8, 5),
        verdict=Verdict(**told),
        **{"severity": "error", **kept},
    )


def at_least(limit: float, measured: float = 0.5, **fields: Any) -> ExpectationOutcome:
    return expected(measured=measured, limit=limit, margin=measured - limit, passed=measured >= limit, **fields)


def at_most(limit: float, measured: float = 0.5, **fields: Any) -> ExpectationOutcome:
    return expected(measured=measured, limit=limit, margin=limit - measured, passed=measured <= limit, **fields)


def outcome(*expectations: ExpectationOutcome, **fields: Any) -> Outcome:
    judged = {"status": status_of(expectations), "expectations": expectations}
    return Outcome(name="a", file="a.sim.yml", **judged | fields)


def changed(old: Outcome, new: Outcome) -> Change:
    comparison = compare_outcomes([old], [new])
    (change,) = comparison.changes
    if not change.failed:
        assert comparison.exit_code() is ExitCode.PASSED
        assert comparison.exit_code(strict=True) is (ExitCode.FAILED if change.warnings else ExitCode.PASSED)
    return change


def weaker(old: Outcome, new: Outcome) -> list[tuple[str, str]]:
    return [(each.kind, (each.new or each.old).name) for each in changed(old, new).weaker]


def test_removed_expectations() -> None:
    # An expectation that was removed is a warning.
    change = changed(outcome(expected(), expected("tilt", "upright")), outcome(expected()))
    assert [(each.kind, each.old.name, each.new) for each in change.weaker] == [("removed", "tilt", None)]
    assert (change.kind, change.warnings) == ("still passes", 1)
    assert not changed(outcome(expected()), outcome(expected(), expected("tilt", "upright"))).warnings
    # A failed expectation that was removed fixes nothing.
    change = changed(outcome(expected(), at_least(0.8, name="far")), outcome(expected()))
    assert (change.kind, change.warnings) == ("fixed", 1)
    change = changed(outcome(expected(), expected("tilt", "upright")), outcome(at_least(0.8)))
    assert (change.kind, [each.kind for each in change.weaker]) == ("newly fails", ["removed"])
    assert weaker(outcome(expected(), expected()), outcome(expected())) == [("removed", "clear")]


@pytest.mark.parametrize("status", ["error", "flaky", "skipped"])
def test_a_run_without_verdicts_removes_nothing(status: str) -> None:
    failures = () if status == "skipped" else (Failure(kind="crash", title="SIGSEGV", message="it crashed"),)
    assert not weaker(outcome(expected()), outcome(status=status, failures=failures))


@pytest.mark.parametrize("holds", [True, False])
def test_an_error_that_is_only_a_warning_now(holds: bool) -> None:
    soft = expected(severity="warning", passed=holds, margin=0.2 if holds else -0.2, measured=0.5 if holds else 0.1)
    assert weaker(outcome(expected()), outcome(soft)) == [("severity", "clear")]
    assert weaker(outcome(soft), outcome(soft)) == []
    assert weaker(outcome(soft), outcome(expected())) == []


def scoped(*, goal: bool = False, **scope: Any) -> ExpectationOutcome:
    return expected(goal=goal, scope=Scope(**scope))


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (scoped(), scoped(after=3), {"after": (0, 3)}),
        (scoped(after=3), scoped(), {}),
        (scoped(), scoped(before=2), {"before": (None, 2)}),
        (scoped(before=4), scoped(before=2), {"before": (4, 2)}),
        (scoped(before=2), scoped(), {}),
        (scoped(after=1, before=4), scoped(after=2, before=3), {"after": (1, 2), "before": (4, 3)}),
        (scoped(goal=True, after=3), scoped(goal=True), {"after": (3, 0)}),
        (scoped(goal=True), scoped(goal=True, after=3), {}),
        (scoped(goal=True, before=2), scoped(goal=True), {"before": (2, None)}),
        (scoped(goal=True, before=2), scoped(goal=True, before=4), {"before": (2, 4)}),
        (scoped(goal=True), scoped(goal=True, before=4), {}),
        (scoped(goal=True, held=2), scoped(goal=True, held=0.5), {"for": (2, 0.5)}),
        (scoped(goal=True, held=2), scoped(goal=True), {"for": (2, None)}),
        (scoped(goal=True), scoped(goal=True, held=2), {}),
        (scoped(), scoped(goal=True, after=3, before=4), {}),
        (expected(), scoped(after=3), {}),
        (scoped(), expected(), {}),
    ],
)
def test_a_window_that_demands_less(old: ExpectationOutcome, new: ExpectationOutcome, found: dict[str, Any]) -> None:
    assert loosened_times(old, new) == found
    assert weaker(outcome(old), outcome(new)) == [("window", "clear")] * bool(found)


def test_more_is_allowed_or_left_unjudged() -> None:
    # A name that is allowed now.
    old, new = scoped(allowed=("crate", "wall")), scoped(allowed=("pallet", "wall"))
    assert weaker(outcome(old), outcome(new)) == [("allow", "clear")]
    assert newly_allowed(old, new) == ("pallet",)
    assert weaker(outcome(old), outcome(scoped())) == []
    assert weaker(outcome(expected()), outcome(new)) == []
    # An expectation that may be left unjudged now.
    accepted = expected(unexercised="warn")
    assert weaker(outcome(expected()), outcome(accepted)) == [("unexercised", "clear")]
    assert weaker(outcome(accepted), outcome(accepted)) == []
    assert weaker(outcome(accepted), outcome(expected())) == []


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (at_least(0.3), at_least(0.1), True),
        (at_least(0.1), at_least(0.3), False),
        (at_least(0.3), at_least(0.3, measured=0.9), False),
        (at_least(0.3), at_least(0.3 * (1 - 1e-9)), False),
        (at_most(0.6), at_most(0.9), True),
        (at_most(0.9), at_most(0.6), False),
        (at_least(0.5), at_least(0.4), True),
        (at_most(0.5), at_most(0.4), False),
        (at_least(0.8), at_least(0.4), True),
        (at_most(0.4), at_most(0.8), True),
        (at_least(0.3), at_most(0.6), False),
        (at_least(0.3), at_least(0.1, unit="rad"), False),
        (at_least(0.3), expected(limit=0.1, measured=None, margin=None, passed=False, judged=Judged()), True),
        (expected(margin=None), expected(margin=None, limit=0.1), False),
        (at_least(0.3), expected(limit=None, margin=None), False),
    ],
    ids=[
        *("lower limit down", "lower limit up", "same limit", "rounded otherwise", "upper limit up"),
        *("upper limit down", "old on its limit", "upper limit down to what was on it", "failed before"),
        *("failed before, upper", "another side", "another unit", "never judged now", "side unknown", "no limit"),
    ],
)
def test_limits_that_allow_more(old: ExpectationOutcome, new: ExpectationOutcome, found: bool) -> None:
    change = changed(outcome(old), outcome(new))
    assert [each.kind for each in change.weaker] == ["limit"] * found


def test_an_unchanged_count_of_feet_is_not_weaker() -> None:
    """The verdict has the limit with the smaller margin: at most 3 feet in the old run, at least 1 in the new one."""
    old = at_most(3, 3, unit="", name="feet", assertion="feet_on_ground")
    new = at_least(1, 2, unit="", name="feet", assertion="feet_on_ground")
    assert changed(outcome(old), outcome(new)).weaker == ()
    old, new = (at_least(number, 3, unit="", name=f"{number} feet", assertion="feet_on_ground") for number in (3, 1))
    assert [each.kind for each in changed(outcome(old), outcome(new)).weaker] == ["limit"]


LOW, HIGH = st.floats(0.0, 0.6), st.floats(0.4, 1.0)


# Most of them pass: only then a limit may be weaker.
@given(
    st.tuples(st.just(at_least), LOW, LOW, HIGH, HIGH)
    | st.tuples(st.just(at_most), HIGH, HIGH, LOW, LOW)
    | st.tuples(st.sampled_from([at_least, at_most]), *[st.floats(0.0, 1.0)] * 4)
)
def test_a_weaker_limit_accepts_more_values(drawn: tuple[Any, float, float, float, float]) -> None:
    side, limit, other, measured, again = drawn
    old, new = side(limit, measured), side(other, again)
    found = list(weaker_checks(outcome(old), outcome(new), [(old, new)]))
    if found:
        assert other < limit if side is at_least else other > limit
        assert not list(weaker_checks(outcome(new), outcome(old), [(new, old)]))


def test_a_default_name_that_changes_with_its_limit_is_the_same_expectation() -> None:
    old = outcome(expected("tilt", "upright"), at_least(0.3, name="at least 0.3 m"))
    change = changed(old, outcome(at_least(0.1, name="at least 0.1 m"), expected("tilt", "upright")))
    names = [(check.kind, check.old.name, check.new and check.new.name) for check in change.weaker]
    assert names == [("limit", "at least 0.3 m", "at least 0.1 m")]
    assert change.renamed == ()
    tighter = changed(old, outcome(expected("tilt", "upright"), at_least(0.45, name="at least 0.45 m")))
    assert [(was.name, now.name) for was, now in tighter.stricter] == [("at least 0.3 m", "at least 0.45 m")]
    assert (tighter.renamed, tighter.warnings) == ((), 0)


@pytest.mark.parametrize("limit", [at_least, at_most])
@pytest.mark.parametrize("measured", [0.4, 0.6])
def test_a_limit_that_allows_less_is_stricter(limit: Callable[..., ExpectationOutcome], measured: float) -> None:
    was, now = (0.3, 0.5) if limit is at_least else (0.7, 0.5)
    old, new = (outcome(limit(each, measured, assertion="max_speed")) for each in (was, now))
    assert [(one.verdict.limit, other.verdict.limit) for one, other in changed(old, new).stricter] == [(was, now)]
    assert changed(new, old).stricter == changed(old, old).stricter == ()


def test_limits_that_are_measured() -> None:
    # A limit that is measured is not stricter.
    old, new = (outcome(at_least(limit, assertion="follow_path")) for limit in (0.3, 0.4))
    assert changed(old, new).stricter == ()
    # A limit that is measured may change with the motion.
    # The right side of an `stl` formula can be a signal, and `all_of` reports one of several limits.
    was, now = (at_least(limit, assertion="stl") for limit in (0.3, 0.1))
    assert weaker(outcome(was), outcome(now)) == []
    assert weaker(outcome(was, digest="f0"), outcome(now, digest="f1")) == []
    assert weaker(outcome(was, digest="f0"), outcome(now, digest="f0")) == [("limit", "clear")]
    other = now.model_copy(update={"name": "another formula"})
    assert weaker(outcome(was), outcome(other)) == [("limit", "another formula")]


@pytest.mark.parametrize("assertion", ["stay_within", "joint_within", "object", "all_of", "any_of"])
def test_of_several_limits_the_reported_one_is_known_by_its_value(assertion: str) -> None:
    def run(limit: float, measured: float, digest: str, name: str = "bounds") -> Outcome:
        return outcome(at_most(limit, measured, assertion=assertion, name=name), digest=digest)

    wide = run(2.0, 1.4, "f0")
    # Another bound was nearest, or the same of another motion.
    for other in (run(0.8, 0.5, "f0"), run(0.8, 0.5, "f0", "others"), run(1.5, 1.4, "f1")):
        assert (changed(wide, other).stricter, changed(other, wide).weaker) == ((), ())
    assert len(changed(wide, run(1.5, 1.4, "f0")).stricter) == 1
    assert weaker(run(1.5, 1.4, "f0"), wide) == [("limit", "bounds")]


def test_limits_that_are_not_known_to_be_stricter() -> None:
    # Of several expectations with one name none is stricter.
    old = outcome(at_most(0.8), at_most(0.6))
    assert changed(old, outcome(at_most(0.6))).stricter == ()
    assert changed(outcome(at_most(0.8)), outcome(at_most(0.6), at_most(0.7))).stricter == ()
    # A run without a verdict has no stricter limit.
    broken = outcome(at_most(0.6), status="error")
    assert changed(outcome(at_most(0.8)), broken).stricter == ()


def test_names_that_changed() -> None:
    # A name that the user changed is the same expectation.
    change = changed(outcome(expected("a")), outcome(expected("b")))
    assert (change.renamed, change.warnings) == ((("a", "b"),), 0)
    softer = changed(outcome(expected("a")), outcome(expected("b", severity="warning")))
    assert [each.kind for each in softer.weaker] == ["severity"]
    smaller = changed(outcome(expected("a")), outcome(expected("b", margin=0.01, measured=0.31)))
    assert [each.expectation for each in smaller.smaller_margins] == ["b"]
    # Of several other names no pair is known.
    old = outcome(expected("a"), expected("b"), expected("same"))
    change = changed(old, outcome(expected("c"), expected("d"), expected("same")))
    assert [(each.kind, each.old.name) for each in change.weaker] == [("removed", "a"), ("removed", "b")]
    assert weaker(old, outcome(expected("same"), expected("c"))) == [("removed", "a"), ("removed", "b")]
    assert weaker(outcome(expected("a")), outcome(expected("a", "upright"))) == [("removed", "a")]


expectations = st.lists(
    st.builds(
        at_least,
        st.sampled_from([0.1, 0.3]),
        name=st.sampled_from("ab"),
        assertion=st.sampled_from(["clearance", "stl"]),
        severity=st.sampled_from(["error", "warning"]),
    ),
    min_size=1,
    max_size=5,
)


@given(expectations, expectations)
def test_every_expectation_is_paired_or_reported(old: list[ExpectationOutcome], new: list[ExpectationOutcome]) -> None:
    found = changed(outcome(*old), outcome(*new)).weaker
    removed = [each.old for each in found if each.kind == "removed"]
    assert len(old) - len(removed) <= len(new)
    assert not changed(outcome(*old), outcome(*old)).weaker


FAR = {"of": "travel.measured", "q": "5 %", "at_least": "1.4 m"}
NEAR = {"of": "travel.measured", "q": "95 %", "at_most": "1.4 m"}
NINETY_FIVE = {"passes": {"at_least": "95 %"}}
EARLY = {"stop_early": {"reject": "85 %", "accept": "95 %"}}


def early(reject: str, accept: str) -> dict[str, Any]:
    return {"stop_early": {"reject": reject, "accept": accept}}


def passes(rate: str, **more: Any) -> dict[str, Any]:
    return {"passes": {"at_least": rate, **more}}


def quantile(claim: dict[str, str], **more: str) -> dict[str, Any]:
    return {"quantile": {**claim, **more}}


def changes(old: dict[str, Any], new: dict[str, Any]) -> tuple[ClaimChange, ...]:
    return claim_changes(Gate.model_validate(old), Gate.model_validate(new))


TRAVEL = "quantile of travel.measured"
OF_EARLY, OF_FAR, OF_NEAR = "reject 85 %, accept 95 %", "5 % quantile at least 1.4 m", "95 % quantile at most 1.4 m"


@pytest.mark.parametrize(
    ("old", "new", "kind", "claim", "texts"),
    [
        (NINETY_FIVE, passes("90 %"), "limit", "passes", ("at least 95 %", "at least 90 %")),
        (passes("99.9999 %"), passes("99.9998 %"), "limit", "passes", ("at least 99.9999 %", "at least 99.9998 %")),
        (NINETY_FIVE, passes("95 %", confidence="60 %"), "confidence", "passes", ("95 %", "60 %")),
        (
            *(NINETY_FIVE, early("30 %", "60 %")),
            *("limit", "passes", ("at least 95 %", "stop_early reject 30 %, accept 60 %")),
        ),
        (NINETY_FIVE, quantile(FAR), "removed", "passes", ("at least 95 %", "")),
        (EARLY, early("30 %", "60 %"), "limit", "stop_early", (OF_EARLY, "reject 30 %, accept 60 %")),
        (EARLY, early("85 %", "90 %"), "limit", "stop_early", (OF_EARLY, "reject 85 %, accept 90 %")),
        (EARLY, passes("80 %"), "limit", "stop_early", (OF_EARLY, "passes at least 80 %")),
        (EARLY, quantile(FAR), "removed", "stop_early", (OF_EARLY, "")),
        (
            *(NINETY_FIVE, {**NINETY_FIVE, "errors": {"at_most": 10}}),
            *("limit", "errors", ("at most 0 runs without a verdict", "at most 10 runs without a verdict")),
        ),
        (quantile(FAR), quantile(FAR, q="20 %"), "limit", TRAVEL, (OF_FAR, "20 % quantile at least 1.4 m")),
        (quantile(FAR), quantile(FAR, at_least="139 cm"), "limit", TRAVEL, (OF_FAR, "5 % quantile at least 139 cm")),
        (quantile(NEAR), quantile(NEAR, at_most="1.5 m"), "limit", TRAVEL, (OF_NEAR, "95 % quantile at most 1.5 m")),
        (quantile(NEAR), quantile(NEAR, q="90 %"), "limit", TRAVEL, (OF_NEAR, "90 % quantile at most 1.4 m")),
        (
            *({**NINETY_FIVE, **quantile(FAR, confidence=confidence)} for confidence in ("99 %", "50 %")),
            *("confidence", TRAVEL, ("99 %", "50 %")),
        ),
        ({**NINETY_FIVE, **quantile(FAR)}, NINETY_FIVE, "removed", TRAVEL, (OF_FAR, "")),
        (quantile(FAR), quantile(NEAR), "removed", TRAVEL, (OF_FAR, "")),
        (quantile(FAR), quantile(FAR, at_least="1.4 s"), "removed", TRAVEL, (OF_FAR, "")),
    ],
)
def test_a_claim_that_demands_less(
    old: dict[str, Any], new: dict[str, Any], kind: str, claim: str, texts: tuple[str, str]
) -> None:
    weaker = [each for each in changes(old, new) if each.is_weaker]
    assert [(each.kind, each.claim, (each.old, each.new)) for each in weaker] == [(kind, claim, texts)]
    back = changes(new, old)
    assert not [each for each in back if each.is_weaker and each.kind != "removed"]
    if kind != "removed":
        assert [(each.kind, each.old, each.new) for each in back] == [(kind, *reversed(texts))]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({**NINETY_FIVE, "runs": 200}, {**NINETY_FIVE, "runs": 59}),
        (EARLY, {"passes": {"at_least": "85 %"}}),
        ({"passes": {"at_least": "85 %"}}, EARLY),
        (NINETY_FIVE, {**NINETY_FIVE, "quantile": FAR}),
        ({"quantile": FAR}, {"quantile": {**FAR, "at_least": 1.4}}),
        ({"quantile": [FAR, {**FAR, "q": "20 %"}]}, {"quantile": [{**FAR, "q": "20 %"}, FAR]}),
        ({"quantile": {**FAR, "q": "20 %"}}, {"quantile": [{**FAR, "q": "30 %"}, {**FAR, "q": "20 %"}]}),
    ],
    ids=["fewer runs", "test to rate", "rate to test", "one more", "no unit", "another order", "one of two"],
)
def test_claims_that_demand_as_much(old: dict[str, Any], new: dict[str, Any]) -> None:
    assert [each for each in changes(old, new) if each.is_weaker] == []
