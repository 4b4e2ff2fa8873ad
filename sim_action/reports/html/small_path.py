"""The path of a robot as a picture of a few millimetres, the same size for every run."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Final

from sim_action.core.records import dataclass
from sim_action.recording.replay.replay_data import Replay
from sim_action.reports.html.document import Html, element
from sim_action.results.outcome import DisplayStatus

if TYPE_CHECKING:
    from sim_action.recording.replay.sightings import SightingData

_MAX_POINTS: Final = 40
_WIDTH: Final = 640
_HEIGHT: Final = 400
_EDGE: Final = 50
_LEAST_EXTENT_M: Final = 0.5
"""A robot that moves less is not magnified further."""


@dataclass(frozen=True, slots=True)
class RunLook:
    """The parts of a replay that the page of all scenarios shows.

    Attributes:
        path: the picture of the path.
        seen: name of a body -> its first sighting, for the bodies that the robot met.
    """

    path: Html
    seen: Mapping[str, SightingData]


def small_path(replay: Replay, status: DisplayStatus) -> Html:
    """Return an SVG of the path from above, as large as it fits: y is up, the start is a circle, the end a dot."""
    count = replay.frames.count
    last, parts = count - 1, max(1, min(count, _MAX_POINTS) - 1)
    rows = [number * last // parts for number in range(parts + 1)]
    # For so few numbers, arrays take longer than lists.
    xs, ys = (column.decoded(count)[rows].tolist() for column in replay.frames.base[:2])
    left, right, low, high = min(xs), max(xs), min(ys), max(ys)
    width, height = max(right - left, _LEAST_EXTENT_M), max(high - low, _LEAST_EXTENT_M)
    scale = min((_WIDTH - 2 * _EDGE) / width, (_HEIGHT - 2 * _EDGE) / height)
    x0, y0 = _WIDTH / 2 - scale * (left + right) / 2, _HEIGHT / 2 + scale * (low + high) / 2
    drawn = [(round(x0 + scale * x), round(y0 - scale * y)) for x, y in zip(xs, ys, strict=True)]
    points = [f"{x},{y}" for (x, y), _ in groupby(drawn)]
    return element(
        "svg",
        element("polyline", points=" ".join(points)) if len(points) > 1 else "",
        _dot(drawn[0], "start"),
        _dot(drawn[-1], "end"),
        class_=f"small-path {status}",
        viewBox=f"0 0 {_WIDTH} {_HEIGHT}",
        aria_hidden="true",
    )


def _dot(place: tuple[int, int], kind: str) -> Html:
    return element("circle", cx=place[0], cy=place[1], r=30, class_=kind)
