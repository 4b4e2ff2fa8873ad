"""The trace of a run: the robot's state as columns over sim time, and its contacts; digests and differences of runs.

The simulation loop gives monitors short traces at full rate. Stored traces have a lower rate, but all contacts.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, Final, Self

from sim_action.core.geometry import Quaternion, Vector3
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.observation import Contact, Observation, SelfContact
from sim_action.state.trace_records import BodyRecord, ClearanceRecord, ClearanceWatch, ContactRecord, SensorRecord

COLUMNS: Final = (
    "time",
    "base_position_xyz",
    "base_orientation_xyzw",
    "base_linear_xyz",
    "base_angular_xyz",
    "joint_position",
    "joint_velocity",
    "joint_effort",
)
"""The columns of a state, and the arrays of a stored trace."""

_WIDTHS: Final = {"base_position_xyz": 3, "base_orientation_xyzw": 4, "base_linear_xyz": 3, "base_angular_xyz": 3}
_CONTACTS: Final = ("contacts", "self_contacts")
_RECORDS: Final = ("sensors", "clearances", "bodies", "objects", "link_contacts")


def _no_links(_: Trace) -> Mapping[str, Any]:
    """Return nothing: only traces for classes of the user's know the robot."""
    return {}


@dataclass(frozen=True, eq=False)
class Trace:
    """The state over T moments for J joints; SI units, world frame.

    Attributes:
        joint_names: J names, the order of the joint columns.
        state: (T, 14 + 3 J), a row a moment; the properties below are its columns, in this order.
        contacts: contacts of the robot with bodies, from every step of the trace; with the ground only if an
            expectation asks for them.
        sensors: sensor name -> its readings, for sensors that the trace keeps.
        clearances: watch -> the observed distances, from every step.
        bodies: body name -> its poses, 30 per second, for moving bodies, if a replay is asked for.
        objects: body name -> its poses, one for each row of `state`, for bodies that assertions name. They are NaN
            until the body appears.
        link_contacts: link -> its contacts at the moments of `state`, the ground included, for links that assertions
            name.
        self_contacts: contacts between links of the robot, from every step, if they are asked for.
        kinematics: a function of a trace, from which `links` comes.
    """

    joint_names: tuple[str, ...]
    state: FloatArray
    contacts: tuple[Contact, ...] = ()
    sensors: Mapping[str, SensorRecord] = field(default_factory=dict)
    clearances: Mapping[ClearanceWatch, ClearanceRecord] = field(default_factory=dict)
    bodies: Mapping[str, BodyRecord] = field(default_factory=dict)
    objects: Mapping[str, BodyRecord] = field(default_factory=dict)
    link_contacts: Mapping[str, ContactRecord] = field(default_factory=dict)
    self_contacts: tuple[SelfContact, ...] = ()
    kinematics: Callable[[Trace], Mapping[str, Any]] = field(default=_no_links, repr=False)

    def __len__(self) -> int:
        return len(self.state)

    @classmethod
    def of_columns(
        cls, joint_names: tuple[str, ...], contacts: tuple[Contact, ...] = (), **columns: FloatArray
    ) -> Self:
        """Return a trace from its columns; raise ValueError if a column is missing or has another length or width."""
        rows, joints = len(columns["time"]), len(joint_names)
        for name, column in columns.items():
            shape = (rows,) if name == "time" else (rows, _WIDTHS.get(name, joints))
            if column.shape != shape or column.dtype != np.float64:
                raise ValueError(f"'{name}' has the shape {column.shape} of {column.dtype}")
        return cls(joint_names, np.column_stack([columns[name] for name in COLUMNS]), contacts)

    @classmethod
    def of_observation(cls, observation: Observation) -> Self:
        """Return a trace of one moment, without contacts."""
        pose, twist, joints = observation.pose, observation.twist, observation.joints
        base = (*pose.position_xyz, *pose.orientation_xyzw, *twist.linear_xyz, *twist.angular_xyz)
        groups = zip(*joints.values(), strict=True)
        state = [observation.time, *base, *(value for group in groups for value in group)]
        return cls(tuple(joints), np.array([state], dtype=np.float64))

    @classmethod
    def concatenate(cls, traces: Sequence[Self]) -> Self:
        """Return traces of the same robot, joined in their order."""
        touches: dict[str, Any] = {
            name: tuple(one for trace in traces for one in getattr(trace, name)) for name in _CONTACTS
        }
        records = {name: _joined([getattr(trace, name) for trace in traces]) for name in _RECORDS}
        return cls(traces[0].joint_names, np.concatenate([trace.state for trace in traces]), **touches, **records)

    @property
    def time(self) -> FloatArray:
        """The sim time since the first command, (T,) s, rising."""
        return self.state[:, 0]

    @property
    def base_position_xyz(self) -> FloatArray:
        """The position of the base link's origin, (T, 3) m."""
        return self.state[:, 1:4]

    @property
    def base_orientation_xyzw(self) -> FloatArray:
        """The orientation of the base link, (T, 4) unit quaternions."""
        return self.state[:, 4:8]

    @property
    def base_linear_xyz(self) -> FloatArray:
        """The velocity of the base link's origin, (T, 3) m/s."""
        return self.state[:, 8:11]

    @property
    def base_angular_xyz(self) -> FloatArray:
        """The angular velocity of the base link, (T, 3) rad/s."""
        return self.state[:, 11:14]

    @property
    def joint_position(self) -> FloatArray:
        """The positions of the joints, (T, J) rad, or m if prismatic."""
        return self._joint_columns(0)

    @property
    def joint_velocity(self) -> FloatArray:
        """The velocities of the joints, (T, J) rad/s, or m/s if prismatic."""
        return self._joint_columns(1)

    @property
    def joint_effort(self) -> FloatArray:
        """The efforts of the motors, (T, J) N m, or N if prismatic."""
        return self._joint_columns(2)

    def _joint_columns(self, group: int) -> FloatArray:
        joints = len(self.joint_names)
        return self.state[:, 14 + group * joints : 14 + (group + 1) * joints]

    def first(self, count: int) -> Self:
        """Return the first `count` moments, with the contacts up to the last of them."""
        end = self.time[count - 1] if count else -np.inf
        return self._part(slice(count), -np.inf, end, end)

    def rows(self, selection: slice | NDArray[np.intp]) -> Self:
        """Return some of the moments with their objects and link contacts, and all other records."""
        state = self.state[selection]
        return replace(self, state=state, objects=self._objects_at(selection), link_contacts=self._contacts_at(state))

    def between(self, start: float, end: float) -> Self:
        """Return all data with start <= time <= end, but readings with start <= time < end.

        A reading belongs to the step after it: a run that ends at `end` does not have it yet.
        """
        told_until = end - 2 * TIME_EPSILON_S
        is_whole = len(self) and start <= self._first and self._last <= (told_until if self.sensors else end)
        if is_whole:
            return self
        start, end = start - TIME_EPSILON_S, end + TIME_EPSILON_S
        first, last = np.searchsorted(self.time, (start, end))
        return self._part(slice(int(first), int(last)), start, end, told_until)

    @cached_property
    def _first(self) -> float:
        """The earliest time of all data in s: contacts and other records may lie between moments."""
        if not self._tells:
            return float(self.state[0, 0])
        times = (*self._touch_times, *(record.time[0] for record in self._records))
        return float(min([self.time[0], *times]))

    @cached_property
    def _last(self) -> float:
        """The latest time of all data in s."""
        if not self._tells:
            return float(self.state[-1, 0])
        times = (*self._touch_times, *(record.time[-1] for record in self._records))
        return float(max([self.time[-1], *times]))

    @property
    def _touch_times(self) -> list[float]:
        return [*(contact.time for contact in self.contacts), *(contact.time for contact in self.self_contacts)]

    @property
    def _records(self) -> list[SensorRecord | ClearanceRecord | BodyRecord]:
        """The records that are not empty."""
        records: list[SensorRecord | ClearanceRecord | BodyRecord] = []
        for several in (self.sensors, self.clearances, self.bodies):
            records += several.values()
        return [record for record in records if len(record)]

    @property
    def _tells(self) -> bool:
        return bool(self.contacts or self.sensors or self.clearances or self.bodies or self.self_contacts)

    def _part(self, selection: slice, start: float, end: float, told_until: float) -> Self:
        if not self._tells:
            return self.rows(selection)
        return replace(
            self,
            state=self.state[selection],
            contacts=tuple(contact for contact in self.contacts if start <= contact.time <= end),
            sensors={name: record.between(start, told_until) for name, record in self.sensors.items()},
            clearances={watch: record.between(start, end) for watch, record in self.clearances.items()},
            bodies={name: record.between(start, end) for name, record in self.bodies.items()},
            objects=self._objects_at(selection),
            link_contacts=self._contacts_at(self.state[selection]),
            self_contacts=tuple(contact for contact in self.self_contacts if start <= contact.time <= end),
        )

    def _objects_at(self, selection: slice | NDArray[np.intp]) -> Mapping[str, BodyRecord]:
        return {name: record.rows(selection) for name, record in self.objects.items()} if self.objects else self.objects

    def _contacts_at(self, state: FloatArray) -> Mapping[str, ContactRecord]:
        if not self.link_contacts:
            return self.link_contacts
        return {link: record.at(state[:, 0]) for link, record in self.link_contacts.items()}

    @cached_property
    def links(self) -> Mapping[str, Any]:
        """Link name -> its `sim_action.LinkMotion` at these moments, world frame; computed when it is read."""
        return self.kinematics(self)

    @cached_property
    def speed(self) -> FloatArray:
        """The speed of the base link's origin, (T,) m/s."""
        return _norm(self.base_linear_xyz)

    @cached_property
    def turn_rate(self) -> FloatArray:
        """The magnitude of the base's angular velocity, (T,) rad/s."""
        return _norm(self.base_angular_xyz)

    @cached_property
    def yaw(self) -> FloatArray:
        """The heading of the base about the world's z axis, (T,) rad in (-pi, pi]."""
        return yaw_angles(self.base_orientation_xyzw)

    @cached_property
    def tilt(self) -> FloatArray:
        """The angle between the base's z axis and the world's, (T,) rad in [0, pi]."""
        x, y, _, _ = self.base_orientation_xyzw.T
        return _array(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0)))

    def distance_to(self, point_xyz: Vector3) -> FloatArray:
        """Return the distance to a point in space, (T,) m."""
        return _norm(self.base_position_xyz - np.asarray(point_xyz))

    def planar_distance_to(self, x: float, y: float) -> FloatArray:
        """Return the distance to a point on the ground plane, (T,) m."""
        return _norm(self.base_position_xyz[:, :2] - np.asarray((x, y)))

    def yaw_error_to(self, yaw: float | FloatArray) -> FloatArray:
        """Return the angle between the heading and `yaw`, (T,) rad in [0, pi]."""
        return np.abs(np.remainder(self.yaw - yaw + np.pi, 2 * np.pi) - np.pi)

    def rotation_to(self, orientation_xyzw: Quaternion) -> FloatArray:
        """Return the angle of the rotation between the orientation and another one, (T,) rad in [0, pi]."""
        return rotation_angles(self.base_orientation_xyzw, np.asarray(orientation_xyzw))

    def arc_length_from(self, point_xyz: Vector3, length: float = 0.0) -> FloatArray:
        """Return the length of the path so far, (T,) m, from `point_xyz`, where it is `length` m."""
        path = np.vstack((np.asarray(point_xyz), self.base_position_xyz))
        # The sum begins with `length`: added afterwards, it would round differently for every way to cut a trace.
        return np.cumsum(np.concatenate(([length], _norm(np.diff(path, axis=0)))))[1:]


