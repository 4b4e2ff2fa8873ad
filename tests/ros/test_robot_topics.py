"""The topics of a robot: usual names, stated names, and names that cannot be."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.ros.robot_topics import Schedule, topic_problems, topics_of
from sim_action.world.scene import Fitting

LIDAR = Fitting("lidar", "lidar", "base_scan", 5.0)
REAR = Fitting("rear lidar", "lidar", "rear", 5.0)
WHEELS = Fitting("wheels", "odometry", "base_link", 20.0)
EYE = Fitting("eye", "camera", "head", 10.0)


def test_usual_topics_are_those_of_the_kinds_of_sensors() -> None:
    assert topics_of([], {}) == {"cmd_vel": "/cmd_vel", "joint_states": "/joint_states", "odom": "/odom"}
    assert (topics_of([LIDAR], {})["lidar"], topics_of([EYE], {})["eye"]) == ("/scan", "/eye/image_raw")
    several = topics_of([LIDAR, REAR], {})
    assert (several["lidar"], several["rear lidar"]) == ("/lidar/scan", "/rear_lidar/scan")
    # Odometry of a sensor is in place of the truth.
    measured = topics_of([WHEELS], {})
    assert (measured["wheels"], "odom" in measured) == ("/odom", False)
    # Stated topics are absolute.
    own = {"cmd_vel": "/arm/cmd_vel", "lidar": "/front"}
    stated = topics_of([LIDAR], {**own, "cmd_vel": "arm/cmd_vel"})
    assert stated == {**own, "joint_states": "/joint_states", "odom": "/odom"}


@pytest.mark.parametrize(
    ("stated", "sensors", "key", "message"),
    [
        ({"lidr": "/scan"}, [LIDAR], "lidr", "did you mean 'lidar'"),
        ({"odom": "/odom"}, [WHEELS], "odom", "allowed: cmd_vel, joint_states, wheels"),
        ({"lidar": "/odom"}, [LIDAR], "lidar", "'/odom' is already the topic of 'odom'"),
    ],
)
def test_topics_that_cannot_be_are_named(
    stated: dict[str, str], sensors: list[Fitting], key: str, message: str
) -> None:
    ((path, said),) = topic_problems(stated, topics_of(sensors, stated))
    assert path == (key,)
    assert message in said


@pytest.mark.parametrize(("rate", "intervals"), [(30, {3, 4}), (40, {2, 3}), (50, {2}), (5, {20}), (100, {1})])
def test_messages_come_as_evenly_as_ticks_allow(rate: float, intervals: set[int]) -> None:
    schedule = Schedule.of(rate, 100)
    due = [tick for tick in range(1001) if schedule.is_due(tick)]
    assert {after - before for before, after in pairwise(due)} == intervals
    assert len(due) == 10 * rate + 1
    assert schedule.is_even == (len(intervals) == 1)


@pytest.mark.parametrize("rate", [0, -1, 100, 1000])
def test_no_rate_and_a_rate_above_that_of_the_ticks_mean_every_tick(rate: float) -> None:
    schedule = Schedule.of(rate, 100)
    assert schedule.rate == 100
    assert all(map(schedule.is_due, range(50)))


@given(st.floats(0.5, 200), st.sampled_from([60.0, 100.0, 120.0]), st.integers(1, 400))
def test_the_number_of_messages_follows_the_rate(rate: float, ticks: float, last: int) -> None:
    schedule = Schedule.of(rate, ticks)
    count = sum(map(schedule.is_due, range(last + 1)))
    assert abs(count - 1 - last * min(rate, ticks) / ticks) <= 1 + 1e-6
