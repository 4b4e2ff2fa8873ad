"""The records of a trace besides the robot's state: bodies, contacts, clearances, readings; and commanded twists.

An assertion declares the channels that it needs. A run records the channels of all its assertions, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import reduce
from operator import or_
from typing import Any, ClassVar, Final, NamedTuple, Self

from sim_action.core.geometry import Twist, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.readings import Reading

ALWAYS: Final = (-math.inf, math.inf)
"""The steps, or sim times, between which a body is there that never appears or disappears."""

FRAME_RATE: Final = 30.0  # the frame rate of replays in Hz, and of the poses of bodies


def frame_stride(rate: float) -> int:
    """Return the number of physics steps at `rate` Hz between two frames."""
    return max(1, round(rate / FRAME_RATE))


class _Table:
    """The base class of records: columns with a row for each of N moments, some with an index into a list of names."""

    widths: ClassVar[Mapping[str, int]]  # column -> the number of numbers in a row of it; 0 for a single one
    names: ClassVar[str] = ""  # the field with the names; empty if there are none
    index: ClassVar[str] = ""  # the column with the index into the names
    time: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return records of the same thing, joined in their order."""
        columns: dict[str, Any] = {column: [getattr(record, column) for record in records] for column in cls.widths}
        fields: dict[str, Any] = {}
        if cls.names:
            lists = [getattr(record, cls.names) for record in records]
            fields[cls.names] = joined_names = tuple(dict.fromkeys(name for names in lists for name in names))
            places = [np.array([joined_names.index(name) for name in names], dtype=np.int64) for names in lists]
            columns[cls.index] = [place[rows] for place, rows in zip(places, columns[cls.index], strict=True)]
        fields |= {column: np.concatenate(pieces) for column, pieces in columns.items()}
        # Events set times that the earlier ones could not know.
        last: Any = records[-1]
        joined: Self = replace(last, **fields)
        return joined

    def between(self, start: float, end: float) -> Self:
        """Return the moments with start <= time <= end."""
        first, last = np.searchsorted(self.time, (start - TIME_EPSILON_S, end + TIME_EPSILON_S))
        return self.rows(slice(int(first), int(last)))

    def rows(self, selection: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """Return some of the moments."""
        whole: Any = self
        part: Self = replace(whole, **{column: getattr(self, column)[selection] for column in self.widths})
        return part

    @property
    def is_whole(self) -> bool:
        """True if the columns have the same length, and index names that exist."""
        shapes = [getattr(self, column).shape for column in self.widths]
        stated = [(len(self.time), width) if width else (len(self.time),) for width in self.widths.values()]
        index = getattr(self, self.index) if self.names else np.zeros(0)
        return shapes == stated and bool((index >= 0).all()) and not (index >= len(getattr(self, self.names, ()))).any()


@dataclass(frozen=True, eq=False)
class BodyRecord(_Table):
    """The poses of one body in the world frame, at N moments."""

    widths: ClassVar[Mapping[str, int]] = {"time": 0, "position_xyz": 3, "orientation_xyzw": 4}

    time: NDArray[np.float64]
    position_xyz: NDArray[np.float64]  # (N, 3) m, the origin of its frame, as `pose` in the scenario
    orientation_xyzw: NDArray[np.float64]

    def within(self, first: float, gone: float = math.inf) -> Self:
        """Return the record of a body that is there from a sim time in s to another one; else its poses are NaN."""
        absent = (self.time < first - TIME_EPSILON_S) | (self.time >= gone - TIME_EPSILON_S)
        if not absent.any():
            return self
        position_xyz = self.position_xyz.copy()
        orientation_xyzw = self.orientation_xyzw.copy()
        position_xyz[absent], orientation_xyzw[absent] = math.nan, math.nan
        return type(self)(self.time, position_xyz, orientation_xyzw)


class LinkTouch(NamedTuple):
    """One contact point of a link with a body of the world or the ground, in the world frame."""

    link: str
    body: str
    position_xyz: Vector3
    normal_xyz: Vector3  # the unit normal of the surfaces, from the body to the link
    force: float  # the normal force in N


@dataclass(frozen=True, eq=False)
class ContactRecord(_Table):
    """The contacts of one link with bodies of the world and the ground, at the moments of a trace, in the world frame.

    Attributes:
        time: (N,) s, not falling; a moment has as many rows as contact points.
        normal_xyz: (N, 3) unit normals of the surfaces, from the body to the link.
    """

    widths: ClassVar[Mapping[str, int]] = {"time": 0, "body": 0, "position_xyz": 3, "normal_xyz": 3, "force": 0}
    names: ClassVar[str] = "bodies"
    index: ClassVar[str] = "body"

    bodies: tuple[str, ...]
    time: NDArray[np.float64]
    body: NDArray[np.int64]
    position_xyz: NDArray[np.float64]
    normal_xyz: NDArray[np.float64]
    force: NDArray[np.float64]  # (N,) N, the normal force

    @classmethod
    def of(cls, touches: Sequence[tuple[float, LinkTouch]]) -> Self:
        """Return the record of these contacts of a link, each with its time in s."""
        bodies = tuple(dict.fromkeys(touch.body for _, touch in touches))
        return cls(
            bodies,
            np.array([time for time, _ in touches], dtype=np.float64),
            np.array([bodies.index(touch.body) for _, touch in touches], dtype=np.int64),
            np.array([touch.position_xyz for _, touch in touches], dtype=np.float64).reshape(-1, 3),
            np.array([touch.normal_xyz for _, touch in touches], dtype=np.float64).reshape(-1, 3),
            np.array([touch.force for _, touch in touches], dtype=np.float64),
        )

    def at(self, moments: NDArray[np.float64]) -> Self:
        """Return the contacts at some moments, (T,) s, rising."""
        return self.rows(self.moment(moments) >= 0)

    def moment(self, moments: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the index (N,) of the moment of each contact among moments, (T,) s, rising; -1 if it has none."""
        if not len(moments):
            return np.full(len(self), -1, dtype=np.intp)
        index = np.searchsorted(moments, self.time - TIME_EPSILON_S).clip(max=len(moments) - 1)
        return np.where(np.abs(moments[index] - self.time) <= TIME_EPSILON_S, index, -1)


class Nearness(NamedTuple):
    """A distance at a sim time: time in s, distance in m (negative inside), and the link and body that are nearest."""

    time: float
    distance: float
    link: str
    body: str


@dataclass(frozen=True, eq=False)
class ClearanceRecord(_Table):
    """The distances at N moments: at all steps, or at each step that is nearer than all before."""

    widths: ClassVar[Mapping[str, int]] = {"time": 0, "distance": 0, "pair": 0}
    names: ClassVar[str] = "pairs"
    index: ClassVar[str] = "pair"

    pairs: tuple[tuple[str, str], ...]  # the pairs (link, body) that were nearest at some moment
    time: NDArray[np.float64]
    distance: NDArray[np.float64]  # (N,) m, negative for an overlap
    pair: NDArray[np.int64]
    # the times in s between which at least one of the bodies is there
    presence: tuple[tuple[float, float], ...] = (ALWAYS,)

    @classmethod
    def of(cls, moments: Sequence[Nearness], presence: tuple[tuple[float, float], ...] = (ALWAYS,)) -> Self:
        """Return the record of these moments."""
        pairs = tuple(dict.fromkeys((one.link, one.body) for one in moments))
        numbers = {pair: number for number, pair in enumerate(pairs)}
        return cls(
            pairs,
            np.array([one.time for one in moments], dtype=np.float64),
            np.array([one.distance for one in moments], dtype=np.float64),
            np.array([numbers[one.link, one.body] for one in moments], dtype=np.int64),
            presence,
        )

    def valid(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Select the times in s at which a body is there."""
        if self.presence == (ALWAYS,):
            return time
        spans = [(time >= first - TIME_EPSILON_S) & (time < gone - TIME_EPSILON_S) for first, gone in self.presence]
        return time[np.logical_or.reduce(spans)]

    def at(self, index: int) -> Nearness:
        """Return one of the moments."""
        return Nearness(float(self.time[index]), float(self.distance[index]), *self.pairs[int(self.pair[index])])


@dataclass(frozen=True, eq=False)
class SensorRecord:
    """The readings of one sensor, at its own rate."""

    kind: str
    time: NDArray[np.float64]
    columns: Mapping[str, NDArray[Any]]  # column name -> (N, ...) numbers; see READING_COLUMNS

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of_readings(cls, kind: str, readings: Sequence[Reading]) -> Self:
        """Return the record of at least one reading."""
        rows = [reading.columns() for reading in readings]
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        return cls(kind, np.array([reading.time for reading in readings]), columns)

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return records of the same sensor, joined in their order."""
        columns = {name: np.concatenate([record.columns[name] for record in records]) for name in records[0].columns}
        return cls(records[0].kind, np.concatenate([record.time for record in records]), columns)

    def between(self, start: float, end: float) -> Self:
        """Return the readings with start <= time <= end."""
        first, last = np.searchsorted(self.time, (start - TIME_EPSILON_S, end + TIME_EPSILON_S))
        columns = {name: column[first:last] for name, column in self.columns.items()}
        return type(self)(self.kind, self.time[first:last], columns)


def _none(width: int) -> NDArray[np.float64]:
    return np.empty((0, width))


@dataclass(frozen=True, eq=False)
class CommandedTwists:
    """The twists that the base was commanded, in their order."""

    time: NDArray[np.float64] = field(default_factory=lambda: _none(1)[:, 0])
    # (N, 6) linear x, y, z in m/s and angular x, y, z in rad/s, in the frame of the base
    values: NDArray[np.float64] = field(default_factory=lambda: _none(6))

    @classmethod
    def of(cls, twists: Sequence[tuple[float, Twist]]) -> Self:
        """Return the record of pairs of time in s and twist."""
        values = [[*twist.linear_xyz, *twist.angular_xyz] for _, twist in twists]
        return cls(np.array([time for time, _ in twists]), np.array(values).reshape(-1, 6))

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, eq=False)
class CommandedValues:
    """Quantities that controllers commanded, for example the positions of joints."""

    time: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    # name, for example of a joint -> (N,) what was commanded from that time on, in SI units; NaN without it
    values: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @classmethod
    def of(cls, changes: Sequence[tuple[float, Mapping[str, float]]]) -> Self:
        """Return the record of pairs of time in s and new values; a value stays until the next one of its name."""
        names = dict.fromkeys(name for _, targets in changes for name in targets)
        values = {name: np.full(len(changes), np.nan) for name in names}
        for row, (_, targets) in enumerate(changes):
            for name, column in values.items():
                column[row] = targets.get(name, column[row - 1] if row else np.nan)
        return cls(np.array([time for time, _ in changes]), values)

    def at(self, name: str, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what was commanded at given times (T,) in s, NaN without it."""
        column = self.values.get(name)
        if column is None:
            return np.full(len(time), np.nan)
        rows = np.searchsorted(self.time, time + TIME_EPSILON_S, side="right") - 1
        return np.where(rows < 0, np.nan, column[rows])


@dataclass(frozen=True, slots=True)
class ClearanceWatch:
    """A request for the smallest distance between some links of the robot and some bodies."""

    links: tuple[str, ...] | None = None
    bodies: tuple[str, ...] | None = None  # bodies of the world; None: all except the ground
    within: float = math.inf  # the largest reported distance in m
    always: bool = False  # True to report every step; else only steps with a new minimum


@dataclass(frozen=True, slots=True)
class Channels:
    """The requested channels; `|` joins two requests."""

    contacts: bool = False
    clearances: frozenset[ClearanceWatch] = frozenset()
    sensors: frozenset[str] = frozenset()
    bodies: frozenset[str] = frozenset()  # the names of bodies that are needed in `Trace.bodies`, 30 poses per second
    # the names of bodies that are needed in `Trace.objects`, a pose at every step
    objects: frozenset[str] = frozenset()
    # the names or patterns of links whose contacts are needed in `Trace.link_contacts`
    link_contacts: frozenset[str] = frozenset()
    # sim times in s at which an observation begins, and the minimum of a clearance is reset
    openings: frozenset[float] = frozenset()
    self_contacts: bool = False
    ground: bool = False  # True if `Trace.contacts` must have those with the ground, too

    @classmethod
    def all_of(cls, several: Iterable[Self]) -> Self:
        """Return the union of several requests."""
        return reduce(or_, several, cls())

    def __or__(self, other: Self) -> Self:
        joined = {one.name: getattr(self, one.name) | getattr(other, one.name) for one in fields(self)}
        return type(self)(**joined)

    def opening_at(self, time: float) -> Self:
        """Return the same request, observed from a sim time on."""
        return replace(self, openings=self.openings | {time})