def yaw_angles(orientation_xyzw: FloatArray) -> FloatArray:
    """Return the headings of unit quaternions (T, 4) about the z axis, (T,) rad in (-pi, pi]."""
    x, y, z, w = orientation_xyzw.T
    yaw: FloatArray = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return yaw


def rotation_angles(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angles of the rotations between unit quaternions (T, 4), (T,) rad in [0, pi]."""
    # A quaternion and its negative are the same orientation. Arc cosines would lose small angles.
    chords = (np.sqrt(np.square(second - sign * first).sum(axis=1)) for sign in (1.0, -1.0))
    return _array(4 * np.arcsin(np.minimum(np.minimum(*chords) / 2, 1.0)))


def _joined(several: Sequence[Mapping[Any, Any]]) -> Any:
    names = dict.fromkeys(name for records in several for name in records)
    by_name = {name: [records[name] for records in several if name in records] for name in names}
    return {name: type(pieces[0]).concatenate(pieces) for name, pieces in by_name.items()}


def _array(values: Any) -> FloatArray:
    return np.asarray(values, dtype=np.float64)


def _norm(vectors: FloatArray) -> FloatArray:
    return _array(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


class Transcript:
    """The messages that a controller received from programs of the user, in their order, as hashes."""

    def __init__(self) -> None:
        self._received: list[tuple[float, bytes]] = []

    def add(self, time: float, sender: str, message: bytes) -> None:
        """Add a message that was received at a sim time in s; `sender`: such as the name of a topic."""
        head = f"{sender} {len(message)}\n".encode(errors="surrogateescape")
        self._received.append((time, hashlib.sha256(head + message).digest()))

    def before(self, end: float) -> bytes:
        """Return a digest of all messages before a sim time in s, with their times."""
        kept = (receipt for receipt in self._received if receipt[0] < end)
        return hashlib.sha256(b"".join(struct.pack("<d", time) + message for time, message in kept)).digest()


class Digest:
    """A SHA-256 digest of the state at every step, independent of how the steps are cut into traces."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, trace: Trace) -> None:
        """Add the following steps."""
        self._hash.update(trace.state.astype("<f8", order="C", copy=False).tobytes())

    def add_transcript(self, transcript: Transcript, end: float) -> None:
        """Add the messages before the end of the run in s of sim time: a period may have gone on after it."""
        self._hash.update(transcript.before(end))

    def hexdigest(self) -> str:
        """Return the digest as 64 hexadecimal digits."""
        return self._hash.hexdigest()


def motion_figures(trace: Trace) -> tuple[float, ...]:
    """Return figures in SI units by which runs of a robot are compared with a tolerance: other motions have others.

    They are the time at the end, means and last values of the motion in the frame of its start, means of its joints
    (weighted, so that no two count alike), and at last the place and the heading of the start.
    """
    heading, start_xyz = trace.yaw[0], trace.base_position_xyz[0]
    cosine, sine = np.cos(heading), np.sin(heading)
    x, y, z = (trace.base_position_xyz - start_xyz).T
    ahead, aside, turned = cosine * x + sine * y, cosine * y - sine * x, np.unwrap(trace.yaw) - heading
    weights = np.arange(1.0, len(trace.joint_names) + 1)
    columns = (ahead, aside, turned, z, trace.tilt, trace.speed, trace.turn_rate)
    joints = (trace.joint_position @ weights, np.abs(trace.joint_velocity) @ weights)
    means = (column.mean() for column in (*columns, *joints))
    last = (column[-1] for column in (ahead, aside, turned))
    return tuple(map(float, (trace.time[-1], *means, *last, *start_xyz, cosine, sine)))


@dataclass(frozen=True, slots=True)
class Divergence:
    """The first difference between two traces.

    Attributes:
        time: the sim time in s; if one trace is only shorter, its end.
        column: such as "x of base_position_xyz", or "joint_velocity of elbow"; empty if one trace is only shorter.
        values: the two values in SI; if one trace is only shorter, both end times in s.
    """

    time: float
    column: str
    values: tuple[float, float]


def first_divergence(first: Trace, second: Trace) -> Divergence | None:
    """Return the first bit that differs, or None. Raise ValueError for traces of different robots."""
    if first.joint_names != second.joint_names:
        raise ValueError("the traces have different joints")
    common = min(len(first), len(second))
    # As in a digest, 0.0 and -0.0 are different.
    ours, theirs = (np.ascontiguousarray(trace.state[:common]) for trace in (first, second))
    rows, columns = np.nonzero(ours.view(np.int64) != theirs.view(np.int64))
    if len(rows):
        row, column = int(rows[0]), int(columns[0])
        name = list(_column_names(first.joint_names))[column]
        return Divergence(float(first.time[row]), name, (float(ours[row, column]), float(theirs[row, column])))
    if len(first) == len(second):
        return None
    ends = float(first.time[-1]), float(second.time[-1])
    return Divergence(min(ends), "", ends)


def _column_names(joints: tuple[str, ...]) -> Iterator[str]:
    """Yield the names of all columns of a state, in their order."""
    for name in COLUMNS:
        if name.startswith("joint_"):
            yield from (f"{name} of {joint}" for joint in joints)
        elif name == "time":
            yield name
        else:
            yield from (f"{axis} of {name}" for axis in name.rpartition("_")[2])
