"""Two engines held against each other: the same verdicts, and how far apart at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.runner.engine_agreement import at_the_same_times, with_agreement
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.state.trace_storage import MotionRecord
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


def motion(time: Sequence[float], **columns: Any) -> MotionRecord:
    """Of a base at these times; what is left out is zero."""
    seen = trace(time, **columns)
    return MotionRecord(seen.time, seen.state[:, 1:8])


FIRST = motion(TIMES, x=[0, 0.1, 0.2, 0.3], yaw=[0, 0, 3.1, 3.1])
# 1 cm to the side at most, at 0.2 s; 2 deg across the seam of the circle.
NEAR = motion(TIMES, x=[0, 0.1, 0.2, 0.3], y=[0, 0.005, 0.01, 0.002], yaw=[0, 0, 3.1 + 0.034907 - 6.283185307, 3.1])
FAR = motion(TIMES, x=[0, 0.1, 0.25, 0.3], yaw=[0, 0.2, 3.1, 3.1])


def loaded(folder: Path, more: str = "") -> LoadedScenario:
    path = folder / "drives.sim.yml"
    path.write_text(TEXT.format(more=more))
    return replace(load_scenario(path), compared=True)


def ran(folder: Path, engine: str, seen: MotionRecord, *, holds: bool = True) -> Outcome:
    seen.save(folder / f"{engine}.npz")
    made = outcome("drives.sim.yml", holds=holds)
    return made.model_copy(update={"name": f"drives [{engine}]", "engine": f"{engine} 1.0"})


def compared(folder: Path, more: str, *outcomes: Outcome) -> tuple[Outcome, ...]:
    """The outcomes after their comparison."""
    files = [folder / f"{outcome.name.rpartition('[')[2].rstrip(']')}.npz" for outcome in outcomes]
    return with_agreement(loaded(folder, more), outcomes, files)


def held_against(
    folder: Path, second: MotionRecord, more: str = "", *, holds: bool = True, first: MotionRecord = FIRST
) -> tuple[Outcome, list[ExpectationOutcome]]:
    """The later outcome, and what the comparison has added to it."""
    outcomes = (ran(folder, "pybullet", first), ran(folder, "mujoco", second, holds=holds))
    before, last = compared(folder, more, *outcomes)
    assert before == outcomes[0]
    return last, list(last.expectations[1:])


def test_one_engine_alone(tmp_path: Path) -> None:
    # One outcome stays as it is.
    alone = ran(tmp_path, "pybullet", FIRST)
    assert compared(tmp_path, "", alone) == (alone,)
    # Agreement that was asked and not judged is noted.
    (noted,) = compared(tmp_path, ASKED, alone)
    assert noted.notes == ("agreement was not judged: the command line selects one engine",)


def test_what_agrees_is_told_with_the_largest_difference_and_when(tmp_path: Path) -> None:
    last, (verdicts, position, yaw) = held_against(tmp_path, NEAR, ASKED)
    assert last.status == "passed"
    assert verdicts.name == "the same verdicts as pybullet 1.0"
    assert position.verdict.measured == pytest.approx(0.01)
    assert position.verdict.margin == pytest.approx(0.02)
    assert position.verdict.time == 0.2
    message = "position differs from pybullet 1.0 by at most 0.01 m, at 0.20 s; allowed: 0.03 m"
    assert position.verdict.message == message
    assert yaw.verdict.measured == pytest.approx(0.034907, abs=1e-6)
    assert yaw.location.line == 4
    assert position.verdict.judged == yaw.verdict.judged == Judged(4, 0.0, 0.3)


def test_limits_that_are_judged(tmp_path: Path) -> None:
    # What is too far apart fails if it was asked.
    last, (_, position, yaw) = held_against(tmp_path, FAR, ASKED)
    assert last.status == "failed"
    assert (position.failed, position.verdict.time) == (True, 0.2)
    assert (yaw.failed, yaw.verdict.time) == (True, 0.1)
    # What only one limit was asked of is judged by that alone.
    last, (_, position) = held_against(tmp_path, NEAR, "agreement: {position: 3 cm}")
    (measured,) = last.measurements
    assert (position.name, measured.name) == ("the same position as pybullet 1.0", "difference in yaw to pybullet 1.0")


def test_what_nobody_asked_is_told_and_fails_nothing(tmp_path: Path) -> None:
    last, added = held_against(tmp_path, FAR)
    assert last.status == "passed"
    assert [(one.name, one.failed, one.warned) for one in added] == [
        ("the same verdicts as pybullet 1.0", False, False)
    ]
    names = ["distance to pybullet 1.0", "difference in yaw to pybullet 1.0"]
    assert [one.name for one in last.measurements] == names
    distance = last.measurements[0]
    assert distance.message == "position differs from pybullet 1.0 by at most 0.05 m, at 0.20 s"
    assert distance.measured == pytest.approx(0.05)
    assert (distance.unit, distance.time) == ("m", 0.2)


@pytest.mark.parametrize(("more", "severity"), [("", "warning"), (ASKED, "error")])
def test_verdicts_that_differ_warn_unless_agreement_was_asked(more: str, severity: str, tmp_path: Path) -> None:
    _, (verdicts, *_) = held_against(tmp_path, NEAR, more, holds=False)
    assert (verdicts.verdict.passed, verdicts.severity) == (False, severity)
    assert verdicts.verdict.message == "'travel' passes in pybullet 1.0 and fails in mujoco 1.0"


@pytest.mark.parametrize(("more", "unexercised"), [("", "error"), (f"{ASKED}\nunexercised: warn", "warn")])
def test_an_expectation_that_one_engine_never_judged_differs(more: str, unexercised: str, tmp_path: Path) -> None:
    first, second = ran(tmp_path, "pybullet", FIRST), ran(tmp_path, "mujoco", NEAR)
    unread = second.expectations[0].model_copy(update={"verdict": Verdict(False, judged=Judged())})
    second = second.model_copy(update={"status": "not_exercised", "expectations": (unread,)})
    _, last = compared(tmp_path, more, first, second)
    assert last.expectations[1].verdict.message == (
        "'travel' passes in pybullet 1.0 and is not exercised in mujoco 1.0"
    )
    assert last.status == ("failed" if more else "not_exercised")
    assert {one.unexercised for one in last.expectations[1:]} == {unexercised}


@pytest.mark.parametrize("place", [0, 1])
def test_an_engine_without_a_verdict_is_told_at_the_one_that_has_one(place: int, tmp_path: Path) -> None:
    failure = Failure(kind="engine", title="engine error", message="gave up")
    outcomes = [ran(tmp_path, "pybullet", FIRST), ran(tmp_path, "mujoco", FIRST)]
    broken = Outcome(name=outcomes[place].name, file="drives.sim.yml", status="error", failures=(failure,))
    outcomes[place] = broken
    after = compared(tmp_path, ASKED, *outcomes)
    assert after[place] == broken
    (verdicts,) = after[1 - place].expectations[1:]
    assert verdicts.failed
    assert verdicts.verdict.message == f"{('pybullet', 'mujoco')[place]} gave no verdict"


def test_runs_that_cannot_be_compared(tmp_path: Path) -> None:
    # Two without a verdict have nothing to compare.
    failure = Failure(kind="engine", title="engine error", message="gave up")
    broken = Outcome(name="drives [x]", file="drives.sim.yml", status="error", failures=(failure,))
    assert compared(tmp_path, ASKED, broken, broken) == (broken, broken)
    # A motion that is gone leaves the verdicts to compare.
    outcomes = (ran(tmp_path, "pybullet", FIRST), ran(tmp_path, "mujoco", NEAR))
    (tmp_path / "mujoco.npz").unlink()
    _, last = compared(tmp_path, "", *outcomes)
    assert [one.name for one in last.expectations] == ["travel", "the same verdicts as pybullet 1.0"]
    # A run that was too long to compare says so.
    outcomes = (ran(tmp_path, "pybullet", FIRST), ran(tmp_path, "mujoco", NEAR))
    long = replace(loaded(tmp_path), compared=False)
    _, last = with_agreement(long, outcomes, [None, None])
    assert not last.measurements
    assert last.notes == (
        "the motion in both engines was not compared: time_limit has more than 2,000,000 physics steps",
    )


steps = st.sets(st.integers(min_value=1, max_value=60)).map(lambda later: [0, *sorted(later)])


@given(steps, steps)
def test_only_moments_that_both_have_are_compared(first: list[int], second: list[int]) -> None:
    ours, theirs = at_the_same_times(motion([n / 240 for n in first]), motion([n * (1 / 240) for n in second]))
    assert ours.time.tolist() == [n / 240 for n in first if n in second]
    assert len(theirs) == len(ours)
    assert abs(theirs.time - ours.time).max() < 1e-9


def test_a_robot_that_stops_earlier_in_one_engine_is_compared_until_then(tmp_path: Path) -> None:
    last, _ = held_against(tmp_path, NEAR.rows(np.arange(2)))
    position = last.measurements[0]
    assert position.measured == pytest.approx(0.005)
    assert position.time == 0.1
    assert position.message.endswith(
        "at 0.10 s (compared until 0.1 s, where the run in mujoco 1.0 ended; pybullet 1.0 ran 0.3 s)"
    )
    # Two runs of one length say nothing about their ends.
    last, _ = held_against(tmp_path, NEAR)
    assert not [one for one in last.measurements if "compared until" in one.message]


@pytest.mark.parametrize(
    "forged",
    [
        replace(NEAR, time=NEAR.time + 1000.0),
        replace(NEAR, base=NEAR.base * float("nan")),
        FIRST.rows(np.arange(0)),
        replace(NEAR, joints={"made_up": NEAR.time}, units={"made_up": "rad"}),
    ],
    ids=["other times", "no numbers", "empty", "other joints"],
)
@pytest.mark.parametrize(("more", "status"), [("", "passed"), (ASKED, "not_exercised")])
def test_an_incomparable_motion_agrees_with_none(more: str, status: str, forged: MotionRecord, tmp_path: Path) -> None:
    last, added = held_against(tmp_path, forged, more)
    assert last.status == status
    assert [one.status for one in added] == ["passed", *(["not_exercised"] * 2 if more else [])]
    assert not last.measurements


LEFT, RIGHT = "wheel_left_joint", "wheel_right_joint"
ARM = replace(
    FIRST,
    joints={LEFT: np.array([0.0, 0.1, 0.2, 0.3]), RIGHT: np.zeros(4), "rail": np.zeros(4)},
    units={LEFT: "rad", RIGHT: "rad", "rail": "m"},
    bolted=True,
)
# The right one is 0.02 rad away at 0.1 s, the left one 0.01 rad at 0.3 s, the rail 4 mm at the end.
BENT = replace(
    ARM,
    joints={
        LEFT: np.array([0.0, 0.1, 0.2, 0.31]),
        RIGHT: np.array([0.0, -0.02, 0.0, 0.0]),
        "rail": np.array([0.0, 0.0, 0.0, 0.004]),
    },
)


def test_joints(tmp_path: Path) -> None:
    # A joint is compared by its name.
    more = f"agreement: {{joints: {{{LEFT}: 0.02, {RIGHT}: 0.015}}}}"
    last, (_, near, far) = held_against(tmp_path, BENT, more, first=ARM)
    assert last.status == "failed"
    assert near.name == f"the same position of joint '{LEFT}' as pybullet 1.0"
    assert [near.verdict.measured, far.verdict.measured] == pytest.approx([0.01, 0.02])
    assert (near.verdict.unit, near.verdict.time) == ("rad", 0.3)
    assert (far.failed, far.verdict.unit) == (True, "rad")
    assert not last.measurements
    # A pattern is judged by its worst joint.
    _, (_, joints) = held_against(tmp_path, BENT, "agreement: {joints: {'wheel*': 1 deg}}", first=ARM)
    assert joints.name == "the same position of joints 'wheel*' as pybullet 1.0"
    assert joints.failed
    assert joints.verdict.message == (
        f"position of joint '{RIGHT}' differs from pybullet 1.0 by at most 1.146 deg, at 0.10 s; allowed: 1 deg"
    )


def test_a_bolted_robot_is_measured_by_its_joints(tmp_path: Path) -> None:
    last, _ = held_against(tmp_path, BENT, first=ARM)
    assert [(one.name, one.unit) for one in last.measurements] == [
        ("difference of turning joints to pybullet 1.0", "rad"),
        ("difference of sliding joints to pybullet 1.0", "m"),
    ]
    assert [one.measured for one in last.measurements] == pytest.approx([0.02, 0.004])


def poses(x: Sequence[float], yaw: Sequence[float]) -> Any:
    """Of a link or body at `TIMES`."""
    return trace(TIMES, x=x, yaw=yaw).state[:, 1:8]


def test_links_have_a_position_and_an_orientation(tmp_path: Path) -> None:
    first = replace(FIRST, links={"base_scan": poses([1, 1, 1, 1], [0, 0, 0, 0])})
    # The same rotation twice, with either sign, then 2 deg.
    turned = poses([1, 1, 1, 1.02], [0, 0, 0.034906585, 0]) * np.array([1, 1, 1, -1, -1, -1, -1])
    more = "agreement:\n  links:\n    base_scan:\n      position: 1 cm\n      orientation: 3 deg"
    _, (_, position, orientation) = held_against(
        tmp_path, replace(FIRST, links={"base_scan": turned}), more, first=first
    )
    assert position.name == "the same position of link 'base_scan' as pybullet 1.0"
    assert (position.failed, position.verdict.time, position.location.line) == (True, 0.3, 7)
    assert (orientation.status, orientation.verdict.time, orientation.location.line) == ("passed", 0.2, 8)
    assert orientation.verdict.measured == pytest.approx(0.034906585)


def test_a_body_is_compared_from_the_time_at_which_it_appears(tmp_path: Path) -> None:
    ball = "world: {objects: [{name: ball, sphere: {radius: 0.1}, mass: 1, appears: 0.2 s, pose: {x: 3}}]}"
    more = f"{ball}\nagreement: {{bodies: {{ball: {{position: 1 cm}}}}}}"
    first = replace(FIRST, bodies={"ball": poses([9, 9, 3, 3], [0, 0, 0, 0])})
    second = replace(FIRST, bodies={"ball": poses([-9, -9, 3, 3.005], [0, 0, 0, 0])})
    _, (_, position) = held_against(tmp_path, second, more, first=first)
    assert position.name == "the same position of body 'ball' as pybullet 1.0"
    assert position.status == "passed"
    assert position.verdict.measured == pytest.approx(0.005)
    assert position.verdict.judged == Judged(2, 0.2, 0.3)
    late = [one.rows(np.arange(2)) for one in (first, second)]
    last, (_, position) = held_against(tmp_path, late[1], more, first=late[0])
    assert (last.status, position.status) == ("not_exercised", "not_exercised")
