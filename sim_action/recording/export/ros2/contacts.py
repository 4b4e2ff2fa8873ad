"""/contacts: where the robot touches what is not the ground, as red balls that are seen for a second."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Final

import numpy as np

from sim_action.core.geometry import Vector3
from sim_action.core.units import TIME_EPSILON
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.cdr import CdrForm
from sim_action.recording.export.ros2.frames import Frames
from sim_action.recording.export.ros2.marker import Marker
from sim_action.recording.export.ros2.topics import Topic, nanoseconds, stamps

_SIZE: Final = (0.04, 0.04, 0.04)
_RED: Final = (0.9, 0.1, 0.1)
_SEEN: Final = 1

Points = dict[tuple[str, str], list[Vector3]]
"""Link and body -> where they touch."""

Shape = tuple[tuple[str, str, int], ...]
"""Link, body and in how many points they touch: what messages of one size have in common."""


def contacts(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """A message for each moment since whose last one something was touched; no topic if there is none."""
    alike = defaultdict[Shape, list[tuple[int, Points]]](list)
    for moment, points in _by_moment(run):
        shape = tuple((*pair, len(points[pair])) for pair in sorted(points))
        alike[shape].append((moment, points))
    times, messages = list[int](), list[bytes]()
    for shape, some in alike.items():
        time = run.trace.time[[moment for moment, _ in some]]
        times += nanoseconds(time).tolist()
        columns = [column for *pair, _ in shape for column in _columns((pair[0], pair[1]), time, some)]
        messages += _form(shape, frames).filled(len(some), *columns)
    if messages:
        yield Topic("/contacts", "visualization_msgs/MarkerArray", np.array(times, dtype=np.int64), messages)


def _columns(pair: tuple[str, str], time: np.ndarray, some: list[tuple[int, Points]]) -> Iterator[np.ndarray]:
    yield stamps(time)
    yield np.array([points[pair] for _, points in some])


def _form(shape: Shape, frames: Frames) -> CdrForm:
    form = CdrForm().fixed("<u4", len(shape))
    for link, body, count in shape:
        group = f"{link} / {body}"
        Marker("sphere list", frames.map, group, 0, scale=_SIZE, colour=_RED, points=count, lifetime=_SEEN).add_to(form)
    return form


def _by_moment(run: RecordedRun) -> Iterator[tuple[int, Points]]:
    """Moments, and where each pair touched last until then, since the moment before."""
    touches, time = run.trace.contacts, run.trace.time
    moments = np.searchsorted(time, np.array([touch.time for touch in touches]) - TIME_EPSILON).clip(max=len(time) - 1)
    found = defaultdict[int, dict[tuple[str, str], tuple[float, list[Vector3]]]](dict)
    for moment, touch in zip(moments.tolist(), touches, strict=True):
        pairs, pair = found[moment], (touch.link, touch.body)
        if pair not in pairs or pairs[pair][0] < touch.time:
            pairs[pair] = (touch.time, [])
        pairs[pair][1].append(touch.position_xyz)
    return ((moment, {pair: points for pair, (_, points) in pairs.items()}) for moment, pairs in found.items())
