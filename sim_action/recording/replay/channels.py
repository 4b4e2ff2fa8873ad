"""The channels of a replay: quantities that no expectation reads, of the base, the joints, contacts and sensors.

A replay has at most 30 values per second of each. If all of them together are too large, those with the highest rate
are halved first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from sim_action.core import geometry
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.replay.columns import MAX_DELTA, FloatArray, TextColumn, fine_scale
from sim_action.recording.replay.replay_data import MAX_CHANNELS, ChannelData
from sim_action.recording.replay.scene_data import MAX_TEXT_LENGTH
from sim_action.robot.model.robot_model import Joint
from sim_action.state.observation import Contact
from sim_action.state.readings import LidarScan, columns_of
from sim_action.state.trace import Trace
from sim_action.state.trace_records import CommandedValues
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.sensors import ReadingLog

MAX_VALUES: Final = 150_000  # the largest number of values that change; each takes about two bytes when packed
MAX_TOUCHED: Final = 8  # the largest number of bodies whose contact forces are stored one by one

# The smallest steps of values in SI units; finer ones are noise.
_LEAST_STEPS: Final = {"m/s": 1e-3, "rad/s": 1e-3}
_LEAST_STEP: Final = 1e-4
_TWIST_UNITS: Final = {"linear": "m/s", "angular": "rad/s"}


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One quantity at times in s, in SI units; see ChannelData."""

    group: str
    name: str
    unit: str
    time: FloatArray
    values: FloatArray
    commanded: bool = False

    @property
    def tells(self) -> bool:
        """True if there is a value that is not stored as zero."""
        return bool((np.abs(self.values) > self.least_step / 2).any())

    @property
    def least_step(self) -> float:
        """The smallest difference of stored values."""
        return _LEAST_STEPS.get(self.unit, _LEAST_STEP)

    @property
    def size(self) -> int:
        """The number of values that take space in a file."""
        # A difference of two ranges without a return is not a number.
        return int(np.count_nonzero(self.values[1:] != self.values[:-1]))

    def halved(self) -> Curve:
        """Return every second value."""
        return replace(self, time=self.time[::2], values=self.values[::2])

    def stored(self, frames: FloatArray, rate: float) -> ChannelData:
        """Return the channel for storage; `frames` are the times of the replay in s, `rate` the physics rate."""
        shared = self.time is frames
        # Rare readings are further apart than a column can say in steps of the physics.
        step = max(1 / rate, float(np.diff(self.time).max(initial=0.0)) / MAX_DELTA)
        return ChannelData.model_construct(
            group=self.group[:MAX_TEXT_LENGTH],
            name=self.name[:MAX_TEXT_LENGTH],
            unit=self.unit[:MAX_TEXT_LENGTH],
            time=None if shared else TextColumn.encoded(self.time, step),
            values=TextColumn.encoded(self.values, max(self.least_step, fine_scale(self.values))),
            commanded=self.commanded,
        )


def stored_channels(
    scene: Scene,
    frames: Trace,
    contacts: Sequence[Contact],
    commanded: Mapping[str, CommandedValues],
    readings: Mapping[str, ReadingLog],
) -> tuple[ChannelData, ...]:
    """Return the channels of a run.

    `frames` is the trace at the moments of the replay, `contacts` are from all steps, `commanded` is by kind; see
    `RunRecorder.commanded`.
    """
    time, rate = frames.time, scene.physics.rate
    curves = [*_of_base(frames, time, commanded.get("base", CommandedValues())), *_of_contacts(contacts, time, rate)]
    curves += _of_joints(scene.model.moving_joints, frames, time, commanded)
    curves += (curve for log in readings.values() for curve in _of_sensor(log, time, rate))
    curves += _of_wrenches(time, commanded.get("wrench", CommandedValues()))
    return tuple(curve.stored(time, rate) for curve in thinned_curves(curves[:MAX_CHANNELS], MAX_VALUES))


def thinned_curves(curves: Sequence[Curve], most: int) -> list[Curve]:
    """Return curves with at most about `most` values that change: those with the most values are halved first."""
    sizes = [curve.size for curve in curves]
    thinned = list(curves)
    while sum(sizes) > most and (longest := max(len(curve.time) for curve in thinned)) > 2:
        for number, curve in enumerate(thinned):
            # Curves that belong together have the same times afterwards, too.
            if len(curve.time) == longest:
                thinned[number] = curve.halved()
                sizes[number] = thinned[number].size
    return thinned


def _of_base(frames: Trace, time: FloatArray, commands: CommandedValues) -> Iterator[Curve]:
    """Yield the velocity of the base in its own frame, measured and commanded."""
    linear = in_base_frame(frames.base_orientation_xyzw, frames.base_linear_xyz)
    angular = in_base_frame(frames.base_orientation_xyzw, frames.base_angular_xyz)
    for kind, vectors, usual in (("linear", linear, "xy"), ("angular", angular, "z")):
        for axis, values in zip("xyz", vectors, strict=True):
            name, unit = f"{kind} {axis}", _TWIST_UNITS[kind]
            aim = Curve("base", name, unit, time, commands.at(name, time), commanded=True)
            measured = Curve("base", name, unit, time, values)
            if aim.tells or (axis in usual and measured.tells):
                yield measured
                if np.isfinite(aim.values).any():
                    yield aim


