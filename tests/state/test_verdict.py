"""Curves of expectations, and the windows that their limits hold for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.state.verdict import Arrow, Circle, Judged, Signal, Verdict, box, goal, line, rectangle

TIME = np.array([0.0, 1.0, 2.0])


def curve(lower: float | None = None, upper: float | None = None) -> Signal:
    return Signal("tilt", "rad", TIME, TIME, lower, upper)


def test_the_limits_of_what_must_not_hold_are_on_the_other_side() -> None:
    away = curve(upper=0.5).contrary()
    assert (away.lower, away.upper) == (0.5, None)
    # Without a window, limits hold throughout.
    assert (curve().start, curve().end) == (0.0, math.inf)
    # Limits that hold when all is over hold at the end of the window.
    signal = curve().at_end().within(0.5, 1.5)
    assert (signal.start, signal.end) == (1.5, 1.5)


@pytest.mark.parametrize(
    ("start", "end", "window"), [(0.0, 2.0, (0.0, 2.0)), (0.5, 1.5, (0.5, 1.5)), (3.0, 2.0, (3.0, 3.0))]
)
def test_limits_hold_within_the_window_of_the_expectation(
    start: float, end: float, window: tuple[float, float]
) -> None:
    signal = curve().within(start, end)
    assert (signal.start, signal.end) == window


def test_a_place_to_come_to_is_a_circle_and_a_heading_there_an_arrow() -> None:
    assert list(goal(1.0, 2.0, None, 0.25, None)) == [Circle(1.0, 2.0, 0.25)]
    assert list(goal(1.0, 2.0, 3.0, 0.25, 0.5)) == [Circle(1.0, 2.0, 0.25, 3.0), Arrow(1.0, 2.0, 0.5)]


def test_an_area_goes_round_its_corners_and_a_box_has_all_its_edges() -> None:
    assert rectangle((0.0, 1.0), (2.0, 3.0)).points == ((0.0, 2.0), (1.0, 2.0), (1.0, 3.0), (0.0, 3.0))
    edges = [part for way in box((0, 1), (2, 3), (0, 4)) for part in zip(way.points, way.points[1:], strict=False)]
    assert len({frozenset(edge) for edge in edges}) == 12
    assert {sum(a != b for a, b in zip(*edge, strict=True)) for edge in edges} == {1}
    # A bound of one axis is a line across it.
    assert {x for x, _, _ in line("x", 2.0, (0.0, 1.0)).points} == {2.0}
    assert {y for _, y, _ in line("y", 2.0, (0.0, 1.0)).points} == {2.0}


def test_a_verdict_without_a_moment_is_not_exercised_even_if_it_passed() -> None:
    never = Verdict(True).counted(Judged())
    assert (never.passed, never.status) == (False, "not_exercised")
    assert Verdict(False).counted(Judged()).status == "not_exercised"
    assert Verdict(True, judged=Judged(-1, 0.0, 1.0)).status == "not_exercised"


def test_a_verdict_keeps_its_own_moments_and_else_takes_those_of_the_run() -> None:
    steps, readings = Judged(240, 0.0, 1.0), Judged(2, 0.5, 1.0)
    assert Verdict(True).counted(steps).judged == steps
    assert Verdict(True, judged=readings).counted(steps).judged == readings
    assert Verdict(True, judged=Judged()).counted(steps).status == "not_exercised"
    assert (Verdict(True).status, Verdict(False).status) == ("passed", "failed")


def test_moments_follow_each_other() -> None:
    judged = Judged().followed_by(np.array([0.5, 1.0, 1.5])).followed_by(np.array([])).followed_by(np.array([2.0, 2.5]))
    assert judged == Judged(5, 0.5, 2.5)
