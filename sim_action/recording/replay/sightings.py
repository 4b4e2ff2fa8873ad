"""The sensor that saw an obstacle first, and when: for the bodies that the robot touched or had to keep clear of.

A return of a lidar belongs to the body whose shapes are near to it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from pydantic import Field

from sim_action.core import geometry
from sim_action.core.field_types import FrozenModel
from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import NDArray
from sim_action.core.records import dataclass
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.replay.columns import FloatArray, Index, poses_at
from sim_action.recording.replay.scene_data import Length, Number
from sim_action.recording.replay.sensor_data import MAX_SENSORS, SensorName, scans_until, times_of
from sim_action.recording.replay.surfaces import Triangles, hull_surface
from sim_action.robot.model.kinematics import link_motion
from sim_action.state.readings import ContactReading, LidarScan
from sim_action.state.trace import Trace
from sim_action.world import placed
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, grid_surface, reach
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.sensors import ReadingLog

MAX_OBSTACLES: Final = 50
_NEAR_M: Final = 0.02  # a return this near to the shape of a body counts as a return from it
# Noise moves most returns along their rays by less than so many standard deviations.
_DEVIATIONS: Final = 3.0
_MAX_PLACES: Final = 100
_BLOCK: Final = 64  # scans that are compared with a body at once


class SightingData(FrozenModel):
    """The first time at which a sensor saw a body."""

    sensor: SensorName
    kind: SensorName
    time: Number  # the sim time in s
    distance: Length | None = None  # the range of the nearest return from the body in m; None for a sensor that touches
    angle: Number | None = None  # the direction of that return in rad, counter-clockwise from the x axis of the sensor
    every: Annotated[int, Field(ge=1, le=1_000_000)] = 1  # one of so many readings was looked at


class BlindData(FrozenModel):
    """A lidar that did not see a body; one of `every` readings was looked at."""

    sensor: SensorName
    every: Annotated[int, Field(ge=1, le=1_000_000)] = 1


class ObstacleData(FrozenModel):
    """A body that the robot touched, or that was nearest to it in an expectation of clearance."""

    body: Index  # the index of the body
    touched: Number | None = None  # the sim time in s of the first contact with the robot; None if it was not touched
    # the first sighting of each sensor that saw it, in the order of time
    seen: Annotated[tuple[SightingData, ...], Field(max_length=MAX_SENSORS)] = ()
    # the lidars that did not see it; without those to which something was too near to be measured
    blind: Annotated[tuple[BlindData, ...], Field(max_length=MAX_SENSORS)] = ()


def obstacles_of(scene: Scene, film: Trace, logs: Mapping[str, ReadingLog]) -> tuple[ObstacleData, ...]:
    """Return the obstacles of a run if a sensor that sees bodies was read; `film`: at 30 Hz; `logs`: readings."""
    looking = [log for log in logs.values() if any(_looks(reading) for reading in log.readings[:1])][:MAX_SENSORS]
    names = {body.name: number for number, body in enumerate(scene.world.objects)}
    met = [(name, touched) for name, touched in _met(film).items() if name in names][:MAX_OBSTACLES]
    if not looking or not met:
        return ()
    end = float(film.time[-1])
    looks = [look for log in looking if (look := _look(scene, film, log, end)) is not None]
    rays = [look for look in looks if isinstance(look, _Rays) and not np.isneginf(look.ranges).any()]
    obstacles = []
    for name, touched in met:
        seen = [sighting for look in looks if (sighting := look.first(scene, film, name)) is not None]
        in_order = tuple(sorted(seen, key=lambda sighting: sighting.time))
        saw = {sighting.sensor for sighting in seen}
        blind = [BlindData(sensor=look.sensor, every=look.every) for look in rays if look.sensor not in saw]
        obstacles.append(ObstacleData(body=names[name], touched=touched, seen=in_order, blind=tuple(blind)))
    return tuple(obstacles)


def _looks(reading: object) -> bool:
    return isinstance(reading, LidarScan | ContactReading)


def _met(film: Trace) -> dict[str, float | None]:
    """Return the touched bodies with the time, then the nearest bodies."""
    met: dict[str, float | None] = {}
    for contact in film.contacts:
        met.setdefault(contact.body, round(contact.time, 5))
    for record in film.clearances.values():
        if len(record):
            met.setdefault(record.at(int(record.distance.argmin())).body, None)
    return met


def _look(scene: Scene, film: Trace, log: ReadingLog, end: float) -> _Rays | _Touches | None:
    """Return what a sensor saw up to the end of the run; None if it was not read before."""
    if scans := scans_until(log, end):
        return _Rays.of(scene, film, log, scans)
    touches = [reading for reading in log.readings if isinstance(reading, ContactReading)]
    return _Touches(log.mounted.name, log.every, [touch for touch in touches if touch.time <= end + TIME_EPSILON_S])


@dataclass(frozen=True, slots=True, eq=False)
class _Touches:
    """The readings of a contact sensor; `every`: one of so many is kept."""

    sensor: str
    every: int
    readings: Sequence[ContactReading]

    def first(self, scene: Scene, film: Trace, name: str) -> SightingData | None:
        """Return the first reading with a touch of a body."""
        times = (reading.time for reading in self.readings if name in reading.bodies)
        time = next(times, None)
        return None if time is None else SightingData(sensor=self.sensor, kind="contact", time=round(time, 5))


@dataclass(frozen=True, slots=True, eq=False)
class _Rays:
    """The returns of a lidar in the world."""

    sensor: str  # the name of the lidar
    every: int  # one of so many scans is kept
    time: FloatArray  # (S,) s
    ranges: FloatArray  # (S, R) m
    angles: FloatArray  # (R,) rad
    starts: FloatArray  # (S, 3) m, world frame
    points: FloatArray  # (S, R, 3) m, world frame; NaN without a return
    noise: float  # the standard deviation of the ranges in m

    @classmethod
    def of(cls, scene: Scene, film: Trace, log: ReadingLog, scans: Sequence[LidarScan]) -> _Rays:
        """Return the returns of the scans of a log."""
        time, ranges, angles = times_of(scans), np.array([scan.ranges for scan in scans]), scans[0].angles
        motion = link_motion(scene.model, film, log.mounted.link or scene.model.root)
        x, y, z, qx, qy, qz, qw = poses_at(time, film.time, motion.position_xyz, motion.orientation_xyzw).T
        pose = geometry.compose(Pose((x, y, z), (qx, qy, qz, qw)), log.mounted.pose)
        spread = np.where(np.isfinite(ranges), ranges, np.nan)
        x_axis, y_axis = (geometry.rotate(pose.orientation_xyzw, axis) for axis in geometry.AXES[:2])
        points = np.empty((*ranges.shape, 3))
        along, across = spread * np.cos(angles), spread * np.sin(angles)
        for column, (x, y, start) in enumerate(zip(x_axis, y_axis, pose.position_xyz, strict=True)):
            points[:, :, column] = along * _tall(x) + across * _tall(y) + _tall(start)
        noise = float(getattr(log.mounted.sensor, "noise", 0.0))
        starts = np.column_stack(pose.position_xyz)
        return cls(log.mounted.name, log.every, time, ranges, angles, starts, points, noise)

    def first(self, scene: Scene, film: Trace, name: str) -> SightingData | None:
        """Return the nearest return of the first scan with a return from a body."""
        (body,) = (body for body in scene.world.objects if body.name == name)
        parts, near = scene.parts_of(body), _NEAR_M + _DEVIATIONS * self.noise
        poses = _body_poses(scene, film, name, self.time)
        is_there = self.time >= (body.appears or 0.0) - TIME_EPSILON_S
        if body.disappears is not None:
            is_there &= self.time < body.disappears - TIME_EPSILON_S
        within = max(reach(part) for part in parts) + near
        for start in range(0, len(self.time), _BLOCK):
            rows = slice(start, start + _BLOCK)
            away = self.points[rows] - poses[rows, None, :3]
            # Comparisons with NaN are false.
            near_it = (np.square(away).sum(axis=2) <= within * within) & is_there[rows, None]
            for row in np.flatnonzero(near_it.any(axis=1)).tolist():
                if (sighting := self._met(start + row, near_it[row], parts, poses[start + row], near)) is not None:
                    return sighting
        return None

    def _met(
        self, row: int, chosen: FloatArray, parts: Sequence[Part], pose: FloatArray, near: float
    ) -> SightingData | None:

        rays = np.flatnonzero(chosen)
        x, y, z, *turn = pose.tolist()
        qx, qy, qz, qw = turn
        body = Pose((x, y, z), (qx, qy, qz, qw))
        # Few returns are left for the many places of each.
        rays = rays[distance_to(parts, seen_from(body, self.points[row, rays])) <= near]
        if self.noise and len(rays):
            places = self._places(row, rays)
            apart = distance_to(parts, seen_from(body, places.reshape(-1, 3))).reshape(places.shape[:2])
            rays = rays[(apart <= _NEAR_M).any(axis=1)]
        if not len(rays):
            return None
        ray = rays[self.ranges[row, rays].argmin()]
        return SightingData(
            sensor=self.sensor,
            kind="lidar",
            time=round(float(self.time[row]), 5),
            distance=round(float(self.ranges[row, ray]), 4),
            angle=round(math.remainder(float(self.angles[ray]), 2 * math.pi), 4),
            every=self.every,
        )

    def _places(self, row: int, rays: NDArray[np.int64]) -> FloatArray:
        """Return places (N, P, 3) on rays from which their returns may be: around the measured ones, by the noise."""
        ranges, start = self.ranges[row, rays, None], self.starts[row]
        away = self.points[row, rays] - start
        along = np.divide(away, ranges, out=np.zeros_like(away), where=ranges > 0.0)
        spread = _DEVIATIONS * self.noise
        offsets = np.linspace(-spread, spread, 1 + min(_MAX_PLACES, 2 * math.ceil(spread / _NEAR_M)))
        # Not behind the sensor.
        spots = np.maximum(ranges + offsets, 0.0)
        places: FloatArray = start + spots[:, :, None] * along[:, None, :]
        return places


def _tall(column: FloatArray | float) -> FloatArray:
    return np.asarray(column, dtype=np.float64).reshape(-1, 1)


def _body_poses(scene: Scene, film: Trace, name: str, time: FloatArray) -> FloatArray:
    """Return the poses (T, 7) of a body at given times."""
    record = film.bodies.get(name)
    if record is not None and len(record):
        return poses_at(time, record.time, record.position_xyz, record.orientation_xyzw)
    (body,) = (body for body in scene.world.objects if body.name == name)
    pose = placed(body, scene.parts_of(body))
    return np.tile([*pose.position_xyz, *pose.orientation_xyzw], (len(time), 1))


# The largest number of pairs of a point and a triangle at once; an array of them has 24 MB.
_MAX_PAIRS: Final = 1_000_000


def distance_to(parts: Sequence[Part], points_xyz: FloatArray) -> FloatArray:
    """Return the distances (N,) in m of points (N, 3), in the frame of the body; at most 0 inside a solid."""
    nearest = np.full(len(points_xyz), math.inf)
    hulls = [np.array(part.points_xyz) for part in parts if isinstance(part, HullPart)]
    surfaces = [hull_surface(hulls)] if hulls else []
    for part in parts:
        if isinstance(part, BoxPart | CylinderPart | SpherePart):
            nearest = np.minimum(nearest, _from_solid(part, points_xyz))
        elif not isinstance(part, HullPart):
            mesh = grid_surface(part) if isinstance(part, GridPart) else part
            surfaces.append(Triangles(mesh.points_xyz, mesh.triangles))
    for surface in surfaces:
        if surface is not None:
            triangles = surface.points_xyz[surface.corners]
            most = max(1, _MAX_PAIRS // max(1, len(triangles)))
            blocks = [_from_triangles(triangles, points_xyz[i : i + most]) for i in range(0, len(points_xyz), most)]
            nearest = np.minimum(nearest, np.concatenate(blocks) if blocks else np.empty(0))
    return nearest


def _from_solid(part: BoxPart | CylinderPart | SpherePart, points_xyz: FloatArray) -> FloatArray:
    if isinstance(part, SpherePart):
        away: FloatArray = np.linalg.norm(points_xyz - part.pose.position_xyz, axis=1)
        return away - part.radius
    x, y, z = seen_from(part.pose, points_xyz).T
    if isinstance(part, CylinderPart):
        over = np.stack((np.hypot(x, y) - part.radius, np.abs(z) - part.height / 2))
    else:
        over = np.stack([np.abs(along) - size / 2 for along, size in zip((x, y, z), part.size_xyz, strict=True)])
    outside: FloatArray = np.sqrt(np.square(np.maximum(over, 0.0)).sum(axis=0))
    inside: FloatArray = np.minimum(over.max(axis=0), 0.0)
    return outside + inside


def seen_from(pose: Pose, points_xyz: FloatArray) -> FloatArray:
    """Return points (N, 3) of the parent frame in the frame of a pose."""
    axes = np.array([geometry.rotate(pose.orientation_xyzw, axis) for axis in geometry.AXES])
    turned: FloatArray = (points_xyz - pose.position_xyz) @ axes.T
    return turned


def _from_triangles(triangles: FloatArray, points_xyz: FloatArray) -> FloatArray:
    """Return the distances (N,) of points (N, 3) from triangles (T, 3, 3): to a face or to an edge."""
    a, b, c = (triangles[:, corner] for corner in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(length, 1e-30)[:, None]
    away = points_xyz[:, None] - a
    over = np.einsum("ntx,tx->nt", away, normal)
    is_above = np.broadcast_to(length > 0, over.shape)
    squared = np.full(over.shape, math.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, offsets = end - start, points_xyz[:, None] - start
        along = np.einsum("ntx,tx->nt", offsets, edge) / np.maximum(np.square(edge).sum(axis=1), 1e-30)
        off = offsets - np.clip(along, 0.0, 1.0)[:, :, None] * edge
        squared = np.minimum(squared, np.square(off).sum(axis=2))
        is_above = is_above & (np.einsum("ntx,tx->nt", offsets, np.cross(normal, edge)) >= 0)
    nearest: FloatArray = np.where(is_above, np.abs(over), np.sqrt(squared)).min(axis=1, initial=math.inf)
    return nearest
