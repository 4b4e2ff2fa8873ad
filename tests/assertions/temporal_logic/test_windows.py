"""Time windows around monitors, and the time for which a goal must hold."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_action.assertions.clearance import Clearance
from sim_action.assertions.distance import Travel
from sim_action.assertions.monitors import State
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.temporal_logic.windows import HoldTime, Window
from sim_action.assertions.upright import Upright
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ClearanceRecord, ClearanceWatch, Nearness, SensorRecord
from sim_action.state.verdict import Judged
from tests.traces import START, contact, monitor, piece, scene, trace
from tests.work import work_of

FAR = Travel(at_least=2.0)
NEAR = Travel(at_most=2.0)


def window(assertion: Travel | NoCollision, after: float = 0.0, before: float = math.inf) -> Window:
    return Window(monitor(assertion), after, before)


def ride() -> Trace:
    return trace([1.0, 2.0, 3.0, 4.0], x=[1.0, 2.0, 3.0, 1.0])


def test_an_open_window_lets_everything_through() -> None:
    told = window(FAR).observe(ride()).verdict()
    assert replace(told, judged=None) == monitor(FAR).observe(ride()).verdict()


def test_a_goal_counts_from_after_on() -> None:
    assert window(FAR, after=2.5).observe(ride()).verdict().time == 3.0


def test_both_ends_belong_to_the_window() -> None:
    assert window(FAR, after=2.0, before=2.0).observe(ride()).verdict().time == 2.0


def test_a_goal_that_comes_true_late_is_lost() -> None:
    late = window(FAR, before=1.5).observe(ride())
    assert late.state is State.BROKEN
    assert late.verdict().message == "travelled 1 m of 2 m in 1.0 s"


def test_a_goal_is_pending_until_its_window_closes() -> None:
    early = window(FAR, before=2.5).observe(ride().first(1))
    assert early.state is State.PENDING
    assert not early.over


def test_a_window_closes_with_the_moment_it_ends_at() -> None:
    slow = window(Travel(at_least=5.0), before=2.0)
    assert slow.observe(ride().first(1)).state is State.PENDING
    assert slow.observe(ride().first(2)).state is State.BROKEN


def test_a_goal_met_in_time_stays_met_after_its_window() -> None:
    assert window(FAR, before=2.0).observe(ride()).state is State.HOLDS


def test_an_invariant_may_be_broken_outside_its_window() -> None:
    assert window(NEAR, before=2.0).observe(ride()).state is State.HOLDS
    assert window(NEAR, after=3.5).observe(ride()).state is State.HOLDS
    assert window(NEAR, after=2.5).observe(ride()).state is State.BROKEN


def test_contacts_count_inside_the_window_only() -> None:
    touched = trace([1.0, 2.0, 3.0], contacts=[contact(1.0), contact(3.0)])
    assert window(NoCollision(), after=2.0, before=2.5).observe(touched).verdict().passed
    assert window(NoCollision(), after=2.0).observe(touched).verdict().time == 3.0


def test_a_contact_between_two_stored_moments_is_seen() -> None:
    touched = trace([1.0, 2.0], contacts=[contact(1.5)])
    assert window(NoCollision(), after=1.25, before=1.75).observe(touched).verdict().time == 1.5


def test_an_over_window_sees_nothing_more() -> None:
    over = window(NEAR, before=1.0).observe(ride().first(1))
    assert over.over
    assert over.observe(ride()) is over


@pytest.mark.parametrize("moments", [trace([]), trace([0.5])])
def test_before_its_window_a_monitor_has_seen_nothing(moments: Trace) -> None:
    waiting = window(NEAR, after=1.0).observe(moments)
    assert waiting.verdict().time is None


def test_a_window_closes_with_the_moment_it_ends_at_however_that_was_computed() -> None:
    assert window(FAR, before=0.1 + 0.2).observe(trace([0.3])).state is State.BROKEN


def test_a_window_adds_little_to_the_work_inside_of_it() -> None:
    inside = Upright().monitor(scene(), START)
    around, moment = Window(inside), trace([1.0])
    around.observe(moment)
    assert work_of(lambda: around.observe(moment)) < 1.6 * work_of(lambda: inside.observe(moment))


RATE = 240
AT = 168 / RATE
STEPS = [step / RATE for step in range(1, 241)]


def seen_at(step: int) -> Trace:
    """Something of each kind at one step: a way, a touch, a distance; and what a sensor has told at each step."""
    time = step / RATE
    way = [float(moment >= time) for moment in STEPS]
    told = [float(n >= step) for n in range(RATE)]
    readings = SensorRecord("contact", np.arange(RATE) / RATE, {"touching": np.array(told), "force": np.array(told)})
    nearest = ClearanceRecord.of([Nearness(time, 0.1, "base_footprint", "wall")])
    return replace(
        trace(STEPS, x=way, contacts=[contact(time)]), sensors={"s": readings}, clearances={ClearanceWatch(): nearest}
    )


LOOKS = {
    "state": Travel(at_most=0.5),
    "contact": NoCollision(),
    "clearance": Clearance(at_least=0.2),
    "sensor": SensorReading(name="s", reading="touching", at_most=0.5),
}


def broken(look: str, step: int, cut: int, after: float = 0.0, before: float = math.inf) -> bool:
    """Whether a window sees what happens at a step, in two blocks."""
    opened = Window(monitor(LOOKS[look]), after, before)
    seen = seen_at(step)
    for start, end in ((0, cut), (cut, len(STEPS))):
        opened = opened.observe(piece(seen, start, end))
    return opened.state is State.BROKEN


@pytest.mark.parametrize("cut", [120, 167, 168, 169])
@pytest.mark.parametrize("look", LOOKS)
def test_the_ends_of_a_window_are_the_same_however_the_run_is_cut(look: str, cut: int) -> None:
    """Moments belong to a step; what a sensor tells at a step is known with the next one, so the last is out."""
    is_reading = look == "sensor"
    assert broken(look, 168 - is_reading, cut, before=AT)
    assert not broken(look, 169 - is_reading, cut, before=AT)
    assert broken(look, 168, cut, after=AT)
    if not is_reading and look != "state":
        assert not broken(look, 167, cut, after=AT)


def test_the_steps_inside_the_window_are_counted() -> None:
    told = window(NEAR, after=1.5, before=3.0).observe(ride().first(2)).observe(ride().rows(slice(2, 4))).verdict()
    assert told.judged == Judged(2, 2.0, 3.0)


def test_a_window_that_never_opened_was_not_exercised() -> None:
    for assertion in (NEAR, FAR, NoCollision()):
        told = window(assertion, after=5.0).observe(ride()).verdict()
        assert told.status == "not_exercised"
        assert told.message == ("never checked: the run ended before 5 s (after); run for longer, or lower 'after'")


HOLD_TIME = np.arange(1.0, 9.0)


def seen(*holds: int, wanted: float = 2.0) -> HoldTime:
    return HoldTime(wanted).observe(HOLD_TIME[: len(holds)], np.array(holds, dtype=bool))


@pytest.mark.parametrize(
    ("holds", "began", "decided"),
    [((1, 1, 1), 1.0, 3.0), ((0, 1, 1, 0, 1, 1, 1, 1), 5.0, 7.0), ((0, 1, 1, 1), 2.0, 4.0)],
)
def test_it_is_met_once_the_stretch_is_long_enough(holds: tuple[int, ...], began: float, decided: float) -> None:
    met = seen(*holds)
    assert (met.state, met.began, met.goal.time, met.longest) == (State.HOLDS, began, decided, 2.0)


def test_the_longest_stretch_is_kept() -> None:
    missed = seen(1, 0, 1, 1, 0, 1)
    assert (missed.state, missed.longest, missed.began, missed.since) == (State.PENDING, 1.0, 3.0, 6.0)


def test_what_never_was_lasted_for_no_time() -> None:
    assert (HoldTime(2.0).longest, seen(0, 0).longest, seen(0, 0).state) == (0.0, 0.0, State.PENDING)


def test_a_stretch_of_no_time_is_met_by_the_first_moment() -> None:
    assert seen(0, 0, wanted=0.0).state is State.PENDING
    assert seen(0, 1, wanted=0.0).goal.time == 2.0


def test_rounding_of_sim_time_costs_no_step() -> None:
    time = np.arange(100, 400) / 240  # (340 - 100) / 240 is 1, but 340 / 240 - 100 / 240 is not
    for first in range(60):
        holds = np.arange(300) >= first
        assert HoldTime(1.0).observe(time, holds).goal.time == time[first + 240]
        assert HoldTime(2 / 240).observe(time, holds).goal.time == time[first + 2]
