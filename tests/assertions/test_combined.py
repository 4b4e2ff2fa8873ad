"""Assertions of assertions: any_of, all_of, at_once, not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import cycle, islice
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import pytest

from sim_action.assertions import Assertion
from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.reach import FinalPose, Reach
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import SensorRecord
from sim_action.state.verdict import Verdict
from sim_action.world.scene import Scene
from tests.traces import START, contact, judged, monitor, piece, scene, states, trace

P, H, B = State.PENDING, State.HOLDS, State.BROKEN
FAR, NEARER, BACK = Travel(at_least=3.0), Travel(at_least=2.0), Travel(at_most=1.0)


def any_of(*parts: Assertion) -> AnyOf:
    return AnyOf(parts=parts)


def all_of(*parts: Assertion) -> AllOf:
    return AllOf(parts=parts)


def no(part: Assertion) -> Negation:
    return Negation(part=part)


def ride(*touches: float) -> Trace:
    """1 m/s, a moment a second."""
    time = [1.0, 2.0, 3.0, 4.0]
    return trace(time, x=time, speed=[0.5, 1.0, 1.0, 1.0], contacts=[contact(touch) for touch in touches])


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        # Goals.
        (any_of(FAR, NEARER), [P, P, H, H, H]),
        (all_of(FAR, NEARER), [P, P, P, H, H]),
        (no(NEARER), [H, H, B, B, B]),
        # Invariants; the ride touches something at 3 s.
        (any_of(NoCollision(), BACK), [H, H, H, B, B]),
        (all_of(NoCollision(), BACK), [H, H, B, B, B]),
        (no(NoCollision()), [P, P, P, H, H]),
        # Both: what is not broken yet does not end the wait for the goal.
        (any_of(NoCollision(), FAR), [P, P, P, H, H]),
        (any_of(BACK, Reach(x=9.0, y=0.0)), [P, P, P, P, P]),
        (all_of(NoCollision(), NEARER), [P, P, H, B, B]),
        # A goal that an upper bound can still break is not decided; its contrary is judged at the end.
        (any_of(Travel(at_least=1.0, at_most=2.0), FAR), [P, P, P, H, H]),
        (no(Travel(at_least=1.0, at_most=2.0)), [H, H, H, H, H]),
        # Twice the contrary.
        (no(no(NEARER)), [P, P, H, H, H]),
        (no(no(NoCollision())), [H, H, H, B, B]),
        # The contrary of several: goals, invariants, both.
        (no(any_of(FAR, NEARER)), [H, H, B, B, B]),
        (no(all_of(FAR, NEARER)), [H, H, H, B, B]),
        (no(any_of(NoCollision(), BACK)), [P, P, P, H, H]),
        (no(all_of(NoCollision(), BACK)), [P, P, H, H, H]),
        (no(any_of(NoCollision(), FAR)), [H, H, H, B, B]),
        (no(all_of(NoCollision(), NEARER)), [H, H, H, H, H]),
        (any_of(no(NEARER), no(NoCollision())), [P, P, P, H, H]),
        (all_of(no(FAR), no(NoCollision())), [P, P, P, B, B]),
    ],
    ids=lambda value: value.title if isinstance(value, Assertion) else "",
)
def test_when_it_is_decided(spec: Assertion, expected: list[State]) -> None:
    assert states(spec, ride(3.0)) == expected


@pytest.mark.parametrize("good", [(True, True), (True, False), (False, True), (False, False)])
def test_the_verdicts_of_all_any_and_not(good: tuple[bool, bool]) -> None:
    parts = [NEARER if one else Travel(at_least=9.0) for one in good]
    assert judged(all_of(*parts), ride()).passed == all(good)
    assert judged(any_of(*parts), ride()).passed == any(good)
    assert judged(no(parts[0]), ride()).passed is not good[0]


def test_of_one_unit_the_margin_decides() -> None:
    low, high = MaxSpeed(linear=1.25), MaxSpeed(linear=2.0)
    told = "all 2 hold; max_speed 1.25 m/s: moved with at most 1 m/s, limit 1.25 m/s"
    assert judged(all_of(high, low), ride()) == Verdict(True, 1.0, 1.25, 0.25, "m/s", 2.0, told)
    assert judged(any_of(high, low), ride()).margin == 1.0
    assert judged(any_of(low, MaxSpeed(linear=0.5)), ride()).margin == 0.25
    assert judged(all_of(low, MaxSpeed(linear=0.25), MaxSpeed(linear=0.75)), ride()).message.startswith("1 of 3 hold; ")
    none = judged(any_of(Travel(at_least=9.0), Travel(at_least=5.0)), ride())
    assert (none.margin, none.limit) == (-1.0, 5.0)
    assert none.message == "none of 2 hold; travel at least 5 m: travelled 4 m of 5 m in 4.0 s"


def test_of_several_units_the_time_decides_and_the_message_names_it() -> None:
    """Of what holds, all_of takes what came true last, any_of what did so first; of what does not, the reverse."""
    slow, upright = MaxSpeed(linear=0.75), Upright()
    assert judged(all_of(FAR, no(BACK), MaxSpeed(linear=2)), ride()).time == 3.0
    assert judged(any_of(NEARER, no(NoCollision())), ride(1.0)).time == 1.0
    failed = judged(all_of(upright, NoCollision(), slow), ride(4.0))
    assert (failed.passed, failed.unit, failed.time) == (False, "m/s", 2.0)
    assert failed.message.startswith("1 of 3 hold; max_speed 0.75 m/s: moved")
    assert judged(any_of(slow, NoCollision()), ride(4.0)).unit == "contacts"


def test_the_contrary_has_the_other_margin() -> None:
    verdict = judged(no(NEARER), ride())
    told = "travelled 2 m in 2.00 s, but 'not' requires the opposite"
    assert verdict == Verdict(False, 2.0, 2.0, 0.0, "m", 2.0, told)
    touched = judged(no(NoCollision()), ride(3.0))
    assert (touched.passed, touched.time) == (True, 3.0)
    assert touched.message == judged(NoCollision(), ride(3.0)).message


@pytest.mark.parametrize("seen", [ride(3.0), ride()], ids=["touches", "does not touch"])
def test_the_opposite_of_a_touch_has_the_other_count_as_limit(seen: Trace) -> None:
    """`not: {contact: ...}` reads as `no_collision` does, and `not: no_collision` as `contact`."""
    touch, nothing = judged(Touch.model_validate("wall"), seen), judged(NoCollision(), seen)
    for spec, plain in ((Touch.model_validate("wall"), nothing), (NoCollision(), touch)):
        negated = judged(no(spec), seen)
        assert (negated.passed, negated.measured, negated.unit) == (plain.passed, plain.measured, "contacts")
        assert (negated.limit, negated.margin) == (plain.limit, plain.margin)
    assert touch.passed is not nothing.passed
    (touching, *_) = no(Touch.model_validate("wall")).signals(scene(), START, seen)
    (colliding, *_) = no(NoCollision()).signals(scene(), START, seen)
    assert (touching.lower, touching.upper) == (None, 0.0)
    assert (colliding.lower, colliding.upper) == (1.0, None)


def test_the_contrary_of_a_contrary_is_told_as_what_it_is_of() -> None:
    for seen in (ride(), ride(3.0)):
        assert judged(no(no(NoCollision())), seen) == judged(NoCollision(), seen)
    assert judged(no(no(no(NEARER))), ride()) == judged(no(NEARER), ride())
    assert no(no(NEARER)).title == "not (not travel at least 2 m)"
    assert any_of(no(NEARER), FAR).title == "any_of: not travel at least 2 m; travel at least 3 m"


def test_no_moment_is_no_pass() -> None:
    for spec in (no(NEARER), no(BACK), any_of(NEARER), all_of(NEARER)):
        assert not judged(spec, trace([])).passed


def test_parts_see_the_way_before_their_window_as_they_would_alone() -> None:
    """A path counts from where the window opens, which a fold that carries on has to be told."""
    for spec in (all_of(PathLength(at_most=1.5)), any_of(PathLength(at_most=1.5)), no(no(PathLength(at_most=1.5)))):
        seen = Window(monitor(spec), 3.0).observe(ride())
        assert seen.verdict().passed, spec.title
        assert seen.verdict().measured == 1.0


def test_problems_say_in_which_part_they_are() -> None:
    spec = any_of(NEARER, no(NoCollision(allow=("wal",))), all_of(NoCollision(), NoCollision(allow=("base_scan", "x"))))
    paths = [path for path, _ in spec.problems(scene())]
    assert paths == [(1, "not", "no_collision", "allow", 0), (2, "all_of", 1, "no_collision", "allow", 1)]
    # What parts need is known of the whole.
    keys = [leaf.key for leaf in any_of(NEARER, no(all_of(NoCollision(), BACK))).leaves()]
    assert keys == ["travel", "no_collision", "travel"]


def test_many_parts_have_a_short_title_and_a_list_in_it_shows_where_it_ends() -> None:
    spec: Assertion = any_of(*[NEARER] * 1000)
    assert len(spec.title) <= 100
    assert len(no(spec).title) <= 100
    inner = all_of(FAR, NEARER)
    assert any_of(inner, BACK).title == "any_of: (all_of: travel at least 3 m; travel at least 2 m); travel at most 1 m"
    assert no(inner).title == "not (all_of: travel at least 3 m; travel at least 2 m)"
    holds = "1 of 2 hold; (all_of: travel at least 3 m; travel at least 2 m): all 2 hold; travel at least "
    assert judged(any_of(inner, BACK), ride()).message.startswith(holds)


class _Steady(NamedTuple):
    """A goal that never comes true, which counts how often it is asked anything; more than `most` times is an error."""

    asked: Counter[str]
    most: int

    @property
    def state(self) -> State:
        self._count("state")
        return P

    def observe(self, trace: Trace) -> Self:
        self._count("observe")
        return self

    def verdict(self) -> Verdict:
        self._count("verdict")
        return Verdict(passed=False)

    def _count(self, what: str) -> None:
        self.asked[what] += 1
        assert self.asked[what] <= self.most, f"{what} is asked for again and again"


class _Leaf(Assertion):
    """An assertion with one monitor, made before."""

    key: ClassVar[str] = "leaf"
    made: Any

    @property
    def title(self) -> str:
        return "leaf"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        opened: Monitor = self.made
        return opened


@pytest.mark.parametrize("layers", [(any_of,), (all_of,), (no,), (any_of, all_of, no)])
def test_what_is_deep_inside_is_asked_no_more_often_for_it(layers: Sequence[Callable[[Assertion], Assertion]]) -> None:
    """Each layer asks the next for its state and whether it is decided: anew, 20 layers would never end."""
    asked: list[Counter[str]] = []
    for depth in (4, 20):
        leaf = _Steady(Counter(), most=100)
        spec: Assertion = _Leaf(made=leaf)
        for layer in islice(cycle(layers), depth):
            spec = layer(spec)
        opened = Window(monitor(spec))
        for index in range(4):
            opened = opened.observe(piece(ride(), index, index + 1))
            assert opened.state is not B
        opened.verdict()
        asked.append(leaf.asked)
    assert asked[0] == asked[1]
    assert asked[0]["observe"] == 4
    assert asked[0]["verdict"] == 1


HERE, THERE = Reach(x=0.5, y=0.0), Reach(x=1.5, y=0.0)
WAY = trace([0.0, 1.0, 2.0, 3.0], x=[0.0, 0.5, 1.0, 1.5], speed=[1.0, 1.0, 1.0, 0.0])


def at_once(*parts: Reach | Travel | Upright | NoCollision | Settled | SensorReading | Negation | AnyOf) -> AtOnce:
    return AtOnce(parts=parts)


def test_places_that_are_never_reached_together_fail_although_each_is_reached() -> None:
    assert judged(AllOf(parts=(HERE, THERE)), WAY).passed
    verdict = judged(at_once(HERE, THERE), WAY)
    assert not verdict.passed
    assert (verdict.measured, verdict.limit, verdict.margin, verdict.time) == (1.0, 2.0, -1.0, 1.0)
    assert verdict.message == (
        "at most 1 of 2 were true at the same moment in 3.0 s, first at 1.00 s; "
        "not true then: reach (1.5, 0) within 0.05 m"
    )
    assert judged(at_once(Reach(x=9, y=9), Reach(x=8, y=8)), WAY).message.startswith("at most none of 2")
    # It comes true at the first moment at which all are true.
    verdict = judged(at_once(Travel(at_least=1.0), Upright(), NoCollision()), WAY)
    assert (verdict.passed, verdict.time) == (True, 2.0)
    assert verdict.message == "all 3 were true at 2.00 s"


def test_an_invariant_that_broke_before_may_be_true_again() -> None:
    seen = trace([0.0, 1.0, 2.0, 3.0], x=[0.0, 0.5, 1.0, 1.5], contacts=(contact(1.0),))
    assert not judged(at_once(HERE, NoCollision()), seen).passed
    assert judged(at_once(THERE, NoCollision()), seen).passed
    assert judged(at_once(HERE, Negation(part=NoCollision())), seen).passed
    # Parts that are true at the same moment.
    assert judged(at_once(THERE, Settled()), WAY).passed
    assert not judged(at_once(HERE, Settled()), WAY).passed
    assert judged(at_once(HERE, AnyOf(parts=(THERE, Travel(at_most=0.6)))), WAY).passed
    assert not judged(at_once(HERE, AnyOf(parts=(THERE, Travel(at_least=0.6)))), WAY).passed


def test_a_reading_counts_until_the_next_one() -> None:
    near = SensorReading(name="scan", reading="ranges", which="min", at_most=1.0)
    readings = SensorRecord("lidar", np.array([0.5, 2.5]), {"ranges": np.array([[0.8, 2.0], [3.0, 4.0]])})
    seen = replace(WAY, sensors={"scan": readings})
    assert judged(at_once(near, HERE), seen).passed
    assert not judged(at_once(near, THERE), seen).passed
    assert not judged(at_once(near, Reach(x=0, y=0)), seen).passed


def test_parts_without_a_truth_at_a_moment_are_refused() -> None:
    spec = AtOnce(parts=(HERE, FinalPose(x=1.0, y=0.0), Stl(formula="eventually (x > 1)"), AllOf(parts=(HERE,))))
    assert [path for path, _ in spec.problems(scene())] == [(1,), (2,), (3,)]
    message = next(message for _, message in spec.problems(scene()))
    assert message == "'final_pose' is not true or false at a moment; use all_of, or another assertion"
    # The number of true conditions is drawn.
    count, *_ = at_once(HERE, Travel(at_least=1.0), Upright()).signals(scene(), START, WAY)
    assert (count.name, count.lower, count.values.tolist()) == ("conditions that are true", 3.0, [1.0, 2.0, 2.0, 2.0])


@pytest.mark.parametrize("part", [HERE, Travel(at_most=1.0)])
def test_it_is_a_goal_whatever_its_parts_are(part: Reach | Travel) -> None:
    assert at_once(part).is_goal
    assert monitor(at_once(part)).state is State.PENDING
