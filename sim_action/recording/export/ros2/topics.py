"""Basics of all topics of a log: messages with times, time stamps, names of coordinate frames (REP 105)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim_action.core.records import dataclass, field
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.state.trace import FloatArray

_NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class Topic:
    """All messages of one topic.

    Attributes:
        type: the message type, such as "std_msgs/String".
        time: the sim time of each message in ns.
        messages: the encoded messages.
        about: metadata of the channel, for people.
    """

    name: str
    type: str
    time: NDArray[np.int64]
    messages: list[bytes]
    about: dict[str, str] = field(default_factory=dict)


def nanoseconds(time: ArrayLike) -> NDArray[np.int64]:
    """Return times (N,) in ns for times (N,) in s."""
    return np.rint(np.asarray(time, dtype=np.float64) * _NANOSECONDS).astype(np.int64)


def stamps(time: FloatArray) -> NDArray[np.int64]:
    """Return (N, 2) builtin_interfaces/Time, seconds and nanoseconds, for times (N,) in s."""
    return np.column_stack(np.divmod(nanoseconds(time), _NANOSECONDS))


@dataclass(frozen=True, slots=True)
class Frames:
    """The names of the coordinate frames of a log, all distinct: a name that is also a link gets a suffix.

    Attributes:
        map: the world frame.
        odom: the origin of the wheel odometry.
        base: the base link of the robot.
        bodies: name of a body of the world -> its frame.
        sensors: name of a sensor -> its frame.
    """

    map: str
    odom: str
    base: str
    bodies: Mapping[str, str]
    sensors: Mapping[str, str]

    @classmethod
    def of(cls, run: RecordedRun) -> Frames:
        """Return the frames of a run."""
        model = run.scene.model
        taken = {link.name for link in model.links}

        def free(name: str) -> str:
            while name in taken:
                name += "_"
            taken.add(name)
            return name

        return cls(
            free("map"),
            free("odom"),
            model.root,
            {body.name: free(body.name) for body in run.scene.world.objects},
            {mounted.name: free(mounted.name) for mounted in run.sensors},
        )