def in_base_frame(orientation_xyzw: FloatArray, vectors: FloatArray) -> tuple[FloatArray, ...]:
    """Return the x, y and z, (T,) each, of vectors (T, 3) of the world frame in the frame of the base."""
    x, y, z, w = orientation_xyzw.T
    turned_back: Any = (-x, -y, -z, w)
    columns: Any = tuple(vectors.T)
    turned: Any = geometry.rotate(turned_back, columns)
    return tuple(turned)


def _of_joints(
    joints: Iterable[Joint], frames: Trace, time: FloatArray, commanded: Mapping[str, CommandedValues]
) -> Iterator[Curve]:
    nothing = CommandedValues()
    for kind, columns in (("velocity", frames.joint_velocity), ("effort", frames.joint_effort)):
        commands = commanded.get(kind, nothing)
        for joint, values in zip(joints, columns.T, strict=True):
            unit = joint.dimension("velocity" if kind == "velocity" else "effort").si
            measured = Curve("joints", f"{joint.name} {kind}", unit, time, values)
            aim = replace(measured, values=commands.at(joint.name, time), commanded=True)
            is_commanded = bool(np.isfinite(aim.values).any())
            if measured.tells or is_commanded:
                yield measured
            if is_commanded:
                yield aim


def _of_contacts(contacts: Sequence[Contact], time: FloatArray, rate: float) -> Iterator[Curve]:
    """Yield the mean normal force between two moments, of all bodies and of each."""
    with_force = [contact for contact in contacts if contact.has_force and contact.time <= time[-1] + TIME_EPSILON_S]
    if not with_force:
        return
    moments = np.searchsorted(time, np.array([contact.time for contact in with_force]) - TIME_EPSILON_S)
    forces = np.array([contact.force for contact in with_force], dtype=np.float64)
    steps = np.maximum(1.0, np.rint(np.diff(time, prepend=time[0] - 1 / rate) * rate))
    bodies = list(dict.fromkeys(contact.body for contact in with_force))

    def curve(name: str, weights: FloatArray) -> Curve:
        total = np.bincount(moments, weights=weights, minlength=len(time))
        return Curve("contacts", name, "N", time, np.asarray(total / steps, dtype=np.float64))

    if len(bodies) != 1:
        yield curve("force of all bodies", forces)
    if len(bodies) <= MAX_TOUCHED:
        touched = np.array([bodies.index(contact.body) for contact in with_force])
        for number, body in enumerate(bodies):
            yield curve(f"force of {body}", np.where(touched == number, forces, 0.0))


def _of_wrenches(time: FloatArray, commands: CommandedValues) -> Iterator[Curve]:
    for name in commands.values:
        curve = Curve(
            "wrenches", name, "N" if name.startswith("force") else "N m", time, commands.at(name, time), commanded=True
        )
        if curve.tells:
            yield curve


def _of_sensor(log: ReadingLog, frames: FloatArray, rate: float) -> Iterator[Curve]:
    """Yield the numbers of a sensor: of a lidar its nearest range, of a camera none, of others all their columns."""
    last, kind, name = frames[-1] + TIME_EPSILON_S, log.mounted.sensor.key, log.mounted.name
    readings = [reading for reading in log.readings if reading.time <= last]
    if kind == "camera" or not readings:
        return
    # The first call of np.unique would take 10 ms: it imports masked arrays.
    steps = np.rint(np.array([reading.time for reading in readings]) * rate)
    first = np.flatnonzero(np.diff(steps, prepend=-np.inf) > 0)
    steps = steps[first]
    time = np.asarray(steps / rate, dtype=np.float64)
    if np.array_equal(steps, np.rint(frames * rate)):
        time = frames
    kept = [readings[row] for row in first]
    scans = [reading for reading in kept if isinstance(reading, LidarScan)]
    if len(scans) == len(kept):
        yield from _of_scans(scans, name, time)
        return
    rows = [reading.columns() for reading in kept]
    for column, about in columns_of(kind).items():
        if about.many:
            continue
        values = np.array([row[column] for row in rows], dtype=np.float64)
        if column == "orientation_xyzw":
            for angle, numbers in angles_of(values).items():
                yield Curve(name, angle, "rad", time, numbers)
            continue
        label = column.removesuffix(f"_{about.axes}").replace("_", " ")
        for axis, numbers in zip(about.axes or ("",), values.reshape(len(rows), -1).T, strict=True):
            yield Curve(name, f"{label} {axis}".rstrip(), about.dimension.si, time, numbers)


def _of_scans(scans: Sequence[LidarScan], name: str, time: FloatArray) -> Iterator[Curve]:
    """Yield the smallest range of each scan and its bearing; something nearer than a lidar can measure has range 0."""
    ranges = np.maximum(0.0, np.array([scan.ranges for scan in scans]))
    nearest = ranges.argmin(axis=1)
    least = ranges[np.arange(len(scans)), nearest]
    bearing = np.array([scan.angle_min for scan in scans]) + nearest * np.array(
        [scan.angle_increment for scan in scans]
    )
    bearing = np.remainder(bearing + np.pi, 2 * np.pi) - np.pi
    yield Curve(name, "nearest range", "m", time, least)
    yield Curve(name, "bearing of the nearest", "rad", time, np.where(np.isfinite(least), bearing, np.nan))


def angles_of(orientation_xyzw: FloatArray) -> dict[str, FloatArray]:
    """Return roll, pitch and yaw of orientations (N, 4), (N,) rad each."""
    x, y, z, w = orientation_xyzw.T
    angles = {
        "roll": np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        "pitch": np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
        "yaw": np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))),
    }
    return {name: np.asarray(values, dtype=np.float64) for name, values in angles.items()}
