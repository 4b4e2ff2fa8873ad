"""The robot touches nothing but the ground."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_action.assertions.monitors.contacts import nearest_of
from sim_action.assertions.no_collision import NoCollision
from sim_action.state.trace_records import ClearanceRecord, ClearanceWatch, Nearness
from sim_action.state.verdict import Verdict
from tests.traces import START, contact, judged, scene, trace

TOUCHED = trace([1.0, 2.0, 3.0], contacts=[contact(2.0), contact(2.0, link="base_scan"), contact(3.0)])


def test_a_robot_that_touches_nothing_passes() -> None:
    assert judged(NoCollision(), trace([1.0, 2.0])) == Verdict(True, 0.0, 0.0, 0.0, "contacts", 2.0, "touched nothing")


def test_the_first_contact_is_named() -> None:
    assert judged(NoCollision(), TOUCHED) == Verdict(
        False,
        1.0,
        0.0,
        -1.0,
        "contacts",
        2.0,
        "base_footprint touched wall at 2.00 s, at (1.00, 0.25, 0.10) m, with 12.5 N in that physics step",
        body="wall",
    )


def test_the_force_is_that_of_all_points_of_the_step() -> None:
    points = [contact(2.0, force=30.0), contact(2.0, force=40.0), contact(2.0, body="ball"), contact(2.1, force=9.0)]
    assert judged(NoCollision(), trace([2.0], contacts=points)).message.endswith("with 70 N in that physics step")
    hard = trace([2.0], contacts=[contact(2.0, force=1234.5)])
    assert judged(NoCollision(), hard).message.endswith("with 1234 N in that physics step")


def test_the_ground_never_counts() -> None:
    grounded = trace([1.0], contacts=[contact(1.0, body="ground")])
    assert judged(NoCollision(), grounded).passed
    assert judged(NoCollision(allow=("ground",)), grounded).passed


def test_a_link_called_ground_is_no_ground() -> None:
    assert not judged(NoCollision(), trace([1.0], contacts=[contact(1.0, link="ground")])).passed


@pytest.mark.parametrize(
    ("allow", "first"),
    [
        ((), "base_footprint"),
        (("base_footprint",), "base_scan"),
        (("base_footprint", "base_scan"), None),
        (("wall",), None),
        (("ball",), "base_footprint"),
    ],
)
def test_what_is_allowed_does_not_count(allow: tuple[str, ...], first: str | None) -> None:
    verdict = judged(NoCollision(allow=allow), TOUCHED)
    assert verdict.passed is (first is None)
    assert verdict.message.startswith(f"{first} touched" if first else "touched nothing")


def test_names_that_are_not_there_are_problems() -> None:
    spec = NoCollision(allow=("wall", "wal", "base_scan", "ground"))
    assert [(path, message.partition(" (")[0]) for path, message in spec.problems(scene())] == [
        (("allow", 1), "'wal' is neither an object nor a link; did you mean 'wall'?")
    ]


def test_only_the_first_unknown_names_are_told_what_there_is() -> None:
    told = [message for _, message in NoCollision(allow=("wal",) * 20).problems(scene())]
    assert ["(allowed: " in message for message in told] == [True] * 10 + [False] * 10


def test_a_contact_without_a_force_is_told_as_such() -> None:
    stuck = contact(0.3, force=0.0)._replace(has_force=False)
    seen = trace([0.1, 0.2, 0.3], contacts=[stuck])
    verdict = judged(NoCollision(), seen)
    assert not verdict.passed
    assert verdict.message.endswith("at (1.00, 0.25, 0.10) m, with no computed force (neither gives way)")
    assert [signal.name for signal in NoCollision().signals(scene(), START, seen)] == ["touching something"]
    hard = trace([0.1, 0.2, 0.3], contacts=[stuck, contact(0.3)])
    assert len(NoCollision().signals(scene(), START, hard)) == 2


WALL = ClearanceWatch(bodies=("wall",))
FAR, NEAR = Nearness(1.0, 2.0, "base_scan", "wall"), Nearness(2.0, 0.5, "base_scan", "wall")


def test_the_least_of_what_was_and_what_comes_is_kept() -> None:
    told = replace(trace([1.0, 2.0]), clearances={WALL: ClearanceRecord.of([FAR, NEAR])})
    assert nearest_of(told, WALL, None) == NEAR
    nearer = Nearness(0.5, 0.25, "base_scan", "wall")
    assert nearest_of(told, WALL, nearer) == nearer


def test_what_is_not_told_changes_nothing() -> None:
    nothing = replace(trace([1.0]), clearances={WALL: ClearanceRecord.of([])})
    assert nearest_of(nothing, WALL, FAR) == FAR
    assert nearest_of(trace([1.0]), WALL, FAR) == FAR
    assert nearest_of(nothing, None, None) is None
