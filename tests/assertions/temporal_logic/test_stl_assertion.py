"""Signal temporal logic over traces."""

from __future__ import annotations

import math
import pickle
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.assertions.combined import AllOf, Negation
from sim_action.assertions.distance import Travel
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.temporal_logic.formula import Always, Eventually, Formula, Interval
from sim_action.assertions.temporal_logic.monitor import BooleanPart, Outcome, Part
from sim_action.assertions.temporal_logic.robustness import Samples
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.core.geometry import quaternion_from_rpy
from sim_action.state.trace import Trace
from sim_action.state.verdict import Judged, Verdict
from tests.assertions.temporal_logic import formulas
from tests.soak import examples
from tests.traces import monitor, piece, scene, states, trace

SCENE = scene()
FAST = trace([1.0, 2.0, 3.0, 4.0], x=[0.25, 1.0, 2.0, 2.5], speed=[0.25, 0.75, 1.0, 0.5])


def stl(text: str) -> Stl:
    return Stl(formula=text)


def judged(assertion: Stl, seen: Trace) -> Verdict:
    return monitor(assertion).observe(seen).verdict()


P, H, B = State.PENDING, State.HOLDS, State.BROKEN


def test_an_invariant_that_holds_says_when_it_was_nearest_to_its_limit() -> None:
    verdict = judged(stl("always (speed < 1.25 m/s)"), FAST)
    message = "speed < 1.25 m/s decides: 1 m/s at 3.00 s"
    assert verdict == Verdict(True, 1.0, 1.25, 0.25, "m/s", 3.0, message, judged=Judged(4, 1.0, 4.0))
    # So does one that is broken.
    verdict = judged(stl("always (speed < 0.5 m/s)"), FAST)
    message = "speed < 0.5 m/s decides: 1 m/s at 3.00 s"
    assert verdict == Verdict(False, 1.0, 0.5, -0.5, "m/s", 3.0, message, judged=Judged(4, 1.0, 4.0))


def test_a_goal_that_is_not_met_says_how_far_it_got() -> None:
    verdict = judged(stl("eventually (travel >= 3 m)"), FAST)
    assert (verdict.passed, verdict.measured, verdict.limit, verdict.margin, verdict.time) == (False, 2.5, 3, -0.5, 4.0)
    assert verdict.message == "travel >= 3 m decides: 2.5 m at 4.00 s"
    # Two signals are measured by their difference.
    verdict = judged(stl("always (x - y >= 2 * speed * 0.5 s)"), FAST)
    assert (verdict.passed, verdict.measured, verdict.limit, verdict.margin) == (True, 0.0, 0.0, 0.0)
    assert (verdict.unit, verdict.time) == ("m", 1.0)
    assert verdict.message == "x - y >= 2 * speed * 0.5 s decides: 0.25 m and 0.25 m at 1.00 s"


def test_joints_angles_and_where_travel_begins() -> None:
    seen = trace([1.0], x=[3.0], y=[4.0], yaw=[0.5], roll=[0.25], velocity=[7.0])
    assert judged(stl("velocity(wheel_left_joint) < 8"), seen).unit == "rad/s"
    assert judged(stl("velocity(wheel_left_joint) < 8"), seen).margin == 1.0
    assert judged(stl("travel < 6 m"), seen).margin == 1.0
    for text, margin in {"yaw > 0": 0.5, "roll > 0": 0.25, "tilt < 0.5": 0.25, "abs(pitch) < 1": 1.0}.items():
        assert judged(stl(text), seen).margin == pytest.approx(margin), text


