"""Time windows around monitors, the time for which a goal must hold, and goals that must become true."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions import Assertion
from sim_action.assertions.clearance import Clearance
from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import Travel
from sim_action.assertions.joint import JointReading
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.windows import HoldTime, Window
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.reach import Reach
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled, StopsBefore
from sim_action.assertions.upright import Upright
from sim_action.state.observation import JointState
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ClearanceRecord, ClearanceWatch, Nearness, SensorRecord
from sim_action.state.verdict import Judged, Verdict
from sim_action.world.physics import Disturbance
from sim_action.world.scene import Scene
from tests.soak import examples
from tests.traces import START, WHEELS, contact, monitor, piece, scene, trace
from tests.work import work_of

FAR = Travel(at_least=2.0)
NEAR = Travel(at_most=2.0)


def window(assertion: Travel | NoCollision, after: float = 0.0, before: float = math.inf) -> Window:
    return Window(monitor(assertion), after, before)


def ride() -> Trace:
    return trace([1.0, 2.0, 3.0, 4.0], x=[1.0, 2.0, 3.0, 1.0])


def test_a_goal_counts_in_its_window_both_ends_of_which_belong_to_it() -> None:
    told = window(FAR).observe(ride()).verdict()
    assert replace(told, judged=None) == monitor(FAR).observe(ride()).verdict()
    assert window(FAR, after=2.5).observe(ride()).verdict().time == 3.0
    assert window(FAR, after=2.0, before=2.0).observe(ride()).verdict().time == 2.0
    assert window(FAR, before=2.0).observe(ride()).state is State.HOLDS
    # A goal that comes true late is lost.
    late = window(FAR, before=1.5).observe(ride())
    assert late.state is State.BROKEN
    assert late.verdict().message == "travelled 1 m of 2 m in 1.0 s"


def test_a_goal_is_pending_until_its_window_closes_with_the_moment_it_ends_at() -> None:
    early = window(FAR, before=2.5).observe(ride().first(1))
    assert early.state is State.PENDING
    assert not early.over
    slow = window(Travel(at_least=5.0), before=2.0)
    assert slow.observe(ride().first(1)).state is State.PENDING
    assert slow.observe(ride().first(2)).state is State.BROKEN
    # However that was computed.
    assert window(FAR, before=0.1 + 0.2).observe(trace([0.3])).state is State.BROKEN


def test_an_invariant_may_be_broken_outside_its_window() -> None:
    assert window(NEAR, before=2.0).observe(ride()).state is State.HOLDS
    assert window(NEAR, after=3.5).observe(ride()).state is State.HOLDS
    assert window(NEAR, after=2.5).observe(ride()).state is State.BROKEN


def test_contacts_count_inside_the_window_only_also_between_two_stored_moments() -> None:
    touched = trace([1.0, 2.0, 3.0], contacts=[contact(1.0), contact(3.0)])
    assert window(NoCollision(), after=2.0, before=2.5).observe(touched).verdict().passed
    assert window(NoCollision(), after=2.0).observe(touched).verdict().time == 3.0
    touched = trace([1.0, 2.0], contacts=[contact(1.5)])
    assert window(NoCollision(), after=1.25, before=1.75).observe(touched).verdict().time == 1.5


def test_an_over_window_sees_nothing_more() -> None:
    over = window(NEAR, before=1.0).observe(ride().first(1))
    assert over.over
    assert over.observe(ride()) is over
    # Before its window, a monitor has seen nothing.
    for moments in (trace([]), trace([0.5])):
        assert window(NEAR, after=1.0).observe(moments).verdict().time is None


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
    moving = trace(STEPS, x=way, contacts=[contact(time)])
    return replace(moving, sensors={"s": readings}, clearances={ClearanceWatch(): nearest})


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


def test_the_steps_inside_the_window_are_counted_and_one_that_never_opened_was_not_exercised() -> None:
    told = window(NEAR, after=1.5, before=3.0).observe(ride().first(2)).observe(ride().rows(slice(2, 4))).verdict()
    assert told.judged == Judged(2, 2.0, 3.0)
    for assertion in (NEAR, FAR, NoCollision()):
        told = window(assertion, after=5.0).observe(ride()).verdict()
        assert told.status == "not_exercised"
        assert told.message == "never checked: the run ended before 5 s (after); run for longer, or lower 'after'"


HOLD_TIME = np.arange(1.0, 9.0)


def seen(*holds: int, duration: float = 2.0) -> HoldTime:
    return HoldTime(duration).observe(HOLD_TIME[: len(holds)], np.array(holds, dtype=bool))


@pytest.mark.parametrize(
    ("holds", "began", "decided"),
    [((1, 1, 1), 1.0, 3.0), ((0, 1, 1, 0, 1, 1, 1, 1), 5.0, 7.0), ((0, 1, 1, 1), 2.0, 4.0)],
)
def test_it_is_met_once_the_stretch_is_long_enough(holds: tuple[int, ...], began: float, decided: float) -> None:
    met = seen(*holds)
    assert (met.state, met.began, met.goal.time, met.longest) == (State.HOLDS, began, decided, 2.0)


def test_the_longest_stretch_is_kept_and_one_of_no_time_met_by_the_first_moment() -> None:
    missed = seen(1, 0, 1, 1, 0, 1)
    assert (missed.state, missed.longest, missed.began, missed.since) == (State.PENDING, 1.0, 3.0, 6.0)
    assert (HoldTime(2.0).longest, seen(0, 0).longest, seen(0, 0).state) == (0.0, 0.0, State.PENDING)
    assert seen(0, 0, duration=0.0).state is State.PENDING
    assert seen(0, 1, duration=0.0).goal.time == 2.0


def test_rounding_of_sim_time_costs_no_step() -> None:
    time = np.arange(100, 400) / 240  # (340 - 100) / 240 is 1, but 340 / 240 - 100 / 240 is not
    for first in range(60):
        holds = np.arange(300) >= first
        assert HoldTime(1.0).observe(time, holds).goal.time == time[first + 240]
        assert HoldTime(2 / 240).observe(time, holds).goal.time == time[first + 2]


HOME, THERE = Reach(x=0.0, y=0.0, tolerance=0.1), Reach(x=1.0, y=0.0, tolerance=0.1)
AT_REST = Settled.model_validate({"for": 1.0})
START_WITH_JOINTS = replace(START, joints=dict.fromkeys(WHEELS, JointState(0.0, 0.0, 0.0)))
DRIVEN, ALONE = replace(scene(), acted_on=True), replace(scene(), acted_on=False)


def way(*x: float, every: float = 0.5) -> Trace:
    return trace([index * every for index in range(len(x))], x=x)


def opened(spec: Assertion, *, driven: bool = True, span: float | None = None) -> Monitor:
    return spec.opened(DRIVEN if driven else ALONE, START_WITH_JOINTS, span)


def verdict(spec: Assertion, seen: Trace, *, driven: bool = True, span: float | None = None) -> Verdict:
    return opened(spec, driven=driven, span=span).observe(seen).verdict()


def test_a_place_where_the_robot_is_already_does_not_count() -> None:
    monitor = opened(HOME).observe(way(0.0, 0.05, 0.0))
    assert monitor.state is State.PENDING
    told = monitor.verdict()
    assert not told.passed
    assert (told.measured, told.limit, told.margin) == (0.0, 0.1, -0.1)
    assert told.message == (
        "was already true at t = 0, and never became true again; a goal counts after it was false once, or if it holds "
        "for a time 'for' after the base or a joint moved (by 1 mm or 0.1 deg) or a disturbance began; to demand "
        "that nothing changes, use stay_within or joint_within"
    )


def test_a_goal_that_is_false_at_first_is_judged_as_it_is_and_a_robot_that_leaves_must_come_back() -> None:
    told = verdict(HOME, way(0.0, 0.5, 1.0))
    assert not told.passed
    assert told.message.startswith("was already true at t = 0, and never became true again; came no closer than 0.5 m")
    seen = way(0.0, 0.5, 1.0)
    assert verdict(THERE, seen) == THERE.monitor(DRIVEN, START).observe(seen).verdict()


def test_leaving_before_the_window_opens_is_enough() -> None:
    window = Window(opened(HOME), after=1.5).observe(way(0.0, 0.5, 0.05, 0.0, 0.0))
    assert (window.state, window.verdict().time) == (State.HOLDS, 1.5)
    window = Window(opened(HOME), after=1.0).observe(way(0.0, 0.0, 0.0, 0.0, 0.0))
    assert window.state is State.PENDING


def test_a_robot_that_rests_before_its_first_command_is_not_settled() -> None:
    seen = trace([0.0, 0.5, 1.0, 1.5, 2.0], speed=[0.0, 0.0, 0.0, 0.0, 0.0])
    assert not verdict(Settled(), seen).passed
    assert verdict(Settled(), seen, driven=False).passed
    drives = trace([0.0, 0.5, 1.0, 1.5, 2.0, 2.5], speed=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    told = verdict(Settled(), drives)
    assert (told.passed, told.time) == (True, 2.5)


def test_a_distance_that_is_known_from_the_first_step_on_does_not_make_a_stop_false_before() -> None:
    spec = StopsBefore.model_validate({"body": "wall", "gap": (0.25, 4.0)})
    times = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    moments = [Nearness(time, 3.0, "base_scan", "wall") for time in times]
    clearances = {spec.near: ClearanceRecord.of(moments), spec.far: ClearanceRecord.of(moments[:1])}
    drives_off = replace(trace([0.0, *times], speed=[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]), clearances=clearances)
    monitor = opened(spec)
    for start, end in ((0, 1), (1, 3), (3, 7)):
        monitor = monitor.observe(piece(drives_off, start, end))
    assert monitor.state is State.PENDING
    assert monitor.verdict().message.startswith("was already true at t = 0, and never became true again")
    assert monitor.verdict() == verdict(spec, drives_off)


def test_a_reading_that_is_known_after_the_first_step_does_not_make_conditions_false_before() -> None:
    near = SensorReading(name="scan", reading="ranges", which="min", at_most=3.5)
    readings = SensorRecord("lidar", np.array([0.2, 0.7]), {"ranges": np.array([[3.0], [3.0]])})
    monitor = opened(AtOnce(parts=(near, Upright())))
    for seen in (way(0.0), replace(trace([0.5, 1.0]), sensors={"scan": readings})):
        monitor = monitor.observe(seen)
    assert monitor.state is State.PENDING
    assert monitor.verdict().message.startswith("was already true at t = 0")


def test_an_explicit_time_counts_from_the_first_movement_on() -> None:
    creeps = trace([0.0, 1.0, 2.0, 3.0, 4.0], x=[0.0, 0.0005, 0.002, 0.003, 0.004], speed=[0.0] * 5)
    assert not verdict(Settled(), creeps).passed
    told = verdict(AT_REST, creeps)
    assert (told.passed, told.time) == (True, 3.0)
    told = verdict(HOME, creeps, span=1.5)
    assert (told.passed, told.time) == (True, 4.0)
    assert not verdict(HOME, creeps, span=2.5).passed


@pytest.mark.parametrize(
    ("x", "yaw", "moves"),
    [(0.0009, 0.0, False), (0.0011, 0.0, True), (0.0, math.radians(0.09), False), (0.0, math.radians(0.11), True)],
)
def test_what_counts_as_movement(x: float, yaw: float, moves: bool) -> None:
    seen = trace([0.0, 1.0, 2.0], x=[0.0, x, x], yaw=[0.0, yaw, yaw])
    assert verdict(HOME, seen, span=0.5).passed is moves


def test_without_commands_it_must_hold_for_a_second_from_the_start() -> None:
    short, whole = way(0.0, 0.0), way(0.0, 0.0, 0.0)
    told = verdict(HOME, short, driven=False)
    assert not told.passed
    assert told.message.startswith("held for at most 0.5 s of 1 s, from 0.00 s on; came within 0 m of (0, 0)")
    told = verdict(HOME, whole, driven=False)
    assert (told.passed, told.time) == (True, 1.0)
    assert told.message.endswith("; it held for 1 s, from 0.00 s on")
    assert not verdict(HOME, whole, driven=False, span=1.5).passed
    assert verdict(HOME, way(0.0, 0.0, 0.0, 0.0), driven=False, span=1.5).passed


def test_without_commands_a_goal_that_comes_true_later_needs_no_time() -> None:
    touch = Touch.model_validate({"with": "ball"})
    falls = trace([0.0, 0.5, 1.0], contacts=(contact(1.0, body="ball"),))
    assert verdict(touch, falls, driven=False).passed


@pytest.mark.parametrize("driven", [True, False])
def test_for_asks_a_goal_to_hold_without_interruption(driven: bool) -> None:
    bounces = way(0.0, 1.0, 1.0, 0.0, 1.0, 1.0)
    monitor = opened(THERE, driven=driven, span=1.0).observe(bounces)
    assert monitor.state is State.PENDING
    told = monitor.verdict()
    assert (told.passed, told.measured, told.limit, told.margin, told.unit) == (False, 0.5, 1.0, -0.5, "s")
    assert told.message == "held for at most 0.5 s of 1 s, from 0.50 s on; came within 0 m of (1, 0) in 0.50 s"
    told = verdict(THERE, way(0.0, 1.0, 1.0, 1.0), driven=driven, span=1.0)
    assert (told.passed, told.time) == (True, 1.5)
    assert told.message == "held for 1 s, from 0.50 s on; came within 0 m of (1, 0) in 0.50 s"


def test_a_limit_still_breaks_a_goal_that_may_not_count_yet_but_not_before_its_window() -> None:
    near = JointReading(name=WHEELS[0], at_least=0.0, at_most=1.0)
    monitor = opened(near).observe(trace([0.0, 1.0], position=[0.5, 2.0]))
    assert monitor.state is State.BROKEN
    assert "more than" in monitor.verdict().message
    seen = trace([0.0, 1.0, 2.0, 3.0], position=[2.0, 2.0, 0.5, 0.5])
    window = Window(opened(near), 2.0, math.inf).observe(seen)
    assert (window.state, window.verdict().passed) == (State.HOLDS, True)


def test_each_part_of_all_of_must_become_true_by_itself_and_conditions_at_once_together() -> None:
    both = AllOf(parts=(THERE, HOME))
    assert not verdict(both, way(0.0, 0.5, 1.0)).passed
    assert verdict(both, way(0.0, 0.5, 1.0, 0.0)).passed
    at_once = AtOnce(parts=(HOME, Upright()))
    assert not verdict(at_once, way(0.0, 0.0, 0.0)).passed
    assert verdict(at_once, way(0.0, 1.0, 0.0)).passed


def test_the_negation_of_a_goal_breaks_at_once_and_that_of_an_invariant_must_become_true() -> None:
    assert opened(Negation(part=HOME)).observe(way(0.0, 0.0)).state is State.BROKEN
    fallen = trace([0.0, 1.0, 2.0], roll=[math.pi, math.pi, math.pi])
    assert not verdict(Negation(part=Upright()), fallen).passed
    assert verdict(Negation(part=Upright()), trace([0.0, 1.0, 2.0], roll=[0.0, 0.0, math.pi])).passed


def test_any_of_may_hold_for_a_time() -> None:
    either = AnyOf(parts=(Reach(x=1.0, y=0.0), Reach(x=2.0, y=0.0)))
    assert verdict(either, way(0.0, 1.0, 2.0, 2.0), span=1.0).passed
    assert not verdict(either, way(0.0, 1.0, 1.5, 2.0), span=1.0).passed


@pytest.mark.parametrize("blocks", [(8,), (1, 2, 5), (1,) * 8])
def test_any_of_with_a_sensor_holds_from_one_reading_to_the_next(blocks: tuple[int, ...]) -> None:
    near = SensorReading(name="scan", reading="ranges", which="min", at_most=2.5, once=True)
    readings = {0.2: 3.0, 1.2: 2.0, 3.2: 2.0}
    monitor = opened(AnyOf(parts=(near, Reach(x=9.0, y=9.0))), span=1.0)
    start = 0
    for length in blocks:
        time = [step / 2 for step in range(start, start + length)]
        seen = [when for when in readings if time[0] - 0.5 < when <= time[-1]]
        ranges = {"ranges": np.array([[readings[when]] for when in seen]).reshape(-1, 1)}
        record = {"scan": SensorRecord("lidar", np.array(seen), ranges)} if seen else {}
        monitor = monitor.observe(replace(trace(time), sensors=record))
        start += length
    told = monitor.verdict()
    assert (told.passed, told.time) == (True, 2.5)


NEAR_WALL = Clearance(at_most=0.5, to=("wall",))
BEFORE_WALL = StopsBefore.model_validate({"body": "wall", "gap": (0.0, 0.5), "for": 1.0})
ALL_WATCHES = {*NEAR_WALL.channels.clearances, *BEFORE_WALL.channels.clearances}


def near(*gaps: float, touches: Sequence[float] = ()) -> Trace:
    """Distances to the wall every 0.5 s, as an engine records them: none at t = 0."""
    time = [index * 0.5 for index in range(len(gaps) + 1)]
    moments = [Nearness(at, gap, "base_scan", "wall") for at, gap in zip(time[1:], gaps, strict=True)]
    least = [moment for index, moment in enumerate(moments) if moment.distance < min([9.0, *gaps[:index]])]
    small = [moment for moment in moments if moment.distance <= 0.5]
    records = {watch: ClearanceRecord.of(small if watch.always else least) for watch in ALL_WATCHES}
    return replace(trace(time, contacts=[contact(at) for at in touches]), clearances=records)


@pytest.mark.parametrize(
    "spec",
    [
        NEAR_WALL,
        BEFORE_WALL,
        AtOnce(parts=(NEAR_WALL, Upright())),
        AtOnce(parts=(BEFORE_WALL, Upright())),
        AtOnce(parts=(AnyOf(parts=(NEAR_WALL, Reach(x=9.0, y=0.0))), Upright())),
        AnyOf(parts=(AtOnce(parts=(NEAR_WALL, Upright())), Reach(x=9.0, y=0.0))),
    ],
    ids=lambda spec: spec.title,
)
def test_a_distance_that_is_not_measured_at_the_start_was_not_false_then(spec: Assertion) -> None:
    stays, leaves = near(0.3, 0.3, 0.3, 0.3), near(0.3, 0.9, 0.4, 0.4, 0.4)
    assert not verdict(spec, stays).passed
    assert verdict(spec, stays).message.count("was already true at t = 0") == 1
    assert verdict(spec, stays, driven=False).passed
    assert verdict(spec, leaves).passed


def test_a_body_that_is_left_for_good_was_measured_and_one_that_is_met_again_is_near() -> None:
    told = verdict(NEAR_WALL, near(0.3, 0.9, 1.0, 1.1))
    assert told.counted(Judged()).status == "failed"
    assert told.message.startswith("was already true at t = 0, and never became true again")
    # The least distance of all is not needed a second time.
    told = verdict(NEAR_WALL, near(0.3, 0.9, 0.9, 0.45))
    assert (told.passed, told.time, told.measured) == (True, 2.0, 0.45)
    # A body that appears beside the robot was not near before.
    assert verdict(NEAR_WALL, near(9.9, 9.9, 0.4)).passed


def test_a_touch_before_the_goal_counts_breaks_it_for_good() -> None:
    seen = near(0.1, 0.0, 0.0, 0.1, 0.1, 0.1, touches=[1.0, 1.5])
    monitor = opened(BEFORE_WALL).observe(seen)
    assert monitor.state is State.BROKEN
    assert monitor.verdict().message == "base_footprint touched wall at 1.00 s"
    # Invariants are judged as they are.
    for spec in (NoCollision(), Travel(at_most=1.0)):
        assert verdict(spec, way(0.0, 0.5)).passed


@examples(200)
@given(st.lists(st.sampled_from([0.0, 0.05, 1.0]), min_size=1, max_size=20))
def test_a_goal_with_commands_counts_exactly_after_it_was_false(x: Sequence[float]) -> None:
    """The oracle: the first place near home after the first place away from it."""
    away = next((index for index, value in enumerate(x) if value > 0.1), None)
    back = None if away is None else next((index for index in range(away, len(x)) if x[index] <= 0.1), None)
    told = verdict(HOME, way(*x))
    assert told.passed is (back is not None)
    if back is not None:
        assert told.time == back * 0.5


@examples(200)
@given(st.lists(st.sampled_from([0.0, 1.0]), min_size=1, max_size=24), st.sampled_from([0.5, 1.0, 2.0]))
def test_a_goal_holds_for_its_time_exactly_if_it_was_true_so_long(x: Sequence[float], span: float) -> None:
    """The oracle: a run of steps at the place that lasts at least `span`; the robot begins away from it."""
    places = [0.0, *x]
    steps = round(span / 0.5)
    lasting = any(all(place > 0 for place in places[at : at + steps + 1]) for at in range(len(places) - steps))
    assert verdict(Reach(x=1.0, y=0.0), way(*places), span=span).passed is lasting


def test_without_commands_the_time_before_the_window_does_not_count() -> None:
    """It stood there for a second, but was away when the window opened."""
    seen = way(0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    window = Window(opened(HOME, driven=False), 2.0, math.inf).observe(seen)
    assert (window.state, window.verdict().passed) == (State.PENDING, False)
    stays = Window(opened(HOME, driven=False), 2.0, math.inf).observe(way(*[0.0] * 7))
    assert (stays.verdict().passed, stays.verdict().time) == (True, 3.0)


def test_contacts_and_distances_are_not_known_at_t_0() -> None:
    """So a robot that touches, or stands before the wall, from the first step on was there from the start."""
    touch = Touch.model_validate({"with": "wall"})
    touches = trace([0.0, 0.5, 1.0], contacts=(contact(0.5), contact(1.0)))
    assert not verdict(touch, touches).passed
    assert not verdict(AtOnce(parts=(touch, Upright())), touches).passed
    assert not verdict(AnyOf(parts=(touch, Travel(at_least=1.0))), touches, span=0.5).passed
    stops = StopsBefore.model_validate({"body": "wall", "gap": (0.1, 0.5)})
    near = {stops.far: ClearanceRecord.of([AT_WALL[0]]), stops.near: ClearanceRecord.of(AT_WALL)}
    stands = replace(trace([0.0, 0.5, 1.0, 1.5], speed=[0.0] * 4), clearances=near)
    assert not verdict(stops, stands).passed
    assert verdict(stops, stands, driven=False).passed
    close = Clearance(at_most=0.5)
    seen = {close.watch: ClearanceRecord.of([AT_WALL[0]]), close.close: ClearanceRecord.of(AT_WALL)}
    assert not verdict(close, replace(stands, clearances=seen)).passed


AT_WALL = [Nearness(at, 0.3, "base_scan", "wall") for at in (0.5, 1.0, 1.5)]


def test_an_explicit_time_counts_from_the_first_disturbance_on() -> None:
    """The better an arm holds its pose under a push, the less it moves."""
    pushed = replace(DRIVEN, world=DRIVEN.world.model_copy(update={"disturbances": (PUSH,)}))
    holds = JointReading(name=WHEELS[0], near=0.0, tolerance=0.1)
    still = trace([0.0, 0.5, 1.0, 1.5, 2.0, 2.5])
    told = holds.opened(pushed, START_WITH_JOINTS, 1.0).observe(still).verdict()
    assert (told.passed, told.time) == (True, 2.0)
    assert not holds.opened(pushed, START_WITH_JOINTS, 2.0).observe(still).verdict().passed
    assert not holds.opened(pushed, START_WITH_JOINTS).observe(still).verdict().passed


PUSH = Disturbance.model_validate({"at": 1.0, "for": 0.2, "force": (20.0, 0.0, 0.0)})


BOLTED = replace(DRIVEN, robot=DRIVEN.robot.model_copy(update={"base": "fixed"}))


@pytest.mark.parametrize(
    ("where", "angle", "moves"),
    [(DRIVEN, 4.9, False), (DRIVEN, 5.1, True), (BOLTED, 0.09, False), (BOLTED, 0.11, True)],
    ids=["it creeps", "it turns", "bolted and still", "bolted and moving"],
)
def test_from_which_angle_on_a_joint_has_moved(where: Scene, angle: float, moves: bool) -> None:
    """A braked wheel that creeps has not moved; a joint of a bolted robot has, from a tenth of a degree on."""
    position = math.radians(angle)
    seen = trace([0.0, 1.0, 2.0], position=[0.0, position, position])
    assert HOME.opened(where, START_WITH_JOINTS, 0.5).observe(seen).verdict().passed is moves
