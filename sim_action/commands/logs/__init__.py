"""Recorded logs as rows with times: CSV (`csv_table.py`) and ROS (`rosbag.py`). A bad log raises RecordingError."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass, field

MAX_ROWS: Final = 250_000  # limit of rows or messages of a command source; so many twists need 130 MB
Kind = Literal["position", "velocity", "effort"]
KINDS: Final[tuple[Kind, ...]] = ("position", "velocity", "effort")
"""Kinds of targets, in the order of their priority: a position overrides a velocity, which overrides an effort."""


class JointColumn(NamedTuple):
    """The meaning of a number in a row: a quantity of a joint."""

    kind: Kind
    joint: str


JointRow = Mapping[JointColumn, float]  # the finite numbers of a row: rad, rad/s and N m, or m, m/s and N


class Steering(NamedTuple):
    """A command for a car: the speed in m/s, and the angle of a middle steered wheel in rad, to the left."""

    speed: float
    angle: float


class TrajectoryPoint(NamedTuple):
    """A point of a trajectory: the time in s since its start, and numbers of its joints; empty if not stated."""

    time: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    accelerations: tuple[float, ...]


class Trajectory(NamedTuple):
    """A motion of joints that begins when it is received; without points, the joints stop."""

    joints: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]


Content = Twist | Steering | JointRow | Trajectory
TimedRow = tuple[int, Content]  # the time of a row in ns, on the clock of the log, and its content


@dataclass(frozen=True, slots=True)
class Recorded:
    """The rows that a log has for one command source."""

    rows: tuple[TimedRow, ...]  # at least one, in the order of time
    resolution_s: float = 1e-9  # the last digit of the times
    read: int = 0  # the number of messages, or of rows, that the log has for this source
    unused: Mapping[str, int] = field(default_factory=dict)  # reason -> the number of them that are not in `rows`
    notes: tuple[str, ...] = ()  # remarks for the user