def test_a_roll_and_a_pitch_are_what_urdf_calls_so() -> None:
    still = trace([1.0])
    state = still.state.copy()
    state[:, 4:8] = quaternion_from_rpy(0.3, -0.4, 2.0)
    seen = Trace(still.joint_names, state)
    assert judged(stl("roll > 0"), seen).margin == pytest.approx(0.3)
    assert judged(stl("pitch < 0"), seen).margin == pytest.approx(0.4)
    assert judged(stl("yaw > 0"), seen).margin == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("always (speed < 2)", [H, H, H, H, H]),
        ("always (speed < 0.8)", [H, H, H, B, B]),
        ("eventually (speed > 0.8)", [P, P, P, H, H]),
        ("eventually (speed > 3)", [P, P, P, P, P]),
        ("speed < 0.5", [P, H, H, H, H]),
        ("speed > 0.5", [P, B, B, B, B]),
        # An interval that is over.
        ("always[0 s, 1 s] (speed < 0.8)", [H, H, H, H, H]),
        ("eventually[0 s, 1 s] (speed > 0.8)", [P, P, B, B, B]),
        ("eventually[2 s, 3 s] (speed < 0.3)", [P, P, P, P, B]),
        # What looks ahead is known when its window is over.
        ("always (speed < 0.5 implies eventually[0 s, 1 s] (speed > 0.7))", [H, H, H, H, H]),
        ("always (speed < 0.5 implies eventually[0 s, 1 s] (speed > 2))", [H, H, B, B, B]),
        ("eventually (always[0 s, 1 s] (speed > 0.7))", [P, P, P, H, H]),
        # Until: a goal, which is lost when what must hold before does not.
        ("speed < 0.5 until speed > 0.7", [P, P, H, H, H]),
        ("speed < 0.5 until speed > 0.9", [P, P, B, B, B]),
        ("speed < 1.5 until speed > 3", [P, P, P, P, P]),
        ("speed < 0.5 until[0 s, 2 s] speed > 0.7", [P, P, H, H, H]),
        ("speed < 0.9 until[2 s, 3 s] speed > 0.7", [P, P, P, H, H]),
        ("speed < 1.5 until[0 s, 1 s] speed > 0.9", [P, P, B, B, B]),
        ("x < 9 until eventually[0 s, 1 s] speed > 0.9", [P, P, P, H, H]),
        ("not (speed < 0.5 until speed > 0.9)", [H, H, H, H, H]),
        ("not (speed < 0.5 until speed > 0.7)", [H, H, B, B, B]),
        # The contrary.
        ("not (always (speed < 0.8))", [P, P, P, H, H]),
        ("not (eventually (speed > 0.8))", [H, H, H, B, B]),
        # BooleanPart.
        ("always (speed < 2) and eventually (speed > 0.8)", [P, P, P, H, H]),
        ("(always (speed < 0.8)) or eventually (x > 2.2)", [P, P, P, P, H]),
        ("(always (speed < 0.7)) or always (speed < 0.9)", [H, H, H, B, B]),
        ("(eventually (speed > 0.8)) implies always (speed < 0.9)", [H, H, H, B, B]),
        ("(always (speed < 0.8)) implies eventually (x > 3)", [P, P, P, H, H]),
        # Judged at the end of the run.
        ("always (eventually (speed > 3))", [H, H, H, H, H]),
        ("(always (speed < 0.8)) until speed > 3", [H, H, H, H, H]),
        ("always (eventually[0 s, 90 s] (speed > 3))", [H, H, H, H, H]),
    ],
)
def test_when_a_formula_is_decided(text: str, expected: list[State]) -> None:
    assert states(stl(text), FAST) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("always (speed < 2)", [0, 1, 1, 1, 1]),
        ("speed < 2", [0, 0, 0, 0, 0]),
        ("always[1 s, 2.5 s] (speed < 2)", [0, 3.5, 3.5, 3.5, 0]),
        # A broken invariant, and a goal that came true.
        ("always[0 s, 9 s] (speed < 0.8)", [0, 10, 10, 0, 0]),
        ("eventually[0 s, 9 s] (speed > 0.8)", [0, 10, 10, 0, 0]),
        # Nested intervals add up. An interval without an end counts up to its start.
        ("always[0 s, 3 s] (eventually[1 s, 2 s] (speed < 2))", [0, 6, 6, 6, 6]),
        ("always[3 s, end] (speed < 2)", [0, 4, 4, 4, 4]),
        ("always[1 s, end] (eventually[0 s, 2 s] (speed < 2))", [0, 4, 4, 4, 4]),
        ("always[0 s, 5 s] (eventually (speed > 0))", [0, 6, 6, 6, 6]),
        ("speed < 2 until[0 s, 2 s] (always[0 s, 3 s] (speed > 3))", [0, 6, 6, 6, 6]),
        ("speed < 0.5 until[0 s, 9 s] speed > 0.7", [0, 10, 0, 0, 0]),
        ("not (speed < 2 until[0 s, 9 s] speed > 3)", [0, 10, 10, 10, 10]),
        # The part that is not decided needs the time.
        ("(always[0 s, 9 s] (speed < 0.8)) or always[0 s, 3 s] (speed < 2)", [0, 10, 10, 4, 0]),
        ("(always[0 s, 2 s] (speed < 2)) and always[0 s, 9 s] (speed < 2)", [0, 10, 10, 10, 10]),
        ("(always[0 s, 1 s] (speed < 2)) or always[0 s, 9 s] (speed < 2)", [0, 10, 0, 0, 0]),
    ],
)
def test_how_long_the_run_must_go_on(text: str, expected: list[float]) -> None:
    """FAST begins at 1 s."""
    opened = monitor(stl(text))
    combined = [monitor(AllOf(parts=(stl(text), Travel(at_most=9.0)))), monitor(Negation(part=stl(text)))]
    for index, needed in enumerate(expected):
        assert [one.needed_until for one in (opened, *combined)] == [needed] * 3
        step = piece(FAST, index, index + 1)
        opened, combined = opened.observe(step), [one.observe(step) for one in combined]


