from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.core.records import replace
from sim_action.results.outcome import Failure, Outcome, status_of
from sim_action.results.proof import MutantResult, MutantStatus
from sim_action.runner.mutation import judgement
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.mutation.planning import TABLE
from sim_action.runner.outcome_assembly import stored_trace
from sim_action.scenario.model import Severity
from sim_action.state.trace import Trace
from sim_action.state.trace_storage import save_trace
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import outcome
from tests.runner.mutation.runs import original, straight
from tests.traces import trace

HOLDS = Verdict(True, 1.5, 2.0, 0.5, "m")
FAILS = Verdict(False, 2.5, 2.0, -0.5, "m")
UNEXERCISED = replace(FAILS, judged=Judged())


def judged_run(
    *verdicts: Verdict, digest: str = "theirs", trace: str | None = None, severities: tuple[Severity, ...] = ()
) -> Outcome:
    (expected,) = outcome("a.sim.yml").expectations
    several = tuple(expected.model_copy(update={"verdict": verdict}) for verdict in verdicts)
    if severities:
        pairs = zip(several, severities, strict=True)
        several = tuple(each.model_copy(update={"severity": severity}) for each, severity in pairs)
    return Outcome(
        name="a", file="a.sim.yml", status=status_of(several), expectations=several, digest=digest, trace=trace
    )


@pytest.fixture
def run(tmp_path: Path) -> Original:
    made = original(tmp_path)
    return replace(made, outcome=judged_run(HOLDS, HOLDS, digest="ours"))


def silenced(run: Original) -> Mutant:
    (mutant,) = TABLE[0].mutants(run)
    return mutant


@pytest.mark.parametrize(
    ("mutant", "status", "noticed"),
    [
        (judged_run(HOLDS, HOLDS, digest="ours"), "no effect", ()),
        (judged_run(HOLDS, HOLDS), "survived", ()),
        (judged_run(HOLDS, FAILS), "noticed", (1,)),
        (judged_run(FAILS, FAILS), "noticed", (0, 1)),
        (judged_run(HOLDS, replace(FAILS, cut_off=True)), "survived", ()),
        # The scenario does not pass, but the expectation has checked nothing.
        (judged_run(HOLDS, UNEXERCISED), "noticed", ()),
        # The run stays green, but the expectation has failed.
        (judged_run(HOLDS, FAILS, severities=("error", "warning")), "survived", (1,)),
        (judged_run(HOLDS, FAILS, severities=("error", "warning"), digest="ours"), "survived", (1,)),
        (judged_run(HOLDS, UNEXERCISED, severities=("error", "warning")), "survived", ()),
        # A sensor that only an expectation reads does not change the motion.
        (judged_run(HOLDS, FAILS, digest="ours"), "noticed", (1,)),
    ],
)
def test_a_mutant_is_noticed_by_verdicts_that_change(
    mutant: Outcome, status: MutantStatus, noticed: tuple[int, ...], run: Original, tmp_path: Path
) -> None:
    result = judgement.judged(run, silenced(run), mutant, tmp_path).result
    assert (result.name, result.status, result.noticed_by) == ("silenced", status, noticed)


def test_what_is_no_notice(run: Original, tmp_path: Path) -> None:
    # An expectation that failed before notices nothing.
    failing = replace(run, outcome=judged_run(HOLDS, FAILS, digest="ours"))
    each = judgement.judged(failing, silenced(run), judged_run(FAILS, FAILS), tmp_path)
    assert each.result.noticed_by == (0,)
    found = judgement.proven(failing, [each], 0).expectations
    assert [(one.finding, one.passed) for one in found] == [("notices", True), ("unknown", False)]
    # A crash is no notice.
    failure = Failure(kind="crash", title="SIGSEGV", message="the process ended")
    crashed = Outcome(name="a", file="a.sim.yml", status="error", failures=(failure,))
    result = judgement.judged(run, silenced(run), crashed, tmp_path).result
    assert (result.status, result.reason) == ("could not run", "SIGSEGV: the process ended")


def test_reasons_of_scenarios_that_did_not_pass() -> None:
    # The reason of an error counts further problems.
    here = Location("a.sim.yml", 3, 9)
    one = Failure(kind="invalid", title="invalid scenario", message="unknown key 'x'", location=here)
    broken = Outcome(name="a", file="a.sim.yml", status="error", failures=(one, one, one))
    told = judgement.not_mutated(broken)
    assert (told.reason, told.location) == ("invalid scenario: unknown key 'x'; and 2 more problems", here)
    # A scenario that did not pass says why.
    told = judgement.not_mutated(judged_run(FAILS))
    assert (told.is_proven, told.exit_code) == (False, 1)
    assert told.reason.startswith("failed")
    assert told.location == Location("a.sim.yml", 8, 5)
    assert judgement.not_mutated(judged_run(HOLDS)).reason == "it left no trace"


