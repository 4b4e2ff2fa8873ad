"""Topics of motion: /tf and /tf_static with all coordinate frames, /odom and /ground_truth/odom of the base."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, Final, cast

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose, Quaternion, Vector3
from sim_action.core.records import dataclass
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.messages import CdrForm
from sim_action.recording.export.ros2.topics import Frames, Topic, nanoseconds, stamps
from sim_action.robot.model.robot_model import Joint
from sim_action.state.trace import FloatArray
from sim_action.world import placed

Link = tuple[str, str, FloatArray]
"""Parent frame, child frame, and (T, 7) poses of the child in the parent; NaN where the child does not exist."""

_TYPE: Final = "tf2_msgs/TFMessage"


def transforms(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /tf with the moving frames at each moment, and /tf_static with the fixed ones."""
    time = run.trace.time
    yield Topic("/tf_static", _TYPE, nanoseconds(time[:1]), _messages(time[:1], [*_fixed(run, frames)]))
    moving = [*_of_base(run, frames), *_of_joints(run), *_of_bodies(run, frames)]
    messages = [message for start, end in _spans(moving) for message in _messages(time[start:end], moving, start)]
    yield Topic("/tf", _TYPE, nanoseconds(time), messages)


def _spans(links: Sequence[Link]) -> Iterator[tuple[int, int]]:
    there = np.column_stack([~np.isnan(track[:, 0]) for _, _, track in links])
    changes = np.flatnonzero((there[1:] != there[:-1]).any(axis=1)) + 1
    return pairwise([0, *changes.tolist(), len(there)])


def _messages(time: FloatArray, links: Sequence[Link], start: int = 0) -> list[bytes]:
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
    """Yield map -> odom -> base; with wheel odometry, `odom` drifts so that the product is the true pose."""
    trace = run.trace
    truth = np.column_stack((trace.base_position_xyz, trace.base_orientation_xyzw))
    measured = wheel_odometry(run)
    if measured is None:
        yield frames.odom, frames.base, truth
        return
    at = measured.latest(trace.time)
    yield frames.map, frames.odom, composed(truth, inverted(at))
    yield frames.odom, frames.base, at


def _of_joints(run: RecordedRun) -> Iterator[Link]:
    """Yield the links that joints move; a link of MJCF may have several joints in series."""
    for child, joints in run.scene.model.joints_to.items():
        moving = [joint for joint in joints if joint.moves]
        if moving:
            track = of_pose(joints[0].origin, len(run.trace))
            for joint in moving:
                track = composed(track, moved_by(joint, _positions(run, joint)))
            yield joints[0].parent, child, track


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
        yield frames.map, frames.odom, of_pose(Pose())
    for child, joints in scene.model.joints_to.items():
        if not any(joint.moves for joint in joints):
            yield joints[0].parent, child, of_pose(joints[0].origin)
    for mounted in run.sensors:
        if mounted.sensor.reads_wheels:
            continue
        link = scene.model.root if mounted.link is None else mounted.link
        yield link, frames.sensors[mounted.name], of_pose(mounted.pose)
    for body in scene.world.objects:
        if body.name not in run.bodies:
            yield frames.map, frames.bodies[body.name], of_pose(placed(body, scene.parts_of(body)))


_ODOMETRY: Final = "nav_msgs/Odometry"
_COVARIANCE: Final = (0.0,) * 36


@dataclass(frozen=True, eq=False)
class OdometryTrack:
    """Odometry at N times.

    Attributes:
        time: (N,) s.
        poses: (N, 7) of the base.
        twists: (N, 6) of the base, in its own frame; linear, then angular.
    """

    time: FloatArray
    poses: FloatArray
    twists: FloatArray

    def latest(self, time: FloatArray) -> FloatArray:
        """Return (T, 7) the last odometry pose at or before each time."""
        told = np.searchsorted(self.time, time + TIME_EPSILON_S, side="right") - 1
        poses: FloatArray = self.poses[told.clip(0)]
        return poses


