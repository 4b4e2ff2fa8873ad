"""The frames of a replay: the motion of robot and bodies as columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sim_action.core.records import dataclass
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.replay.columns import MAX_MOMENTS, Column, FloatArray, steady
from sim_action.recording.replay.replay_data import Frames, PoseColumns
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord, CommandedValues

# The resolution of columns: lengths in m, quaternions, joints in rad (sliding ones in m), speed in m/s.
_LENGTH: Final = 1e-4
_TURN: Final = 1e-4
_JOINT: Final = 1e-3
_SLIDING: Final = 1e-4
_SPEED: Final = 1e-3

NOTHING_COMMANDED: Final = CommandedValues()


def thinned(trace: Trace) -> Trace:
    """Return a trace with at most `MAX_MOMENTS` evenly spaced moments, including the last one."""
    if len(trace) <= MAX_MOMENTS:
        return trace
    return trace.rows(np.linspace(0, len(trace) - 1, MAX_MOMENTS).round().astype(np.intp))


@dataclass(frozen=True, slots=True)
class Track:
    """A moving body; `appears` is the time in s before which its record is not valid."""

    record: BodyRecord
    appears: float = 0.0


def frames_of(
    trace: Trace,
    tracks: Sequence[Track],
    rate: float,
    sliding: Sequence[bool],
    aims: CommandedValues = NOTHING_COMMANDED,
) -> Frames:
    """Return the frames of a trace and of moving bodies.

    `rate` is the physics rate in Hz; `sliding` is True for each prismatic joint; `aims`: the commanded positions.
    """
    steps = [_SLIDING if slides else _JOINT for slides in sliding]
    return Frames(
        time=Column.encoded(trace.time, 1 / rate),
        base=_pose_columns(trace.base_position_xyz, trace.base_orientation_xyzw),
        joints=tuple(Column.encoded(column, step) for column, step in zip(trace.joint_position.T, steps, strict=True)),
        commanded=_commanded(trace, aims, steps),
        speed=Column.encoded(trace.speed, _SPEED),
        tilt=Column.encoded(trace.tilt, _JOINT),
        tracks=tuple(_track(track, trace.time) for track in tracks),
    )


def _commanded(trace: Trace, aims: CommandedValues, steps: Sequence[float]) -> tuple[Column | None, ...]:
    """Return a column per joint, None for a joint without position targets; nothing if no joint has one."""
    found = [aims.at(name, trace.time) for name in trace.joint_names]
    columns = [
        Column.encoded(values, step) if np.isfinite(values).any() else None
        for values, step in zip(found, steps, strict=True)
    ]
    return tuple(columns) if any(columns) else ()


def _track(track: Track, time: FloatArray) -> PoseColumns:
    """Return the poses of a body at given times: the last recorded pose, or the first one before it appears."""
    record = track.record
    first = min(int(np.searchsorted(record.time, track.appears - TIME_EPSILON_S)), len(record) - 1)
    rows = np.searchsorted(record.time, time + TIME_EPSILON_S, side="right") - 1
    rows = np.clip(rows, first, None)
    position, orientation = record.position_xyz[rows], steady(record.orientation_xyzw[rows])
    since = time[-1] - record.time[-1]
    if since > TIME_EPSILON_S and len(record) - first > 1:
        # The last moment lies after the last record, so extrapolate the motion.
        ahead = since / (record.time[-1] - record.time[-2])
        position[-1] += ahead * (record.position_xyz[-1] - record.position_xyz[-2])
        before, last = steady(record.orientation_xyzw[-2:])
        turned = last + ahead * (last - before)
        orientation[-1] = turned / np.linalg.norm(turned)
    return _pose_columns(position, orientation)


def _pose_columns(position_xyz: FloatArray, orientation_xyzw: FloatArray) -> PoseColumns:
    x, y, z = (Column.encoded(column, _LENGTH) for column in position_xyz.T)
    qx, qy, qz, qw = (Column.encoded(column, _TURN) for column in steady(orientation_xyzw).T)
    return (x, y, z, qx, qy, qz, qw)
