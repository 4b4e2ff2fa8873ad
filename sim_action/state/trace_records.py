"""The records of a trace besides the robot's state: bodies, contacts, clearances, readings; and commanded twists."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Twist, Vector3
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.readings import Reading

ALWAYS: Final = (-math.inf, math.inf)
"""The steps, or sim times, between which a body is there that never appears or disappears."""

FRAME_RATE: Final = 30.0
"""The frame rate of replays in Hz, and of the poses of bodies."""


def frame_stride(rate: float) -> int:
    """Return the number of physics steps at `rate` Hz between two frames."""
    return max(1, round(rate / FRAME_RATE))


@dataclass(frozen=True, eq=False)
class BodyRecord:
    """The poses of one body in the world frame, at N moments.

    Attributes:
        time: (N,) s, rising.
        position_xyz: (N, 3) m, the origin of its frame, as `pose` in the scenario.
        orientation_xyzw: (N, 4) unit quaternions.
    """

    time: NDArray[np.float64]
    position_xyz: NDArray[np.float64]
    orientation_xyzw: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return records of the same body, joined in their order."""
        return cls(
            np.concatenate([record.time for record in records]),
            np.concatenate([record.position_xyz for record in records]),
            np.concatenate([record.orientation_xyzw for record in records]),
        )

    def between(self, start: float, end: float) -> Self:
        """Return the moments with start <= time <= end."""
        first, last = np.searchsorted(self.time, (start - TIME_EPSILON_S, end + TIME_EPSILON_S))
        return self.rows(slice(int(first), int(last)))

    def rows(self, wanted: slice | NDArray[np.intp]) -> Self:
        """Return some of the moments."""
        return type(self)(self.time[wanted], self.position_xyz[wanted], self.orientation_xyzw[wanted])

    def within(self, first: float, gone: float = math.inf) -> Self:
        """Return the record of a body that is there from a sim time in s to another one; else its poses are NaN."""
        absent = (self.time < first - TIME_EPSILON_S) | (self.time >= gone - TIME_EPSILON_S)
        if not absent.any():
            return self
        position_xyz, orientation_xyzw = self.position_xyz.copy(), self.orientation_xyzw.copy()
        position_xyz[absent], orientation_xyzw[absent] = math.nan, math.nan
        return type(self)(self.time, position_xyz, orientation_xyzw)

    @property
    def is_whole(self) -> bool:
        """True if the columns have the same length."""
        count = len(self.time)
        shapes = (self.time.shape, self.position_xyz.shape, self.orientation_xyzw.shape)
        return shapes == ((count,), (count, 3), (count, 4))


class LinkTouch(NamedTuple):
    """One contact point of a link with a body of the world or the ground, in the world frame.

    Attributes:
        normal_xyz: the unit normal of the surfaces, from the body to the link.
        force: the normal force in N.
    """

    link: str
    body: str
    position_xyz: Vector3
    normal_xyz: Vector3
    force: float


