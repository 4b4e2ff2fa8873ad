"""How closely the robot keeps to a path, against hand-made ways."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.assertions.follow_path import FollowPath, PathEnd, PathPoint
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.window import Window
from sim_action.core.workspace import Workspace
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from tests.traces import judged, monitor, scene, trace

LINE = (PathPoint(x=0, y=0), PathPoint(x=4, y=0))
HAIRPIN = (PathPoint(x=0, y=0), PathPoint(x=2, y=0), PathPoint(x=0, y=0))
END = PathEnd(tolerance=0.25)


def way(*places: tuple[float, float]) -> Trace:
    """A place a second."""
    x, y = zip(*places, strict=True)
    return trace([float(n) for n in range(1, len(places) + 1)], x=x, y=y)


SWERVE = way((1, 0), (2, 0.25), (3, -0.5), (4, 0))


def test_the_greatest_error_speaks_with_where_on_the_path_it_was() -> None:
    assert judged(FollowPath(path=LINE, max_error=0.75), SWERVE) == Verdict(
        True, 0.5, 0.75, 0.25, "m", 3.0, "at most 0.5 m off the path at 3.00 s, 3 m along it, limit 0.75 m"
    )


def test_the_first_error_that_is_too_great_speaks() -> None:
    assert judged(FollowPath(path=LINE, max_error=0.125), SWERVE) == Verdict(
        False, 0.25, 0.125, -0.125, "m", 2.0, "0.25 m off the path at 2.00 s, 2 m along it, more than 0.125 m"
    )


def test_the_mean_is_judged_when_the_run_is_over() -> None:
    root = math.sqrt((0.25**2 + 0.5**2) / 4)
    failed = FollowPath(path=LINE, rms=0.25)
    assert monitor(failed).observe(SWERVE).state is State.HOLDS
    verdict = judged(failed, SWERVE)
    assert (verdict.passed, verdict.measured, verdict.time) == (False, root, 4.0)
    assert verdict.message == "RMS distance from the path 0.2795 m, more than 0.25 m"
    assert judged(FollowPath(path=LINE, rms=0.3), SWERVE).message == (
        "RMS distance from the path 0.2795 m, limit 0.3 m"
    )


def test_both_may_be_asked_and_what_fails_speaks() -> None:
    assert judged(FollowPath(path=LINE, max_error=0.75, rms=0.3), SWERVE).measured == 0.5
    assert judged(FollowPath(path=LINE, max_error=0.75, rms=0.25), SWERVE).limit == 0.25
    assert judged(FollowPath(path=LINE, max_error=0.4, rms=0.25), SWERVE).limit == 0.4


def test_the_end_is_a_goal() -> None:
    spec = FollowPath(path=LINE, end=END)
    opened = monitor(spec)
    assert opened.state is State.PENDING
    assert opened.observe(SWERVE.first(3)).state is State.PENDING
    short = math.hypot(1, 0.5)
    verdict = judged(spec, SWERVE.first(3))
    assert (verdict.passed, verdict.limit, verdict.time) == (False, 0.25, 3.0)
    assert verdict.measured == pytest.approx(short)
    assert verdict.margin == pytest.approx(0.25 - short)
    told = "came no closer than 1.118 m to the end of the path of 4 m, measured along it, in 3.0 s; closest at 3.00 s"
    assert verdict.message == told
    assert judged(FollowPath(path=LINE, rms=0.01, end=END), SWERVE).limit == 0.01
    assert monitor(FollowPath(path=LINE, rms=0.01, end=END)).observe(SWERVE).state is State.BROKEN
    assert judged(spec, SWERVE) == Verdict(
        True, 0.0, 0.25, 0.25, "m", 4.0, "reached the end of the path within 0 m in 4.00 s"
    )


def test_what_happens_after_the_end_does_not_count_if_it_is_a_goal() -> None:
    beyond = way((1, 0), (2, 0), (3, 0), (4, 0), (5, 3))
    assert judged(FollowPath(path=LINE, max_error=0.1, rms=0.1, end=END), beyond).passed
    verdict = judged(FollowPath(path=LINE, max_error=0.1), beyond)
    assert not verdict.passed
    assert verdict.measured == pytest.approx(math.hypot(1, 3))


def test_the_end_must_be_reached_in_order() -> None:
    # It stands at the end from the beginning, as the path ends where it begins.
    spec = FollowPath(path=HAIRPIN, end=END)
    assert not judged(spec, way((0, 0), (0.5, 0), (0, 0))).passed
    assert judged(spec, way((0.5, 0), (1, 0), (1.5, 0), (2, 0), (1.5, 0), (1, 0), (0.5, 0), (0, 0))).passed


def test_before_its_window_the_robot_goes_on_and_is_not_judged() -> None:
    spec = FollowPath(path=HAIRPIN, max_error=0.1, end=END)
    gone = way((0.5, 1), (1, 1), (1.5, 0), (2, 0), (1.5, 0), (1, 0), (0.5, 0), (0, 0))
    assert not judged(spec, gone).passed
    assert Window(monitor(spec), 3.0).observe(gone).verdict().passed


def test_a_robot_that_begins_beside_the_path_is_off_it() -> None:
    verdict = judged(FollowPath(path=LINE, max_error=0.5), way((0, 1), (1, 0)))
    assert (verdict.passed, verdict.time, verdict.measured) == (False, 1.0, 1.0)


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"path": LINE}, "give 'max_error', 'rms', 'end' or several of them"),
        ({"max_error": 0.1}, "give either 'path' or 'file'"),
        ({"path": LINE, "file": "p.csv", "max_error": 0.1}, "give either 'path' or 'file'"),
        ({"path": LINE[:1], "max_error": 0.1}, "at least 2 items"),
        ({"path": (LINE[0], LINE[1], LINE[1]), "max_error": 0.1}, "point 3 of the path equals the point before it"),
        ({"path": LINE, "max_error": 0}, "greater than 0"),
    ],
)
def test_what_is_no_path_is_refused(keys: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        FollowPath.model_validate(keys)


def problems_of(folder: Path, text: str) -> list[str]:
    (folder / "p.csv").write_text(text)
    found = list(FollowPath(file="p.csv", max_error=0.1).file_problems(Workspace(folder, folder)))
    assert all(path == ("file",) for path, _ in found)
    return [message for _, message in found]


def test_a_file_holds_a_path(tmp_path: Path) -> None:
    assert problems_of(tmp_path, "t, x, y\n0, 0, 0\n1, 2, 0\n2, 4, 0\n") == []
    here = replace(scene(), workspace=Workspace(tmp_path, tmp_path))
    spec = FollowPath(file="p.csv", max_error=0.75)
    assert spec.monitor(here, monitor_start()).observe(SWERVE).verdict() == judged(
        FollowPath(path=LINE, max_error=0.75), SWERVE
    )


def monitor_start() -> Any:
    from tests.traces import START

    return START


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
    ((path, message),) = FollowPath(file="no.csv", rms=0.1).file_problems(Workspace(tmp_path, tmp_path))
    assert (path, message.split(" (")[0]) == (("file",), "'no.csv' does not exist")


@pytest.mark.parametrize(
    ("asked", "limit"),
    [
        ({"max_error": 0.75, "rms": 0.5, "end": END}, 0.75),
        ({"rms": 0.5, "end": END}, 0.5),
        ({"end": END}, 0.25),
    ],
)
def test_without_a_step_the_limit_is_the_first_that_was_asked(asked: dict[str, Any], limit: float) -> None:
    verdict = judged(FollowPath(path=LINE, **asked), trace([]))
    assert (verdict.passed, verdict.measured, verdict.limit) == (False, None, limit)
