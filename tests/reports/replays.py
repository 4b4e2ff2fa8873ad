"""Replays of a box that nobody moves, with the curves of expectations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.replay_data import Frames, Replay, SignalData
from sim_action.recording.replay.scene_data import LinkData, SceneData

STEP = 1 / 240


def column(values: Sequence[float], scale: float = 1e-4) -> Column:
    return Column.encoded(np.array(values, dtype=np.float64), scale)


def signal(
    name: str,
    values: Sequence[float],
    *,
    time: Sequence[float] | None = None,
    unit: str = "m",
    expectation: int = 0,
    **limits: Any,
) -> SignalData:
    moments = None if time is None else column(time, STEP)
    return SignalData(expectation=expectation, name=name, unit=unit, time=moments, values=column(values), **limits)


def replay(*signals: SignalData) -> Replay:
    """Of three seconds, a moment each."""
    still = column([0.0] * 4)
    return Replay(
        version=2,
        scene=SceneData(robot="box", links=(LinkData(name="base"),)),
        frames=Frames(
            time=column([0.0, 1.0, 2.0, 3.0], STEP),
            base=(still, still, still, still, still, still, column([1.0] * 4)),
            speed=still,
            tilt=still,
        ),
        signals=signals,
    )
