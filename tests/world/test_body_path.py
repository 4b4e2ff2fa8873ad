"""What a scenario says of bodies that move or appear."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, compose, twist_between
from sim_action.world import Body
from sim_action.world.body import Numbers, PathPoint, PosePath

GATE: dict[str, Any] = {"name": "gate", "box": (0.1, 1, 1), "pose": {"x": 1, "y": 2}}


def body(**keys: Any) -> Body:
    return Body.model_validate({**GATE, **keys})


def test_a_body_begins_at_its_pose_or_at_the_first_point_of_its_path() -> None:
    assert body().beginning == Placement(x=1.0, y=2.0)
    moving = body(path=({"at": "1 s", "y": 3}, {"at": "2 s", "x": 5, "z": 1}))
    assert moving.beginning == Placement(x=1.0, y=3.0)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"path": ({"at": 0},)}, "two points"),
        ({"loop": True}, "'loop' needs a 'path'"),
        ({"path": ({"at": 0}, {"at": 1, "x": 2}), "mass": 1}, "remove 'mass'"),
        ({"path": ({"at": 0}, {"at": 1, "x": 2}), "appears": 1}, "exists from the start"),
        ({"path": ({"at": 0}, {"at": 1, "x": 2}), "loop": True}, "must end where it starts"),
        ({"path": ({"at": 0}, {"at": 1, "yaw": "180 deg"}), "loop": True}, "must end where it starts"),
        ({"path": ({"at": -1}, {"at": 1, "x": 2})}, "greater than or equal to 0"),
        ({"path": ({"x": 1}, {"at": 1, "x": 2})}, "Field required"),
        ({"appears": 0}, "greater than 0"),
        ({"path": ({"at": 0}, {"at": 1e5, "y": 1e6})}, "less than or equal to 100000"),
    ],
)
def test_motions_that_do_not_fit_together_are_refused(keys: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        body(**keys)


@pytest.mark.parametrize("end", [{"x": 1, "yaw": "360 deg"}, {"x": 1, "yaw": "-720 deg"}, {"x": 1}])
def test_a_loop_may_end_after_whole_turns(end: dict[str, Any]) -> None:
    assert body(path=({"at": 0}, {"at": 1, "x": 2}, {"at": 2, **end}), loop=True).loop


numbers = st.tuples(*[st.floats(-10, 10)] * 6)
points = st.lists(numbers, min_size=2, max_size=6)
gaps = st.lists(st.floats(0.1, 10), min_size=6, max_size=6)


def through(points: list[Numbers], gaps: list[float], *, loops: bool = False) -> PosePath:
    times = [sum(gaps[: index + 1]) for index in range(len(points))]
    return PosePath(tuple(times), tuple(points), loops)


@given(points, gaps)
def test_it_is_at_every_point_in_its_time(points: list[Numbers], gaps: list[float]) -> None:
    path = through(points, gaps)
    for time, point in zip(path.times, points, strict=True):
        assert path.numbers(time) == pytest.approx(point)


@given(points, gaps, st.floats(0, 1))
def test_between_two_points_it_is_the_same_share_of_the_way(
    points: list[Numbers], gaps: list[float], share: float
) -> None:
    path = through(points, gaps)
    for (start, one), (end, other) in pairwise(zip(path.times, points, strict=True)):
        expected = [a + (b - a) * share for a, b in zip(one, other, strict=True)]
        assert path.numbers(start + (end - start) * share) == pytest.approx(expected, abs=1e-9)


@given(points, gaps, st.floats(0, 100))
def test_it_waits_at_its_first_point_and_stays_at_its_last(
    points: list[Numbers], gaps: list[float], away: float
) -> None:
    path = through(points, gaps)
    assert path.numbers(path.times[0] - away) == points[0]
    assert path.numbers(path.times[-1] + away) == points[-1]


@given(points, gaps, st.floats(0, 1), st.integers(0, 5))
def test_a_loop_comes_round_again(points: list[Numbers], gaps: list[float], share: float, rounds: int) -> None:
    path = through([*points[:5], points[0]], gaps, loops=True)
    period = path.times[-1] - path.times[0]
    time = path.times[0] + share * period
    # Once round is where it began, whatever the rounding of either time.
    assert path.numbers(time + rounds * period) == pytest.approx(path.numbers(time), abs=1e-9 * rounds * 1e3 + 1e-9)


def test_a_loop_waits_but_once() -> None:
    path = through([(0,) * 6, (1, 0, 0, 0, 0, 0), (0,) * 6], [5.0, 1.0, 1.0], loops=True)
    assert [path.numbers(time)[0] for time in (0, 4, 5, 5.5, 6, 7, 7.5, 8)] == [0, 0, 0, 0.5, 1, 0, 0.5, 1]


def test_what_a_point_leaves_out_stays_as_it_was() -> None:
    said = [{"at": "1 s", "x": "2 m"}, {"at": "2 s", "yaw": "90 deg"}, {"at": "3 s", "x": 0}]
    start = Placement(x=9.0, y=3.0, z=0.5, roll=0.1)
    path = PosePath.of(start, [PathPoint.model_validate(point) for point in said])
    quarter = math.pi / 2
    assert path.points == (
        (2.0, 3.0, 0.5, 0.1, 0.0, 0.0),
        (2.0, 3.0, 0.5, 0.1, 0.0, quarter),
        (0.0, 3.0, 0.5, 0.1, 0.0, quarter),
    )


def test_angles_go_as_far_as_is_written() -> None:
    said = [{"at": 0}, {"at": "8 s", "yaw": "720 deg"}]
    path = PosePath.of(Placement(z=0.0), [PathPoint.model_validate(point) for point in said])
    assert path.pose(1.0).yaw == pytest.approx(math.pi / 2)
    assert path.pose(3.0).yaw == pytest.approx(-math.pi / 2)
    assert path.numbers(4.0)[5] == pytest.approx(math.tau)


@given(points, gaps, st.floats(0, 3), st.floats(0, 1))
def test_no_point_is_faster_than_the_bound(
    numbers: list[Numbers], gaps: list[float], reach: float, share: float
) -> None:
    times = tuple(sum(gaps[:number]) for number in range(len(numbers)))
    path = PosePath(times, tuple(numbers))
    speed, turn = path.fastest(reach)
    moment, later = share * times[-1], share * times[-1] + 1e-3
    corner = (reach, 0.0, 0.0)
    one, other = (compose(path.pose(time), Pose(corner)) for time in (moment, later))
    assert math.dist(one.position_xyz, other.position_xyz) <= speed * 1e-3 * (1 + 1e-6) + 1e-9
    assert math.hypot(*twist_between(one, other, 1e-3).angular_xyz) <= turn * (1 + 1e-6) + 1e-4


def test_a_path_at_rest_has_no_speed() -> None:
    assert PosePath((0.0, 1.0), ((1.0, 2.0, 3.0, 0.0, 0.0, 0.0),) * 2).fastest(1.0) == (0.0, 0.0)