def test_findings_count_mutants_that_changed_the_run(run: Original, tmp_path: Path) -> None:
    several = [
        judgement.judged(run, silenced(run), each, tmp_path)
        for each in (judged_run(HOLDS, FAILS), judged_run(HOLDS, HOLDS))
    ]
    scenario = judgement.proven(run, several, 0)
    useless, useful = scenario.expectations
    assert (useless.finding, useless.noticed, useless.missed) == ("checks nothing", (), ("silenced",))
    assert (useful.finding, useful.noticed, useful.missed) == ("notices", ("silenced",), ())
    assert (useless.sensitivity, scenario.useless) == (0.25, (useless,))
    same = [judgement.judged(run, silenced(run), judged_run(HOLDS, HOLDS, digest="ours"), tmp_path)]
    assert [each.finding for each in judgement.proven(run, same, 0).expectations] == ["unknown", "unknown"]


def test_findings_on_unfinished_and_equal_mutants(run: Original, tmp_path: Path) -> None:
    # Nothing is blamed before all mutants ran.
    several = [judgement.judged(run, silenced(run), judged_run(HOLDS, FAILS), tmp_path)]
    for scenario in (judgement.proven(run, several, 3), judgement.proven(run, several, 0, 3)):
        assert [(each.finding, each.changed) for each in scenario.expectations] == [("unknown", 1), ("notices", 1)]
        assert (scenario.left_out, scenario.unfinished) in ((3, 0), (0, 3))
    # A mutant with the same motion counts for the verdict that it changed.
    reading = judgement.judged(run, silenced(run), judged_run(HOLDS, FAILS, digest="ours"), tmp_path)
    other, reader = judgement.proven(run, [reading], 0).expectations
    assert (other.finding, other.changed, other.missed) == ("unknown", 0, ())
    assert (reader.finding, reader.changed, reader.noticed) == ("notices", 1, ("silenced",))


def test_an_expectation_that_was_not_exercised_has_noticed_nothing(run: Original, tmp_path: Path) -> None:
    lost = judgement.judged(run, silenced(run), judged_run(HOLDS, UNEXERCISED), tmp_path)
    assert (lost.result.noticed_by, lost.result.not_exercised) == ((), (1,))
    other, unexercised = judgement.proven(run, [lost], 0).expectations
    assert (other.finding, other.changed, other.missed) == ("checks nothing", 1, ("silenced",))
    assert (unexercised.finding, unexercised.changed, unexercised.not_exercised) == ("unknown", 0, ("silenced",))
    survivor = judgement.judged(run, silenced(run), judged_run(HOLDS, HOLDS), tmp_path)
    _, useless = judgement.proven(run, [lost, survivor], 0).expectations
    assert (useless.finding, useless.changed, useless.not_exercised) == ("checks nothing", 1, ("silenced",))


def test_the_motion_of_a_survivor_is_compared(run: Original, tmp_path: Path) -> None:
    save_trace(straight(1.0), tmp_path / "m.npz")
    each = judgement.judged(run, silenced(run), judged_run(HOLDS, HOLDS, trace="m.npz"), tmp_path)
    assert each.result.change is not None
    assert each.result.change.text == "the robot was 1.00 m behind at 20.00 s"
    told = judgement.with_suggestion(each, "- no_collision").result
    assert told.suggestion == "- no_collision"
    assert judgement.proven(run, [replace(each, result=told)], 0).survivors == (told,)


def test_a_trace_that_is_missing_or_damaged_is_none(tmp_path: Path) -> None:
    (tmp_path / "m.npz").write_bytes(b"no trace")
    assert stored_trace(judged_run(HOLDS, trace="m.npz"), tmp_path) is None
    assert stored_trace(judged_run(HOLDS, trace="gone.npz"), tmp_path) is None
    assert stored_trace(judged_run(HOLDS), tmp_path) is None


TIME = [0.0, 1.0, 2.0]


def moved(**columns: list[float]) -> Trace:
    return trace(TIME, **columns)  # type: ignore[arg-type] # columns only


AHEAD = moved(x=[0, 1, 2])


