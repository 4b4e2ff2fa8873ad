"""/tf and /tf_static: where everything is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from sim_action.core.geometry import Pose
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2 import poses
from sim_action.recording.export.ros2.cdr import CdrForm
from sim_action.recording.export.ros2.frames import Frames
from sim_action.recording.export.ros2.odometry import wheel_odometry
from sim_action.recording.export.ros2.topics import Topic, nanoseconds, stamps
from sim_action.robot.robot_model import Joint
from sim_action.state.trace import FloatArray
from sim_action.world import placed

Link = tuple[str, str, FloatArray]
"""Parent frame, child frame, and the pose of the one in the other at each moment, (T, 7); not a number: not there."""

_TYPE: Final = "tf2_msgs/TFMessage"


def transforms(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """What moves, moment by moment, as far as it is there; what does not, once."""
    time = run.trace.time
    yield Topic("/tf_static", _TYPE, nanoseconds(time[:1]), _messages(time[:1], [*_fixed(run, frames)]))
    moving = [*_of_base(run, frames), *_of_joints(run), *_of_bodies(run, frames)]
    messages = [message for start, end in _spans(moving) for message in _messages(time[start:end], moving, start)]
    yield Topic("/tf", _TYPE, nanoseconds(time), messages)


def _spans(links: Sequence[Link]) -> Iterator[tuple[int, int]]:
    """Moments, from the first up to the last, through which the same of them are there."""
    there = np.column_stack([~np.isnan(track[:, 0]) for _, _, track in links])
    changes = np.flatnonzero((there[1:] != there[:-1]).any(axis=1)) + 1
    return pairwise([0, *changes.tolist(), len(there)])


def _messages(time: FloatArray, links: Sequence[Link], start: int = 0) -> list[bytes]:
    """Of moments from `start` on, through which the same links are there."""
    told = [(parent, child, track[start : start + len(time)]) for parent, child, track in links]
    return _filled(time, [link for link in told if not np.isnan(link[2][0, 0])])


def _filled(time: FloatArray, links: Sequence[Link]) -> list[bytes]:
    form = CdrForm().fixed("<u4", len(links))
    columns: list[FloatArray] = []
    for parent, child, placed_at in links:
        form.gap("<i4", 2).string(parent).string(child).gap("<f8", 7)
        columns += [stamps(time).astype(np.float64), placed_at]
    return form.filled(len(time), *columns)


def _of_base(run: RecordedRun, frames: Frames) -> Iterator[Link]:
    """Where wheels were counted, `odom` drifts in `map`, and their product is the truth."""
    trace = run.trace
    truth = np.column_stack((trace.base_position_xyz, trace.base_orientation_xyzw))
    believed = wheel_odometry(run)
    if believed is None:
        yield frames.odom, frames.base, truth
        return
    at = believed.latest(trace.time)
    yield frames.map, frames.odom, poses.composed(truth, poses.inverted(at))
    yield frames.odom, frames.base, at


def _of_joints(run: RecordedRun) -> Iterator[Link]:
    for joint in run.scene.model.moving_joints:
        yield joint.parent, joint.child, poses.moved_by(joint, _positions(run, joint))


def _positions(run: RecordedRun, joint: Joint) -> FloatArray:
    trace = run.trace
    if joint.name not in trace.joint_names:
        return np.full(len(trace), joint.home)
    return trace.joint_position[:, trace.joint_names.index(joint.name)]


def _of_bodies(run: RecordedRun, frames: Frames) -> Iterator[Link]:
    return ((frames.map, frames.bodies[name], track) for name, track in run.bodies.items())


def _fixed(run: RecordedRun, frames: Frames) -> Iterator[Link]:
    scene = run.scene
    if wheel_odometry(run) is None:
        yield frames.map, frames.odom, poses.of_pose(Pose())
    for joint in scene.model.joints:
        if not joint.moves:
            yield joint.parent, joint.child, poses.of_pose(joint.origin)
    for mounted in run.sensors:
        if mounted.sensor.reads_wheels:
            continue
        link = scene.model.root if mounted.link is None else mounted.link
        yield link, frames.sensors[mounted.name], poses.of_pose(mounted.pose)
    for body in scene.world.objects:
        if body.name not in run.bodies:
            yield frames.map, frames.bodies[body.name], poses.of_pose(placed(body, scene.parts_of(body)))
