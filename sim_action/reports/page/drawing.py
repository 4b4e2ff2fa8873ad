"""The drawing of a run that needs no script: the way of the robot from above, what stands there, where it had to go."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.recording.replay.marks import ArrowMark, CircleMark, MarkData, PolygonMark, PolylineMark
from sim_action.recording.replay.models import Replay
from sim_action.reports.page.footprints import Frame, outline, robot_outlines
from sim_action.reports.page.markup import Html, element
from sim_action.results.outcome import ExpectationOutcome, Outcome

FloatArray = NDArray[np.float64]

_MOST_POINTS: Final = 120
_MOST_SOLIDS: Final = 200
_LEAST_MARGIN: Final = 0.35
"""m around what has to be seen."""


def drawing(replay: Replay, outcome: Outcome) -> Html:
    """An SVG, a metre a unit, north up; its size on the page is the style sheet's."""
    way = _way(replay)
    start, end = robot_outlines(replay, 0), robot_outlines(replay, replay.frames.count - 1)
    x, y, width, height = _view(np.concatenate([way, *start, *end, *_mark_points(replay.marks)]))
    box = (x, y, x + width, y + height)
    failed = frozenset(number for number, expected in enumerate(outcome.expectations) if _missed(expected))
    return element(
        "svg",
        element("title", f"The way of the robot from above, {width:.2g} m wide"),
        *(_polygon(corners, "body") for corners in islice(_bodies(replay, box), _MOST_SOLIDS)),
        *(_mark(mark, failed) for mark in replay.marks),
        *(_polygon(corners, "start") for corners in start),
        *(_polygon(corners, "robot") for corners in end),
        _line(way, "way"),
        *(_touch(contact.position) for contact in replay.contacts[:20]),
        class_="drawing",
        role="img",
        viewBox=f"{x:.3f} {-y - height:.3f} {width:.3f} {height:.3f}",
    )


def _missed(expected: ExpectationOutcome) -> bool:
    return expected.failed and not expected.verdict.cut_off


def _way(replay: Replay) -> FloatArray:
    """(N, 2): some of the places that the base came by, its first and last among them."""
    count = replay.frames.count
    places = np.column_stack([column.decoded(count) for column in replay.frames.base[:2]])
    rows = np.linspace(0, count - 1, min(count, _MOST_POINTS)).astype(int)
    return np.asarray(places[rows])


def _view(points: FloatArray) -> tuple[float, float, float, float]:
    """Left, lower end, width and height in m of what is to be seen; no more than three times as wide as high."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(_LEAST_MARGIN, 0.1 * float((high - low).max()))
    middle, size = (low + high) / 2, high - low + 2 * margin
    width, height = max(size[0], size[1] / 1.2), max(size[1], size[0] / 3)
    return float(middle[0] - width / 2), float(middle[1] - height / 2), float(width), float(height)


def _bodies(replay: Replay, box: tuple[float, float, float, float]) -> Iterator[FloatArray]:
    """Outlines of what stands in the view, where it began."""
    for body in replay.scene.bodies:
        for shape in body.shapes:
            corners = outline(shape, Frame.of(body.pose), replay.scene.meshes)
            low, high = corners.min(axis=0), corners.max(axis=0)
            if low[0] < box[2] and high[0] > box[0] and low[1] < box[3] and high[1] > box[1]:
                yield corners


def _mark_points(marks: Sequence[MarkData]) -> Iterator[FloatArray]:
    for mark in marks:
        match mark:
            case CircleMark():
                yield np.array([(mark.x + dx, mark.y + dy) for dx in (-mark.radius, mark.radius) for dy in (-0.1, 0.1)])
            case ArrowMark():
                yield np.array([(mark.x, mark.y)])
            case PolylineMark() | PolygonMark():
                yield np.array([point[:2] for point in mark.points])


def _mark(mark: MarkData, failed: frozenset[int]) -> Html:
    kind = "goal missed" if mark.expectation in failed else "goal"
    match mark:
        case CircleMark():
            return element("circle", class_=kind, cx=_number(mark.x), cy=_number(-mark.y), r=_number(mark.radius))
        case PolygonMark():
            return _polygon(np.array(mark.points), kind)
        case PolylineMark():
            return _line(np.array(mark.points)[:, :2], f"{kind} path")
        case ArrowMark():
            tip = np.array([mark.x + 0.3 * np.cos(mark.yaw), mark.y + 0.3 * np.sin(mark.yaw)])
            return _line(np.array([(mark.x, mark.y), tip]), f"{kind} path")


def _touch(position: tuple[float, float, float]) -> Html:
    return element("circle", class_="touch", cx=_number(position[0]), cy=_number(-position[1]), r="0.02")


def _polygon(corners: FloatArray, kind: str) -> Html:
    return element("polygon", class_=kind, points=_points(corners))


def _line(points: FloatArray, kind: str) -> Html:
    return element("polyline", class_=kind, points=_points(points))


def _points(points: FloatArray) -> str:
    return " ".join(f"{_number(x)},{_number(-y)}" for x, y in points.tolist())


def _number(value: float) -> str:
    return f"{value + 0.0:.3f}".rstrip("0").rstrip(".")
