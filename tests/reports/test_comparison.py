"""A comparison, as people read it in a terminal and in a pull request."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from markdown_it import MarkdownIt

from sim_action.core.provenance import Provenance
from sim_action.reports.comparison import MAX_CHARACTERS, comparison_markdown, headline, print_comparison, rows
from sim_action.results.comparison import Comparison, compare_outcomes
from sim_action.results.gates import judged_gate
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, Scope
from tests.gate_runs import judged, planned, run, stated, verdicts
from tests.outcomes import like
from tests.reports.samples import SAMPLES


@pytest.fixture
def several() -> Comparison:
    """Some of everything."""
    passed, failed = SAMPLES["passed"].outcomes[0], SAMPLES["failed"].outcomes[2]
    tight, fast = _with_margin(passed, 0.3), {"real_time_factor": 40.0, "sim_time": 60.0, "digest": "f0"}
    slow = like(_with_margin(passed, 0.1), **{**fast, "real_time_factor": 10.0, "digest": "f1"})
    crash = SAMPLES["crash"].outcomes[0]
    old = [_named("breaks", passed), _named("fixed", failed), _named("tight", like(tight, **fast))]
    old += [_named("removed", passed), _named("same", passed), _named("still", failed), _named("otherwise", failed)]
    new = [_named("breaks", failed), _named("fixed", passed), _named("tight", slow), _named("same", passed)]
    new += [_named("still", failed), _named("new", passed), _named("otherwise", crash)]
    old += [_named("elsewhere", like(passed, **fast, provenance=_made_on("Big")))]
    new += [_named("elsewhere", like(slow, provenance=_made_on("Small | 2")))]
    differ = Failure(kind="flaky", title="flaky", message="no two of 5 runs the same")
    flaky = like(crash, status="flaky", failures=(differ,))
    old += [_named("shaky", passed), _named("once", flaky)]
    new += [_named("shaky", flaky), _named("once", passed)]
    travel = passed.expectations[0]
    strict = _with(passed, travel, like(travel, name="stay upright", assertion="upright"))
    looser = replace(travel.verdict, limit=1.0, margin=0.5012)
    old += [_named("weaker", strict)]
    loose = like(travel, name="travel at least 1 m", verdict=looser, severity="warning")
    new += [_named("weaker", _with(passed, loose))]
    old += [_named("renamed", passed)]
    new += [_named("renamed", _with(passed, like(travel, name="come home", unexercised="warn")))]
    return compare_outcomes(old, new)


def _with(outcome: Outcome, *expectations: ExpectationOutcome) -> Outcome:
    return like(outcome, expectations=expectations)


def _made_on(cpu: str) -> Provenance:
    return Provenance(cpu=cpu, sim_action="0.1.0", python="3.11.7", platform="Linux")


def _named(name: str, outcome: Outcome) -> Outcome:
    return like(outcome, name=name)


def _with_margin(outcome: Outcome, margin: float) -> Outcome:
    (expected,) = outcome.expectations
    return _with(outcome, like(expected, verdict=replace(expected.verdict, margin=margin)))


def printed(comparison: Comparison, environment: dict[str, str] | None = None) -> str:
    stream = io.StringIO()
    print_comparison(comparison, environment or {}, stream)
    return stream.getvalue()


def test_golden(several: Comparison, gates: Comparison, golden: Callable[[str, str], None]) -> None:
    for name, comparison in (("comparison", several), ("paired", gates)):
        golden(f"{name}.txt", printed(comparison))
        golden(f"{name}.md", comparison_markdown(comparison))


def test_an_expectation_that_is_no_longer_judged_is_a_warning() -> None:
    accepted = SAMPLES["not-exercised"].outcomes[0]
    travel, unread = accepted.expectations
    read = like(unread, verdict=replace(travel.verdict, message="at least 0.3 m"))
    before = like(accepted, expectations=(travel, read))
    (row,) = rows(compare_outcomes([before], [accepted]))
    assert (row.status, row.kind) == ("warned", "no longer checked")
    assert row.message.startswith("range stays above 0.2 m: never checked: sensor 'lidar' had no reading")


@pytest.mark.parametrize(
    ("goal", "old", "new", "told"),
    [
        (True, Scope(before=2), Scope(before=4), "before 4 s, was 2 s"),
        (True, Scope(before=2, held=1), Scope(), "no before, was 2 s; no for, was 1 s"),
        (False, Scope(), Scope(after=0.5, before=2), "after 0.5 s, was 0 s; before 2 s, was none"),
        (False, Scope(), Scope(allowed=("box", "wall")), "allow has box, wall now"),
    ],
)
def test_a_scope_that_demands_less_is_a_warning(goal: bool, old: Scope, new: Scope, told: str) -> None:
    passed = SAMPLES["passed"].outcomes[0]
    expected = passed.expectations[0]
    verdict = replace(expected.verdict, goal=goal)

    def scoped(scope: Scope) -> Outcome:
        return _with(passed, like(expected, verdict=verdict, scope=scope))

    (row,) = rows(compare_outcomes([scoped(old)], [scoped(new)]))
    assert (row.status, row.kind) == ("warned", "allows more" if new.allowed else "weaker window")
    assert row.message == f"{expected.name}: {told}"


def test_headlines_and_titles() -> None:
    # A digest is news where the verdict is none.
    passed, failed = SAMPLES["passed"].outcomes[0], SAMPLES["failed"].outcomes[2]
    again = like(passed, digest="f1")
    assert [row.kind for row in rows(compare_outcomes([passed], [again]))] == ["moves differently"]
    worse = like(failed, digest="f1")
    assert [row.kind for row in rows(compare_outcomes([passed], [worse]))] == ["newly fails"]
    # What moves differently does not hide what still fails.
    still = like(failed, name="other")
    kinds = [row.kind for row in rows(compare_outcomes([passed, still], [again, still]))]
    assert kinds == ["still fails", "moves differently"]
    # A flaky scenario is in the title.
    flaky = like(SAMPLES["crash"].outcomes[0], status="flaky")
    failed = SAMPLES["failed"].outcomes[0]
    assert comparison_markdown(compare_outcomes([], [flaky])).startswith("## 🎲 1 scenario is flaky\n")
    text = comparison_markdown(compare_outcomes([], [flaky, failed]))
    assert text.startswith("## ❌ 1 scenario newly fails, 1 flaky\n")
    # Runs that are alike have a headline alone.
    same = compare_outcomes(SAMPLES["passed"].outcomes, SAMPLES["passed"].outcomes)
    assert printed(same) == "1 still passes\n"
    assert comparison_markdown(same).startswith("## ✅ Nothing newly fails\n")
    assert "|" not in comparison_markdown(same)
    assert headline(compare_outcomes([], [])) == "no scenarios"


def test_a_run_that_lacks_every_scenario_is_told() -> None:
    old = SAMPLES["passed"].outcomes
    gone = compare_outcomes(old, [])
    *_, message, counts = printed(gone).splitlines()
    assert message.startswith("every scenario of the old run was removed, so nothing was compared")
    assert counts == "1 warning (removed)"
    title, counts, message, *_ = comparison_markdown(gone).split("\n\n")
    assert title == "## ❌ Every scenario was removed"
    assert "nothing was compared; check the new results, or allow it with --allow-removed." in message
    allowed = compare_outcomes(old, [], allow_removed=True)
    assert printed(allowed).splitlines()[-1] == "1 warning (removed)"
    assert "nothing was compared" not in printed(allowed) + comparison_markdown(allowed)


def test_hostile_text() -> None:
    # Hostile text is text in markdown.
    hostile = SAMPLES["hostile"].outcomes
    (table,) = comparison_markdown(compare_outcomes([], hostile)).split("\n\n")[2:]
    assert {line.count("|") for line in table.splitlines()} == {5}
    html = MarkdownIt("commonmark").enable("table").render(table)
    assert "<b>" not in html.replace("<b>&", "")
    assert "<a " not in html
    assert "@octocat" not in html
    assert html.count("<strong>") == len(hostile)
    # Hostile text gives a log no command.
    text = printed(compare_outcomes([], SAMPLES["hostile"].outcomes), {"GITHUB_ACTIONS": "true", "NO_COLOR": "1"})
    first, *lines, last = text.splitlines()
    assert first.startswith("::stop-commands::")
    assert last == f"::{first.removeprefix('::stop-commands::')}::"
    assert not any(line.startswith("::") or "##[" in line or "\x1b" in line for line in lines)


def test_very_many_changes_fit_into_a_comment_the_worst_of_them() -> None:
    bad, good = SAMPLES["hostile"].outcomes[0], SAMPLES["passed"].outcomes[0]
    new = [_named(f"good {place}", good) for place in range(3_000)] + [_named("bad", bad)]
    text = comparison_markdown(compare_outcomes([], new))
    assert len(text) <= MAX_CHARACTERS
    assert "**bad**" in text
    assert "more changes are not shown" in text
    shown = printed(compare_outcomes([], new))
    assert "2801 more changes are not shown" in shown
    assert "newly fails" in shown


@pytest.fixture
def gates() -> Comparison:
    """One gate for each result of paired runs."""
    old, new = list[Outcome](), list[Outcome]()

    def add(gate: str, before: Sequence[Outcome], now: Sequence[Outcome], at_least: float = 0.5) -> None:
        old.extend(judged(before, gate, at_least=at_least))
        new.extend(judged(now, gate, at_least=at_least))

    def runs(gate: str, passed: int, seed: int = 0, digest: str | None = None) -> list[Outcome]:
        found = verdicts([sample < passed for sample in range(100)], gate, seed=seed)
        digests = (None if digest is None else f"{digest}{sample}" for sample in range(100))
        return [like(each, digest=own) for each, own in zip(found, digests, strict=True)]

    add("fell", runs("fell", 95), runs("fell", 80))
    add("fell and newly fails", runs("fell and newly fails", 100), runs("fell and newly fails", 70), at_least=0.9)
    add("rose", runs("rose", 80), runs("rose", 92))
    add("a little", runs("a little", 95), runs("a little", 93))
    add("other | seed", runs("other | seed", 95), runs("other | seed", 80, seed=1))
    add("closer", runs("closer", 100), [run(sample, gate="closer", margin=0.1) for sample in range(100)])
    add("lost", runs("lost", 100), [*runs("lost", 100)[:-1], run(99, "error", gate="lost")])
    add("moves", runs("moves", 100, digest="f0"), runs("moves", 100, digest="f1"))
    add("same", runs("same", 100), runs("same", 100))
    return compare_outcomes(old, new)


def test_changes_of_gates_without_a_row_of_their_runs() -> None:
    # A gate that needs less confidence is a warning.
    old, new = (judged(verdicts([True] * 40), confidence=confidence) for confidence in (0.95, 0.8))
    gates = [planned(40, confidence=0.95)], [planned(40, confidence=0.8)]
    (row,) = rows(compare_outcomes(old, new, gates=gates))
    assert (row.status, row.kind, row.message) == ("warned", "less confidence", "passes: confidence 80 %, was 95 %")
    # Other draws are counted of all runs.
    before, now = (judged(verdicts([True] * count)) for count in (50, 60))
    (row,) = rows(compare_outcomes(before, now))
    assert row.message.startswith("only 50 of 60 runs have the same draws, so the runs are not compared; unpaired")


@pytest.mark.parametrize(
    ("old", "new", "look", "what", "detail"),
    [
        (0.9, 0.8, "warned", "weaker limit", "passes: at least 80 %, was at least 90 %"),
        (0.8, 0.9, "information", "stricter limit", "passes: at least 90 %, was at least 80 %"),
        (0.9, None, "warned", "no longer checked", "passes: removed from the gate, was at least 90 %"),
    ],
)
def test_a_claim_that_moved_is_shown_with_both_values(
    old: float, new: float | None, look: str, what: str, detail: str
) -> None:
    runs = verdicts([True] * 100)
    quantile = {"of": "clearance.measured", "q": 0.05, "at_least": "1 m"}
    gates = [stated(quantile=quantile, passes=rate and {"at_least": rate}) for rate in (old, new)]
    before, now = ([judged_gate(gate, runs), *runs] for gate in gates)
    (row,) = rows(compare_outcomes(before, now, gates=([gates[0]], [gates[1]])))
    assert (row.status, row.kind, row.message) == (look, what, detail)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (95, 80, "fell by 15 points (from 95 % to 80 % of 100 runs; 95 % interval 7.3 to 22.1; p < 0.0001)"),
        (90, 99, "rose by 9 points (from 90 % to 99 % of 100 runs; 95 % interval 2.7 to 15; p = 0.0039)"),
        (96, 95, "went from 96 % to 95 % of 100 runs; 95 % interval of the change -4.3 to 2.3 points; p = 1"),
    ],
)
def test_the_change_of_a_rate_in_words(old: int, new: int, told: str) -> None:
    before, now = (judged(verdicts([sample < passed for sample in range(100)])) for passed in (old, new))
    (row,) = rows(compare_outcomes(before, now))
    assert row.message == f"the pass rate {told}"


@pytest.mark.parametrize(
    ("goal", "told"),
    [(True, "came true at 2.00 s"), (False, "measured 1.501 m, limit 1.5 m, margin 0.0012 m, at 2.00 s")],
)
def test_a_goal_that_was_met_before_has_no_margin(goal: bool, told: str) -> None:
    passed, failed = SAMPLES["passed"].outcomes[0], SAMPLES["failed"].outcomes[2]
    travel = passed.expectations[0]
    met = _named("a", _with(passed, like(travel, verdict=replace(travel.verdict, goal=goal))))
    (row,) = rows(compare_outcomes([met], [_named("a", failed)]))
    assert row.message.endswith(f"; before: {told}")
