"""Wheel odometry: what it believes of joints that are moved by hand."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.core.errors import InvalidPart
from sim_action.core.geometry import Pose, compose, inverse, quaternion_from_rpy
from sim_action.drives.diff import DiffDrive
from sim_action.sensors import Measure, Mount
from sim_action.sensors.odometry import Odometry
from sim_action.state.observation import JointState
from sim_action.state.readings import OdometryReading
from tests.sensors.stubs import NO_PROBE, sight_of
from tests.traces import START, WHEELS, scene

RADIUS, SEPARATION = 0.033, 0.160
RATE = 10.0
SCENE = scene()
TWO_WHEELS = DiffDrive(left=(WHEELS[0],), right=(WHEELS[1],)).wheel_motion(SCENE.model)
BEGINNING = Pose((1.0, 2.0, 0.01), quaternion_from_rpy(0, 0, math.pi / 2))


def opened(spec: Odometry, *, seed: int = 0) -> Measure:
    there = replace(SCENE, seed=seed)
    return spec.open(Mount(there, "base_footprint", Pose(), RATE, there.generator("odometry"), TWO_WHEELS))


def believed(
    spec: Odometry, wheels_m: Iterable[tuple[float, float]], *, seed: int = 0, beginning: Pose = BEGINNING
) -> list[OdometryReading]:
    """What it tells while the rims of the wheels, left and right, are so many m further than in the beginning."""
    measure, told = opened(spec, seed=seed), []
    for tick, rims in enumerate(wheels_m):
        joints = {name: JointState(7.0 + rim / RADIUS, 0.0, 0.0) for name, rim in zip(WHEELS, rims, strict=True)}
        # The truth is looked at in the beginning alone.
        pose = beginning if tick == 0 else Pose((99.0, 99.0, 99.0))
        reading = measure(sight_of(replace(START, time=tick / RATE, pose=pose, joints=joints), NO_PROBE))
        assert isinstance(reading, OdometryReading)
        told.append(reading)
    return told


def same(pose: Pose, other: Pose) -> bool:
    apart = compose(inverse(pose), other)
    return max(map(abs, (*apart.position_xyz, *apart.orientation_xyzw[:3]))) < 1e-12


def steadily(left: float, right: float, ticks: int = 10) -> list[tuple[float, float]]:
    return [(left * tick / ticks, right * tick / ticks) for tick in range(ticks + 1)]


def test_it_begins_where_the_robot_is() -> None:
    (first,) = believed(Odometry(), [(0.0, 0.0)])
    assert same(first.pose, BEGINNING)
    assert first.twist.linear_xyz == first.twist.angular_xyz == (0.0, 0.0, 0.0)
    sizes = {name: len(values) for name, values in first.columns().items()}
    assert sizes == {"position_xyz": 3, "orientation_xyzw": 4, "linear_xyz": 3, "angular_xyz": 3}
    # A line leads ahead from there.
    told = believed(Odometry(), steadily(0.5, 0.5))
    assert told[-1].pose.position_xyz == pytest.approx((1.0, 2.5, 0.01))
    assert told[-1].twist.linear_xyz == pytest.approx((0.5, 0.0, 0.0))
    assert [reading.time for reading in told] == [tick / RATE for tick in range(11)]


def test_who_leans_goes_over_level_ground_all_the_same() -> None:
    leaning = Pose((0.0, 0.0, 0.0), quaternion_from_rpy(0.1, 0.2, 0.3))
    first, last = believed(Odometry(), [(0.0, 0.0), (1.0, 1.0)], beginning=leaning)
    assert same(first.pose, leaning)
    assert last.pose.position_xyz == pytest.approx((math.cos(leaning.yaw), math.sin(leaning.yaw), 0.0))
    assert last.pose.orientation_xyzw == pytest.approx(leaning.orientation_xyzw)


@pytest.mark.parametrize("ticks", [1, 7])
def test_an_arc_is_exact_at_any_rate(ticks: int) -> None:
    # A quarter of a circle of 1 m, to the left.
    quarter = math.pi / 2
    arc = steadily(quarter * (1 - SEPARATION / 2), quarter * (1 + SEPARATION / 2), ticks)
    last = believed(Odometry(), arc)[-1]
    assert last.pose.position_xyz == pytest.approx((0.0, 3.0, 0.01))
    assert abs(last.pose.yaw) == pytest.approx(math.pi)
    assert last.twist.linear_xyz == pytest.approx((quarter / ticks * RATE, 0.0, 0.0))
    assert last.twist.angular_xyz == pytest.approx((0.0, 0.0, quarter / ticks * RATE))


def test_a_wrong_radius_scales_the_way_and_a_wrong_separation_the_turn() -> None:
    line = believed(Odometry(radius_error=0.02, separation_error=0.1), steadily(1.0, 1.0))[-1]
    assert line.pose.position_xyz == pytest.approx((1.0, 3.02, 0.01))
    on_the_spot = steadily(-SEPARATION / 2, SEPARATION / 2)
    turned = believed(Odometry(radius_error=0.02, separation_error=0.1), on_the_spot)[-1]
    assert turned.pose.yaw - math.pi / 2 == pytest.approx(1.02 / 1.1)


def test_encoders_count_whole_ticks() -> None:
    tick = math.tau * RADIUS / 100
    told = believed(Odometry(resolution=100), [(0.003 * step, 0.003 * step) for step in range(200)])
    ways = [reading.pose.position_xyz[1] - 2.0 for reading in told]
    ticks = np.array(ways) / tick
    assert ticks == pytest.approx(np.round(ticks), abs=1e-9)
    # Never off by more than a tick, however long the way.
    assert max(abs(way - 0.003 * step) for step, way in enumerate(ways)) <= tick


@pytest.mark.parametrize("key", ["noise", "radius_error", "separation_error"])
def test_errors_stay_within_what_numbers_can_tell(key: str) -> None:
    with pytest.raises(ValidationError, match="less than or equal to 100"):
        Odometry.model_validate({key: 1e308})
    with pytest.raises(InvalidPart, match="must be at most 1,000,000,000, found"):
        Odometry(resolution=10**400)


def test_a_state_that_is_no_longer_finite_is_left_to_the_watchdog() -> None:
    for resolution, rim in ((100, math.nan), (100, math.inf), (None, math.nan), (None, math.inf)):
        _, last = believed(Odometry(resolution=resolution), [(0.0, 0.0), (rim, 1.0)])
        assert math.isnan(last.pose.yaw)


@pytest.mark.parametrize("ticks", [1, 20])
def test_noise_grows_with_the_root_of_the_way_at_any_rate(ticks: int) -> None:
    ends = [
        believed(Odometry(noise=0.001), steadily(4.0, 4.0, ticks), seed=seed)[-1].pose.position_xyz[1] - 6.0
        for seed in range(300)
    ]
    # Each wheel is off by 2 mm after 4 m, their mean by 1 / sqrt(2) of it.
    assert np.std(ends) == pytest.approx(0.002 / math.sqrt(2), rel=0.17)
    assert abs(np.mean(ends)) < 1e-3


def test_who_stands_does_not_drift_and_the_seed_decides() -> None:
    assert same(believed(Odometry(noise=0.5), steadily(0.0, 0.0))[-1].pose, BEGINNING)
    first, again, other = (believed(Odometry(noise=0.5), steadily(1.0, 1.0), seed=seed)[-1] for seed in (1, 1, 2))
    assert first == again
    assert first != other
