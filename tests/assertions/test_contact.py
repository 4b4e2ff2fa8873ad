"""The robot touches a body."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.assertions.contact import Touch
from sim_action.assertions.monitors import State, is_decided
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.state.trace_records import ClearanceRecord, Nearness
from sim_action.state.verdict import Verdict
from tests.traces import contact, judged, monitor, scene, trace

RATE = 240


def touch(**keys: Any) -> Touch:
    return Touch.model_validate({"with": "ball", **keys})


def seen(*forces: float | None, first: int = 1, link: str = "base_scan") -> Trace:
    """A step each from step `first` on, with a touch of the ball by this force, or none."""
    times = [(first + n) / RATE for n in range(len(forces))]
    pairs = zip(times, forces, strict=True)
    return trace(times, contacts=[contact(t, "ball", link, force) for t, force in pairs if force is not None])


def test_the_first_touch_is_enough() -> None:
    assert judged(touch(), seen(None, 3.0, 4.0)) == Verdict(
        True, 1.0, 1.0, 0.0, "contacts", 2 / RATE, "touched ball at 0.01 s, with 3 N"
    )


def test_points_of_one_step_add_up() -> None:
    corners: list[Contact] = [contact(1 / RATE, "ball", "base_scan", 2.0) for _ in range(4)]
    both = trace([1 / RATE], contacts=[*corners, contact(1 / RATE, "ball", "base_footprint", 1.0)])
    assert judged(touch(at_least=9.0), both).measured == 9.0
    assert judged(touch(at_least=8.0, link="base_scan"), both).measured == 8.0
    assert judged(touch(at_least=9.0, link="base_*"), both).passed


def test_what_is_too_weak_is_not_enough() -> None:
    assert judged(touch(at_least=5.0), seen(3.0, 4.5, None)) == Verdict(
        False, 4.5, 5.0, -0.5, "N", 2 / RATE, "touched ball with 4.5 N of 5 N at 0.01 s"
    )
    assert judged(touch(at_least=4.5), seen(3.0, 4.5)).message == "touched ball with 4.5 N at 0.01 s"


def test_what_is_too_strong_breaks_it_also_after_the_touch() -> None:
    opened = monitor(touch(at_most=5.0))
    gentle = opened.observe(seen(3.0, 4.5))
    assert (opened.state, gentle.state, is_decided(gentle, opened.state)) == (State.PENDING, State.HOLDS, False)
    assert gentle.verdict() == Verdict(
        True, 4.5, 5.0, 0.5, "N", 2 / RATE, "touched ball with at most 4.5 N at 0.01 s, limit 5 N"
    )
    rough = gentle.observe(seen(6.0, first=12))
    assert (rough.state, is_decided(rough, opened.state)) == (State.BROKEN, True)
    assert rough.verdict() == Verdict(
        False, 6.0, 5.0, -1.0, "N", 12 / RATE, "touched ball with 6 N at 0.05 s, more than 5 N"
    )


def test_without_a_limit_a_touch_decides() -> None:
    assert is_decided(monitor(touch()).observe(seen(1.0)), State.PENDING)


LOST = [None] * 12
"""Steps of more than 50 ms, with the one after them."""


def test_a_touch_lasts_until_it_is_lost() -> None:
    held = judged(touch(**{"for": 2 / RATE}), seen(1.0, 1.0, *LOST, 1.0, 1.0, 1.0))
    assert (held.passed, held.time, held.unit) == (True, 17 / RATE, "s")
    let_go = judged(touch(**{"for": 3 / RATE}), seen(1.0, 1.0, *LOST, 1.0, 1.0, 1.0))
    assert let_go.measured == pytest.approx(2 / RATE)
    assert let_go.message == "touched ball for 0.008333 s of 0.0125 s, from 0.06 s on"


def test_a_touch_that_is_lost_for_50_ms_lasts_on() -> None:
    assert judged(touch(**{"for": 13 / RATE}), seen(1.0, *LOST[1:], 1.0, 1.0)).passed
    assert not judged(touch(**{"for": 14 / RATE}), seen(1.0, *LOST, 1.0, 1.0)).passed


def test_what_is_too_weak_is_no_touch() -> None:
    weak = [0.5] * 12
    assert judged(touch(**{"for": 14 / RATE}), seen(2.0, *weak, 2.0, 2.0)).passed
    assert not judged(touch(**{"for": 14 / RATE, "at_least": 1.0}), seen(2.0, *weak, 2.0, 2.0)).passed
    never = judged(touch(**{"for": 3 / RATE, "at_least": 3.0}), seen(2.0, 2.0, 0.5, 2.0))
    assert (never.unit, never.measured) == ("N", 2.0)


def test_a_stored_trace_has_the_touches_between_its_moments() -> None:
    sparse = seen(*[1.0] * 48).rows(slice(0, None, 24))
    assert judged(touch(**{"for": 40 / RATE}), sparse).passed


def test_what_was_touched_instead_is_told() -> None:
    aside = [contact(0.5, "wall", "base_footprint"), contact(0.75, "ball", "base_footprint")]
    one, both = trace([1.0], contacts=aside[:1]), trace([1.0], contacts=aside)
    missed = judged(touch(link="base_scan"), one)
    assert missed == Verdict(
        False,
        0.0,
        1.0,
        -1.0,
        "contacts",
        1.0,
        "did not touch ball in 1.0 s; base_footprint touched wall at 0.50 s",
    )
    assert judged(touch(link="base_scan"), both).message.endswith("; base_footprint touched it at 0.75 s")
    assert judged(touch(), trace([1.0])).message == "did not touch ball in 1.0 s; touched nothing else"


def test_how_near_it_came_is_told_where_that_is_known() -> None:
    spec = touch(link="base_scan")
    watch = ClearanceWatch(("base_scan",), ("ball",))
    assert spec.channels == Channels(contacts=True, clearances=frozenset({watch}))
    near = ClearanceRecord.of([Nearness(0.25, 0.75, "base_scan", "ball"), Nearness(0.5, 0.5, "base_scan", "ball")])
    away = replace(trace([1.0]), clearances={watch: near})
    assert judged(spec, away).message == (
        "did not touch ball in 1.0 s; came within 0.5 m at 0.50 s; touched nothing else"
    )
    assert touch(link="*_scan").channels == Channels(contacts=True)


def test_it_needs_a_moment() -> None:
    assert judged(touch(), trace([])).message == "no physics step to measure"


@pytest.mark.parametrize(
    ("keys", "path", "message"),
    [
        ({"with": "bal"}, "with", "the world has no body 'bal'; did you mean 'ball'?"),
        ({"with": "ground"}, "with", "contacts with the ground are not recorded; name an object"),
        (
            {"link": "base_scam"},
            "link",
            "the robot has no link 'base_scam' with a collision shape; did",
        ),
        ({"link": "*_finger"}, "link", "the robot has no link"),
    ],
)
def test_names_that_are_none_are_problems(keys: dict[str, Any], path: str, message: str) -> None:
    ((where, found),) = touch(**keys).problems(scene())
    assert where == (path,)
    assert found.startswith(message)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"at_least": 0}, "greater than 0"),
        ({"at_least": 2, "at_most": 1}, "nothing is at least 2 N and at most 1 N"),
        ({"for": 0}, "greater than 0"),
    ],
)
def test_what_no_touch_can_be_is_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        touch(**keys)


def test_the_title_says_what_is_asked() -> None:
    assert touch().title == "contact with ball"
    asked = touch(link="*_finger", at_least="1 N", at_most="20 N", **{"for": "500 ms"})
    assert asked.title == "contact of *_finger with ball at least 1 N, at most 20 N, for 0.5 s"
