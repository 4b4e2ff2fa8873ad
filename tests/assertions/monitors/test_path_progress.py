"""Paths, and how something that goes on along them is projected onto them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.monitors.path_progress import Foot, Point, Progress, ReferencePath, smoothed

CORNER = ReferencePath(((0.0, 0.0), (3.0, 0.0), (3.0, 4.0)))
EIGHT = tuple((2 * math.sin(turn), math.sin(2 * turn)) for turn in [math.tau * n / 200 for n in range(201)])


def test_lengths_add_up() -> None:
    assert CORNER.lengths == (0.0, 3.0, 7.0)


@pytest.mark.parametrize(
    ("place", "begin", "end", "foot"),
    [
        ((1.0, 1.0), 0.0, 7.0, Foot(1.0, 1.0)),
        ((-1.0, 0.0), 0.0, 7.0, Foot(0.0, 1.0)),
        ((3.0, 6.0), 0.0, 7.0, Foot(7.0, 2.0)),
        ((4.0, -1.0), 0.0, 7.0, Foot(3.0, math.sqrt(2))),
        ((2.0, 1.0), 0.0, 7.0, Foot(2.0, 1.0)),  # as near to the second piece: the first one counts
        ((2.5, 2.0), 0.0, 7.0, Foot(5.0, 0.5)),
        ((2.5, 2.0), 0.0, 2.0, Foot(2.0, math.hypot(0.5, 2.0))),  # not so far yet
        ((1.0, 0.0), 4.0, 7.0, Foot(4.0, math.hypot(2.0, 1.0))),  # not back again
        ((1.0, 0.5), 3.0, 3.0, Foot(3.0, math.hypot(2.0, 0.5))),
        ((3.0, 4.5), 7.0, 7.0, Foot(7.0, 0.5)),
    ],
)
def test_the_nearest_place_is_looked_for_between_two_lengths(
    place: Point, begin: float, end: float, foot: Foot
) -> None:
    assert CORNER.foot(place, begin, end) == pytest.approx(foot)


places = st.tuples(st.floats(-5, 5), st.floats(-5, 5))


@given(places, st.floats(0, 7), st.floats(0, 7))
def test_no_place_between_them_is_nearer(place: Point, one: float, other: float) -> None:
    begin, end = sorted((one, other))
    found = CORNER.foot(place, begin, end)
    assert begin - 1e-9 <= found.along <= end + 1e-9
    for share in range(101):
        along = begin + (end - begin) * share / 100
        there = (along, 0.0) if along <= 3 else (3.0, along - 3)
        assert found.distance <= math.dist(place, there) + 1e-9


@given(st.lists(places, max_size=30))
def test_progress_never_goes_back_whatever_is_done(way: list[Point]) -> None:
    progress = Progress.at_start(ReferencePath(EIGHT), (0.0, 0.0))
    for place in way:
        later = progress.to(place)
        assert later.foot.along >= progress.foot.along
        assert later.foot.along <= progress.path.length
        progress = later


def followed(path: ReferencePath, way: Sequence[Point]) -> list[Progress]:
    progress = [Progress.at_start(path, way[0])]
    for place in way:
        progress.append(progress[-1].to(place))
    return progress[1:]


@pytest.mark.parametrize("aside", [0.0, 0.05, -0.05])
def test_an_eight_is_followed_through_its_crossing(aside: float) -> None:
    path = ReferencePath(EIGHT)
    way = [(x + aside, y) for x, y in EIGHT]
    feet = [progress.foot for progress in followed(path, way)]
    # What is beside the path all the way is abreast of the point that it was moved from, but for what it was moved by.
    for length, foot in zip(path.lengths, feet, strict=True):
        assert foot.along == pytest.approx(length, abs=0.07)
        assert foot.distance <= abs(aside) + 1e-9


def test_to_go_straight_on_at_a_crossing_where_the_path_turns_is_to_leave_it() -> None:
    # A loop that comes back to the start of its second straight: 0 -> 2, round, and across it again.
    path = ReferencePath(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0), (1.0, -1.0)))
    shortcut = [(x / 100, 0.0) for x in range(101)] + [(1.0, -y / 100) for y in range(1, 101)]
    (*_, last) = followed(path, shortcut)
    assert last.remaining > 3.0
    assert last.foot.distance == pytest.approx(1.0)


def test_a_corner_may_be_cut() -> None:
    cut = [(x / 100, 0.0) for x in range(250)] + [(2.5 + n / 200, n / 200) for n in range(101)]
    cut += [(3.0, 0.5 + n / 100) for n in range(351)]
    ends = followed(CORNER, cut)
    assert max(progress.foot.distance for progress in ends) == pytest.approx(0.25)
    assert ends[-1].foot.along == 7.0


def test_there_and_back_on_the_same_line_is_followed_both_ways() -> None:
    path = ReferencePath(((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)))
    there = [(x / 100, 0.01) for x in range(101)]
    feet = [progress.foot for progress in followed(path, [*there, *reversed(there)])]
    assert feet[50].along == pytest.approx(0.5)
    assert feet[-1].along == pytest.approx(2.0)
    assert max(foot.distance for foot in feet) == pytest.approx(0.01)


def test_a_curve_goes_through_its_points_and_never_turns_sharply() -> None:
    points = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.5)]
    curve = smoothed(points)
    assert all(any(math.dist(point, there) < 1e-12 for there in curve) for point in points)
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(curve)]
    turns = [abs(math.remainder(after - before, math.tau)) for before, after in pairwise(headings)]
    assert max(turns) < math.radians(20)


def test_a_curve_through_points_on_a_line_is_that_line() -> None:
    for x, y in smoothed([(0.0, 0.0), (1.0, 2.0), (3.0, 6.0), (3.5, 7.0)]):
        assert y == pytest.approx(2 * x)


def test_two_points_make_a_straight_line() -> None:
    assert smoothed([(0.0, 0.0), (1.0, 1.0)]) == [(0.0, 0.0), (1.0, 1.0)]
