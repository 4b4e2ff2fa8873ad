"""The robot touches a body."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_action.assertions.combined import Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceRecord, ClearanceWatch, Nearness
from sim_action.state.verdict import Verdict
from sim_action.world import Body, PathPoint, Physics, Sphere, World
from tests.assertions.test_cuts import MOVABLE
from tests.traces import START, contact, judged, monitor, piece, scene, trace

RATE = 240
WINDOW = 12  # steps of the default window, 50 ms


def touch(**keys: Any) -> Touch:
    return Touch.model_validate({"with": "ball", **keys})


def seen(*forces: float | None, first: int = 1, link: str = "base_scan") -> Trace:
    """A step each from step `first` on, with a touch of the ball by this force, or none."""
    times = [(first + n) / RATE for n in range(len(forces))]
    pairs = zip(times, forces, strict=True)
    return trace(times, contacts=[contact(t, "ball", link, force) for t, force in pairs if force is not None])


def test_the_first_touch_is_enough_and_the_name_of_the_body_alone_asks_for_it() -> None:
    first = Verdict(True, 1.0, 1.0, 0.0, "contacts", 2 / RATE, "touched ball at 0.01 s", body="ball")
    assert judged(touch(), seen(None, 3.0, 4.0)) == first
    assert monitor(touch()).observe(seen(1.0)).is_decided
    assert Touch.model_validate("ball") == touch()


def test_points_of_one_step_add_up() -> None:
    corners: list[Contact] = [contact(1 / RATE, "ball", "base_scan", 24.0) for _ in range(4)]
    both = trace([1 / RATE], contacts=[*corners, contact(1 / RATE, "ball", "base_footprint", 12.0)])
    assert judged(touch(at_least=9.0), both).measured == 9.0
    assert judged(touch(at_least=8.0, link="base_scan"), both).measured == 8.0
    assert judged(touch(at_least=9.0, link="base_*"), both).passed


def test_a_force_is_the_mean_over_a_window() -> None:
    hit = seen(48.0, *[None] * 10, 24.0, None, 12.0)
    assert judged(touch(at_least=6.0), hit).measured == 6.0
    assert judged(touch(at_least=6.1), hit).measured == 6.0
    assert judged(touch(at_least=20.0, window=3 / RATE), hit).measured == 16.0
    assert judged(touch(at_most=48.0, window=1 / RATE), hit).measured == 48.0


def test_what_is_too_weak_is_not_enough() -> None:
    weak = seen(*[4.5] * WINDOW, None)
    message = "touched ball with 4.5 N of 5 N at 0.05 s (0.225 N s within 50 ms)"
    assert judged(touch(at_least=5.0), weak) == Verdict(False, 4.5, 5.0, -0.5, "N", 0.05, message)
    told = judged(touch(at_least=4.5), weak)
    assert told.message == "touched ball with 4.5 N at 0.05 s (0.225 N s within 50 ms)"


def test_what_is_too_strong_breaks_it_also_after_the_touch() -> None:
    opened = monitor(touch(at_most=5.0))
    gentle = opened.observe(seen(*[4.5] * WINDOW))
    assert (opened.state, gentle.state, gentle.is_decided) == (State.HOLDS, State.HOLDS, False)
    passed = "touched ball with at most 4.5 N at 0.05 s, limit 5 N (0.225 N s within 50 ms)"
    assert gentle.verdict() == Verdict(True, 4.5, 5.0, 0.5, "N", 0.05, passed, body="ball")
    rough = gentle.observe(seen(4.5, 16.5, first=WINDOW + 1))
    assert (rough.state, rough.is_decided) == (State.BROKEN, True)
    failed = "touched ball with 5.5 N at 0.06 s, more than 5 N (0.275 N s within 50 ms)"
    assert rough.verdict() == Verdict(False, 5.5, 5.0, -0.5, "N", (WINDOW + 2) / RATE, failed, body="ball")


def test_an_impulse_is_that_of_a_window() -> None:
    hit = seen(None, 72.0, 48.0, None)
    for limits, passed, words in (
        ({"at_most": 0.4}, False, "0.5 N s at 0.01 s, more than 0.4 N s"),
        ({"at_most": "600 mN s"}, True, "at most 0.5 N s at 0.01 s, limit 0.6 N s"),
        ({"at_least": 0.4}, True, "0.5 N s at 0.01 s"),
        ({"at_least": 0.6}, False, "0.5 N s of 0.6 N s at 0.01 s"),
    ):
        told = judged(touch(impulse=limits), hit)
        message = f"touched ball with {words} (within 50 ms: 10 N on average)"
        assert (told.passed, told.unit, told.message) == (passed, "N s", message)
    told = judged(touch(impulse={"at_most": 0.4}), hit)
    assert (told.measured, told.limit, told.margin) == pytest.approx((0.5, 0.4, -0.1))


@pytest.mark.parametrize(
    ("limits", "unit"),
    [
        ({"at_most": 15.0, "impulse": {"at_most": 0.6}}, "N s"),
        ({"at_most": 11.0, "impulse": {"at_most": 0.6}}, "N"),
        ({"at_most": 15.0, "impulse": {"at_most": 0.4}}, "N s"),
        ({"at_most": 9.0, "impulse": {"at_most": 0.6}}, "N"),
        ({"at_least": 9.0, "impulse": {"at_most": 0.4}}, "N s"),
        ({"at_least": 11.0, "impulse": {"at_least": 0.4, "at_most": 0.6}}, "N"),
        ({"at_least": 9.0, "impulse": {"at_least": 0.6}}, "N s"),
    ],
)
def test_of_several_limits_the_decisive_one_is_reported(limits: dict[str, Any], unit: str) -> None:
    assert judged(touch(**limits), seen(None, 72.0, 48.0, None)).unit == unit


def test_an_upper_limit_alone_needs_no_touch() -> None:
    for limit in ({"at_most": 5.0}, {"impulse": {"at_most": 5.0}}):
        spec = touch(**limit)
        unit = "N" if "at_most" in limit else "N s"
        assert not spec.is_goal
        message = "did not touch ball; to demand a touch, add `contact: {with: ball}`"
        assert judged(spec, seen(None, None)) == Verdict(True, 0.0, 5.0, 5.0, unit, 2 / RATE, message)
        assert judged(spec, trace([])).message == "no physics step to measure"
    spec = touch(at_most=5.0, link="base_scan")
    watch = ClearanceWatch(("base_scan",), ("ball",))
    near = ClearanceRecord.of([Nearness(0.5, 0.75, "base_scan", "ball")])
    away = replace(trace([1.0], contacts=[contact(0.5, "ball", "base_footprint")]), clearances={watch: near})
    added = "to demand a touch, add `contact: {with: ball, link: base_scan}`"
    assert judged(spec, away).message == f"did not touch ball; came within 0.75 m at 0.50 s; {added}"


@pytest.mark.parametrize("goal", [{"at_least": 1.0}, {"for": 1 / RATE}, {"impulse": {"at_least": 0.1, "at_most": 5.0}}])
def test_an_upper_limit_beside_a_goal_leaves_it_a_goal(goal: dict[str, Any]) -> None:
    spec = touch(at_most=5.0, **goal)
    assert spec.is_goal
    told = judged(spec, seen(None, None))
    assert (told.passed, told.message) == (False, "did not touch ball in 0.0 s; touched nothing else")


def test_a_force_at_the_start_has_lasted() -> None:
    start = replace(START, contacts=(contact(0.0, "ball", force=6.0), contact(0.0, "wall", force=60.0)))
    rests = seen(*[6.0] * 20)
    spec = touch(at_least=6.0, at_most=6.0)
    told = spec.monitor(scene(), start).observe(rests).verdict()
    assert (told.passed, told.measured, told.time) == (True, 6.0, 1 / RATE)
    assert spec.monitor(scene(), START).observe(rests).verdict().time == 0.05
    assert judged(touch(at_most=6.0), rests, start).measured == 6.0


def test_a_load_that_is_there_from_the_first_step_on_does_not_become_true() -> None:
    """An engine that has not settled knows no contacts at t = 0."""
    spec, where = touch(at_least=5.0), replace(scene(), acted_on=True)
    for rests in (seen(*[6.0] * 60), seen(*[6.0] * 13)):
        told = spec.opened(where, MOVABLE).observe(rests).verdict()
        assert (told.passed, told.margin) == (False, 0.0)
        opened = spec.opened(where, MOVABLE)
        for start in range(0, len(rests), 5):
            opened = opened.observe(piece(rests, start, start + 5))
        assert opened.verdict() == told
    contrary = Negation(part=touch(at_most=5.0)).opened(where, MOVABLE).observe(seen(*[6.0] * 60)).verdict()
    assert (contrary.passed, contrary.message[:28]) == (False, "was already true at t = 0, a")
    for comes in (seen(None, *[6.0] * 30), seen(1.0, 2.0, None, *[6.0] * 30), seen(*[4.0] * 20, *[6.0] * 30)):
        assert spec.opened(where, MOVABLE).observe(comes).verdict().passed


def test_a_force_looks_back_to_before_the_window_of_its_expectation() -> None:
    whole = seen(120.0, *[None] * 20)
    early = Window(monitor(touch(at_most=5.0)), 12 / RATE, math.inf).observe(whole).verdict()
    assert (early.passed, early.measured) == (False, 10.0)
    late = Window(monitor(touch(at_most=5.0)), 13 / RATE, math.inf).observe(whole).verdict()
    assert (late.passed, late.measured) == (True, 0.0)


IMPULSE = {"at_least": 0.1, "at_most": 0.5}


@pytest.mark.parametrize("limits", [{"at_most": 9.0}, {"at_least": 9.0}, {"impulse": IMPULSE}])
def test_a_stored_trace_at_10_hz_has_the_same_verdict(limits: dict[str, Any]) -> None:
    rng = np.random.default_rng(1)
    forces = [float(rng.uniform(0, 60)) if rng.random() < 0.3 else None for _ in range(240)]
    whole = seen(*forces)
    assert judged(touch(**limits), whole.rows(slice(23, None, 24))) == judged(touch(**limits), whole)


@pytest.mark.parametrize("limits", [{"at_most": 9.0}, {"impulse": {"at_most": 0.5}}, {"at_least": 1.0, "at_most": 9.0}])
def test_a_contact_without_a_force_keeps_no_upper_limit(limits: dict[str, Any]) -> None:
    """A body on a path is inside a bolted robot: neither gives way, and no engine computes a force."""
    stuck = seen(None, 0.0, 0.0)
    stuck = replace(stuck, contacts=tuple(one._replace(has_force=False) for one in stuck.contacts))
    opened = monitor(touch(**limits)).observe(stuck)
    assert opened.state is State.BROKEN
    told = opened.verdict()
    message = "touched ball at 0.01 s, with no computed force (neither gives way), so no limit can hold"
    assert (told.passed, told.measured, told.message) == (False, None, message)
    assert opened.truth(stuck).holds.tolist() == ["at_least" not in limits, False, False]
    assert judged(touch(), stuck).passed


@pytest.mark.parametrize("limits", [{"at_least": 5.0}, {"impulse": {"at_least": 0.5}}, {"at_least": 5.0, "for": 0.1}])
def test_a_contact_without_a_force_meets_no_lower_limit(limits: dict[str, Any]) -> None:
    stuck = seen(*[None] * 4, 0.0, 0.0)
    stuck = replace(stuck, contacts=tuple(one._replace(has_force=False) for one in stuck.contacts))
    opened = monitor(touch(**limits)).observe(stuck)
    assert opened.state is State.PENDING
    told = opened.verdict()
    message = "touched ball at 0.02 s, with no computed force (neither gives way), so no limit can hold"
    assert (told.passed, told.measured, told.time, told.message) == (False, None, 5 / RATE, message)
    assert judged(Negation(part=touch(**limits)), stuck).passed
    pressed = replace(stuck, contacts=(*stuck.contacts, contact(6 / RATE, "ball", force=12.0)))
    assert judged(touch(at_least=5.0), pressed).message.startswith("touched ball with 1 N of 5 N at 0.03 s (")


LOST = [None] * 12  # steps of more than 50 ms, with the one after them


def test_a_touch_lasts_until_it_is_lost_for_more_than_50_ms() -> None:
    held = judged(touch(**{"for": 2 / RATE}), seen(1.0, 1.0, *LOST, 1.0, 1.0, 1.0))
    assert (held.passed, held.time, held.unit) == (True, 17 / RATE, "s")
    let_go = judged(touch(**{"for": 3 / RATE}), seen(1.0, 1.0, *LOST, 1.0, 1.0, 1.0))
    assert let_go.measured == pytest.approx(2 / RATE)
    assert let_go.message == "touched ball for 0.008333 s of 0.0125 s, from 0.06 s on"
    assert judged(touch(**{"for": 13 / RATE}), seen(1.0, *LOST[1:], 1.0, 1.0)).passed
    assert not judged(touch(**{"for": 14 / RATE}), seen(1.0, *LOST, 1.0, 1.0)).passed


def test_a_mean_force_must_last() -> None:
    weak = [0.5] * 12
    assert judged(touch(**{"for": 14 / RATE}), seen(2.0, *weak, 2.0, 2.0)).passed
    lasting = touch(**{"for": 14 / RATE, "at_least": 1.0})
    assert not judged(lasting, seen(*[1.0] * 24, *weak)).passed
    assert judged(lasting, seen(*[1.0] * 26, *weak)).passed
    # A loss of contact only lowers the mean.
    assert judged(lasting, seen(*[2.0, None] * 14, 2.0)).passed
    limits = {"at_least": 1.0, "at_most": 5.0, "impulse": {"at_most": 0.5}}
    assert judged(touch(**limits, **{"for": 2 / RATE}), seen(*[3.0] * 24)).message == (
        "touched ball for 0.008333 s, from 0.02 s on; at most 3 N, limit 5 N (0.15 N s within 50 ms); "
        "at most 0.15 N s, limit 0.5 N s (within 50 ms: 3 N on average)"
    )
    never = judged(touch(**{"for": 3 / RATE, "at_least": 3.0}), seen(24.0, 2.0, 0.0, 4.0))
    assert (never.unit, never.measured) == ("N", 2.5)


def test_a_stored_trace_has_the_touches_between_its_moments() -> None:
    sparse = seen(*[1.0] * 48).rows(slice(0, None, 24))
    assert judged(touch(**{"for": 40 / RATE}), sparse).passed


def test_what_was_touched_instead_is_told() -> None:
    aside = [contact(0.5, "wall", "base_footprint"), contact(0.75, "ball", "base_footprint")]
    one, both = trace([1.0], contacts=aside[:1]), trace([1.0], contacts=aside)
    message = "did not touch ball in 1.0 s; base_footprint touched wall at 0.50 s"
    assert judged(touch(link="base_scan"), one) == Verdict(False, 0.0, 1.0, -1.0, "contacts", 1.0, message)
    assert judged(touch(link="base_scan"), both).message.endswith("; base_footprint touched it at 0.75 s")
    assert judged(touch(), trace([1.0])).message == "did not touch ball in 1.0 s; touched nothing else"


def test_how_near_it_came_is_told_where_that_is_known() -> None:
    spec = touch(link="base_scan")
    watch = ClearanceWatch(("base_scan",), ("ball",))
    assert spec.channels == Channels(contacts=True, clearances=frozenset({watch}))
    near = ClearanceRecord.of([Nearness(0.25, 0.75, "base_scan", "ball"), Nearness(0.5, 0.5, "base_scan", "ball")])
    away = replace(trace([1.0]), clearances={watch: near})
    message = "did not touch ball in 1.0 s; came within 0.5 m at 0.50 s; touched nothing else"
    assert judged(spec, away).message == message
    assert touch(link="*_scan").channels == Channels(contacts=True)


@pytest.mark.parametrize(
    ("keys", "path", "message"),
    [
        ({"with": "bal"}, "with", "the world has no body 'bal'; did you mean 'ball'?"),
        ({"with": "grund"}, "with", "the world has no body 'grund'"),
        ({"link": "base_scam"}, "link", "the robot has no link 'base_scam' with a collision shape; did"),
        ({"link": "*_finger"}, "link", "the robot has no link"),
    ],
)
def test_names_that_are_none_are_problems(keys: dict[str, Any], path: str, message: str) -> None:
    ((where, found),) = touch(**keys).problems(scene())
    assert where == (path,)
    assert found.startswith(message)


@pytest.mark.parametrize(
    ("limits", "rate", "found"),
    [
        ({"at_most": 1, "window": "1 ms"}, 240, "1 ms is shorter than a physics step of 4.167 ms"),
        ({"impulse": {"at_most": 1}, "window": "3 ms"}, 240, "at least 334 Hz, or the window"),
        ({"at_least": 1}, 10, "50 ms is shorter than a physics step of 100 ms (physics.rate: 10 Hz); raise"),
        ({"at_least": 1}, 20, None),
        ({"at_most": 1, "window": "1 ms"}, 1000, None),
        ({}, 10, None),
    ],
)
def test_a_window_holds_a_physics_step(limits: dict[str, Any], rate: float, found: str | None) -> None:
    problems = list(touch(**limits).problems(replace(scene(), physics=Physics(rate=rate))))
    assert [path for path, _ in problems] == ([] if found is None else [("window",)])
    assert found is None or found in problems[0][1]


@pytest.mark.parametrize("limits", [{"at_most": 5}, {"at_least": 5}, {"impulse": {"at_most": 1}}])
def test_a_force_that_nothing_computes_has_no_limit(limits: dict[str, Any]) -> None:
    made = scene()
    path = (PathPoint(at=0.0, x=1.0), PathPoint(at=2.0, x=0.0))
    ball = Body(name="ball", sphere=Sphere(radius=0.1), path=path)
    free = replace(made, world=World(objects=(ball, Body(name="wall", box=(1.0, 1.0, 1.0)))))
    bolted = replace(free, robot=made.robot.model_copy(update={"base": "fixed"}))
    # The base and what is fixed to it cannot move; the wheels can.
    ((where, found),) = touch(link="base_*", **limits).problems(bolted)
    assert where == ()
    assert found.startswith("there is no force between 'ball' and these links: 'ball' follows its path, ")
    assert list(touch(link="base_*").problems(bolted)) == []
    assert list(touch(link="base_*", **limits).problems(free)) == []
    assert list(touch(**limits).problems(bolted)) == []
    assert list(touch(**{"with": "wall", **limits}).problems(bolted)) == []


def test_a_contact_without_a_force_has_no_curve_of_one() -> None:
    pressed = seen(None, 3.0)
    stuck = replace(pressed, contacts=tuple(one._replace(force=0.0, has_force=False) for one in pressed.contacts))
    assert [signal.name for signal in touch().signals(scene(), START, stuck)] == ["touching ball"]
    assert len(touch().signals(scene(), START, pressed)) == 2
