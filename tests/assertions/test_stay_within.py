"""The robot does not leave a box."""

from __future__ import annotations

from sim_action.assertions.stay_within import StayWithin
from sim_action.state.verdict import Verdict
from tests.traces import judged, trace

CURVE = trace([1.0, 2.0, 3.0], x=[0.5, 1.0, 1.5], y=[0.0, -0.5, -2.0])


def test_the_nearest_face_speaks_if_all_hold() -> None:
    assert judged(StayWithin(x=(-1.0, 2.0), y=(-3.0, 3.0)), CURVE) == Verdict(
        True, 1.5, 2.0, 0.5, "m", 3.0, "stayed within bounds; closest to x = 2 m with x = 1.5 m at 3.00 s"
    )


def test_a_lower_face_is_left_downwards() -> None:
    assert judged(StayWithin(y=(-0.25, 1.0)), CURVE) == Verdict(
        False, -0.5, -0.25, -0.25, "m", 2.0, "crossed the bound y = -0.25 m: y = -0.5 m at 2.00 s"
    )


def test_the_face_that_was_passed_first_speaks_though_another_was_passed_by_more() -> None:
    verdict = judged(StayWithin(x=(0.0, 0.75), y=(-1.0, 1.0)), CURVE)
    assert (verdict.time, verdict.limit) == (2.0, 0.75)


def test_a_face_belongs_to_the_box_and_an_axis_left_out_is_free() -> None:
    assert judged(StayWithin(x=(0.5, 1.5)), CURVE).margin == 0.0
    assert judged(StayWithin(z=(-0.1, 0.1)), CURVE).passed


def test_a_hair_past_a_bound_is_told_apart_from_it() -> None:
    verdict = judged(StayWithin(x=(-1.0, 1.0)), trace([1.0], x=[1.00001]))
    assert verdict.message == "crossed the bound x = 1 m: x = 1.00001 m at 1.00 s"