def test_nothing_is_needed_after_the_window() -> None:
    opened = Window(monitor(stl("always[0 s, 9 s] (speed < 2)")), 2.0, 3.5)
    assert [opened.observe(FAST.first(count)).needed_until for count in (1, 2, 3, 4)] == [3.5, 3.5, 3.5, 2.0]
    assert Window(monitor(Travel(at_most=9.0))).observe(FAST).needed_until == 0
    # A window with an end is watched until it closes, unless all is decided.
    limit = Window(monitor(Travel(at_most=9.0)), 0.0, 3.5)
    assert [limit.observe(FAST.first(count)).needed_until for count in (1, 4)] == [3.5, 0.0]
    goal = Window(monitor(Travel(at_least=1.0)), 0.0, 3.5)
    assert goal.observe(trace([0.0, 1.0], x=[0.0, 1.0])).needed_until == 0.0


@examples(100)
@given(formulas.plain_formulas, formulas.walks)
def test_the_needed_time_never_grows_and_ends_with_the_decision(formula: Formula, walk: list[tuple[int, int]]) -> None:
    opened = [folded(formula, walk[:length], []) for length in range(1, len(walk) + 1)]
    needed = [one.needed_until for one in opened]
    assert needed == sorted(needed, reverse=True)
    assert not any(one.is_decided and until for one, until in zip(opened, needed, strict=True))


def test_an_interval_that_the_run_never_came_to() -> None:
    always, eventually = (judged(stl(f"{word}[9 s, 10 s] (speed < 1)"), FAST) for word in ("always", "eventually"))
    assert (always.passed, always.status) == (eventually.passed, eventually.status) == (False, "not_exercised")
    assert {always.margin, eventually.margin} == {None}
    missed = "the run ended at 4 s, before the interval [9 s, 10 s] began at 10 s"
    assert always.message == f"never checked: {missed}; run for longer, or move the interval"
    # No moment is no pass.
    verdict = judged(stl("always (speed < 1)"), trace([]))
    assert (verdict.passed, verdict.message) == (False, "no physics step to measure")


