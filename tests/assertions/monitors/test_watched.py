"""Links and frames that assertions watch, against formulas for a burger that moves at random."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.combined import AllOf
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.follow_path import FollowPath, PathEnd, PathPoint
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors.watched import MotionAssertion
from sim_action.assertions.reach import FinalPose, Reach, TargetOrientation
from sim_action.assertions.settled import Settled
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.upright import Upright
from sim_action.core.geometry import quaternion_from_rpy
from sim_action.core.lazy_numpy import FloatArray
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from tests.assertions.test_cuts import random_trace
from tests.soak import examples
from tests.traces import START, judged, monitor, rotation_matrices, scene, trace

SCAN, WHEEL, ROOT = "base_scan", "wheel_left_link", "base_footprint"
# Places in the base frame, as the file of the model has them, in m.
SCAN_AT, WHEEL_AT = np.array((-0.032, 0.0, 0.182)), np.array((0.0, 0.080, 0.033))
PATH = (PathPoint(x=0, y=0), PathPoint(x=3, y=0))
seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-7.0, 7.0)


def about_y(angle: FloatArray) -> FloatArray:
    zero, one = np.zeros_like(angle), np.ones_like(angle)
    cosine, sine = np.cos(angle), np.sin(angle)
    rows = [[cosine, zero, sine], [zero, one, zero], [-sine, zero, cosine]]
    return np.moveaxis(np.array(rows), -1, 0)


def scan_in_world(seen: Trace) -> FloatArray:
    found: FloatArray = seen.base_position_xyz + rotation_matrices(seen.base_orientation_xyzw) @ SCAN_AT
    return found


def scan_in_wheel(seen: Trace) -> FloatArray:
    back = about_y(-seen.joint_position[:, 0])
    found: FloatArray = np.einsum("tij,j->ti", back, SCAN_AT - WHEEL_AT)
    return found


def curves(spec: MotionAssertion, seen: Trace) -> list[FloatArray]:
    return [signal.values for signal in spec.signals(scene(), START, seen)]


@examples(20)
@given(seeds, angles, angles, angles)
def test_errors_of_a_pose_in_the_world_and_in_a_frame(seed: int, roll: float, pitch: float, yaw: float) -> None:
    seen = random_trace(seed)
    target = TargetOrientation(roll=roll, pitch=pitch, yaw=yaw)
    wanted = rotation_matrices(np.array([quaternion_from_rpy(roll, pitch, yaw)]))[0]
    in_wheel = about_y(-seen.joint_position[:, 0])
    for frame, places, turned in (
        ("world", scan_in_world(seen), rotation_matrices(seen.base_orientation_xyzw)),
        (WHEEL, scan_in_wheel(seen), in_wheel),
    ):
        spec = Reach(link=SCAN, frame=frame, x=0.3, y=-0.2, z=0.1, orientation=target)
        distance, angle = curves(spec, seen)
        np.testing.assert_allclose(distance, np.linalg.norm(places - (0.3, -0.2, 0.1), axis=1), atol=1e-12)
        # The trace of a rotation matrix is 1 + 2 cos(angle).
        cosines = (np.einsum("tij,ij->t", turned, wanted) - 1) / 2
        np.testing.assert_allclose(np.cos(angle), cosines, atol=1e-12)


@examples(20)
@given(seeds)
def test_speeds_relative_to_a_frame_that_turns(seed: int) -> None:
    seen = random_trace(seed)
    spec = MaxSpeed(link=SCAN, frame=WHEEL, linear=100.0, angular=100.0)
    # Sudden changes of the random positions are jumps; the stored trace has mean values for them.
    opened: Any = spec.monitor(scene(), START)
    rates = seen.joint_velocity[:, 0]
    speed = np.abs(rates) * np.hypot(*(SCAN_AT - WHEEL_AT)[[0, 2]])
    linear, angular = (one.motion for one in opened.monitor.monitors)
    looked = opened.watched.seen(seen)
    np.testing.assert_allclose(looked.speed, speed, atol=1e-12)
    np.testing.assert_allclose(looked.turn_rate, np.abs(rates), atol=1e-12)
    assert linear == angular


def test_the_message_names_link_and_frame() -> None:
    turning = trace([1.0, 2.0], x=[0.0, 1.0], yaw=[0.0, math.pi / 2])
    there = judged(Reach(link=SCAN, x=1.0, y=-0.032, z=0.182, tolerance=0.01), turning)
    assert there.message == "base_scan came within 0 m of (1, -0.032, 0.182) in 2.00 s"
    spec = Reach(link=SCAN, frame="base", x=0.5, y=0.0)
    assert spec.title == "reach of base_scan in base (0.5, 0) within 0.05 m"
    message = "base_scan came no closer than 0.532 m to (0.5, 0) in base in 2.0 s; closest at 1.00 s"
    assert judged(spec, turning).message == message
    in_wheel = judged(Reach(frame=WHEEL, x=0.0, y=-0.08), turning)
    assert in_wheel.message == "the base came within 0 m of (0, -0.08) in wheel_left_link in 1.00 s"


MESSAGES: list[tuple[MotionAssertion, str, str]] = [
    (
        Reach(link=SCAN, x=0, y=0, orientation=TargetOrientation(yaw=1.0)),
        "reach of base_scan (0, 0) at roll 0 deg, pitch 0 deg, yaw 57.3 deg within 0.05 m",
        "base_scan came within 0.032 m of (0, 0), 0 deg off its orientation, in 2.00 s",
    ),
    (
        FinalPose(link=SCAN, frame="base", z=0.182, yaw=0.0),
        "final_pose of base_scan in base z = 0.182 m facing 0 deg within 0.05 m",
        "base_scan ended 0 m from z = 0.182 m in base, 0 deg off its heading at 2.00 s",
    ),
    (
        StayWithin(link=SCAN, frame=WHEEL, z=(-1, 1)),
        "stay_within of base_scan in wheel_left_link z -1 m to 1 m",
        "base_scan in wheel_left_link stayed within bounds; closest to z = 1 m with z = 0.149 m at 1.00 s",
    ),
    (
        MaxSpeed(link=SCAN, linear=0.25),
        "max_speed of base_scan 0.25 m/s",
        "base_scan moved with 0.5 m/s at 1.00 s, more than 0.25 m/s",
    ),
    (
        Travel(link=SCAN, at_most=0.1),
        "travel of base_scan at most 0.1 m",
        "base_scan travelled at most 0.03068 m, limit 0.1 m",
    ),
    (
        PathLength(link=SCAN, at_most=0.1),
        "path_length of base_scan at most 0.1 m",
        "base_scan covered at most 0.03068 m, limit 0.1 m",
    ),
    (
        Upright(link=SCAN, frame=WHEEL, max_tilt=0.1),
        "upright of base_scan in wheel_left_link within 5.73 deg",
        "base_scan in wheel_left_link tilted by 28.65 deg at 2.00 s, more than 5.73 deg",
    ),
    (
        FollowPath(link=SCAN, path=PATH, max_error=0.5),
        "follow_path of base_scan max error 0.5 m",
        "base_scan: at most 0.032 m off the path at 1.00 s, 0 m along it, limit 0.5 m",
    ),
    (
        Settled.model_validate({"link": SCAN, "for": 0.5, "speed": 1.0}),
        "settled of base_scan for 0.5 s",
        "base_scan: at rest from 1.00 s on, for 1 s",
    ),
]


@pytest.mark.parametrize(("spec", "title", "message"), MESSAGES, ids=lambda value: getattr(value, "key", ""))
def test_titles_and_messages(spec: MotionAssertion, title: str, message: str) -> None:
    still = trace([1.0, 2.0], yaw=[0.0, 1.0], speed=[0.5, 0.5], position=[0.0, 0.5])
    assert (spec.title, judged(spec, still).message) == (title, message)


def test_a_miss_says_how_the_link_was_turned() -> None:
    turned = trace([1.0, 2.0], x=[1.0, 2.0], yaw=[0.5, 1.0], position=[0.25, 0.25])
    upside = TargetOrientation(roll=2.0)
    assert judged(Reach(link=SCAN, frame=WHEEL, x=0, y=0, orientation=upside), turned).message == (
        "base_scan came no closer than 0.1049 m to (0, 0) in wheel_left_link, 115.2 deg off its orientation, in 2.0 s; "
        "closest at 1.00 s with roll 0 deg, pitch -14.32 deg, yaw 0 deg"
    )
    assert judged(FinalPose(link=SCAN, orientation=upside), turned).message == (
        "base_scan ended 123.4 deg off its orientation at 2.00 s with roll 0 deg, pitch 0 deg, yaw 57.3 deg; "
        "it was closest at 1.00 s"
    )
    assert judged(FinalPose(x=1.0, orientation=upside), turned).message == (
        "ended 1 m from x = 1 m, 123.4 deg off its orientation at 2.00 s with roll 0 deg, pitch 0 deg, yaw 57.3 deg; "
        "it was closest at 1.00 s"
    )
    right = TargetOrientation(yaw=1.0)
    for spec in (FinalPose(orientation=right), FinalPose(x=9.0, orientation=right), Reach(x=9, y=0, orientation=right)):
        assert "with roll" not in judged(spec, turned).message
    # Without a step, there is no subject.
    assert judged(Reach(link=SCAN, x=0, y=0), trace([])).message == "no physics step to measure"


def test_a_path_in_space_has_heights() -> None:
    rising = tuple(PathPoint(x=x, y=0, z=z) for x, z in ((-0.032, 0.182), (3 - 0.032, 4.182)))
    climbing = trace([1.0, 2.0, 3.0], x=[0.0, 1.5, 3.0], z=[0.0, 2.0, 4.0])
    spec = FollowPath(link=SCAN, path=rising, max_error=1e-9, end=PathEnd(tolerance=1e-9))
    assert judged(spec, climbing).passed
    # 1.5 m ahead at the start's height: 3-4-5.
    verdict = judged(FollowPath(link=SCAN, path=rising, max_error=1.0), trace([1.0], x=[1.5]))
    assert not verdict.passed
    assert verdict.measured == pytest.approx(1.5 * 4 / 5)
    assert judged(FollowPath(link=SCAN, path=PATH, max_error=0.1), climbing).passed
    # The base does, too.
    base = tuple(PathPoint(x=x, y=0, z=z) for x, z in ((0, 0), (3, 4)))
    assert judged(FollowPath(path=base, max_error=1e-9), climbing).passed


def test_relative_to_the_start_of_a_link() -> None:
    turned = START.__class__(START.time, START.pose.__class__((1, 2, 0), quaternion_from_rpy(0, 0, 1)), START.twist, {})
    lifted = trace([1.0], x=[1.0], y=[2.0], z=[0.5], yaw=[1.25])
    moved = scan_in_world(lifted)[0] - scan_in_world(trace([0.0], x=[1.0], y=[2.0], yaw=[1.0]))[0]
    x, y, z = moved.tolist()
    for spec in (
        FinalPose(link=SCAN, relative=True, x=x, y=y, z=z, tolerance=1e-9),
        FinalPose(link=SCAN, relative=True, yaw=0.25, yaw_tolerance=1e-9),
        FinalPose(link=SCAN, relative=True, orientation=TargetOrientation(yaw=0.25, tolerance=1e-7)),
        FinalPose(relative=True, orientation=TargetOrientation(yaw=0.25, tolerance=1e-7)),
    ):
        assert judged(spec, lifted, turned).passed, judged(spec, lifted, turned).message


@pytest.mark.parametrize(
    ("keys", "path", "problem"),
    [
        ({"link": "base_scam"}, ("link",), "the robot has no link 'base_scam'; did you mean 'base_scan'?"),
        ({"frame": "wheel_left"}, ("frame",), "there is no frame 'wheel_left'"),
        ({"link": SCAN, "frame": SCAN}, ("frame",), "'base_scan' never moves in its own frame"),
        ({"frame": "base"}, ("frame",), "'base_footprint' never moves in its own frame"),
        ({"frame": ROOT}, ("frame",), "'base_footprint' never moves in its own frame"),
    ],
)
def test_unknown_links_and_frames(keys: dict[str, Any], path: tuple[str, ...], problem: str) -> None:
    spec = Reach.model_validate({"x": 0, "y": 0, **keys})
    ((found, message),) = AllOf(parts=(spec,)).problems(scene())
    assert found == (0, "reach", *path)
    assert message.startswith(problem)


def test_a_heading_and_an_orientation_are_not_both_and_some_points_with_heights_are_refused() -> None:
    with pytest.raises(ValueError, match="give 'yaw' or 'orientation', not both"):
        Reach(x=0, y=0, yaw=0, orientation=TargetOrientation())
    with pytest.raises(ValueError, match="give 'z' for all points of the path, or for none of them"):
        FollowPath(path=(PathPoint(x=0, y=0), PathPoint(x=1, y=0, z=1)), max_error=1)


def test_the_base_link_by_its_name_moves_like_the_base() -> None:
    seen = random_trace(3)
    for spec, named in (
        (Reach(x=0.1, y=0.2, z=0.3), Reach(link=ROOT, x=0.1, y=0.2, z=0.3)),
        (MaxSpeed(linear=0.1), MaxSpeed(link=ROOT, linear=0.1)),
    ):
        verdict: Verdict = judged(spec, seen)
        other = judged(named, seen)
        assert (other.measured, other.time) == (verdict.measured, verdict.time)
        assert other.message == f"base_footprint {verdict.message}"
        assert monitor(spec).state is monitor(named).state
