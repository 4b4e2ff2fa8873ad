"""MCAP logs of ROS 2 messages: `--record mcap`.

Topics: /tf and /tf_static with all coordinate frames, /odom and /ground_truth/odom of the base, /clock, /joint_states,
/cmd_vel, /wrench, /scan of a lidar and /imu; /NAME/joint_states and /NAME/odom of each other robot; `ros2_markers` has
the topics that are drawn.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, BinaryIO, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.wording import free_name
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2_markers import contacts, robot_description, world_markers
from sim_action.recording.export.ros2_messages import CdrForm, Frames, Topic, definition, full_name, nanoseconds, stamps
from sim_action.recording.replay.channels import in_base_frame
from sim_action.robot.model.kinematics import frames_of, joint_motion, link_motion, link_of_frame
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.sensors import MountedSensor
from sim_action.sensors.lidar import Lidar
from sim_action.state.command import WORLD_FRAME, LinkWrench
from sim_action.state.trace import Trace
from sim_action.state.trace_records import SensorRecord
from sim_action.world import placed

if TYPE_CHECKING:
    from mcap.writer import Writer


class McapLog:
    """A log of ROS 2 messages for Foxglove, Lichtblick and `ros2 bag`: frames, joints, odometry, commands, contacts.

    Times are sim time. The frame `map` is the world. `odom` coincides with it, unless the trace contains wheel
    odometry, which drifts relative to `map`.
    """

    extra: ClassVar[str] = "mcap"
    packages: ClassVar[tuple[str, ...]] = ("mcap.writer",)

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Write a run; see `Export.write`."""
        from mcap.writer import Writer

        writer: Any = Writer(file)  # not all of it has types
        writer.start(profile="ros2")
        _write_topics(writer, list(topics(run)))
        writer.finish()


def topics(run: RecordedRun) -> Iterator[Topic]:
    """Yield all topics of a run; those with a single message come first."""
    frames = Frames.of(run)
    yield from robot_description(run)
    yield from transforms(run, frames)
    yield from world_markers(run, frames)
    yield from states(run)
    yield from odometry(run, frames)
    yield from of_actors(run, frames)
    yield from sensing(run, frames)
    yield from contacts(run, frames)


def _write_topics(writer: Writer, written: list[Topic]) -> None:
    """Write all messages in the order of their times."""
    schemas: dict[str, int] = {}
    channels = []
    for topic in written:
        if topic.type not in schemas:
            text = definition(topic.type).encode()
            schemas[topic.type] = writer.register_schema(full_name(topic.type), "ros2msg", text)
        channels.append(writer.register_channel(topic.name, "cdr", schemas[topic.type], topic.metadata))
    times = np.concatenate([topic.time for topic in written])
    messages = [message for topic in written for message in topic.messages]
    of = [channel for channel, topic in zip(channels, written, strict=True) for _ in topic.messages]
    for index in np.argsort(times, kind="stable").tolist():
        time = int(times[index])
        writer.add_message(of[index], time, messages[index], time)


_NAMES: Final = {"lidar": "scan", "imu": "imu"}
_UNKNOWN: Final = (0.0,) * 9


