"""Two engines held against each other: the same verdicts, and how far apart at the same time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.runner.engine_agreement import at_the_same_times, with_agreement
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.state.trace import Trace
from sim_action.state.trace_storage import save_trace
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import outcome
from tests.traces import trace

TEXT = """\
name: drives
robot: {{model: turtlebot3_burger}}
expect: [upright]
{more}
time_limit: 1 s
"""
ASKED = "agreement: {position: 3 cm, yaw: 3 deg}"
TIMES = [0.0, 0.1, 0.2, 0.3]
FIRST = trace(TIMES, x=[0, 0.1, 0.2, 0.3], yaw=[0, 0, 3.1, 3.1])
# 1 cm to the side at most, at 0.2 s; 2 deg across the seam of the circle.
NEAR = trace(TIMES, x=[0, 0.1, 0.2, 0.3], y=[0, 0.005, 0.01, 0.002], yaw=[0, 0, 3.1 + 0.034907 - 6.283185307, 3.1])
FAR = trace(TIMES, x=[0, 0.1, 0.25, 0.3], yaw=[0, 0.2, 3.1, 3.1])


def loaded(folder: Path, more: str = "") -> LoadedScenario:
    path = folder / "drives.sim.yml"
    path.write_text(TEXT.format(more=more))
    return load_scenario(path)


def ran(folder: Path, engine: str, seen: Trace, *, holds: bool = True) -> Outcome:
    (folder / "traces").mkdir(exist_ok=True)
    save_trace(seen, folder / f"traces/{engine}.npz")
    made = outcome("drives.sim.yml", holds=holds, trace=f"traces/{engine}.npz")
    return made.model_copy(update={"name": f"drives [{engine}]", "engine": f"{engine} 1.0"})


def held_against(
    folder: Path, second: Trace, more: str = "", *, holds: bool = True
) -> tuple[Outcome, list[ExpectationOutcome]]:
    """The later outcome, and what the comparison has added to it."""
    outcomes = (ran(folder, "pybullet", FIRST), ran(folder, "mujoco", second, holds=holds))
    first, last = with_agreement(loaded(folder, more), outcomes, folder)
    assert first == outcomes[0]
    return last, list(last.expectations[1:])


def test_one_outcome_stays_as_it_is(tmp_path: Path) -> None:
    alone = ran(tmp_path, "pybullet", FIRST)
    assert with_agreement(loaded(tmp_path), (alone,), tmp_path) == (alone,)


def test_agreement_that_was_asked_and_not_judged_is_noted(tmp_path: Path) -> None:
    alone = ran(tmp_path, "pybullet", FIRST)
    (noted,) = with_agreement(loaded(tmp_path, ASKED), (alone,), tmp_path)
    assert noted.notes == ("agreement was not judged: the command line selects one engine",)


def test_what_agrees_is_told_with_the_largest_difference_and_when(tmp_path: Path) -> None:
    last, (verdicts, position, yaw) = held_against(tmp_path, NEAR, ASKED)
    assert last.status == "passed"
    assert verdicts.name == "the same verdicts as pybullet 1.0"
    assert position.verdict.measured == pytest.approx(0.01)
    assert position.verdict.margin == pytest.approx(0.02)
    assert position.verdict.time == 0.2
    assert (
        position.verdict.message == "position differs from pybullet 1.0 by at most 0.01 m, at 0.20 s; allowed: 0.03 m"
    )
    assert yaw.verdict.measured == pytest.approx(0.034907, abs=1e-6)
    assert yaw.location.line == 4


def test_what_is_too_far_apart_fails_if_it_was_asked(tmp_path: Path) -> None:
    last, (_, position, yaw) = held_against(tmp_path, FAR, ASKED)
    assert last.status == "failed"
    assert (position.failed, position.verdict.time) == (True, 0.2)
    assert (yaw.failed, yaw.verdict.time) == (True, 0.1)


def test_what_only_one_limit_was_asked_of_is_judged_by_that_alone(tmp_path: Path) -> None:
    _, (_, position, yaw) = held_against(tmp_path, NEAR, "agreement: {position: 3 cm}")
    assert (position.name, yaw.name) == ("the same position as pybullet 1.0", "difference in yaw to pybullet 1.0")


def test_what_nobody_asked_is_told_and_fails_nothing(tmp_path: Path) -> None:
    last, added = held_against(tmp_path, FAR)
    assert last.status == "passed"
    assert [(one.failed, one.warned, one.verdict.limit) for one in added] == [(False, False, None)] * 3
    names = ["the same verdicts as pybullet 1.0", "distance to pybullet 1.0", "difference in yaw to pybullet 1.0"]
    assert [one.name for one in added] == names
    assert added[1].verdict.message == "position differs from pybullet 1.0 by at most 0.05 m, at 0.20 s"


@pytest.mark.parametrize(("more", "severity"), [("", "warning"), (ASKED, "error")])
def test_verdicts_that_differ_are_a_warning_unless_agreement_was_asked(
    more: str, severity: str, tmp_path: Path
) -> None:
    _, (verdicts, *_) = held_against(tmp_path, NEAR, more, holds=False)
    assert (verdicts.verdict.passed, verdicts.severity) == (False, severity)
    assert verdicts.verdict.message == "'travel' passes in pybullet 1.0 and fails in mujoco 1.0"


@pytest.mark.parametrize(("more", "unexercised"), [("", "error"), (f"{ASKED}\nunexercised: warn", "warn")])
def test_an_expectation_that_one_engine_never_judged_is_a_different_verdict(
    more: str, unexercised: str, tmp_path: Path
) -> None:
    first, second = ran(tmp_path, "pybullet", FIRST), ran(tmp_path, "mujoco", NEAR)
    unread = second.expectations[0].model_copy(update={"verdict": Verdict(False, judged=Judged())})
    second = second.model_copy(update={"status": "not_exercised", "expectations": (unread,)})
    _, last = with_agreement(loaded(tmp_path, more), (first, second), tmp_path)
    assert last.expectations[1].verdict.message == (
        "'travel' passes in pybullet 1.0 and is not exercised in mujoco 1.0"
    )
    assert last.status == ("failed" if more else "not_exercised")
    assert {one.unexercised for one in last.expectations[1:]} == {unexercised}


def test_the_moments_that_two_engines_were_compared_at_are_counted(tmp_path: Path) -> None:
    last, (_, position, yaw) = held_against(tmp_path, NEAR, ASKED)
    assert position.verdict.judged == yaw.verdict.judged == Judged(4, 0.0, 0.3)
    assert last.status == "passed"


@pytest.mark.parametrize("place", [0, 1])
def test_an_engine_without_a_verdict_is_told_at_the_one_that_has_one(place: int, tmp_path: Path) -> None:
    failure = Failure(kind="engine", title="engine error", message="gave up")
    outcomes = [ran(tmp_path, "pybullet", FIRST), ran(tmp_path, "mujoco", FIRST)]
    broken = Outcome(name=outcomes[place].name, file="drives.sim.yml", status="error", failures=(failure,))
    outcomes[place] = broken
    after = with_agreement(loaded(tmp_path, ASKED), tuple(outcomes), tmp_path)
    assert after[place] == broken
    (verdicts,) = after[1 - place].expectations[1:]
    assert verdicts.failed
    assert verdicts.verdict.message == f"{('pybullet', 'mujoco')[place]} gave no verdict"


def test_two_without_a_verdict_have_nothing_to_compare(tmp_path: Path) -> None:
    failure = Failure(kind="engine", title="engine error", message="gave up")
    broken = Outcome(name="drives [x]", file="drives.sim.yml", status="error", failures=(failure,))
    assert with_agreement(loaded(tmp_path, ASKED), (broken, broken), tmp_path) == (broken, broken)


def test_a_trace_that_is_gone_leaves_the_verdicts_to_compare(tmp_path: Path) -> None:
    outcomes = (ran(tmp_path, "pybullet", FIRST), ran(tmp_path, "mujoco", NEAR))
    (tmp_path / "traces/mujoco.npz").unlink()
    _, last = with_agreement(loaded(tmp_path), outcomes, tmp_path)
    assert [one.name for one in last.expectations] == ["travel", "the same verdicts as pybullet 1.0"]


steps = st.sets(st.integers(min_value=1, max_value=60)).map(lambda later: [0, *sorted(later)])


@given(steps, steps)
def test_only_moments_that_both_have_are_compared(first: list[int], second: list[int]) -> None:
    ours, theirs = at_the_same_times(trace([n / 240 for n in first]), trace([n * (1 / 240) for n in second]))
    assert ours.time.tolist() == [n / 240 for n in first if n in second]
    assert len(theirs) == len(ours)
    assert abs(theirs.time - ours.time).max() < 1e-9


def test_a_robot_that_stops_earlier_in_one_engine_is_compared_until_then(tmp_path: Path) -> None:
    _, (_, position, _) = held_against(tmp_path, replace(NEAR, state=NEAR.state[:2]))
    assert position.verdict.measured == pytest.approx(0.005)
    assert position.verdict.time == 0.1


@pytest.mark.parametrize(
    "forged",
    [replace(NEAR, state=NEAR.state + 1000.0), replace(NEAR, state=NEAR.state * float("nan")), FIRST.rows(slice(0))],
    ids=["other times", "no numbers", "empty"],
)
@pytest.mark.parametrize(("more", "status"), [("", "passed"), (ASKED, "not_exercised")])
def test_a_trace_that_cannot_be_compared_agrees_with_none(
    more: str, status: str, forged: Trace, tmp_path: Path
) -> None:
    last, added = held_against(tmp_path, forged, more)
    assert last.status == status
    assert [one.status for one in added] == ["passed", *(["not_exercised"] if more else [])]
