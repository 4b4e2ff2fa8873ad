"""The runs of a gate are compared in pairs: what changed is found, and what did not change is not reported."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pytest

from sim_action.cli.compare import compare_results
from sim_action.core.errors import ExitCode
from sim_action.core.records import replace
from sim_action.results.comparison import Change, Comparison, Thresholds, compare_outcomes
from sim_action.results.gates import judged_gate
from sim_action.results.outcome import Outcome, Scope
from sim_action.results.paired_comparison import GateComparison, Rate, adjusted, compare_gate
from tests.gate_runs import FILE, judged, planned, run, simulated, stated, verdicts
from tests.outcomes import results

SEEDS = 100


def compared(old: Sequence[Outcome], new: Sequence[Outcome]) -> Comparison:
    """Compare two sets of runs of one gate."""
    return compare_outcomes(judged(old), judged(new))


def only(comparison: Comparison) -> tuple[Change, GateComparison]:
    """Return the one change, which is of a gate."""
    (change,) = comparison.changes
    assert change.gate is not None
    return change, change.gate


def of_runs(versions: Iterable[Sequence[bool]], gate: str = "push") -> GateComparison:
    """Compare the runs of two versions alone: bounds of gates take longer."""
    before, now = (verdicts(passed, gate) for passed in versions)
    return compare_gate(before[0], now[0], list(zip(before, now, strict=True)), 0.5)


def direction(gate: GateComparison | None) -> str | None:
    """Return the direction in which the pass rate changed."""
    assert gate is not None
    assert gate.rate is not None
    return gate.rate.direction


def passing(count: int, runs: int = 100) -> list[bool]:
    """Return verdicts of which the first ones passed."""
    return [sample < count for sample in range(runs)]


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_drop_from_95_to_80_percent_is_found_at_100_draws(noise: float) -> None:
    old, new = (
        [simulated(seed, rate, noise=noise, version=str(rate)) for seed in range(SEEDS)] for rate in (0.95, 0.8)
    )
    found = [direction(of_runs(pair)) for pair in zip(old, new, strict=True)]
    assert found.count("fell") > 90
    assert "rose" not in found


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
def test_identical_commits_show_no_change(noise: float) -> None:
    pairs = [[simulated(seed, 0.95, noise=noise, version=each) for each in "ab"] for seed in range(SEEDS)]
    found = [direction(of_runs(pair)) for pair in pairs]
    assert found.count(None) >= 95
    if not noise:
        assert found.count(None) == SEEDS


def test_rates_that_fell_or_rose() -> None:
    # A fallen rate fails although the gate still passes.
    comparison = compared(verdicts(passing(95)), verdicts(passing(80)))
    change, gate = only(comparison)
    assert gate.rate is not None
    assert (change.kind, gate.rate.direction, gate.pairs, gate.left_out) == ("still passes", "fell", 100, 0)
    assert (gate.rate.worse, gate.rate.better, gate.rate.tests) == (15, 0, 1)
    assert gate.rate.p == pytest.approx(2 * 0.5**15)
    assert (comparison.failures, comparison.warnings, comparison.exit_code()) == (1, 0, ExitCode.FAILED)
    # A risen rate is no failure.
    comparison = compared(verdicts(passing(80)), verdicts(passing(95)))
    _, gate = only(comparison)
    assert gate.rate is not None
    assert gate.rate.direction == "rose"
    assert (comparison.failures, comparison.exit_code(strict=True)) == (0, ExitCode.PASSED)
    # A sample that fails now is no new failure but a gate is.
    comparison = compared(verdicts(passing(95)), verdicts(passing(94)))
    change, gate = only(comparison)
    assert (change.kind, gate.failed, comparison.exit_code(strict=True)) == ("still passes", False, ExitCode.PASSED)
    old, new = (judged(verdicts(passing(count)), at_least=0.9) for count in (100, 94))
    change, gate = only(compare_outcomes(old, new))
    assert (change.kind, change.new and change.new.status) == ("newly fails", "inconclusive")
    # A gate that fell and newly fails counts once.
    old, new = (judged(verdicts(passing(count)), at_least=0.9) for count in (100, 60))
    comparison = compare_outcomes(old, new)
    assert (comparison.failures, only(comparison)[1].failed) == (1, True)


@pytest.mark.parametrize(
    ("new", "pairs"),
    [
        (verdicts(passing(80), seed=1), 0),
        (verdicts(passing(80, 120)), 100),
        ([*verdicts(passing(80, 99)), run(100)], 99),
        ([each.model_copy(update={"name": f"{each.name} "}) for each in verdicts(passing(80))], 0),
    ],
    ids=["another seed", "another number", "another index", "other names"],
)
def test_other_samples_are_not_compared(new: list[Outcome], pairs: int) -> None:
    comparison = compared(verdicts(passing(95)), new)
    change, gate = only(comparison)
    assert (gate.same_draws, gate.pairs, change.kind) == (False, pairs, "still passes")
    assert (gate.rate, gate.margins) == (None, ())
    assert (gate.old, gate.new) == (Rate(95, 100), Rate(80, len(new)) if new[-1].number != 101 else Rate(81, 100))
    assert (comparison.exit_code(), comparison.warnings) == (ExitCode.PASSED, 1)


def test_pairs_without_a_verdict() -> None:
    # Runs without a verdict are left out of the pairs.
    old, new = verdicts(passing(95)), verdicts(passing(95))
    old[3], new[99] = run(3, "skipped"), run(99, "not_exercised")
    _, gate = only(compared(old, new))
    assert (gate.pairs, gate.left_out, gate.same_draws) == (98, 2, True)
    assert (gate.old, gate.new) == (Rate(94, 99), Rate(95, 99))
    lost = [*judged(verdicts(passing(95)))[:1], *verdicts(passing(95))[:-10]]
    _, gate = only(compare_outcomes(judged(old), lost))
    assert (gate.pairs, gate.left_out, gate.same_draws) == (89, 11, True)
    # A gate without any pair has no rate.
    skipped = [run(sample, "skipped") for sample in range(20)]
    change, gate = only(compared(verdicts(passing(20, 20)), skipped))
    assert (change.kind, gate.pairs, gate.left_out, gate.rate) == ("not run", 0, 20, None)


def with_margins(margins: Sequence[float]) -> list[Outcome]:
    return [run(sample, margin=margin) for sample, margin in enumerate(margins)]


def twofold(runs: Iterable[Outcome]) -> list[Outcome]:
    """Return the runs with their expectation twice, at last as 'upright'."""
    renamed = {"name": "upright", "assertion": "upright"}
    return [
        run.model_copy(update={"expectations": (expected, expected.model_copy(update=renamed))})
        for run in runs
        for expected in run.expectations
    ]


def test_a_loss_of_margin_beyond_the_threshold_is_a_warning() -> None:
    draws = random.Random(1)
    old = [0.4 + draws.uniform(-0.1, 0.1) for _ in range(50)]
    comparison = compared(with_margins(old), with_margins([margin - 0.3 for margin in old]))
    _, gate = only(comparison)
    (loss,) = gate.margins
    assert (loss.expectation, loss.unit, loss.pairs) == ("clearance", "m", 50)
    found = loss.new - loss.old, loss.change.low, loss.change.high, loss.confidence
    assert found == pytest.approx((-0.3, -0.3, -0.3, 0.95))
    assert (comparison.exit_code(), comparison.exit_code(strict=True)) == (ExitCode.PASSED, ExitCode.FAILED)
    small = compared(with_margins(old), with_margins([margin - 0.1 for margin in old]))
    assert only(small)[1].margins == ()
    before, now = (judged(with_margins([margin - lost for margin in old])) for lost in (0, 0.1))
    asked = compare_outcomes(before, now, Thresholds(0.9))
    assert len(only(asked)[1].margins) == 1


def test_losses_of_margin() -> None:
    # A loss of margin that may be chance is not reported.
    old, new = [0.1] * 50, [-5.0, *[0.12] * 49]
    assert sum(new) < 0.5 * sum(old)
    assert only(compared(with_margins(old), with_margins(new)))[1].margins == ()
    # Few pairs have no comparison of margins.
    for count, found in ((19, 0), (20, 1)):
        _, gate = only(compared(with_margins([0.4] * count), with_margins([0.1] * count)))
        assert len(gate.margins) == found
    # Margins of several expectations share the confidence.
    _, gate = only(compared(twofold(with_margins([0.4] * 30)), twofold(with_margins([0.1] * 30))))
    assert [loss.expectation for loss in gate.margins] == ["clearance", "upright"]
    assert [loss.confidence for loss in gate.margins] == pytest.approx([0.975, 0.975])
    # An expectation with another name in some draws goes by its assertion, and a margin below 0 is none to lose.
    other, *same = with_margins([0.1] * 30)
    (expected,) = other.expectations
    other = other.model_copy(update={"expectations": (expected.model_copy(update={"name": "far"}),)})
    _, gate = only(compared(with_margins([0.4] * 30), [other, *same]))
    assert [loss.expectation for loss in gate.margins] == [expected.assertion]
    _, gate = only(compared(with_margins([-0.1] * 30), with_margins([-0.4] * 30)))
    assert gate.margins == ()


@pytest.mark.parametrize("scale", [1e110, 1e307])
def test_margins_of_any_size_are_compared(scale: float) -> None:
    old, new = ([scale * size] * 30 for size in (4.0, 1.0))
    (loss,) = only(compared(with_margins(old), with_margins([*new[1:], 0.5 * scale])))[1].margins
    assert (loss.change.low / scale, loss.change.high / scale) == pytest.approx((-3.0, -3.0), abs=0.2)
    opposite = with_margins([-1.7e308] * 30)
    assert only(compared(with_margins([1.7e308] * 30), opposite))[1].margins == ()


@pytest.mark.parametrize("side", ["old", "new"])
def test_margins_of_undecided_expectations_are_not_compared(side: str) -> None:
    old, new = with_margins([0.4] * 30), with_margins([0.1] * 30)
    for runs in (old,) if side == "old" else (new,):
        runs[:] = [with_verdict(each, cut_off=True) for each in runs]
    assert only(compared(old, new))[1].margins == ()


def with_verdict(outcome: Outcome, **changes: Any) -> Outcome:
    (expected,) = outcome.expectations
    verdict = replace(expected.verdict, **changes)
    return outcome.model_copy(update={"expectations": (expected.model_copy(update={"verdict": verdict}),)})


def gates(*worse: int) -> tuple[list[Outcome], list[Outcome]]:
    """Return two results with one gate for each number of pairs that fail now."""
    old, new = list[Outcome](), list[Outcome]()
    for place, count in enumerate(worse):
        old += judged(verdicts(passing(100), f"gate {place}"), f"gate {place}")
        new += judged(verdicts(passing(100 - count), f"gate {place}"), f"gate {place}")
    return old, new


def fallen(*worse: int) -> list[bool]:
    return [change.failed for change in compare_outcomes(*gates(*worse)).changes]


def test_several_gates() -> None:
    # Several gates share the chance of a wrong report.
    assert fallen(6) == [True]
    assert fallen(6, 6) == [False, False]
    assert fallen(6, 7) == [True, True]
    assert fallen(8, 6, 6) == [True, False, False]
    found = [change.gate.rate for change in compare_outcomes(*gates(6, 7)).changes if change.gate]
    assert [rate.p for rate in found if rate] == pytest.approx([2 * 0.5**6, 4 * 0.5**7])
    assert [rate.tests for rate in found if rate] == [2, 2]
    assert fallen(6, 0, 0, 5) == [True, False, False, False]


def test_identical_commits_with_several_gates_show_no_change() -> None:
    reported = 0
    for seed in range(SEEDS):
        gates = [
            of_runs([simulated(1000 * seed + ord(gate), 0.9, noise=0.2, version=each) for each in "12"], gate)
            for gate in "abcde"
        ]
        reported += any(direction(gate) for gate in adjusted(gates))
    assert reported <= 5


def test_runs_that_check_less() -> None:
    # Runs that check less are reported once.
    old, new = verdicts(passing(50, 50)), verdicts(passing(50, 50))
    strict = [with_scope(each, Scope(before=2)) for each in old]
    loose = [with_scope(each, Scope(after=1, before=2)) for each in new]
    comparison = compared(strict, loose)
    (change,) = comparison.changes
    assert [(weaker.kind, weaker.old.name) for weaker in change.weaker] == [("window", "clearance")]
    none = [each.model_copy(update={"expectations": ()}) for each in new]
    (change,) = compared(strict, none).changes
    assert [weaker.kind for weaker in change.weaker] == ["removed"]
    # Weaker checks are reported for each expectation.
    (change,) = compared(twofold(strict), twofold(loose)).changes
    weaker = [(weaker.kind, weaker.old.name) for weaker in change.weaker]
    assert weaker == [("window", "clearance"), ("window", "upright")]


def test_limits_and_seeds_of_other_draws() -> None:
    # Limits of other draws are not compared.
    # A limit may be drawn.
    old = verdicts(passing(30, 30))
    loose = [with_verdict(each, limit=0.5, margin=0.9) for each in old]
    assert [weaker.kind for weaker in compared(old, loose).changes[0].weaker] == ["limit"]
    others = [with_verdict(each, limit=0.5, margin=0.9) for each in verdicts(passing(30, 30), seed=1)]
    assert compared(old, others).changes[0].weaker == ()
    windows = [with_scope(each, Scope(after=1)) for each in others]
    scoped = [with_scope(each, Scope()) for each in old]
    assert [weaker.kind for weaker in compared(scoped, windows).changes[0].weaker] == ["window"]
    # Runs of other seeds are no pairs although their values are equal.
    old = verdicts(passing(95))
    new = [each.model_copy(update={"seed": 5000}) for each in old]
    _, gate = only(compared(old, new))
    assert (gate.same_draws, gate.pairs) == (False, 0)


def with_scope(outcome: Outcome, scope: Scope) -> Outcome:
    (expected,) = outcome.expectations
    return outcome.model_copy(update={"expectations": (expected.model_copy(update={"scope": scope}),)})


def test_the_stated_claims_of_both_gates_are_compared() -> None:
    runs = verdicts(passing(100))
    gates = stated(passes={"at_least": 0.9}), stated(passes={"at_least": 0.8})
    old, new = ([judged_gate(gate, runs), *runs] for gate in gates)
    comparison = compare_outcomes(old, new, gates=([gates[0]], [gates[1]]))
    change, _ = only(comparison)
    assert [(claim.kind, claim.claim, claim.is_weaker) for claim in change.claims] == [("limit", "passes", True)]
    assert (change.weaker, change.stricter, change.renamed, comparison.warnings) == ((), (), (), 1)
    assert comparison.exit_code(strict=True) is ExitCode.FAILED
    stricter = compare_outcomes(new, old, gates=([gates[1]], [gates[0]]))
    assert [(claim.kind, claim.is_weaker) for claim in only(stricter)[0].claims] == [("limit", False)]
    assert stricter.warnings == 0
    assert only(compare_outcomes(old, new))[0].claims == ()


def test_claims_and_runs_of_changed_gates() -> None:
    # Claims of other kinds are not renamed.
    runs = verdicts(passing(100))
    gates = stated(passes={"at_least": 0.95}), stated(stop_early={"reject": 0.3, "accept": 0.6})
    old, new = ([judged_gate(gate, runs), *runs] for gate in gates)
    change, _ = only(compare_outcomes(old, new, gates=([gates[0]], [gates[1]])))
    assert (change.renamed, [claim.kind for claim in change.claims]) == ((), ["limit"])
    # Errors that are gone are no removed check.
    old = verdicts(passing(100))
    old[0] = run(0, "error")
    change, _ = only(compared(old, verdicts(passing(100))))
    assert (change.kind, change.weaker) == ("fixed", ())
    # A new gate is compared with runs that had none.
    before = [each.model_copy(update={"gate": None}) for each in verdicts(passing(95))]
    change, gate = only(compare_outcomes(before, judged(verdicts(passing(80)))))
    assert (change.kind, change.old, gate.pairs, gate.failed) == ("new", None, 100, True)
    (change,) = compare_outcomes([], judged(verdicts(passing(80)))).changes
    assert (change.kind, change.gate, change.warnings) == ("new", None, 0)


def test_runs_without_the_gate_they_had_are_compared_one_by_one() -> None:
    after = [each.model_copy(update={"gate": None}) for each in verdicts(passing(8, 10))]
    changes = compare_outcomes(judged(verdicts(passing(9, 10))), after).changes
    kinds = [change.kind for change in changes if change.kind != "still passes"]
    assert kinds == ["newly fails", "still fails", "removed"]
    (removed,) = compare_outcomes(judged(verdicts(passing(9, 10))), []).changes
    assert removed.kind == "removed"


def test_samples_and_moved_gates() -> None:
    # Samples without their gate are compared one by one.
    old, new = (verdicts(passing(count, 10)) for count in (10, 9))
    assert [change.kind for change in compare_outcomes(old, new).changes].count("newly fails") == 1
    # A gate in a moved file is the same.
    there = [each.model_copy(update={"file": "moved.sim.yml"}) for each in verdicts(passing(80))]
    change, gate = only(compare_outcomes(judged(verdicts(passing(95))), judged(there)))
    assert (change.kind, gate.pairs, gate.failed) == ("still passes", 100, True)


def test_results_of_shards_are_joined_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder, count in (("old", 95), ("new", 80)):
        runs = verdicts(passing(count))
        for index in (1, 2):
            part = results(*runs[index - 1 :: 2], shard=(index, 2, 100))
            there = tmp_path / folder / str(index)
            there.mkdir(parents=True)
            part.model_copy(update={"gates": (planned(100),)}).write(there)
    old, new = str(tmp_path / "old"), str(tmp_path / "new")
    told = "the pass rate fell by 15 points (from 95 % to 80 % of 100 runs; 95 % interval 7.3 to 22.1; p < 0.0001)"
    assert compare_results(old, new) is ExitCode.FAILED
    assert capsys.readouterr().out.splitlines() == [
        f"✗ pass rate fell  push  {FILE}  {told}",
        "1 pass rate fell, 1 still passes",
    ]
    assert compare_results(old, old) is ExitCode.PASSED
    assert capsys.readouterr().out == "1 still passes\n"


def test_the_stated_gates_of_results_files_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder, at_least in (("old", 0.9), ("new", 0.8)):
        (tmp_path / folder).mkdir()
        found = results(*verdicts(passing(100)))
        found.model_copy(update={"gates": (planned(100, at_least=at_least),)}).write(tmp_path / folder)
    assert compare_results(str(tmp_path / "old"), str(tmp_path / "new"), strict=True) is ExitCode.FAILED
    assert "passes: at least 80 %, was at least 90 %" in capsys.readouterr().out