def wheel_odometry(run: RecordedRun) -> OdometryTrack | None:
    """Return the readings of the first odometry sensor in the trace, or None."""
    for record in run.trace.sensors.values():
        if record.kind == "odometry" and len(record):
            columns = record.columns
            return OdometryTrack(
                record.time,
                np.column_stack((columns["position_xyz"], columns["orientation_xyzw"])),
                np.column_stack((columns["linear_xyz"], columns["angular_xyz"])),
            )
    return None


def odometry(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /odom, and with wheel odometry also /ground_truth/odom."""
    measured, truth = wheel_odometry(run), _ground_truth(run)
    if measured is None:
        yield _odometry_topic("/odom", frames.odom, frames.base, truth, "ground truth")
        return
    yield _odometry_topic("/odom", frames.odom, frames.base, measured, "wheel odometry")
    yield _odometry_topic("/ground_truth/odom", frames.map, frames.base, truth, "ground truth")


def _ground_truth(run: RecordedRun) -> OdometryTrack:
    trace = run.trace
    turned = trace.base_orientation_xyzw
    twists = [rotated_into(turned, vectors) for vectors in (trace.base_linear_xyz, trace.base_angular_xyz)]
    return OdometryTrack(trace.time, np.column_stack((trace.base_position_xyz, turned)), np.column_stack(twists))


def _odometry_topic(name: str, frame: str, child: str, told: OdometryTrack, source: str) -> Topic:
    form = CdrForm().gap("<i4", 2).string(frame).string(child)
    form.gap("<f8", 7).fixed("<f8", *_COVARIANCE).gap("<f8", 6).fixed("<f8", *_COVARIANCE)
    messages = form.filled(len(told.time), stamps(told.time), told.poses, told.twists)
    return Topic(name, _ODOMETRY, nanoseconds(told.time), messages, {"source": source})


def of_pose(pose: Pose, count: int = 1) -> FloatArray:
    """Return the same pose `count` times, (N, 7) x, y, z in m and quaternion x, y, z, w."""
    return np.tile([*pose.position_xyz, *pose.orientation_xyzw], (count, 1))


def composed(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """Return `geometry.compose` of each pair of poses (N, 7)."""
    return _array(geometry.compose(_pose(outer), _pose(inner)))


def inverted(poses: FloatArray) -> FloatArray:
    """Return `geometry.inverse` of each pose (N, 7)."""
    return _array(geometry.inverse(_pose(poses)))


def rotated_into(orientations: FloatArray, vectors: FloatArray) -> FloatArray:
    """Rotate vectors (N, 3) from the world frame into frames with orientations (N, 4)."""
    back = geometry.conjugate(cast(Quaternion, tuple(orientations.T)))
    return np.column_stack(geometry.rotate(back, cast(Vector3, tuple(vectors.T))))


def moved_by(joint: Joint, positions: FloatArray) -> FloatArray:
    """Return (N, 7) motions of the child link's frame from position zero to joint positions (N,) in rad or m."""
    motion = np.zeros((len(positions), 7))
    if joint.type == "prismatic":
        motion[:, :3], motion[:, 6] = positions[:, None] * joint.axis_xyz, 1.0
        return motion
    motion[:, 3:6], motion[:, 6] = np.sin(positions / 2)[:, None] * joint.axis_xyz, np.cos(positions / 2)
    if joint.anchor_xyz == ZERO:
        return motion
    to_anchor, back = Pose(joint.anchor_xyz), geometry.inverse(Pose(joint.anchor_xyz))
    turned = composed(of_pose(to_anchor, len(positions)), motion)
    return composed(turned, of_pose(back, len(positions)))


def _pose(poses: FloatArray) -> Pose:
    columns: Any = tuple(poses.T)
    return Pose(columns[:3], columns[3:])


def _array(pose: Pose) -> FloatArray:
    return np.column_stack((*pose.position_xyz, *pose.orientation_xyzw))