def sensing(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield a topic for each lidar and IMU in the trace; several of one kind are named by sensor."""
    kept = [mounted for mounted in run.sensors if mounted.name in run.trace.sensors]
    taken = set[str]()
    kinds = Counter(mounted.sensor.key for mounted in kept)
    for mounted in kept:
        kind, record = mounted.sensor.key, run.trace.sensors[mounted.name]
        if kind not in _NAMES:
            continue
        alone = kinds[kind] == 1
        name = free_name(f"/{_NAMES[kind]}" if alone else f"/{_plain(mounted.name)}/{_NAMES[kind]}", taken)
        yield (_scan if kind == "lidar" else _imu)(name, frames.sensors[mounted.name], mounted, record)


def _plain(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return plain if plain[:1].isalpha() else f"sensor_{plain}"


def _scan(name: str, frame: str, mounted: MountedSensor, record: SensorRecord) -> Topic:
    lidar, ranges = mounted.sensor, record.columns["ranges"]
    assert isinstance(lidar, Lidar)
    rays = ranges.shape[1]
    last = lidar.first_angle + lidar.increment * (rays - 1)
    form = CdrForm().gap("<i4", 2).string(frame).fixed("<f4", lidar.first_angle, last, lidar.increment)
    form.fixed("<f4", 0.0, 1 / mounted.rate, lidar.min_range, lidar.range)
    form.fixed("<u4", rays).gap("<f4", rays).fixed("<u4", 0)
    messages = form.filled(len(record), stamps(record.time), ranges)
    return Topic(name, "sensor_msgs/LaserScan", nanoseconds(record.time), messages)


def _imu(name: str, frame: str, _: MountedSensor, record: SensorRecord) -> Topic:
    columns = [record.columns[f"{key}"] for key in ("orientation_xyzw", "angular_velocity_xyz")]
    acceleration = np.asarray(record.columns["linear_acceleration_xyz"])
    form = CdrForm().gap("<i4", 2).string(frame).gap("<f8", 4).fixed("<f8", *_UNKNOWN)
    form.gap("<f8", 3).fixed("<f8", *_UNKNOWN).gap("<f8", 3).fixed("<f8", *_UNKNOWN)
    messages = form.filled(len(record), stamps(record.time), *columns, acceleration)
    return Topic(name, "sensor_msgs/Imu", nanoseconds(record.time), messages)


def states(run: RecordedRun) -> Iterator[Topic]:
    """Yield /clock, and /joint_states, /cmd_vel and /wrench/LINK if the robot has joints, or got twists or wrenches."""
    trace, twists = run.trace, run.twists
    count = len(trace)
    at = nanoseconds(trace.time)
    clock = CdrForm().gap("<i4", 2).filled(count, stamps(trace.time))
    yield Topic("/clock", "rosgraph_msgs/Clock", at, clock)
    if trace.joint_names:
        yield _joint_states("/joint_states", trace)
    if len(twists):
        messages = CdrForm().gap("<f8", 6).filled(len(twists), twists.values)
        yield Topic("/cmd_vel", "geometry_msgs/Twist", nanoseconds(twists.time), messages)
    yield from _wrenches(run)


def _joint_states(name: str, trace: Trace) -> Topic:
    joints, time = len(trace.joint_names), trace.time
    form = CdrForm().gap("<i4", 2).string("").strings(*trace.joint_names)
    for _ in range(3):
        form.fixed("<u4", joints).gap("<f8", joints)
    columns = (trace.joint_position, trace.joint_velocity, trace.joint_effort)
    messages = form.filled(len(time), stamps(time), *columns)
    return Topic(name, "sensor_msgs/JointState", nanoseconds(time), messages)


def _wrenches(run: RecordedRun) -> Iterator[Topic]:
    """Yield a topic for each link with a commanded wrench: the sum of its wrenches, in the link's own frame.

    There is a message for each change of the command, and for each moment at which the wrench has changed in the frame
    of the link because the link has turned.
    """
    turns = _Turns(run.scene.model, run.trace)
    taken = set[str]()
    for link in dict.fromkeys(wrench.link for _, wrenches in run.wrenches for wrench in wrenches):
        time = list[float]()
        sums = list[NDArray[np.float64]]()
        ends = [*(moment for moment, _ in run.wrenches[1:]), np.inf]
        for (start, wrenches), end in zip(run.wrenches, ends, strict=True):
            mine = [wrench for wrench in wrenches if wrench.link == link]
            for moment in turns.moments(mine, start, end):
                row = turns.row(moment)
                total = np.sum([turns.in_own_frame(wrench, row) for wrench in mine], axis=0)
                if moment == start or not np.array_equal(total, sums[-1]):
                    time.append(moment)
                    sums.append(total)
        form = CdrForm().gap("<i4", 2).string(link).gap("<f8", 6)
        messages = form.filled(len(time), stamps(np.array(time)), np.array(sums))
        name = free_name(f"/wrench/{_plain(link)}", taken)
        yield Topic(name, "geometry_msgs/WrenchStamped", nanoseconds(np.array(time)), messages)


class _Turns:
    """The orientations of links at the moments of a trace."""

    def __init__(self, model: RobotModel, trace: Trace) -> None:
        self._model, self._trace = model, trace
        self._orientations: dict[str, NDArray[np.float64]] = {}

    def moments(self, wrenches: Sequence[LinkWrench], start: float, end: float) -> list[float]:
        """Return the times in s from `start` to before `end` at which wrenches on a link may change in its frame."""
        if not wrenches:
            return []
        if not any(
            self._frame(wrench) != wrench.link and any((*wrench.force_xyz, *wrench.torque_xyz)) for wrench in wrenches
        ):
            return [start]
        first, last = np.searchsorted(self._trace.time, (start + TIME_EPSILON_S, end - TIME_EPSILON_S))
        return [start, *self._trace.time[first:last].tolist()]

    def row(self, moment: float) -> int:
        """Return the index of the first moment of the trace at or after a time in s."""
        return min(int(np.searchsorted(self._trace.time, moment - TIME_EPSILON_S)), len(self._trace) - 1)

    def in_own_frame(self, wrench: LinkWrench, row: int) -> NDArray[np.float64]:
        """Return force and torque (6,) about the axes and the origin of the wrench's link, at the moment of a row."""
        force, torque, frame = wrench.force_xyz, wrench.torque_xyz, self._frame(wrench)
        if frame != wrench.link:
            back = geometry.conjugate(self._orientation(row, wrench.link))
            ahead = geometry.IDENTITY if frame == WORLD_FRAME else self._orientation(row, frame)
            turn = geometry.multiply(back, ahead)
            force, torque = geometry.rotate(turn, force), geometry.rotate(turn, torque)
        return np.array([*force, *np.add(torque, np.cross(wrench.point_xyz, force))])

    def _frame(self, wrench: LinkWrench) -> str:
        return link_of_frame(self._model, wrench.frame)

    def _orientation(self, row: int, link: str) -> Quaternion:
        if link not in self._orientations:
            self._orientations[link] = link_motion(self._model, self._trace, link).orientation_xyzw
        x, y, z, w = self._orientations[link][row].tolist()
        return x, y, z, w


Link = tuple[str, str, FloatArray]
"""Parent frame, child frame, and (T, 7) poses of the child in the parent; NaN where the child does not exist."""

_TYPE: Final = "tf2_msgs/TFMessage"


def transforms(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /tf with the moving frames at each moment, and /tf_static with the fixed ones."""
    time = run.trace.time
    fixed = _messages(time[:1], [*_fixed(run, frames)])
    yield Topic("/tf_static", _TYPE, nanoseconds(time[:1]), fixed, is_latched=True)
    moving = [*_of_base(run, frames), *_of_joints(run), *_of_bodies(run, frames)]
    messages = [message for start, end in _spans(moving) for message in _messages(time[start:end], moving, start)]
    yield Topic("/tf", _TYPE, nanoseconds(time), messages)


def _spans(links: Sequence[Link]) -> Iterator[tuple[int, int]]:
    known_rows = np.column_stack([~np.isnan(track[:, 0]) for _, _, track in links])
    changes = np.flatnonzero((known_rows[1:] != known_rows[:-1]).any(axis=1)) + 1
    return pairwise([0, *changes.tolist(), len(known_rows)])


def _messages(time: FloatArray, links: Sequence[Link], start: int = 0) -> list[bytes]:
    later_links = [(parent, child, track[start : start + len(time)]) for parent, child, track in links]
    links = [link for link in later_links if not np.isnan(link[2][0, 0])]
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
    of_odom, of_base = (frames_of(poses[:, :3], poses[:, 3:]) for poses in (at, truth))
    yield frames.map, frames.odom, of_pose(geometry.compose(of_base, geometry.inverse(of_odom)), len(at))
    yield frames.odom, frames.base, at


def _of_joints(run: RecordedRun) -> Iterator[Link]:
    """Yield the links that joints move; a link of MJCF may have several joints in series."""
    for child, joints in run.scene.model.joints_to.items():
        moving = [joint for joint in joints if joint.moves]
        if moving:
            pose = joints[0].origin
            for joint in moving:
                pose = geometry.compose(pose, joint_motion(joint, _positions(run, joint), np))
            yield joints[0].parent, child, of_pose(pose, len(run.trace))


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
    """Odometry at N times."""

    time: FloatArray  # (N,) s
    poses: FloatArray  # (N, 7) of the base
    twists: FloatArray  # (N, 6) of the base, in its own frame; linear, then angular

    def latest(self, time: FloatArray) -> FloatArray:
        """Return (T, 7) the last odometry pose at or before each time."""
        rows = np.searchsorted(self.time, time + TIME_EPSILON_S, side="right") - 1
        poses: FloatArray = self.poses[rows.clip(0)]
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
    measured = wheel_odometry(run)
    truth = _ground_truth(run.trace)
    if measured is None:
        yield _odometry_topic("/odom", frames.odom, frames.base, truth, "ground truth")
        return
    yield _odometry_topic("/odom", frames.odom, frames.base, measured, "wheel odometry")
    yield _odometry_topic("/ground_truth/odom", frames.map, frames.base, truth, "ground truth")


def of_actors(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /NAME/joint_states and /NAME/odom of each other robot; its odometry is the truth in the world frame."""
    taken = {"/ground_truth/odom"}
    for name, trace in run.actors.items():
        if trace.joint_names:
            yield _joint_states(free_name(f"/{_plain(name)}/joint_states", taken), trace)
        topic = free_name(f"/{_plain(name)}/odom", taken)
        truth = _ground_truth(trace)
        yield _odometry_topic(topic, frames.map, frames.bodies[name], truth, "ground truth")


def _ground_truth(trace: Trace) -> OdometryTrack:
    turned = trace.base_orientation_xyzw
    twists = (*in_base_frame(turned, trace.base_linear_xyz), *in_base_frame(turned, trace.base_angular_xyz))
    return OdometryTrack(trace.time, np.column_stack((trace.base_position_xyz, turned)), np.column_stack(twists))


def _odometry_topic(name: str, frame: str, child: str, track: OdometryTrack, source: str) -> Topic:
    form = CdrForm().gap("<i4", 2).string(frame).string(child)
    form.gap("<f8", 7).fixed("<f8", *_COVARIANCE).gap("<f8", 6).fixed("<f8", *_COVARIANCE)
    messages = form.filled(len(track.time), stamps(track.time), track.poses, track.twists)
    return Topic(name, _ODOMETRY, nanoseconds(track.time), messages, {"source": source})


def of_pose(pose: Pose, count: int = 1) -> FloatArray:
    """Return poses (N, 7) x, y, z in m and quaternion x, y, z, w; the numbers of `pose` may be columns (N,)."""
    return np.column_stack([np.broadcast_to(number, count) for number in (*pose.position_xyz, *pose.orientation_xyzw)])
