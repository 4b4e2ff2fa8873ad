"""/odom: what wheels tell of the way, where a sensor counts them; else the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from sim_action.core.units import TIME_EPSILON
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.cdr import CdrForm
from sim_action.recording.export.ros2.frames import Frames
from sim_action.recording.export.ros2.poses import seen_from
from sim_action.recording.export.ros2.topics import Topic, nanoseconds, stamps
from sim_action.state.trace import FloatArray

_TYPE: Final = "nav_msgs/Odometry"
_COVARIANCE: Final = (0.0,) * 36


@dataclass(frozen=True, eq=False)
class Believed:
    """N times of odometry.

    Attributes:
        time: (N,) s.
        poses: (N, 7) of the base.
        twists: (N, 6) of the base, in its own frame; linear, then angular.
    """

    time: FloatArray
    poses: FloatArray
    twists: FloatArray

    def latest(self, time: FloatArray) -> FloatArray:
        """(T, 7) the last pose that was told until each time."""
        told = np.searchsorted(self.time, time + TIME_EPSILON, side="right") - 1
        poses: FloatArray = self.poses[told.clip(0)]
        return poses


def wheel_odometry(run: RecordedRun) -> Believed | None:
    """Of the first sensor of that kind, if the trace keeps one."""
    for record in run.trace.sensors.values():
        if record.kind == "odometry" and len(record):
            columns = record.columns
            return Believed(
                record.time,
                np.column_stack((columns["position_xyz"], columns["orientation_xyzw"])),
                np.column_stack((columns["linear_xyz"], columns["angular_xyz"])),
            )
    return None


def odometry(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """/odom, and beside that of wheels /ground_truth/odom."""
    believed, truth = wheel_odometry(run), _truth(run)
    if believed is None:
        yield _topic("/odom", frames.odom, frames.base, truth, "ground truth")
        return
    yield _topic("/odom", frames.odom, frames.base, believed, "wheel odometry")
    yield _topic("/ground_truth/odom", frames.map, frames.base, truth, "ground truth")


def _truth(run: RecordedRun) -> Believed:
    trace = run.trace
    turned = trace.base_orientation_xyzw
    twists = [seen_from(turned, vectors) for vectors in (trace.base_linear_xyz, trace.base_angular_xyz)]
    return Believed(trace.time, np.column_stack((trace.base_position_xyz, turned)), np.column_stack(twists))


def _topic(name: str, frame: str, child: str, told: Believed, source: str) -> Topic:
    form = CdrForm().gap("<i4", 2).string(frame).string(child)
    form.gap("<f8", 7).fixed("<f8", *_COVARIANCE).gap("<f8", 6).fixed("<f8", *_COVARIANCE)
    messages = form.filled(len(told.time), stamps(told.time), told.poses, told.twists)
    return Topic(name, _TYPE, nanoseconds(told.time), messages, {"source": source})