def text_of_change(one: Trace, other: Trace, *sliding: str) -> str:
    change = judgement.path_change(one, other, sliding)
    assert change is not None
    return change.text


@pytest.mark.parametrize(
    ("mutant", "told"),
    [
        (moved(x=[0, 1, 2], y=[0, 0.8, 0.2]), "the robot was 0.80 m further left at 1.00 s"),
        (moved(x=[0, 1, 2], y=[0, -0.8, 0.2]), "the robot was 0.80 m further right at 1.00 s"),
        (moved(x=[0, 1.5, 2]), "the robot was 0.50 m further ahead at 1.00 s"),
        (moved(x=[0, 1, 1.5]), "the robot was 0.50 m behind at 2.00 s"),
        (moved(x=[0, 1, 2], z=[0, 0.3, 0]), "the robot was 0.30 m higher at 1.00 s"),
        (moved(x=[0, 0.92, 2], y=[0, 0.09, 0]), "the robot was 0.12 m further left at 1.00 s"),
        (moved(x=[0, 1, 2], yaw=[0, 0, 0.2]), "the robot was turned by 11.46 deg more at 2.00 s"),
    ],
)
def test_the_greatest_change_is_told(mutant: Trace, told: str) -> None:
    assert text_of_change(AHEAD, mutant) == told


def test_the_words_of_a_change() -> None:
    # Directions are those of the robot.
    north = moved(y=[0, 1, 2], yaw=[math.pi / 2] * 3)
    aside = moved(y=[0, 1, 2], x=[0, 0, -0.4], yaw=[math.pi / 2] * 3)
    assert "0.40 m further left" in text_of_change(north, aside)
    # Small changes do not count.
    assert judgement.path_change(AHEAD, AHEAD) is None
    assert judgement.path_change(AHEAD, moved(x=[0, 1.09, 2], yaw=[0, 0.08, 0])) is None
    # A longer run counts where it ends.
    longer = trace([*TIME, 3.0], x=[0, 1, 2, 3])
    assert text_of_change(AHEAD, longer) == "the robot was 1.00 m further ahead at the end"


def test_the_joints_of_a_robot_that_stays_count() -> None:
    still, bent = moved(position=[0, 0, 0]), moved(position=[0, 0.5, 0])
    change = judgement.path_change(still, bent)
    assert change is not None
    assert (change.joint, change.joint_change) == ("wheel_left_joint", 0.5)
    assert change.text == "joint 'wheel_left_joint' was 28.65 deg elsewhere at 1.00 s"
    slid = text_of_change(still, bent, "wheel_left_joint")
    assert slid == "joint 'wheel_left_joint' was 0.5 m elsewhere at 1.00 s"
    assert judgement.path_change(still, moved(position=[0, 0.05, 0])) is None
    assert judgement.path_change(straight(), straight()) is None


def test_other_strengths_follow_what_was_noticed(run: Original) -> None:
    """A milder fault runs if one was noticed, a stronger one if not, or while an expectation has noticed nothing."""
    first, second, third = (replace(silenced(run), subject=name) for name in "abc")

    def judged_one(mutant: Mutant, *noticed_by: int) -> judgement.JudgedMutant:
        status = "noticed" if noticed_by else "survived"
        result = MutantResult.model_validate(
            {"name": mutant.name, "words": "w", "status": status, "noticed_by": noticed_by}
        )
        return judgement.JudgedMutant(mutant, run.outcome, result)

    def following(*ran: judgement.JudgedMutant) -> list[Mutant]:
        return judgement.next_strengths(run, ran)

    def names(*ran: judgement.JudgedMutant) -> list[str]:
        return [each.mutant.subject for each in judgement.with_strengths(ran[:1], ran[1:])]

    milder, stronger = replace(first, milder=(second, third)), replace(first, stronger=(second, third))
    assert following(judged_one(milder)) == []
    assert following(judged_one(milder, 0)) == [replace(second, milder=(third,))]
    assert names(judged_one(milder, 0), judged_one(replace(second, milder=(third,)), 0)) == ["b"]
    assert names(judged_one(milder, 0), judged_one(second)) == ["a"]
    assert names(judged_one(milder, 0)) == ["a"]
    assert following(judged_one(stronger, 0, 1)) == []
    assert following(judged_one(stronger, 0)) == following(judged_one(stronger)) == [replace(second, stronger=(third,))]
    assert names(judged_one(stronger), judged_one(second)) == ["a", "b"]
    (kept,) = judgement.with_strengths([judged_one(milder, 0)], [judged_one(second)])
    assert following(kept) == []
