"""The signals, marks and golden trajectories of expectations: curves, places and motions that they refer to."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Final

import numpy as np

from sim_action.core.errors import InvalidPart
from sim_action.core.records import replace
from sim_action.recording.replay.columns import MAX_MOMENTS, Column, FloatArray, fine_scale
from sim_action.recording.replay.frames import thinned
from sim_action.recording.replay.golden import MAX_GOLDEN, GoldenData
from sim_action.recording.replay.marks import MAX_MARKS, ArrowMark, CircleMark, MarkData, PolygonMark, PolylineMark
from sim_action.recording.replay.replay_data import MAX_SIGNALS, SignalData
from sim_action.recording.replay.scene import skeleton
from sim_action.recording.replay.scene_data import MAX_TEXT_LENGTH
from sim_action.recording.replay.shapes import MAX_ABS_VALUE
from sim_action.scenario.model import Scenario
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Circle, Mark, Polygon, Polyline, Signal
from sim_action.world.scene import Scene

# The resolution of signals with their own rate: about what a screen can show.
_SAMPLE_PERIOD_S: Final = 1 / 15
# That of golden files.
_TIME_RESOLUTION_S: Final = 1e-3


def stored_signals(scenario: Scenario, scene: Scene, start: Observation, film: Trace) -> tuple[SignalData, ...]:
    """Return the signals of all expectations; `start` is the settled state at t = 0."""
    frames = thinned(film)
    found = (
        stored_signal(number, signal, frames.time, scene.physics.rate)
        for number, expected in enumerate(scenario.expect)
        for signal in expected.signals(scene, start, frames)
        if len(signal.time)
    )
    return tuple(signal for signal, _ in zip(found, range(MAX_SIGNALS), strict=False))


def stored_marks(scenario: Scenario, scene: Scene, start: Observation) -> tuple[MarkData, ...]:
    """Return the marks of all expectations; `start` is the settled state at t = 0."""
    found: list[MarkData] = []
    links: Mapping[str, int] = {}
    for number, expected in enumerate(scenario.expect):
        for mark in expected.marks(scene, start):
            if mark.link and not links:
                _, links = skeleton(scene.model)
            # A place beyond the range of a replay is not visible.
            with suppress(InvalidPart):
                found.append(_stored_mark(number, mark).model_copy(update={"link": links.get(mark.link)}))
    return tuple(found[:MAX_MARKS])


def stored_golden(scenario: Scenario, scene: Scene) -> tuple[GoldenData, ...]:
    """Return the golden trajectories of a scenario, as far as a replay can hold them."""
    return tuple(_golden(scenario, scene))[:MAX_GOLDEN]


def _golden(scenario: Scenario, scene: Scene) -> Iterator[GoldenData]:
    if scene.workspace.updates_golden:
        return
    names = [joint.name for joint in scene.model.moving_joints]
    for number, expected in enumerate(scenario.expect):
        if expected.assertion.key != "matches":
            continue
        from sim_action.assertions.matches import Matches
        from sim_action.state.golden_trajectory import RESOLUTION

        assert isinstance(expected.assertion, Matches)
        golden = expected.assertion.golden_in(scene)
        if len(golden.rows) > MAX_MOMENTS:
            continue
        x, y, z, yaw, *joints = (Column.encoded(values, RESOLUTION) for values in golden.rows.T[1:])
        places = [names.index(name) for name in golden.form.joint_names]
        yield GoldenData(
            expectation=number,
            time=Column.encoded(golden.time, _TIME_RESOLUTION_S),
            base=(x, y, z, yaw),
            joints=tuple(zip(places, joints, strict=True)),
            position=expected.assertion.position,
            yaw=expected.assertion.yaw,
        )


def stored_signal(number: int, signal: Signal, frames: FloatArray, rate: float) -> SignalData:
    """Return a signal of expectation `number` for storage.

    `frames` are the times (T,) of the replay in s, `rate` is the physics rate in Hz.
    """
    shared = np.array_equal(signal.time, frames)
    signal = signal if shared else coarse(signal, rate)
    return SignalData(
        expectation=number,
        name=signal.name[:MAX_TEXT_LENGTH],
        unit=signal.unit[:MAX_TEXT_LENGTH],
        time=None if shared else Column.encoded(signal.time, 1 / rate),
        values=Column.encoded(signal.values, fine_scale(signal.values)),
        lower=_limit(signal.lower),
        upper=_limit(signal.upper),
        start=min(signal.start, MAX_ABS_VALUE),
        end=signal.end if math.isfinite(signal.end) else None,
    )


def coarse(signal: Signal, rate: float) -> Signal:
    """Reduce a signal to first, minimum, maximum and last value of each period; times are multiples of 1 / `rate` s."""
    steps, first = np.unique(np.rint(signal.time * rate), return_index=True)
    values = signal.values[first]
    span = float(steps[-1] - steps[0]) / rate
    period = max(_SAMPLE_PERIOD_S, 4 * span / (MAX_MOMENTS - 4))
    parts = np.floor((steps - steps[0]) / rate / period)
    begins = np.flatnonzero(np.diff(parts, prepend=-1.0))
    kept = np.unique([row for begin, end in _spans(begins, len(steps)) for row in _telling(values, begin, end)])
    return replace(signal, time=steps[kept] / rate, values=values[kept])


def _spans(begins: np.ndarray[tuple[int, ...], np.dtype[np.intp]], count: int) -> Iterator[tuple[int, int]]:
    ends = [*begins.tolist()[1:], count]
    return zip(begins.tolist(), ends, strict=True)


def _telling(values: FloatArray, begin: int, end: int) -> tuple[int, int, int, int]:
    part = np.where(np.isnan(values[begin:end]), values[begin], values[begin:end])
    return begin, begin + int(part.argmin()), begin + int(part.argmax()), end - 1


def _limit(limit: float | None) -> float | None:
    return limit if limit is not None and abs(limit) <= MAX_ABS_VALUE else None


def _stored_mark(number: int, mark: Mark) -> MarkData:
    match mark:
        case Circle():
            return CircleMark(kind="circle", expectation=number, x=mark.x, y=mark.y, z=mark.z, radius=mark.radius)
        case Polygon():
            return PolygonMark(kind="polygon", expectation=number, points=mark.points)
        case Polyline():
            return PolylineMark(
                kind="polyline",
                expectation=number,
                points=mark.points,
                tolerance=mark.tolerance,
                is_aside=mark.is_aside,
            )
        case _:
            tolerance = min(math.pi, mark.tolerance)
            return ArrowMark(kind="arrow", expectation=number, x=mark.x, y=mark.y, yaw=mark.yaw, tolerance=tolerance)
