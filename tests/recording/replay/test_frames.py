"""The moments of a run as columns."""

from __future__ import annotations

import numpy as np
import pytest

from sim_action.core.geometry import quaternion_from_rpy
from sim_action.recording.replay.build import Track, frames_of, thinned
from sim_action.recording.replay.columns import MAX_MOMENTS
from sim_action.recording.replay.replay_data import Frames
from sim_action.state.trace_records import BodyRecord
from tests.traces import trace

RATE = 240.0


def test_columns_are_the_trace_to_half_a_step() -> None:
    time = [0.0, 0.1, 0.2]
    frames = frames_of(trace(time, x=[0.0, 0.12345, 0.3], position=[0.0, 1.0004, 2.0]), [], RATE, [False, True])
    assert frames.count == 3
    assert frames.time.decoded(3) == pytest.approx(time, abs=1 / RATE / 2)
    assert frames.base[0].decoded(3) == pytest.approx([0.0, 0.12345, 0.3], abs=5e-5)
    assert frames.joints[0].decoded(3) == pytest.approx([0.0, 1.0004, 2.0], abs=5e-4)
    assert frames.joints[1].scale == 1e-4


def test_turning_round_and_round_does_not_jump() -> None:
    yaw = np.linspace(0, 8 * np.pi, 200)
    flipped = trace(list(np.arange(200) / 10), yaw=[float(np.remainder(turn, 2 * np.pi)) for turn in yaw])
    frames = frames_of(flipped, [], RATE, [False, False])
    for column in frames.base[3:]:
        assert np.abs(np.diff(column.decoded(200))).max() < 0.2


def test_a_body_is_where_it_was_last_looked_at_and_not_where_it_waits() -> None:
    record = BodyRecord(
        np.array([0.0, 1.0, 2.0]),
        np.array([[0.0, 0.0, 1e6], [1.0, 0.0, 0.5], [2.0, 0.0, 0.1]]),
        np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)),
    )
    (track,) = frames_of(trace([0.0, 1.5, 2.0]), [Track(record, appears=0.9)], RATE, [False, False]).tracks
    assert track[0].decoded(3) == pytest.approx([1.0, 1.0, 2.0])
    assert track[2].decoded(3) == pytest.approx([0.5, 0.5, 0.1])


def test_the_very_last_moment_goes_on_as_it_went() -> None:
    turned = np.array([quaternion_from_rpy(0.0, 0.0, yaw) for yaw in (0.0, 0.1, 0.2)])
    record = BodyRecord(np.array([0.0, 0.1, 0.2]), np.outer([0.0, 1.0, 2.0], [1.0, 0.0, 0.0]), turned)
    (track,) = frames_of(trace([0.0, 0.1, 0.2, 0.25]), [Track(record)], RATE, [False, False]).tracks
    assert track[0].decoded(4) == pytest.approx([0.0, 1.0, 2.0, 2.5])
    assert 2 * np.arcsin(track[5].decoded(4)) == pytest.approx([0.0, 0.1, 0.2, 0.25], abs=3e-4)


def test_what_lasts_for_hours_is_thinned_and_keeps_its_ends() -> None:
    long = trace([step / 30 for step in range(2 * MAX_MOMENTS)])
    kept = thinned(long)
    assert len(kept) == MAX_MOMENTS
    assert (kept.time[0], kept.time[-1]) == (long.time[0], long.time[-1])
    frames = frames_of(kept, [], RATE, [False, False])
    assert Frames.model_validate_json(frames.model_dump_json(exclude_defaults=True)) == frames
