"""Topics of states, commands and sensors: /clock, /joint_states, /cmd_vel, /wrench, /scan of a lidar and /imu."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Quaternion
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.messages import CdrForm
from sim_action.recording.export.ros2.topics import Frames, Topic, nanoseconds, stamps
from sim_action.robot.model.kinematics import link_of_frame
from sim_action.robot.model.link_motion import link_motion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.sensors import MountedSensor
from sim_action.sensors.lidar import Lidar
from sim_action.state.command import WORLD_FRAME, LinkWrench
from sim_action.state.trace import Trace
from sim_action.state.trace_records import SensorRecord

_NAMES: Final = {"lidar": "scan", "imu": "imu"}
_UNKNOWN: Final = (0.0,) * 9


def sensing(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield a topic for each lidar and IMU in the trace; several of one kind are named by sensor."""
    kept = [mounted for mounted in run.sensors if mounted.name in run.trace.sensors]
    taken = set[str]()
    for mounted in kept:
        kind, record = mounted.sensor.key, run.trace.sensors[mounted.name]
        if kind not in _NAMES:
            continue
        alone = sum(other.sensor.key == kind for other in kept) == 1
        name = _free(f"/{_NAMES[kind]}" if alone else f"/{_plain(mounted.name)}/{_NAMES[kind]}", taken)
        yield (_scan if kind == "lidar" else _imu)(name, frames.sensors[mounted.name], mounted, record)


def _plain(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return plain if plain[:1].isalpha() else f"sensor_{plain}"


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


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
    count, at = len(trace), nanoseconds(trace.time)
    clock = CdrForm().gap("<i4", 2).filled(count, stamps(trace.time))
    yield Topic("/clock", "rosgraph_msgs/Clock", at, clock)
    if joints := len(trace.joint_names):
        form = CdrForm().gap("<i4", 2).string("").strings(*trace.joint_names)
        for _ in range(3):
            form.fixed("<u4", joints).gap("<f8", joints)
        columns = (trace.joint_position, trace.joint_velocity, trace.joint_effort)
        yield Topic("/joint_states", "sensor_msgs/JointState", at, form.filled(count, stamps(trace.time), *columns))
    if len(twists):
        messages = CdrForm().gap("<f8", 6).filled(len(twists), twists.values)
        yield Topic("/cmd_vel", "geometry_msgs/Twist", nanoseconds(twists.time), messages)
    yield from _wrenches(run)


def _wrenches(run: RecordedRun) -> Iterator[Topic]:
    """Yield a topic for each link with a commanded wrench: the sum of its wrenches, in the link's own frame.

    There is a message for each change of the command, and for each moment at which the wrench has changed in the frame
    of the link because the link has turned.
    """
    turns, taken = _Turns(run.scene.model, run.trace), set[str]()
    for link in dict.fromkeys(wrench.link for _, wrenches in run.wrenches for wrench in wrenches):
        time, sums = list[float](), list[NDArray[np.float64]]()
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
        name = _free(f"/wrench/{_plain(link)}", taken)
        yield Topic(name, "geometry_msgs/WrenchStamped", nanoseconds(np.array(time)), messages)


class _Turns:
    """The orientations of links at the moments of a trace."""

    def __init__(self, model: RobotModel, trace: Trace) -> None:
        self._model, self._trace = model, trace
        self._found: dict[str, NDArray[np.float64]] = {}

    def moments(self, wrenches: Sequence[LinkWrench], start: float, end: float) -> list[float]:
        """Return the times in s from `start` to before `end` at which wrenches on a link may change in its frame."""
        if not wrenches:
            return []
        if not any(self._frame(each) != each.link and any((*each.force_xyz, *each.torque_xyz)) for each in wrenches):
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
        if link not in self._found:
            self._found[link] = link_motion(self._model, self._trace, link).orientation_xyzw
        x, y, z, w = self._found[link][row].tolist()
        return x, y, z, w