@pytest.mark.parametrize(
    ("text", "status", "moments"),
    [
        ("always (speed < 2)", "passed", (4, 1.0, 4.0)),
        ("speed < 2", "passed", (1, 1.0, 1.0)),
        ("always[1 s, 2 s] (speed < 2)", "passed", (2, 2.0, 3.0)),
        ("not (eventually[2 s, 9 s] (speed > 2))", "passed", (2, 3.0, 4.0)),
        ("speed < 0.9 until[1 s, 9 s] speed > 0.9", "passed", (3, 2.0, 4.0)),
        # `before` fails before the interval begins: one step decides.
        ("speed < 0.9 until[3 s, 9 s] speed > 2", "failed", (1, 4.0, 4.0)),
        ("speed < 0.7 until[7 s, 9 s] speed > 2", "failed", (1, 3.0, 3.0)),
        ("not (speed < 0.7 until[7 s, 9 s] speed > 2)", "passed", (1, 3.0, 3.0)),
        ("speed < 2 until[7 s, 9 s] speed > 2", "not_exercised", (0, None, None)),
        ("not (speed < 2 until[7 s, 9 s] speed > 2)", "not_exercised", (0, None, None)),
        # A witness has seen the whole inner interval.
        ("eventually (always[0 s, 2 s] (speed > 0.4))", "passed", (2, 1.0, 2.0)),
        ("eventually (always[0 s, 2 s] (speed > 0.9))", "failed", (2, 1.0, 2.0)),
        ("not (always (eventually[0 s, 2 s] (speed < 0.4)))", "passed", (2, 1.0, 2.0)),
        ("eventually (always[0 s, 4 s] (speed > 0.2))", "not_exercised", (0, None, None)),
        ("eventually (always (speed > 0.9))", "failed", (4, 1.0, 4.0)),
        ("eventually (always (always[1 s, 2 s] (speed > 0.9)))", "failed", (3, 1.0, 3.0)),
        # The intervals of an invariant are cut at the end of the run.
        ("always (eventually[0 s, 2 s] (speed > 0.7))", "failed", (4, 1.0, 4.0)),
        ("always (speed < 0.4 implies eventually[0 s, 9 s] (speed > 0.9))", "passed", (4, 1.0, 4.0)),
        ("always (speed > 0.9 implies always[0 s, 1 s] (speed > 0.4))", "passed", (4, 1.0, 4.0)),
        ("always (always[1 s, 2 s] (speed > 0.4))", "passed", (3, 1.0, 3.0)),
        ("always (always[7 s, 9 s] (speed > 0.4))", "not_exercised", (0, None, None)),
        # A part that was never judged is neither true nor false.
        ("(always (speed < 2)) and always[7 s, 9 s] (speed < 2)", "not_exercised", (0, None, None)),
        ("(always (speed < 0.9)) and always[7 s, 9 s] (speed < 2)", "failed", (4, 1.0, 4.0)),
        ("(always (speed < 2)) or always[7 s, 9 s] (speed < 2)", "passed", (4, 1.0, 4.0)),
        ("(always (speed < 0.9)) or always[7 s, 9 s] (speed < 2)", "not_exercised", (0, None, None)),
        ("(eventually (speed > 0.9)) implies eventually[7 s, 9 s] (speed < 2)", "not_exercised", (0, None, None)),
        ("(eventually (speed > 2)) implies eventually[7 s, 9 s] (speed < 2)", "passed", (4, 1.0, 4.0)),
    ],
)
def test_how_often_a_formula_is_judged(text: str, status: str, moments: tuple[int, float, float]) -> None:
    verdict = Window(monitor(stl(text))).observe(FAST).verdict()
    assert (verdict.status, verdict.judged) == (status, Judged(*moments))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "eventually (always[0 s, 4 s] (speed > 0.2))",
            "the run ended at 4 s, and the formula looks 4 s ahead; run for longer, or shorten its intervals",
        ),
        (
            "always[1 s, 2 s] (eventually[7 s, end] (speed > 0.2))",
            "the run ended at 4 s, before the interval [7 s, end] began at 9 s; run for longer, or move the interval",
        ),
        (
            "always (eventually[1 s, 2 s] (speed > 0.2))",
            "of the last steps never began: the run ended at 4 s, and the formula looks 2 s ahead; give the outer",
        ),
    ],
)
def test_a_formula_without_evidence_says_what_was_missing(text: str, message: str) -> None:
    verdict = judged(stl(text), FAST)
    assert not verdict.passed
    assert message in verdict.message


