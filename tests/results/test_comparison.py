"""What has changed between two runs."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ExitCode, Location
from sim_action.core.provenance import Provenance
from sim_action.results.comparison import (
    Change,
    ChangeKind,
    Comparison,
    Slower,
    SmallerMargin,
    Thresholds,
    compare_outcomes,
)
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, Repeats, Status
from sim_action.state.verdict import Judged, Verdict

STATUSES: tuple[Status, ...] = ("passed", "failed", "flaky", "error", "skipped")


def expected(name: str = "clearance", **verdict: Any) -> ExpectationOutcome:
    told = {"passed": True, "measured": 1.4, "limit": 1.0, "margin": 0.4, "unit": "m", "time": 2.0, **verdict}
    return ExpectationOutcome(
        name=name, assertion=name, severity="error", location=Location("a.sim.yml", 8, 5), verdict=Verdict(**told)
    )


def outcome(name: str = "a", status: Status = "passed", *, file: str = "a.sim.yml", **fields: Any) -> Outcome:
    if status == "flaky":
        fields["failures"] = (Failure(kind="flaky", title="flaky", message="no two runs are the same"),)
    if status == "error":
        fields["failures"] = (Failure(kind="crash", title="SIGSEGV", message="it crashed"),)
    if status == "failed":
        fields.setdefault("expectations", (expected(passed=False, margin=-0.1),))
    if status in ("passed", "not_exercised"):
        judged = Judged(0 if status == "not_exercised" else 240)
        fields.setdefault("expectations", (expected(judged=judged),))
    return Outcome(name=name, file=file, status=status, **fields)


def made_on(cpu: str, build: str = "a wheel") -> Provenance:
    return Provenance(cpu=cpu, engine_build=build, sim_action="0", python="3.11", platform="Linux")


def changed(old: Outcome | None, new: Outcome | None, thresholds: Thresholds | None = None) -> Change:
    (change,) = compare_outcomes([old] if old else [], [new] if new else [], thresholds).changes
    return change


@pytest.mark.parametrize(
    ("old", "new", "kind"),
    [
        ("passed", "passed", "still passes"),
        ("passed", "failed", "newly fails"),
        ("passed", "error", "newly fails"),
        ("passed", "skipped", "not run"),
        ("passed", None, "removed"),
        ("failed", "passed", "fixed"),
        ("error", "passed", "fixed"),
        ("failed", "failed", "still fails"),
        ("failed", "error", "fails differently"),
        ("error", "failed", "fails differently"),
        ("skipped", "failed", "newly fails"),
        ("skipped", "passed", "still passes"),
        (None, "passed", "new"),
        (None, "failed", "newly fails"),
        (None, "skipped", "not run"),
        ("passed", "flaky", "flaky"),
        ("flaky", "flaky", "flaky"),
        (None, "flaky", "flaky"),
        ("flaky", "passed", "not repeated"),
        ("flaky", "failed", "fails differently"),
        ("passed", "not_exercised", "newly fails"),
        ("skipped", "not_exercised", "newly fails"),
        (None, "not_exercised", "newly fails"),
        ("failed", "not_exercised", "fails differently"),
        ("not_exercised", "failed", "fails differently"),
        ("not_exercised", "not_exercised", "still fails"),
        ("not_exercised", "passed", "fixed"),
    ],
)
def test_what_became_of_a_scenario(old: Status | None, new: Status | None, kind: ChangeKind) -> None:
    change = changed(old and outcome(status=old), new and outcome(status=new))
    assert change.kind == kind
    assert Comparison((change,)).exit_code() is (
        ExitCode.FAILED if kind in ("newly fails", "flaky", "removed") else ExitCode.PASSED
    )
    assert change.warnings == (kind in ("removed", "not run", "not repeated"))


def test_flaky_removed_and_strict() -> None:
    # What was flaky is mended once several runs are the same.
    repeats = Repeats(count=5, agreed=5, digests=1)
    assert changed(outcome(status="flaky"), outcome(repeats=repeats)).kind == "fixed"
    # A run without any old scenario compares nothing.
    other = outcome("b", file="b.sim.yml")
    assert compare_outcomes([outcome(), other], []).is_empty
    assert compare_outcomes([outcome()], [other]).is_empty
    for old, new in (([outcome(), other], [outcome()]), ([], [outcome()]), ([], []), ([outcome(file="")], [other])):
        assert not compare_outcomes(old, new).is_empty
    allowed = compare_outcomes([outcome()], [], allow_removed=True)
    assert (allowed.is_empty, allowed.exit_code(), allowed.warnings) == (False, ExitCode.PASSED, 1)
    # Warnings fail only if they are to.
    comparison = compare_outcomes([outcome(), outcome("b")], [outcome()])
    assert comparison.exit_code() is ExitCode.PASSED
    assert comparison.exit_code(strict=True) is ExitCode.FAILED
    assert compare_outcomes([outcome()], [outcome()]).exit_code(strict=True) is ExitCode.PASSED


@pytest.mark.parametrize(
    ("verdicts", "found"),
    [
        (({}, {"margin": 0.19}), SmallerMargin("clearance", "m", 0.4, 0.19, 0.4, 0.19)),
        (({}, {"margin": 0.21}), None),
        (({"margin": 0.008}, {"margin": 0.0}), None),
        (({"margin": 0.012}, {"margin": 0.004}), None),
        (({"margin": 0.016}, {"margin": 0.004}), SmallerMargin("clearance", "m", 0.016, 0.004, 0.016, 0.004)),
        (({}, {"margin": 0.1, "goal": True}), None),
        (({}, {"margin": 0.1, "unit": "rad"}), None),
        (({}, {"margin": -0.1, "passed": False}), None),
        (({"margin": None}, {"margin": 0.1}), None),
        (({"limit": 0.0}, {"limit": 0.0, "margin": 0.1}), SmallerMargin("clearance", "m", 0.4, 0.1, None, None)),
        (({"limit": 0.0}, {"limit": 0.0, "measured": 500.0, "margin": 0.1}), None),
    ],
    ids=[
        *("less than half", "more than half", "next to nothing", "less than a hundredth", "more than a hundredth"),
        *("a goal", "another unit", "failed", "none before"),
        *("a limit of zero", "nothing beside what was measured"),
    ],
)
def test_margins_that_shrink(verdicts: tuple[dict[str, Any], dict[str, Any]], found: SmallerMargin | None) -> None:
    old, new = (outcome(expectations=(expected(**verdict),)) for verdict in verdicts)
    assert changed(old, new).smaller_margins == ((found,) if found else ())


def test_margins_and_expectations_that_are_missed() -> None:
    # The threshold of margins is theirs who ask.
    old, new = outcome(expectations=(expected(),)), outcome(expectations=(expected(margin=0.3),))
    assert changed(old, new, Thresholds(margin=0.8)).smaller_margins
    assert not changed(old, new, Thresholds(margin=0.7)).smaller_margins
    # Expectations of one name are compared in their order.
    old = outcome(expectations=(expected(margin=0.9), expected(margin=0.1), expected("upright")))
    new = outcome(expectations=(expected("upright"), expected(margin=0.9), expected(margin=0.02)))
    assert [(smaller.old, smaller.new) for smaller in changed(old, new).smaller_margins] == [(0.1, 0.02)]
    # What a failing scenario misses beside that is a warning.
    old = outcome(status="failed", expectations=(expected("b", passed=False), expected("c"), expected("d")))
    now = (expected("b", passed=False), expected("c", passed=False), expected("d", passed=False, cut_off=True))
    change = changed(old, outcome(status="failed", expectations=now))
    assert [missed.name for missed in change.missed] == ["c"]
    assert change.warnings == 1
    # Why a scenario newly fails is told once.
    change = changed(outcome(expectations=(expected(),)), outcome(status="failed"))
    assert not change.missed
    assert change.warnings == 0


@pytest.mark.parametrize(
    ("old", "new", "sim_time", "found"),
    [(100.0, 40.0, 30.0, Slower(100.0, 40.0)), (100.0, 60.0, 30.0, None), (100.0, 40.0, 2.0, None)],
    ids=["less than half as fast", "more than half", "a blink later"],
)
def test_slower_runs(old: float, new: float, sim_time: float, found: Slower | None) -> None:
    before, now = (outcome(real_time_factor=factor, sim_time=sim_time) for factor in (old, new))
    assert changed(before, now).slower == found


def test_on_another_machine_slower_runs_are_no_warning() -> None:
    before, now = (
        outcome(real_time_factor=factor, sim_time=30.0, provenance=made_on(cpu))
        for cpu, factor in (("Big", 100.0), ("Small", 10.0))
    )
    change = changed(before, now)
    assert (change.slower, change.processors, change.warnings) == (Slower(100.0, 10.0), ("Big", "Small"), 0)
    same = changed(before, now.model_copy(update={"provenance": before.provenance}))
    assert (same.processors, same.warnings) == (None, 1)


@pytest.mark.parametrize(
    ("fields", "otherwise"),
    [
        ({"digest": "f1"}, True),
        ({"digest": "f0"}, False),
        ({"digest": "f1", "seed": 2}, False),
        ({"digest": "f1", "engine": "MuJoCo 4.0"}, False),
        ({"digest": None}, False),
        ({"digest": "f1", "provenance": made_on("Big", "another wheel")}, False),
        ({"digest": "f1", "provenance": made_on("Small")}, True),
    ],
)
def test_a_robot_that_moves_otherwise_with_the_same_seed_and_engine(fields: dict[str, Any], otherwise: bool) -> None:
    made: dict[str, Any] = {"seed": 1, "engine": "PyBullet 3.2.7", "digest": "f0", "provenance": made_on("Big")}
    change = changed(outcome(**made), outcome(**{**made, **fields}))
    assert change.moves_differently is otherwise
    assert change.warnings == 0


def test_moved_files() -> None:
    # A file that was moved is no other scenario.
    stays = outcome("b", file="b.sim.yml")
    changes = compare_outcomes(
        [outcome("a", file="old.sim.yml"), stays], [stays, outcome("a", file="new.sim.yml")]
    ).changes
    assert [(change.outcome.name, change.kind) for change in changes] == [(name, "still passes") for name in "ba"]
    # Of several of a name nobody knows which was moved.
    old = [outcome("a", file="1.sim.yml"), outcome("a", file="2.sim.yml")]
    turns = [change.kind for change in compare_outcomes(old, [outcome("a", file="3.sim.yml")]).changes]
    assert turns == ["new", "removed", "removed"]


names = st.sampled_from("ab")
outcomes = st.lists(st.builds(outcome, names, st.sampled_from(STATUSES), file=names), max_size=6)


@given(outcomes, outcomes)
def test_every_outcome_is_compared_once(old: list[Outcome], new: list[Outcome]) -> None:
    changes = compare_outcomes(old, new).changes
    assert [change.new for change in changes if change.new] == new
    assert sorted(id(change.old) for change in changes if change.old) == sorted(map(id, old))
    assert all(change.old or change.new for change in changes)


@given(outcomes)
def test_nothing_has_changed_since_the_same_run(same: list[Outcome]) -> None:
    comparison = compare_outcomes(same, same)
    assert comparison.failures == comparison.count("flaky")
    assert all(change.kind in ("still passes", "still fails", "not run", "flaky") for change in comparison.changes)