@dataclass(frozen=True, eq=False)
class ContactRecord:
    """The contacts of one link with bodies of the world and the ground, at the moments of a trace, in the world frame.

    Attributes:
        bodies: the names of the bodies that it touched.
        time: (N,) s, not falling; a moment has as many rows as contact points.
        body: (N,) the index into `bodies`.
        position_xyz: (N, 3) m.
        normal_xyz: (N, 3) unit normals of the surfaces, from the body to the link.
        force: (N,) N, the normal force.
    """

    bodies: tuple[str, ...]
    time: NDArray[np.float64]
    body: NDArray[np.int64]
    position_xyz: NDArray[np.float64]
    normal_xyz: NDArray[np.float64]
    force: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of(cls, found: Sequence[tuple[float, LinkTouch]]) -> Self:
        """Return the record of these contacts of a link, each with its time in s."""
        bodies = tuple(dict.fromkeys(touch.body for _, touch in found))
        return cls(
            bodies,
            np.array([time for time, _ in found], dtype=np.float64),
            np.array([bodies.index(touch.body) for _, touch in found], dtype=np.int64),
            np.array([touch.position_xyz for _, touch in found], dtype=np.float64).reshape(-1, 3),
            np.array([touch.normal_xyz for _, touch in found], dtype=np.float64).reshape(-1, 3),
            np.array([touch.force for _, touch in found], dtype=np.float64),
        )

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return records of the same link, joined in their order."""
        bodies = tuple(dict.fromkeys(body for record in records for body in record.bodies))
        places = [np.array([bodies.index(body) for body in record.bodies], dtype=np.int64) for record in records]
        return cls(
            bodies,
            np.concatenate([record.time for record in records]),
            np.concatenate([place[record.body] for place, record in zip(places, records, strict=True)]),
            np.concatenate([record.position_xyz for record in records]),
            np.concatenate([record.normal_xyz for record in records]),
            np.concatenate([record.force for record in records]),
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

    def rows(self, wanted: NDArray[np.bool_]) -> Self:
        """Return some of the contacts."""
        return type(self)(
            self.bodies,
            self.time[wanted],
            self.body[wanted],
            self.position_xyz[wanted],
            self.normal_xyz[wanted],
            self.force[wanted],
        )

    @property
    def is_whole(self) -> bool:
        """True if the columns have the same length and name bodies that exist."""
        count = len(self.time)
        shapes = [column.shape for column in (self.time, self.body, self.force, self.position_xyz, self.normal_xyz)]
        known = (self.body >= 0) & (self.body < len(self.bodies))
        return shapes == [(count,), (count,), (count,), (count, 3), (count, 3)] and bool(known.all())


class Nearness(NamedTuple):
    """A distance at a sim time: time in s, distance in m (negative inside), and the link and body that are nearest."""

    time: float
    distance: float
    link: str
    body: str


@dataclass(frozen=True, eq=False)
class ClearanceRecord:
    """The distances at N moments: at all steps, or at each step that is nearer than all before.

    Attributes:
        pairs: the pairs (link, body) that were nearest at some moment.
        time: (N,) s, rising.
        distance: (N,) m, negative for an overlap.
        pair: (N,) the index into `pairs`.
        presence: the times in s between which at least one of the bodies is there.
    """

    pairs: tuple[tuple[str, str], ...]
    time: NDArray[np.float64]
    distance: NDArray[np.float64]
    pair: NDArray[np.int64]
    presence: tuple[tuple[float, float], ...] = (ALWAYS,)

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of(cls, found: Sequence[Nearness], presence: tuple[tuple[float, float], ...] = (ALWAYS,)) -> Self:
        """Return the record of these moments."""
        pairs = tuple(dict.fromkeys((one.link, one.body) for one in found))
        numbers = {pair: number for number, pair in enumerate(pairs)}
        return cls(
            pairs,
            np.array([one.time for one in found], dtype=np.float64),
            np.array([one.distance for one in found], dtype=np.float64),
            np.array([numbers[one.link, one.body] for one in found], dtype=np.int64),
            presence,
        )

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return records of the same watch, joined in their order."""
        pairs = tuple(dict.fromkeys(pair for record in records for pair in record.pairs))
        places = [np.array([pairs.index(pair) for pair in record.pairs], dtype=np.int64) for record in records]
        return cls(
            pairs,
            np.concatenate([record.time for record in records]),
            np.concatenate([record.distance for record in records]),
            np.concatenate([place[record.pair] for place, record in zip(places, records, strict=True)]),
            # Events set times that the earlier ones could not know.
            records[-1].presence,
        )

    def between(self, start: float, end: float) -> Self:
        """Return the moments with start <= time <= end."""
        first, last = np.searchsorted(self.time, (start - TIME_EPSILON_S, end + TIME_EPSILON_S))
        return self.rows(slice(int(first), int(last)))

    def rows(self, wanted: slice | NDArray[np.intp]) -> Self:
        """Return some of the moments."""
        return replace(self, time=self.time[wanted], distance=self.distance[wanted], pair=self.pair[wanted])

    def there(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return those of some times in s at which a body is there."""
        if self.presence == (ALWAYS,):
            return time
        spans = [(time >= first - TIME_EPSILON_S) & (time < gone - TIME_EPSILON_S) for first, gone in self.presence]
        return time[np.logical_or.reduce(spans)]

    @property
    def is_whole(self) -> bool:
        """True if the columns have the same length and name pairs that exist."""
        shapes = {self.time.shape, self.distance.shape, self.pair.shape}
        return shapes == {(len(self.time),)} and bool(((self.pair >= 0) & (self.pair < len(self.pairs))).all())

    def at(self, index: int) -> Nearness:
        """Return one of the moments."""
        return Nearness(float(self.time[index]), float(self.distance[index]), *self.pairs[int(self.pair[index])])


@dataclass(frozen=True, eq=False)
class SensorRecord:
    """The readings of one sensor, at its own rate.

    Attributes:
        kind: the kind of sensor, as scenarios name it.
        time: (N,) s, rising.
        columns: column name -> (N, ...) numbers; see READING_COLUMNS.
    """

    kind: str
    time: NDArray[np.float64]
    columns: Mapping[str, NDArray[Any]]

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
    """The twists that the base was commanded, in their order.

    Attributes:
        time: (N,) s, rising.
        values: (N, 6) linear x, y, z in m/s and angular x, y, z in rad/s, in the frame of the base.
    """

    time: NDArray[np.float64] = field(default_factory=lambda: _none(1)[:, 0])
    values: NDArray[np.float64] = field(default_factory=lambda: _none(6))

    @classmethod
    def of(cls, told: Sequence[tuple[float, Twist]]) -> Self:
        """Return the record of pairs of time in s and twist."""
        values = [[*twist.linear_xyz, *twist.angular_xyz] for _, twist in told]
        return cls(np.array([time for time, _ in told]), np.array(values).reshape(-1, 6))

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, eq=False)
class CommandedValues:
    """Quantities that controllers commanded, for example the positions of joints.

    Attributes:
        time: (N,) s, rising.
        values: name, for example of a joint -> (N,) what was commanded from that time on, in SI units; NaN without it.
    """

    time: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    values: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @classmethod
    def of(cls, told: Sequence[tuple[float, Mapping[str, float]]]) -> Self:
        """Return the record of pairs of time in s and new values; a value stays until the next one of its name."""
        names = dict.fromkeys(name for _, targets in told for name in targets)
        values = {name: np.full(len(told), np.nan) for name in names}
        for row, (_, targets) in enumerate(told):
            for name, column in values.items():
                column[row] = targets.get(name, column[row - 1] if row else np.nan)
        return cls(np.array([time for time, _ in told]), values)

    def at(self, name: str, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what was commanded at given times (T,) in s, NaN without it."""
        column = self.values.get(name)
        if column is None:
            return np.full(len(time), np.nan)
        rows = np.searchsorted(self.time, time + TIME_EPSILON_S, side="right") - 1
        return np.where(rows < 0, np.nan, column[rows])