def test_a_goal_that_is_near_only_at_the_end_of_the_run_has_no_witness() -> None:
    """The heading comes near at 2.9 s. Whether it would stay there for 2 s was not seen."""
    time = [step / 10 for step in range(1, 31)]
    near = trace(time, yaw=[math.radians(40.0 if at >= 2.9 else 0.0) for at in time])
    verdict = judged(stl("eventually always[0 s, 2 s] abs(yaw - 40 deg) < 2 deg"), near)
    assert verdict.status == "failed"
    assert verdict.margin == pytest.approx(math.radians(-38.0))
    assert verdict.judged == Judged(10, 0.1, 1.0)


def test_a_window_begins_it_and_cuts_it() -> None:
    spec = stl("always[1 s, end] (speed < 0.9)")
    seen = Window(monitor(spec), 2.0, 3.0).observe(FAST)
    assert not seen.verdict().passed
    assert seen.verdict().time == 3.0
    assert Window(monitor(spec), 3.0, 4.0).observe(FAST).verdict().passed
    # Pending when the window closes: as the verdict on what was seen is.
    until_then = Window(monitor(stl("eventually[0 s, 9 s] always[0 s, 9 s] speed > 0.2")), 0.0, 3.0)
    assert until_then.observe(FAST.first(2)).state is State.PENDING
    assert until_then.observe(FAST).verdict().status == "not_exercised"
    until_then = Window(monitor(stl("eventually[0 s, 9 s] always speed > 0.2")), 0.0, 3.0)
    assert until_then.observe(FAST).state is State.HOLDS


@examples(100)
@given(formulas.plain_formulas, formulas.walks)
def test_the_margin_is_the_robustness_at_the_first_moment(formula: Formula, walk: list[tuple[int, int]]) -> None:
    verdict = folded(formula, walk, []).verdict()
    expected, moments = formulas.evidence(formula, walk)
    assert verdict.passed == (expected >= 0 and moments > 0)
    assert verdict.margin == (None if math.isinf(expected) else expected)
    assert verdict.judged is not None
    assert verdict.judged.moments == moments


@examples(100)
@given(formulas.plain_formulas, formulas.walks, st.integers(0, 5), st.integers(5, 30))
def test_a_formula_that_passes_was_judged_inside_its_window(
    formula: Formula, walk: list[tuple[int, int]], after: int, before: int
) -> None:
    verdict = Window(folded(formula, [], []), after, before).observe(walked(walk)).verdict()
    moments = verdict.judged
    assert moments is not None
    if verdict.passed:
        assert moments.moments >= 1
    if moments.first is not None and moments.last is not None:
        assert after <= moments.first <= moments.last <= min(before, len(walk) - 1)
        assert moments.moments <= moments.last - moments.first + 1


@examples(100)
@given(formulas.every_step_formulas, formulas.walks, st.integers(1, 20))
def test_a_longer_run_turns_no_failed_invariant_into_a_pass(
    formula: Formula, walk: list[tuple[int, int]], length: int
) -> None:
    early, whole = (folded(formula, seen, []).verdict() for seen in (walk[:length], walk))
    assert not (early.status == "failed" and whole.status != "failed")
    if early.margin is not None and whole.margin is not None:
        assert early.margin >= whole.margin


@examples(100)
@given(formulas.simple, formulas.walks, st.integers(0, 3), st.integers(0, 4), st.integers(0, 6))
def test_a_goal_that_passes_has_a_witness_whose_whole_interval_was_seen(
    inner: Formula, walk: list[tuple[int, int]], start: int, length: int, end: int
) -> None:
    formula = Eventually(Always(inner, Interval(start, start + length)), Interval(0.0, end))
    verdict = folded(formula, walk, []).verdict()
    holds = [formulas.meaning(inner, walk, at) >= 0 for at in range(len(walk))]
    whole = [holds[at + start : at + start + length + 1] for at in range(end + 1) if at + start + length < len(walk)]
    assert verdict.passed == any(map(all, whole))
    assert verdict.status == ("not_exercised" if not whole else "passed" if verdict.passed else "failed")


