"""How near the robot came to bodies, folded over traces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_action.state.trace_channels import ClearanceWatch
from sim_action.state.trace_records import Nearness

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray, Trace


def nearest_of(trace: Trace, watch: ClearanceWatch | None, before: Nearness | None) -> Nearness | None:
    """The first least distance of what a watch tells of these moments and what was known before; None if nothing is."""
    record = None if watch is None else trace.clearances.get(watch)
    if record is None or not len(record):
        return before
    nearest = record.at(int(record.distance.argmin()))
    return nearest if before is None or nearest.distance < before.distance else before


def distances(trace: Trace, *watches: ClearanceWatch) -> tuple[FloatArray, FloatArray]:
    """(N,) s and (N,) m: all that watches of the same two tell."""
    records = [trace.clearances[watch] for watch in watches if watch in trace.clearances]
    if not records:
        return np.empty(0), np.empty(0)
    time, first = np.unique(np.concatenate([record.time for record in records]), return_index=True)
    return time, np.concatenate([record.distance for record in records])[first]


def least_so_far(trace: Trace, watch: ClearanceWatch) -> tuple[FloatArray, FloatArray]:
    """(N,) s and (N,) m: what was nearest up to each moment that came nearer, and at the last of the trace."""
    time, distance = distances(trace, watch)
    if not len(time):
        return time, distance
    least = np.minimum.accumulate(distance)
    last = float(trace.time[-1])
    return (np.append(time, last), np.append(least, least[-1])) if last > time[-1] else (time, least)
