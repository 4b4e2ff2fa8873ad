"""The curves behind a verdict, out of the replay that the run has left; the file may be a stranger's."""

from __future__ import annotations

from typing import Final

import numpy as np

from sim_action.recording.replay.models import Replay, SignalData
from sim_action.recording.replay.storage import ReplayError, read
from sim_action.reports import ReportOptions
from sim_action.results.outcome import Outcome
from sim_action.results.trace_files import stored_file
from sim_action.state.verdict import Signal, Verdict

# Limits are stored as they are; a verdict's went through other arithmetic.
_SAME_LIMIT: Final = 1e-9


def replay_of(outcome: Outcome, options: ReportOptions) -> Replay | None:
    """What the run has left; None if that is nothing, or nothing that can be read."""
    path = None if outcome.replay is None else stored_file(options.folder, outcome.replay)
    if path is None:
        return None
    try:
        return read(path)
    except ReplayError:
        return None


def curve(replay: Replay, expectation: int, verdict: Verdict) -> Signal | None:
    """Of the curves of an expectation, counted from 0, the one that its verdict is about; None if it has none."""
    stored = [signal for signal in replay.signals if signal.expectation == expectation]
    curves = [_read(signal, replay) for signal in stored]
    return min(curves, key=lambda one: _strangeness(one, verdict), default=None)


def _read(stored: SignalData, replay: Replay) -> Signal:
    frames = replay.frames
    column, count = (frames.time, frames.count) if stored.time is None else (stored.time, 1 + len(stored.time.deltas))
    return Signal(
        stored.name,
        stored.unit,
        column.decoded(count),
        stored.values.decoded(count),
        stored.lower,
        stored.upper,
        stored.start,
        np.inf if stored.end is None else stored.end,
    )


def _strangeness(signal: Signal, verdict: Verdict) -> tuple[bool, bool, float]:
    """How little a curve has to do with a verdict: another unit, another limit, another value at its moment."""
    limits = [limit for limit in (signal.lower, signal.upper) if limit is not None]
    limit = verdict.limit
    is_other = limit is None or not any(abs(one - limit) <= _SAME_LIMIT * max(1.0, abs(limit)) for one in limits)
    there = np.isfinite(signal.values)
    if verdict.measured is None or verdict.time is None or not there.any():
        return signal.unit != verdict.unit, is_other, np.inf
    value = float(np.interp(verdict.time, signal.time[there], signal.values[there]))
    return signal.unit != verdict.unit, is_other, abs(value - verdict.measured)
