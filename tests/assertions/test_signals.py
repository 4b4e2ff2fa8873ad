"""What each assertion looked at over time: the curves, with their names, units and limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions import Assertion
from sim_action.assertions.clearance import Clearance
from sim_action.assertions.combined import AllOf, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.effort import Effort, Energy
from sim_action.assertions.follow_path import FollowPath, PathEnd, PathPoint
from sim_action.assertions.joint import JointReading, JointWithin
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.odometry_error import OdometryError
from sim_action.assertions.reach import FinalPose, Reach
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled, StopsBefore
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.assertions.user_assertion import UserAssertion
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ClearanceRecord, ClearanceWatch, Nearness, SensorRecord
from sim_action.state.verdict import Arrow, Circle, Mark, Polygon, Polyline, Signal, box
from tests.assertions.test_cuts import SPECS, random_trace
from tests.soak import examples
from tests.traces import START, WHEELS, contact, expectation, scene, trace

RATE = 240
FACING = Arrow(3.0, 0.0, 0.5, tolerance=math.radians(5))
STEP = 1 / RATE
LEFT = WHEELS[0]
WAY = trace([0.0, 1.0, 2.0], x=[0.0, 3.0, 3.0], y=[0.0, 0.0, 4.0], yaw=[0.0, 0.5, 1.0], speed=[0.0, 3.0, 4.0])
STRAIGHT = (PathPoint(x=0, y=0), PathPoint(x=3, y=0))
Curve = tuple[str, str, list[float], float | None, float | None]


def signals(assertion: Assertion, seen: Trace = WAY) -> tuple[Signal, ...]:
    return assertion.signals(scene(), START, seen)


def told(signal: Signal) -> Curve:
    return signal.name, signal.unit, [round(value, 9) for value in signal.values.tolist()], signal.lower, signal.upper


@pytest.mark.parametrize(
    ("assertion", "curves"),
    [
        (Travel(at_least=2.0, at_most=6.0), [("travelled", "m", [0.0, 3.0, 5.0], 2.0, 6.0)]),
        (Reach(x=3, y=0, tolerance=0.25), [("distance to (3, 0)", "m", [3.0, 0.0, 4.0], None, 0.25)]),
        (
            Reach(x=3, y=0, yaw=0.5, tolerance=0.25, yaw_tolerance=0.125),
            [
                ("distance to (3, 0)", "m", [3.0, 0.0, 4.0], None, 0.25),
                ("heading error", "rad", [0.5, 0.0, 0.5], None, 0.125),
            ],
        ),
        (Upright(max_tilt=0.5), [("tilt", "rad", [0.0, 0.0, 0.0], None, 0.5)]),
        (
            MaxSpeed(linear=3.5, angular=1.0),
            [("speed", "m/s", [0.0, 3.0, 4.0], None, 3.5), ("turn rate", "rad/s", [0.0, 0.0, 0.0], None, 1.0)],
        ),
        (StayWithin(y=(-1.0, 2.0)), [("y", "m", [0.0, 0.0, 4.0], -1.0, 2.0)]),
        (PathLength(at_most=6.0), [("path length", "m", [0.0, 3.0, 7.0], None, 6.0)]),
        (FinalPose(y=0.0, tolerance=0.25), [("distance to y = 0 m", "m", [0.0, 0.0, 4.0], None, 0.25)]),
        (FinalPose(yaw=0.5, yaw_tolerance=0.25), [("heading error", "rad", [0.5, 0.0, 0.5], None, 0.25)]),
        (
            FollowPath(path=STRAIGHT, max_error=1.0, rms=2.0),
            [
                ("distance from the path", "m", [0.0, 0.0, 4.0], None, 1.0),
                ("RMS distance from the path", "m", [0.0, 0.0, round(4 / math.sqrt(3), 9)], None, 2.0),
            ],
        ),
        (
            Settled.model_validate({"for": 1.0, "speed": 3.0}),
            [
                ("time at rest", "s", [0.0, 1.0, 0.0], 1.0, None),
                ("speed", "m/s", [0.0, 3.0, 4.0], None, 3.0),
                ("turn rate", "rad/s", [0.0, 0.0, 0.0], None, math.radians(1)),
            ],
        ),
        (
            Stl(formula="always[0 s, 1 s] (speed < 2 m/s) and not (eventually (x + 1 m > abs(y)))"),
            [
                ("speed", "m/s", [0.0, 3.0, 4.0], None, 2.0),
                ("x + 1 m - abs(y)", "m", [1.0, 4.0, 0.0], None, 0.0),
                ("robustness", "", [-1.0, -4.0, -4.0], 0.0, None),
            ],
        ),
        (
            Stl(formula="x > 1 m implies y > 2 m"),
            [
                ("x", "m", [0.0, 3.0, 3.0], None, 1.0),
                ("y", "m", [0.0, 0.0, 4.0], 2.0, None),
                ("robustness", "m", [1.0, 1.0, 1.0], 0.0, None),
            ],
        ),
        (Negation(part=Travel(at_least=2.0)), [("travelled", "m", [0.0, 3.0, 5.0], None, 2.0)]),
        (
            AllOf(parts=(Travel(at_least=2.0), Upright(max_tilt=0.5))),
            [("travelled", "m", [0.0, 3.0, 5.0], 2.0, None), ("tilt", "rad", [0.0, 0.0, 0.0], None, 0.5)],
        ),
        (UserAssertion.model_validate("checks.py:Check"), []),
    ],
    ids=lambda value: value.title if isinstance(value, Assertion) else "",
)
def test_curves_have_names_units_limits_and_the_values_up_to_each_moment(
    assertion: Assertion, curves: list[Curve]
) -> None:
    found = signals(assertion)
    assert [told(signal) for signal in found] == curves
    assert all(signal.time.tolist() == [0.0, 1.0, 2.0] for signal in found)


DRIVEN = trace([0.0, 0.5, 1.0], position=[0.0, 1.0, 3.0], velocity=[0.0, 2.0, -4.0], effort=[0.0, -3.0, 0.0])


@pytest.mark.parametrize(
    ("assertion", "curves"),
    [
        (JointReading(name=LEFT, at_least=2.0), [(f"{LEFT} position", "rad", [0.0, 1.0, 3.0], 2.0, None)]),
        (
            JointReading(name=LEFT, reading="velocity", near=1.0, tolerance=0.5),
            [(f"{LEFT} velocity from 57.3 deg/s", "rad/s", [1.0, 1.0, 5.0], None, 0.5)],
        ),
        (
            JointWithin(position={LEFT: (-1.0, 2.0)}, effort={LEFT: (-2.0, 2.0)}),
            [(LEFT, "rad", [0.0, 1.0, 3.0], -1.0, 2.0), (f"{LEFT} effort", "N m", [0.0, -3.0, 0.0], -2.0, 2.0)],
        ),
        (
            Effort(joints=(LEFT,), at_most=2.0, rms_at_most=1.0),
            [
                (f"{LEFT} effort", "N m", [0.0, 3.0, 0.0], None, 2.0),
                (f"{LEFT} RMS effort", "N m", [0.0, round(math.sqrt(4.5), 9), round(math.sqrt(3), 9)], None, 1.0),
            ],
        ),
        (Energy(at_most=2.0, braking="costs"), [("work", "J", [0.0, 1.5, 1.5], None, 2.0)]),
        (
            Settled.model_validate({"for": 1.0, "joints": True}),
            [
                ("time at rest", "s", [0.0, 0.0, 0.0], 1.0, None),
                ("speed", "m/s", [0.0, 0.0, 0.0], None, 0.01),
                ("turn rate", "rad/s", [0.0, 0.0, 0.0], None, math.radians(1)),
                (f"{LEFT} speed", "rad/s", [0.0, 2.0, 4.0], None, math.radians(1)),
                (f"{WHEELS[1]} speed", "rad/s", [0.0, 0.0, 0.0], None, math.radians(1)),
            ],
        ),
    ],
    ids=lambda value: value.title if isinstance(value, Assertion) else "",
)
def test_joints_are_shown_in_their_own_units(assertion: Assertion, curves: list[Curve]) -> None:
    assert [told(signal) for signal in signals(assertion, DRIVEN)] == curves


def test_a_path_that_was_followed_to_its_end_is_shown_up_to_there() -> None:
    error, remaining = signals(FollowPath(path=STRAIGHT, end=PathEnd(tolerance=0.5)))
    assert told(error) == ("distance from the path", "m", [0.0, 0.0], None, None)
    assert told(remaining) == ("distance to the end of the path", "m", [3.0, 0.0], None, 0.5)


TOUCHED = trace(
    [0.0, 24 * STEP, 48 * STEP],
    contacts=[contact(time * STEP, "wall", force=force) for time, force in [(30, 5.0), (30, 7.0), (31, 4.0)]],
)


def test_what_is_touched_is_shown_at_the_steps_that_touch() -> None:
    touching, force = signals(NoCollision(), TOUCHED)
    assert [round(time * RATE, 6) for time in touching.time.tolist()] == [0, 24, 29, 30, 31, 32, 48]
    assert told(touching) == ("touching something", "contacts", [0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0], None, 0.0)
    assert [round(time * RATE, 6) for time in force.time.tolist()] == [0, 24, *range(30, 44), 48]
    mean = [0.0, 0.0, 1.0, *[round(4 / 3, 9)] * 11, round(1 / 3, 9), 0.0, 0.0]
    assert told(force) == ("contact force, mean over 50 ms", "N", mean, None, None)


def test_without_a_contact_it_is_shown_at_the_moments_of_the_trace() -> None:
    (touching, _) = signals(NoCollision(allow=("wall",)), TOUCHED)
    assert touching.time.tolist() == TOUCHED.time.tolist()
    assert touching.values.tolist() == [0.0, 0.0, 0.0]


def test_a_touch_that_is_wanted_shows_what_was_asked_of_it_first() -> None:
    watch = ClearanceWatch(None, ("wall",))
    near = ClearanceRecord.of([Nearness(0.0, 2.0, "base_scan", "wall"), Nearness(24 * STEP, 1.0, "base_scan", "wall")])
    seen = replace(TOUCHED, clearances={watch: near})
    names = [signal.name for signal in signals(Touch.model_validate({"with": "wall"}), seen)]
    assert names == ["touching wall", "force on wall, mean over 50 ms", "least distance to wall"]
    limits = {"with": "wall", "impulse": {"at_least": 0.02, "at_most": 0.1}, "window": 0.025}
    impulse, force, *_ = signals(Touch.model_validate(limits), seen)
    assert (impulse.name, impulse.unit) == ("impulse on wall within 25 ms", "N s")
    assert (impulse.lower, impulse.upper) == (0.02, 0.1)
    assert impulse.values.max() == pytest.approx(16 * STEP)
    assert (force.name, force.values.max()) == ("force on wall, mean over 25 ms", pytest.approx(16 / 6))
    limits = {"with": "wall", "at_most": 20.0, "for": 0.1}
    lasting, pressing, touching, nearest = signals(Touch.model_validate(limits), seen)
    assert told(lasting) == ("time touching wall", "s", [0.0, 0.0, round(STEP, 9)], 0.1, None)
    assert told(pressing)[3:] == (None, 20.0)
    assert told(touching)[3:] == (1.0, None)
    assert told(nearest) == ("least distance to wall", "m", [2.0, 1.0, 1.0], None, None)
    # A robot that never touches has lasted for no time.
    lasting, *_ = signals(Touch.model_validate({"with": "ball", "for": 0.1}), TOUCHED)
    assert lasting.values.tolist() == [0.0, 0.0, 0.0]


NEAR = [Nearness(1.0, 3.0, "base_scan", "wall"), Nearness(2.0, 1.0, "base_scan", "wall")]


def test_clearance_is_the_least_so_far() -> None:
    spec = Clearance(at_least=0.5, at_most=2.0, to=("wall",))
    seen = replace(trace([0.0, 1.0, 2.0, 3.0]), clearances={spec.watch: ClearanceRecord.of(NEAR)})
    (signal,) = signals(spec, seen)
    assert told(signal) == ("least distance to wall", "m", [3.0, 1.0, 1.0], 0.5, 2.0)
    assert signal.time.tolist() == [1.0, 2.0, 3.0]
    # One that nothing was told of has no curve.
    assert signals(Clearance(at_least=0.5)) == ()


def test_a_gap_is_shown_as_far_as_it_is_known_and_ends_at_a_touch() -> None:
    spec = StopsBefore.model_validate({"body": "wall", "gap": (0.5, 2.0), "for": 1.0})
    told_of = {spec.far: ClearanceRecord.of(NEAR), spec.near: ClearanceRecord.of(NEAR[1:])}
    seen = replace(trace([0.0, 1.0, 2.0, 3.0], speed=[1.0, 1.0, 0.0, 0.0]), clearances=told_of)
    gap, rest = signals(spec, seen)
    assert told(gap) == ("gap to wall", "m", [3.0, 1.0], 0.5, 2.0)
    assert told(rest) == ("time at rest", "s", [0.0, 0.0, 0.0, 0.0], 1.0, None)
    gap, _ = signals(spec, replace(seen, contacts=(contact(1.5), contact(2.0))))
    assert (gap.time.tolist(), gap.values.tolist()) == ([1.0, 1.5], [3.0, 0.0])


LEAST = SensorReading(name="scan", reading="ranges", which="min", at_least=0.5)


def test_readings_come_at_the_rate_of_their_sensor_with_gaps_where_nothing_is_in_range() -> None:
    record = SensorRecord("lidar", np.array([0.25, 0.75]), {"ranges": np.array([[1.0, 2.0], [np.inf, np.inf]])})
    (signal,) = signals(LEAST, replace(WAY, sensors={"scan": record}))
    assert (signal.name, signal.unit, signal.lower) == ("min of scan's ranges", "m", 0.5)
    assert signal.time.tolist() == [0.25, 0.75]
    np.testing.assert_array_equal(signal.values, [1.0, np.nan])


def test_odometry_is_shown_as_its_errors() -> None:
    columns: dict[str, Any] = {
        "position_xyz": np.array([[0.0, 0.0, 0.0], [3.0, 1.0, 0.0]]),
        "orientation_xyzw": np.array([quaternion_from_rpy(0, 0, yaw) for yaw in (0.0, 0.5)]),
    }
    record = SensorRecord("odometry", np.array([0.0, 1.0]), columns)
    found = signals(OdometryError(position=0.5, yaw=1.0, drift=0.25), replace(WAY, sensors={"odometry": record}))
    assert [told(signal) for signal in found] == [
        ("position error", "m", [0.0, 1.0], None, 0.5),
        ("heading error", "rad", [0.0, 0.0], None, 1.0),
        ("drift", "", [0.0, round(1 / 3, 9)], None, 0.25),
    ]


def test_a_sensor_that_told_nothing_has_no_curve() -> None:
    assert signals(OdometryError(position=0.5)) == ()
    assert signals(LEAST) == ()


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: f"{spec.title}")
def test_every_assertion_has_a_curve_of_what_the_robot_does(spec: Assertion) -> None:
    found = signals(spec, random_trace(1))
    assert found
    assert any(signal.lower is not None or signal.upper is not None for signal in found)
    for signal in found:
        assert signal.time.shape == signal.values.shape
        assert np.all(np.diff(signal.time) > 0)
        assert not np.isinf(signal.values).any()


STEPS = st.integers(0, 65).map(lambda step: step * STEP)


@examples(100)
@given(st.sampled_from([spec for spec in SPECS if spec.key != "stops_before"]), st.integers(0, 999), STEPS, STEPS)
def test_what_a_verdict_measures_is_on_a_curve_against_the_same_limit(
    spec: Assertion, seed: int, after: float, before: float
) -> None:
    """At the moment of the verdict; gaps that are drawn at random do not fit touches that are."""
    seen = random_trace(seed)
    verdict = Window(spec.monitor(scene(), START), after, before).observe(seen).verdict()
    if verdict.measured is None or verdict.time is None:
        return
    found = expectation(spec, after=after, before=before).signals(scene(), START, seen)
    alike = [one for one in found if one.unit == verdict.unit and verdict.limit in (one.lower, one.upper)]
    values = [float(np.interp(verdict.time, signal.time, signal.values)) for signal in alike]
    assert min(abs(value - verdict.measured) for value in values) < 1e-9


def test_what_adds_up_begins_with_the_window_and_one_that_never_opened_shows_none_of_it() -> None:
    (signal,) = expectation(PathLength(at_most=6.0), after=1.0).signals(scene(), START, WAY)
    assert (signal.time.tolist(), signal.values.tolist(), signal.start) == ([1.0, 2.0], [0.0, 4.0], 1.0)
    assert expectation(PathLength(at_most=6.0), after=5.0).signals(scene(), START, WAY) == ()


@pytest.mark.parametrize("assertion", [FinalPose(x=0.0), Effort(rms_at_most=1.0), Stl(formula="always (x > 0 m)")])
def test_what_is_judged_at_the_end_has_its_limit_there(assertion: Assertion) -> None:
    signal = expectation(assertion, before=1.5).signals(scene(), START, WAY)[-1]
    assert (signal.start, signal.end) == (1.5, 1.5)


@pytest.mark.parametrize(
    ("options", "window"),
    [({}, (0.0, 2.0)), ({"after": 0.5, "before": 1.5}, (0.5, 1.5)), ({"before": 9.0}, (0.0, 2.0))],
)
def test_limits_hold_in_the_window_of_the_expectation(options: dict[str, float], window: tuple[float, float]) -> None:
    (signal,) = expectation(Upright(), **options).signals(scene(), START, WAY)
    assert (signal.start, signal.end) == window
    assert signal.time.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("assertion", "marks"),
    [
        (Travel(at_least=2.0, at_most=6.0), (Circle(0.0, 0.0, 2.0), Circle(0.0, 0.0, 6.0))),
        (Reach(x=3, y=0, tolerance=0.25), (Circle(3.0, 0.0, 0.25),)),
        (Reach(x=3, y=0, yaw=0.5, tolerance=0.25), (Circle(3.0, 0.0, 0.25), FACING)),
        (StayWithin(x=(0, 1), y=(2, 3)), (Polygon(((0, 2), (1, 2), (1, 3), (0, 3))),)),
        (StayWithin(x=(0, 1)), (Polyline(((0, -5, 0), (0, 5, 0))), Polyline(((1, -5, 0), (1, 5, 0))))),
        (StayWithin(x=(0, 1), y=(2, 3), z=(0, 1)), tuple(box((0, 1), (2, 3), (0, 1)))),
        (StayWithin(z=(0, 1)), ()),
        (Upright(max_tilt=math.radians(5)), ()),
        (FinalPose(x=3, y=0, yaw=0.5, tolerance=0.25), (Circle(3.0, 0.0, 0.25), FACING)),
        (FinalPose(x=3), (Polyline(((3, -5, 0), (3, 5, 0))),)),
        (FinalPose(x=3, relative=True), ()),
        (FollowPath(path=STRAIGHT, end=PathEnd(tolerance=0.5)), (Polyline(((0, 0, 0), (3, 0, 0))), Circle(3, 0, 0.5))),
        (FollowPath(path=STRAIGHT, max_error=0.2), (Polyline(((0, 0, 0), (3, 0, 0)), tolerance=0.2),)),
        (Negation(part=Reach(x=3, y=0, tolerance=0.25)), (Circle(3.0, 0.0, 0.25),)),
        (AllOf(parts=(Travel(at_least=2.0), Upright())), (Circle(0.0, 0.0, 2.0),)),
    ],
    ids=lambda value: value.title if isinstance(value, Assertion) else "",
)
def test_marks_say_where_it_is(assertion: Assertion, marks: tuple[Mark, ...]) -> None:
    assert expectation(assertion).marks(scene(), START) == marks


@pytest.mark.parametrize(
    ("assertion", "radii"),
    [
        (Clearance(at_least=0.3, to=("ball", "cube")), [0.4]),
        (Clearance(at_least=0.3, at_most=0.5, to=("ball",)), [0.4, 0.6]),
        (StopsBefore(body="ball", gap=(0.0, 0.5)), [0.6]),
    ],
    ids=lambda value: value.title if isinstance(value, Assertion) else "",
)
def test_a_distance_from_bodies_that_do_not_move_is_a_line_around_them(
    assertion: Assertion, radii: list[float]
) -> None:
    marks = assertion.marks(scene(), START)
    assert [max(x for x, _, _ in mark.points) for mark in marks if isinstance(mark, Polyline)] == pytest.approx(radii)


def test_a_place_from_the_start_is_marked_in_the_world() -> None:
    begun = replace(START, pose=Pose((1.0, 2.0, 0.0), quaternion_from_rpy(0.0, 0.0, math.pi / 2)))
    spec = FinalPose(x=3, y=0, yaw=0.0, tolerance=0.25, relative=True)
    circle, arrow = spec.marks(scene(), begun)
    assert isinstance(circle, Circle)
    assert isinstance(arrow, Arrow)
    assert (circle.x, circle.y, arrow.yaw) == pytest.approx((1.0, 5.0, math.pi / 2))
