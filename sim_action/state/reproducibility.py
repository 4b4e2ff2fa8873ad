"""Reproducibility of runs: a digest of all states and messages of a run, and the first difference of two runs."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator

from sim_action.core.lazy_numpy import np
from sim_action.core.records import dataclass
from sim_action.state.trace import COLUMNS, Trace


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
        kept = (each for each in self._received if each[0] < end)
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
