"""The moments of a replay as columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.replay.columns import MAX_MOMENTS, Column, FloatArray
from sim_action.recording.replay.replay_file import Frames, PoseColumns
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord

# Of a column's step: m, of quaternions, rad (or m, where joints slide), m/s.
_LENGTH: Final = 1e-4
_TURN: Final = 1e-4
_JOINT: Final = 1e-3
_SLIDING: Final = 1e-4
_SPEED: Final = 1e-3


def thinned(trace: Trace) -> Trace:
    """At most so many moments as a column may have, evenly spread, with the last one."""
    if len(trace) <= MAX_MOMENTS:
        return trace
    return trace.rows(np.linspace(0, len(trace) - 1, MAX_MOMENTS).round().astype(np.intp))


@dataclass(frozen=True, slots=True)
class Track:
    """A body that moves; `appears`: s before which it is not there, and its record says nothing."""

    record: BodyRecord
    appears: float = 0.0


def frames_of(trace: Trace, tracks: Sequence[Track], rate: float, sliding: Sequence[bool]) -> Frames:
    """The columns of a trace and of bodies; `rate`: of the physics; `sliding`: of each joint, whether it slides."""
    steps = [_SLIDING if slides else _JOINT for slides in sliding]
    return Frames(
        time=Column.encoded(trace.time, 1 / rate),
        base=_pose_columns(trace.base_position_xyz, trace.base_orientation_xyzw),
        joints=tuple(Column.encoded(column, step) for column, step in zip(trace.joint_position.T, steps, strict=True)),
        speed=Column.encoded(trace.speed, _SPEED),
        tilt=Column.encoded(trace.tilt, _JOINT),
        tracks=tuple(_track(track, trace.time) for track in tracks),
    )


def _track(track: Track, time: FloatArray) -> PoseColumns:
    """A body at these moments; where it was not looked at, as just before, and until it appears, as then."""
    record = track.record
    first = min(int(np.searchsorted(record.time, track.appears - TIME_EPSILON_S)), len(record) - 1)
    rows = np.searchsorted(record.time, time + TIME_EPSILON_S, side="right") - 1
    rows = np.clip(rows, first, None)
    position, orientation = record.position_xyz[rows], _steady(record.orientation_xyzw[rows])
    since = time[-1] - record.time[-1]
    if since > TIME_EPSILON_S and len(record) - first > 1:
        # The very last moment comes between two looks: it goes on as it went.
        ahead = since / (record.time[-1] - record.time[-2])
        position[-1] += ahead * (record.position_xyz[-1] - record.position_xyz[-2])
        before, last = _steady(record.orientation_xyzw[-2:])
        turned = last + ahead * (last - before)
        orientation[-1] = turned / np.linalg.norm(turned)
    return _pose_columns(position, orientation)


def _pose_columns(position_xyz: FloatArray, orientation_xyzw: FloatArray) -> PoseColumns:
    x, y, z = (Column.encoded(column, _LENGTH) for column in position_xyz.T)
    qx, qy, qz, qw = (Column.encoded(column, _TURN) for column in _steady(orientation_xyzw).T)
    return (x, y, z, qx, qy, qz, qw)


def _steady(orientation_xyzw: FloatArray) -> FloatArray:
    """The same turns, without jumps from a quaternion to its negative, which turns alike."""
    dots = np.einsum("ij,ij->i", orientation_xyzw[1:], orientation_xyzw[:-1])
    signs = np.cumprod(np.concatenate(([1.0], np.where(dots < 0, -1.0, 1.0))))
    return orientation_xyzw * signs[:, None]
