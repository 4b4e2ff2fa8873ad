"""How closely the robot keeps to a path, against hand-made ways."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions import follow_path
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.core.workspace import Workspace
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from tests.traces import START, judged, monitor, scene, trace

LINE = (follow_path.PathPoint(x=0, y=0), follow_path.PathPoint(x=4, y=0))
HAIRPIN = (follow_path.PathPoint(x=0, y=0), follow_path.PathPoint(x=2, y=0), follow_path.PathPoint(x=0, y=0))
END = follow_path.PathEnd(tolerance=0.25)


def way(*places: tuple[float, float]) -> Trace:
    """A place a second."""
    x, y = zip(*places, strict=True)
    return trace([float(n) for n in range(1, len(places) + 1)], x=x, y=y)


SWERVE = way((1, 0), (2, 0.25), (3, -0.5), (4, 0))


def along(**keys: Any) -> follow_path.FollowPath:
    return follow_path.FollowPath(path=LINE, **keys)


def test_the_greatest_error_speaks_or_the_first_that_is_too_great_with_where_on_the_path_it_was() -> None:
    message = "at most 0.5 m off the path at 3.00 s, 3 m along it, limit 0.75 m"
    assert judged(along(max_error=0.75), SWERVE) == Verdict(True, 0.5, 0.75, 0.25, "m", 3.0, message)
    message = "0.25 m off the path at 2.00 s, 2 m along it, more than 0.125 m"
    assert judged(along(max_error=0.125), SWERVE) == Verdict(False, 0.25, 0.125, -0.125, "m", 2.0, message)


def test_the_mean_is_judged_when_the_run_is_over() -> None:
    root = math.sqrt((0.25**2 + 0.5**2) / 4)
    failed = along(rms=0.25)
    assert monitor(failed).observe(SWERVE).state is State.HOLDS
    verdict = judged(failed, SWERVE)
    assert (verdict.passed, verdict.measured, verdict.time) == (False, root, 4.0)
    assert verdict.message == "RMS distance from the path 0.2795 m, more than 0.25 m"
    assert judged(along(rms=0.3), SWERVE).message == "RMS distance from the path 0.2795 m, limit 0.3 m"
    # Both may be asked, and what fails speaks.
    assert judged(along(max_error=0.75, rms=0.3), SWERVE).measured == 0.5
    assert judged(along(max_error=0.75, rms=0.25), SWERVE).limit == 0.25
    assert judged(along(max_error=0.4, rms=0.25), SWERVE).limit == 0.4


def test_the_end_is_a_goal() -> None:
    spec = along(end=END)
    opened = monitor(spec)
    assert opened.state is State.PENDING
    assert opened.observe(SWERVE.first(3)).state is State.PENDING
    assert opened.observe(SWERVE).is_decided
    short = math.hypot(1, 0.5)
    verdict = judged(spec, SWERVE.first(3))
    assert (verdict.passed, verdict.limit, verdict.time) == (False, 0.25, 3.0)
    assert verdict.measured == pytest.approx(short)
    assert verdict.margin == pytest.approx(0.25 - short)
    told = "came no closer than 1.118 m to the end of the path of 4 m, measured along it, in 3.0 s; closest at 3.00 s"
    assert verdict.message == told
    assert judged(along(rms=0.01, end=END), SWERVE).limit == 0.01
    assert monitor(along(rms=0.01, end=END)).observe(SWERVE).state is State.BROKEN
    told = "reached the end of the path within 0 m in 4.00 s"
    assert judged(spec, SWERVE) == Verdict(True, 0.0, 0.25, 0.25, "m", 4.0, told)


def test_what_happens_after_the_end_does_not_count_if_it_is_a_goal() -> None:
    beyond = way((1, 0), (2, 0), (3, 0), (4, 0), (5, 3))
    assert judged(along(max_error=0.1, rms=0.1, end=END), beyond).passed
    verdict = judged(along(max_error=0.1), beyond)
    assert not verdict.passed
    assert verdict.measured == pytest.approx(math.hypot(1, 3))


def test_the_end_must_be_reached_in_order() -> None:
    # It stands at the end from the beginning, as the path ends where it begins.
    spec = follow_path.FollowPath(path=HAIRPIN, end=END)
    assert not judged(spec, way((0, 0), (0.5, 0), (0, 0))).passed
    assert judged(spec, way((0.5, 0), (1, 0), (1.5, 0), (2, 0), (1.5, 0), (1, 0), (0.5, 0), (0, 0))).passed


def test_before_its_window_the_robot_goes_on_and_is_not_judged() -> None:
    spec = follow_path.FollowPath(path=HAIRPIN, max_error=0.1, end=END)
    gone = way((0.5, 1), (1, 1), (1.5, 0), (2, 0), (1.5, 0), (1, 0), (0.5, 0), (0, 0))
    assert not judged(spec, gone).passed
    assert Window(monitor(spec), 3.0).observe(gone).verdict().passed


def test_a_robot_that_begins_beside_the_path_is_off_it() -> None:
    verdict = judged(along(max_error=0.5), way((0, 1), (1, 0)))
    assert (verdict.passed, verdict.time, verdict.measured) == (False, 1.0, 1.0)


def problems_of(folder: Path, text: str) -> list[str]:
    (folder / "p.csv").write_text(text)
    found = list(follow_path.FollowPath(file="p.csv", max_error=0.1).file_problems(Workspace(folder, folder)))
    assert all(path == ("file",) for path, _ in found)
    return [message for _, message in found]


def test_a_file_holds_a_path(tmp_path: Path) -> None:
    assert problems_of(tmp_path, "t, x, y\n0, 0, 0\n1, 2, 0\n2, 4, 0\n") == []
    here = replace(scene(), workspace=Workspace(tmp_path, tmp_path))
    spec = follow_path.FollowPath(file="p.csv", max_error=0.75)
    assert spec.monitor(here, START).observe(SWERVE).verdict() == judged(along(max_error=0.75), SWERVE)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "p.csv: the first line has no column 'x' (allowed: none)"),
        ("x,Y\n0,0\n", "p.csv: the first line has no column 'y' (allowed: Y, x)"),
        ("x,y\n0,0\n", "p.csv: expected 2 to 10000 points, found 1"),
        ("x,y\n0,0\n1,zero\n", "p.csv: line 3: expected a number in m, at most 1e+06, found 'zero'"),
        ("x,y\n0,0\n1\n", "p.csv: line 3: expected a number in m, at most 1e+06, found nothing"),
        ("x,y\n0,0\nnan,1\n", "p.csv: line 3: expected a number in m, at most 1e+06, found 'nan'"),
        ("x,y\n0,0\n1,1\n1,1\n", "p.csv: point 3 equals the point before it; remove one of them"),
    ],
)
def test_a_file_that_holds_none_is_told(text: str, problem: str, tmp_path: Path) -> None:
    (found,) = problems_of(tmp_path, text)
    assert found.startswith(problem)


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    ((path, message),) = follow_path.FollowPath(file="no.csv", rms=0.1).file_problems(Workspace(tmp_path, tmp_path))
    assert (path, message.split(" (")[0]) == (("file",), "'no.csv' does not exist")


@pytest.mark.parametrize(
    ("asked", "limit"),
    [({"max_error": 0.75, "rms": 0.5, "end": END}, 0.75), ({"rms": 0.5, "end": END}, 0.5), ({"end": END}, 0.25)],
)
def test_without_a_step_the_limit_is_the_first_that_was_asked(asked: dict[str, Any], limit: float) -> None:
    verdict = judged(along(**asked), trace([]))
    assert (verdict.passed, verdict.measured, verdict.limit) == (False, None, limit)


CORNER = follow_path.ReferencePath(((0.0, 0.0), (3.0, 0.0), (3.0, 4.0)))
EIGHT = tuple((2 * math.sin(turn), math.sin(2 * turn)) for turn in [math.tau * n / 200 for n in range(201)])


@pytest.mark.parametrize(
    ("place", "begin", "end", "foot"),
    [
        ((1.0, 1.0), 0.0, 7.0, follow_path.Foot(1.0, 1.0)),
        ((-1.0, 0.0), 0.0, 7.0, follow_path.Foot(0.0, 1.0)),
        ((3.0, 6.0), 0.0, 7.0, follow_path.Foot(7.0, 2.0)),
        ((4.0, -1.0), 0.0, 7.0, follow_path.Foot(3.0, math.sqrt(2))),
        ((2.0, 1.0), 0.0, 7.0, follow_path.Foot(2.0, 1.0)),  # as near to the second piece: the first one counts
        ((2.5, 2.0), 0.0, 7.0, follow_path.Foot(5.0, 0.5)),
        ((2.5, 2.0), 0.0, 2.0, follow_path.Foot(2.0, math.hypot(0.5, 2.0))),  # not so far yet
        ((1.0, 0.0), 4.0, 7.0, follow_path.Foot(4.0, math.hypot(2.0, 1.0))),  # not back again
        ((1.0, 0.5), 3.0, 3.0, follow_path.Foot(3.0, math.hypot(2.0, 0.5))),
        ((3.0, 4.5), 7.0, 7.0, follow_path.Foot(7.0, 0.5)),
    ],
)
def test_the_nearest_place_is_looked_for_between_two_lengths(
    place: follow_path.Point, begin: float, end: float, foot: follow_path.Foot
) -> None:
    assert CORNER.lengths == (0.0, 3.0, 7.0)
    assert CORNER.foot(place, begin, end) == pytest.approx(foot)


places = st.tuples(st.floats(-5, 5), st.floats(-5, 5))


@given(places, st.floats(0, 7), st.floats(0, 7))
def test_no_place_between_them_is_nearer(place: follow_path.Point, one: float, other: float) -> None:
    begin, end = sorted((one, other))
    found = CORNER.foot(place, begin, end)
    assert begin - 1e-9 <= found.along <= end + 1e-9
    for share in range(101):
        along = begin + (end - begin) * share / 100
        there = (along, 0.0) if along <= 3 else (3.0, along - 3)
        assert found.distance <= math.dist(place, there) + 1e-9


@given(st.lists(places, max_size=30))
def test_progress_never_goes_back_whatever_is_done(way: list[follow_path.Point]) -> None:
    progress = follow_path.Progress.at_start(follow_path.ReferencePath(EIGHT), (0.0, 0.0))
    for place in way:
        later = progress.to(place)
        assert later.foot.along >= progress.foot.along
        assert later.foot.along <= progress.path.length
        progress = later


def followed(path: follow_path.ReferencePath, way: Sequence[follow_path.Point]) -> list[follow_path.Progress]:
    progress = [follow_path.Progress.at_start(path, way[0])]
    for place in way:
        progress.append(progress[-1].to(place))
    return progress[1:]


@pytest.mark.parametrize("aside", [0.0, 0.05, -0.05])
def test_an_eight_is_followed_through_its_crossing(aside: float) -> None:
    path = follow_path.ReferencePath(EIGHT)
    way = [(x + aside, y) for x, y in EIGHT]
    feet = [progress.foot for progress in followed(path, way)]
    # What is beside the path all the way is abreast of the point that it was moved from, but for what it was moved by.
    for length, foot in zip(path.lengths, feet, strict=True):
        assert foot.along == pytest.approx(length, abs=0.07)
        assert foot.distance <= abs(aside) + 1e-9


def test_to_go_straight_on_at_a_crossing_where_the_path_turns_is_to_leave_it() -> None:
    # A loop that comes back to the start of its second straight: 0 -> 2, round, and across it again.
    path = follow_path.ReferencePath(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0), (1.0, -1.0)))
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
    path = follow_path.ReferencePath(((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)))
    there = [(x / 100, 0.01) for x in range(101)]
    feet = [progress.foot for progress in followed(path, [*there, *reversed(there)])]
    assert feet[50].along == pytest.approx(0.5)
    assert feet[-1].along == pytest.approx(2.0)
    assert max(foot.distance for foot in feet) == pytest.approx(0.01)


def test_a_curve_goes_through_its_points_and_never_turns_sharply() -> None:
    points = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.5)]
    curve = follow_path.smoothed(points)
    assert all(any(math.dist(point, there) < 1e-12 for there in curve) for point in points)
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(curve)]
    turns = [abs(math.remainder(after - before, math.tau)) for before, after in pairwise(headings)]
    assert max(turns) < math.radians(20)


def test_a_curve_through_points_on_a_line_is_that_line() -> None:
    for x, y in follow_path.smoothed([(0.0, 0.0), (1.0, 2.0), (3.0, 6.0), (3.5, 7.0)]):
        assert y == pytest.approx(2 * x)
    assert follow_path.smoothed([(0.0, 0.0), (1.0, 1.0)]) == [(0.0, 0.0), (1.0, 1.0)]
