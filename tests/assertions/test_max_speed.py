"""The robot is never faster."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors.windows import Window
from sim_action.core.geometry import Pose, Twist
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world import Physics
from tests.traces import START, judged, monitor, piece, scene, trace

FASTER = trace([1.0, 2.0, 3.0], speed=[0.25, -0.5, 0.75], turn_rate=[0.0, -2.0, 1.0])


def test_backwards_is_a_speed_too_and_turning_has_a_limit_of_its_own() -> None:
    message = "moved with at most 0.75 m/s, limit 1 m/s"
    assert judged(MaxSpeed(linear=1.0), FASTER) == Verdict(True, 0.75, 1.0, 0.25, "m/s", 3.0, message)
    message = "moved with 0.5 m/s at 2.00 s, more than 0.25 m/s"
    assert judged(MaxSpeed(linear=0.25), FASTER) == Verdict(False, 0.5, 0.25, -0.25, "m/s", 2.0, message)
    message = "turned with 114.6 deg/s at 2.00 s, more than 57.3 deg/s"
    assert judged(MaxSpeed(angular=1.0), FASTER) == Verdict(False, 2.0, 1.0, -1.0, "rad/s", 2.0, message)
    # Standing still can be asked for.
    assert judged(MaxSpeed(linear=0.0), trace([1.0])).passed


@pytest.mark.parametrize(
    ("linear", "angular", "unit", "time"),
    [(1.0, 3.0, "m/s", 3.0), (1.0, 1.0, "rad/s", 2.0), (0.3, 3.0, "m/s", 2.0), (0.6, 1.0, "rad/s", 2.0)],
)
def test_of_both_limits_the_one_that_was_broken_first_speaks(
    linear: float, angular: float, unit: str, time: float
) -> None:
    verdict = judged(MaxSpeed(linear=linear, angular=angular), FASTER)
    assert (verdict.unit, verdict.time) == (unit, time)


@pytest.mark.parametrize(("linear", "angular", "unit"), [(1.0, 2.1, "rad/s"), (0.8, 4.0, "m/s"), (100.0, 2.5, "rad/s")])
def test_of_two_limits_that_hold_the_tighter_one_speaks(linear: float, angular: float, unit: str) -> None:
    verdict = judged(MaxSpeed(linear=linear, angular=angular), FASTER)
    assert verdict.passed
    assert verdict.unit == unit


def jumping(*, rate: float = 240.0, **columns: Any) -> Trace:
    """A base at t = 0 and after each of five steps; it stands unless columns are given."""
    return trace([number / rate for number in range(6)], **columns)


THERE, TURNED = [0.0, 0.0, 0.0, 5.0, 5.0, 5.0], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]


def cut(seen: Trace, *ends: int) -> list[Trace]:
    return [piece(seen, first, last) for first, last in itertools.pairwise((0, *ends, len(seen)))]


@pytest.mark.parametrize("ends", [(), (1,), (3,), (2, 4), (1, 2, 3, 4, 5)])
def test_a_jump_that_no_velocity_explains_breaks_it(ends: tuple[int, ...]) -> None:
    watching = monitor(MaxSpeed(linear=1.0))
    for part in cut(jumping(x=THERE), *ends):
        watching = watching.observe(part)
    verdict = watching.verdict()
    assert not verdict.passed
    assert verdict.measured == pytest.approx(1200)
    assert (verdict.limit, verdict.time) == (1.0, 3 / 240)
    assert verdict.message == (
        "jumped 5 m, from (0, 0, 0) to (5, 0, 0) between 0.0083 s and 0.0125 s, while it moved with 0 m/s: "
        "moved with 1200 m/s at 0.01 s, more than 1 m/s"
    )


@pytest.mark.parametrize("first", [0, 1])
def test_a_jump_in_the_first_step_counts_with_and_without_a_row_at_zero(first: int) -> None:
    seen = jumping(x=[0.0, 2.0, 2.0, 2.0, 2.0, 2.0])
    verdict = judged(MaxSpeed(linear=1.0), piece(seen, first, 6))
    assert (verdict.passed, verdict.time) == (False, 1 / 240)
    assert verdict.message.startswith("jumped 2 m, from (0, 0, 0) to (2, 0, 0) between 0.0000 s and 0.0042 s")


def test_a_turn_that_no_turn_rate_explains_breaks_it() -> None:
    verdict = judged(MaxSpeed(angular=1.0), jumping(yaw=TURNED))
    assert verdict.measured == pytest.approx(240)
    assert (verdict.passed, verdict.time) == (False, 3 / 240)
    assert verdict.message.startswith(
        "jumped by 57.3 deg, from roll, pitch, yaw (0 deg, 0 deg, 0 deg) to (0 deg, 0 deg, 57.3 deg) "
        "between 0.0083 s and 0.0125 s, while it turned with 0 deg/s: turned with "
    )


def test_a_jump_in_position_is_no_turn() -> None:
    assert judged(MaxSpeed(angular=1.0), jumping(x=THERE)).passed
    assert judged(MaxSpeed(linear=1.0), jumping(yaw=TURNED)).passed


@pytest.mark.parametrize("ends", [(), (2,), (3,), (4,), (1, 2, 3, 4, 5)])
def test_the_step_to_the_first_moment_of_a_window_counts(ends: tuple[int, ...]) -> None:
    for after, passed in ((3 / 240, False), (4 / 240, True)):
        watching = Window(monitor(MaxSpeed(linear=1.0)), after)
        for part in cut(jumping(x=THERE), *ends):
            watching = watching.observe(part)
        assert watching.verdict().passed == passed


def test_the_first_moment_of_a_window_follows_no_step() -> None:
    """A robot that drove from t = 0 to the begin of a window did not jump."""
    late = trace([2.0, 2.0 + 1 / 240], x=[5.0, 5.0])
    assert judged(MaxSpeed(linear=1.0), late).passed


@given(
    speeds=st.lists(st.floats(-100, 100), min_size=2, max_size=20),
    corrections=st.lists(st.floats(-9e-4, 9e-4), min_size=20, max_size=20),
    rate=st.sampled_from([50.0, 240.0, 1000.0]),
    implicit=st.booleans(),
)
def test_a_motion_that_velocities_explain_is_judged_by_them_alone(
    speeds: list[float], corrections: list[float], rate: float, implicit: bool
) -> None:
    x, at = [], 0.0
    for before, after, correction in zip([speeds[0], *speeds], speeds, corrections, strict=False):
        at += (after if implicit else (before + after) / 2) / rate + correction / 2
        x.append(at)
    seen = trace([step / rate for step in range(1, len(x) + 1)], x=x, speed=speeds)
    start = replace(START, pose=Pose((x[0] - speeds[0] / rate, 0.0, 0.0)), twist=Twist((speeds[0], 0.0, 0.0)))
    where = replace(scene(), physics=Physics(rate=rate))
    watching = monitor(MaxSpeed(linear=200.0), start, where).observe(seen)
    assert watching.verdict().measured == pytest.approx(max(map(abs, speeds)), abs=1e-9)


@given(length=st.floats(0.02, 100), speed=st.floats(0, 1), step=st.integers(1, 5))
def test_a_jump_breaks_any_limit_below_its_speed(length: float, speed: float, step: int) -> None:
    x = [number * speed / 240 + (length if number >= step else 0.0) for number in range(6)]
    verdict = judged(MaxSpeed(linear=2.0), jumping(x=x, speed=[speed] * 6))
    assert not verdict.passed
    assert verdict.time == step / 240
    assert verdict.measured == pytest.approx(length * 240 + speed)


def test_the_curve_of_a_decimated_trace_shows_the_jump() -> None:
    (curve,) = MaxSpeed(linear=1.0).signals(scene(), START, jumping(rate=30.0, x=THERE))
    assert curve.values.tolist() == pytest.approx([0, 0, 0, 150, 0, 0])