@examples(100)
@given(formulas.plain_formulas, formulas.walks, st.lists(st.integers(0, 20), max_size=8))
def test_pieces_say_what_the_whole_says_and_a_decision_stands(
    formula: Formula, walk: list[tuple[int, int]], at: list[int]
) -> None:
    whole = folded(formula, walk, [])
    assert folded(formula, walk, at).verdict() == whole.verdict()
    assert folded(formula, walk, at).state is whole.state
    said, decided = [], False
    for length in range(len(walk) + 1):
        early = folded(formula, walk[:length], [])
        said.append(early.state)
        if decided:
            assert said[-1] is said[-2]
        decided = early.is_decided
        if decided:
            assert early.verdict().passed == whole.verdict().passed == (early.state is State.HOLDS)
    # What ended a run does not un-end it.
    changes = [(a, b) for a, b in pairwise(said) if a is not b]
    assert set(changes) <= {(P, H), (P, B), (H, B)}


def walked(walk: list[tuple[int, int]]) -> Trace:
    columns = list(zip(*walk, strict=True)) or [(), ()]
    return trace([float(n) for n in range(len(walk))], x=list(columns[0]), y=list(columns[1]))


def folded(formula: Formula, walk: list[tuple[int, int]], at: list[int]) -> Monitor:
    seen = walked(walk)
    opened = monitor(stl(str(formula)), where=SCENE)
    for start, end in pairwise(sorted([0, *(min(cut, len(walk)) for cut in at), len(walk)])):
        opened = opened.observe(piece(seen, start, end))
    return opened


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("always (speed < 0.5 m)", "'speed' is in m/s, '0.5 m' in m: they cannot be compared; at character 9"),
        ("x + time < 1", "'x' is in m, 'time' in s: they cannot be compared"),
        ("x * y < 1 m", "'x * y' is in m^2, '1 m' in m"),
        ("position(wheel_left) < 1", "the model has no moving joint 'wheel_left'; did you mean 'wheel_left_joint'?"),
        ("position(scan_joint) < 1", "the model has no moving joint 'scan_joint'"),
        ("always[1 ms, 2 ms] x < 1", "no physics step (1 / 240 s) is in the interval [0.001 s, 0.002 s]"),
    ],
)
def test_what_does_not_fit_the_scene(text: str, message: str) -> None:
    ((path, told),) = stl(text).problems(scene())
    assert path == ()
    assert message in told


def test_text_may_stand_alone_and_nothing_else_may() -> None:
    assert Stl.model_validate("speed < 1") == stl("speed < 1")
    for value in (5, ("speed < 1",), None):
        with pytest.raises(ValidationError, match="expected a formula such as"):
            Stl.model_validate(value)
    with pytest.raises(ValidationError, match=r"unknown signal 'sped'.*at character 1"):
        Stl.model_validate("sped < 1")


def test_a_long_formula_has_a_short_title_and_pickles_after_use() -> None:
    spec = stl(" and\n".join(["x < 1"] * 50))
    assert len(spec.title) <= 100
    assert "\n" not in spec.title
    assert spec.parsed
    assert pickle.loads(pickle.dumps(spec)) == spec


@dataclass(frozen=True)
class _Asked(Part):
    """A part that is never known, which counts how often it is asked for its state; more than 100 times is an error."""

    asked: Counter[str]

    @property
    def state(self) -> State:
        self.asked["state"] += 1
        assert self.asked["state"] <= 100, "the state is asked for again and again"
        return P

    @property
    def is_decided(self) -> bool:
        return self.state is not P

    @property
    def needed_until(self) -> float:
        return 0.0

    def observe(self, samples: Samples) -> Self:
        return self

    def outcome(self) -> Outcome:
        return Outcome(-math.inf, None, Judged())


def test_what_is_deep_inside_is_asked_no_more_often_for_it() -> None:
    """Each layer asks the next for its state and whether it is decided: anew, 20 layers would never end."""
    innermost = _Asked(Counter())
    part: Part = innermost
    for layer in range(20):
        part = BooleanPart((part,), every=bool(layer % 2))
    assert part.state is P
    assert not part.is_decided
    assert innermost.asked["state"] <= 4


def test_a_jump_is_a_speed() -> None:
    seen = trace([step / 240 for step in range(4)], x=[0.0, 0.0, 5.0, 5.0])
    verdict = judged(stl("always(speed < 1 m/s)"), seen)
    assert not verdict.passed
    assert verdict.measured == pytest.approx(1200)
