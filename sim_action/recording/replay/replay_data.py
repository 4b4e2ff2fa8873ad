"""The data of a replay, version 2: motion, contacts, signals and channels, their consistency, and the file of a replay.

SI units, world frame, quaternions x, y, z, w.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, ValidationError, ValidationInfo, model_validator

from sim_action.core.field_types import FrozenModel
from sim_action.core.files import open_regular, whole_file
from sim_action.core.wording import system_reason
from sim_action.recording.replay import scene_data
from sim_action.recording.replay.columns import Column, Index, TextColumn
from sim_action.recording.replay.scene_data import SceneData
from sim_action.recording.replay.sensor_data import MAX_PICTURE_BYTES, MAX_RANGES, MAX_SENSORS, CameraData, ScanData
from sim_action.recording.replay.sightings import MAX_OBSTACLES, ObstacleData
from sim_action.state.timeline import MAX_TIME_MARKS

MAX_GOLDEN: Final = 8


class GoldenData(FrozenModel):
    """A golden trajectory, at its own moments."""

    expectation: Index  # the number of the expectation, counted from 0
    time: Column  # the sim time in s
    base: tuple[Column, Column, Column, Column]  # x, y, z in m and yaw in rad of the base link, in the world frame
    # (index in `Replay.joint_names`, positions in rad, or m if prismatic) of the joints that the file has
    joints: Annotated[tuple[tuple[Index, Column], ...], Field(max_length=scene_data.MAX_LINKS)] = ()
    # position, yaw: the tolerances of the expectation in m and rad; None if it has none, and in older replays
    position: scene_data.Length | None = None
    yaw: scene_data.Length | None = None

    @property
    def count(self) -> int:
        """The number of moments."""
        return 1 + len(self.time.deltas)

    def fits(self, joints: int) -> bool:
        """Return True if the columns are complete and the run has `joints` joints or more than the largest index."""
        columns = (*self.base, *(column for _, column in self.joints))
        are_whole = all(column.fits(self.count) and column.is_motion for column in columns)
        return self.time.rises and are_whole and all(index < joints for index, _ in self.joints)


MAX_CONTACTS: Final = 200
MAX_SIGNALS: Final = 200
MAX_CHANNELS: Final = 400

MAX_VALUES: Final = 50_000_000
"""The largest number of values in all columns of a motion, for which a browser needs 400 MB.

A column that never changes takes no space in a file.
"""

PoseColumns = tuple[Column, Column, Column, Column, Column, Column, Column]  # x, y, z, then the quaternion x, y, z, w


class Frames(FrozenModel):
    """The motion of a run at 30 Hz, including the last moment; all columns are as long as `time`."""

    time: Column  # the sim time in s
    base: PoseColumns  # the pose of the base link in the world
    # the joint positions in rad (m if prismatic), in the order of `Replay.joint_names`
    joints: Annotated[tuple[Column, ...], Field(max_length=scene_data.MAX_LINKS)] = ()
    # the commanded joint positions in the same order, null for a joint that has none; empty if no joint has one
    commanded: Annotated[tuple[Column | None, ...], Field(max_length=scene_data.MAX_LINKS)] = ()
    speed: Column  # the speed of the base link in m/s
    tilt: Column  # the angle in rad between the z axes of the base and the world
    # the poses of moving bodies in the world
    tracks: Annotated[tuple[PoseColumns, ...], Field(max_length=scene_data.MAX_BODIES)] = ()

    @property
    def count(self) -> int:
        """The number of moments."""
        return 1 + len(self.time.deltas)

    @property
    def columns(self) -> tuple[Column, ...]:
        """All columns."""
        tracks = (column for track in self.tracks for column in track)
        commanded = (column for column in self.commanded if column is not None)
        return (self.time, *self.base, *self.joints, *commanded, self.speed, self.tilt, *tracks)


class EventData(FrozenModel):
    """A mark of the timeline, see `TimeMark`: from `time` in s, to `until`; null for an instant or for ever."""

    time: scene_data.Number
    until: scene_data.Number | None = None
    words: scene_data.Text
    planned: bool = False


class ContactData(FrozenModel):
    """An uninterrupted contact of a link with a body, from `time` to `until` in s."""

    time: scene_data.Number
    until: scene_data.Number
    link: Index  # the index of the link
    body: Index  # the index of the body
    position: scene_data.Place  # the position of the first contact point in m, world frame
    # the largest mean force over 50 ms in N; None if engines compute none, see `Contact.has_force`
    force: scene_data.Number | None
    impulse: scene_data.Number  # the impulse of the whole contact in N s
    # the direction of the mean force on the link as a unit vector, world frame; None if it is not known
    normal: scene_data.Place | None = None
    period: Annotated[scene_data.Length, Field(gt=0)] | None = None  # the time in s between two values of `forces`
    forces: Column | None = None  # the mean force in N over each period since `time`
    # x, y and z of the mean contact point in m over each period, world frame; null in older replays
    places: tuple[Column, Column, Column] | None = None

    @property
    def is_whole(self) -> bool:
        """True if all columns are there and have the same length; one that never changes has no differences."""
        columns = (*([] if self.forces is None else [self.forces]), *(self.places or ()))
        lengths = {len(column.deltas) for column in columns} - {0}
        return (self.forces is None) == (self.period is None) and len(lengths) <= 1


class SignalData(FrozenModel):
    """One signal of an expectation over time."""

    expectation: Index  # the number of the expectation, counted from 0
    name: scene_data.Text
    unit: scene_data.Text  # the SI unit of values and limits
    time: Column | None = None  # the times in s; null for the moments of `Frames.time`
    values: Column  # the values, with gaps where the signal does not exist
    lower: scene_data.Number | None = None  # lower, upper: the limits of the values; null for none
    upper: scene_data.Number | None = None
    # start, end: the window in s in which the limits apply; an end of null means the end of the run
    start: scene_data.Number = 0.0
    end: scene_data.Number | None = None


class ChannelData(FrozenModel):
    """One recorded quantity over time that belongs to no expectation: of a sensor, of a command or of contacts."""

    group: scene_data.Text  # the thing it belongs to, for example the name of a sensor
    name: scene_data.Text
    unit: scene_data.Text  # the SI unit of the values
    time: TextColumn | None = None  # the times in s; null for the moments of `Frames.time`
    values: TextColumn  # the values, with gaps where there is none
    # True for values that a controller asked for; the measured ones have the same group and name
    commanded: bool = False


WITHOUT_SCENE: Final = object()  # the context of pydantic for a replay whose scene is known already


class Replay(FrozenModel):
    """The recording of a run for the report."""

    version: Literal[1, 2]
    scene: scene_data.SceneData
    joint_names: Annotated[tuple[scene_data.Text, ...], Field(max_length=scene_data.MAX_LINKS)] = ()
    frames: Frames
    # the contacts with the largest forces, at most 200, in the order of time
    contacts: Annotated[tuple[ContactData, ...], Field(max_length=MAX_CONTACTS)] = ()
    contacts_left_out: Annotated[int, Field(ge=0, le=2**53)] = 0  # the number of further contacts
    # what the scenario lets happen at a time, in the order of time
    events: Annotated[tuple[EventData, ...], Field(max_length=MAX_TIME_MARKS)] = ()
    signals: Annotated[tuple[SignalData, ...], Field(max_length=MAX_SIGNALS)] = ()
    marks: Annotated[tuple[scene_data.MarkData, ...], Field(max_length=scene_data.MAX_MARKS)] = ()
    channels: Annotated[tuple[ChannelData, ...], Field(max_length=MAX_CHANNELS)] = ()  # further recorded quantities
    # the name of the scenario; null in version 1 and in runs that a launch file describes
    scenario: scene_data.Text | None = None
    scans: Annotated[tuple[ScanData, ...], Field(max_length=MAX_SENSORS)] = ()  # the scans of lidars
    cameras: Annotated[tuple[CameraData, ...], Field(max_length=MAX_SENSORS)] = ()  # the pictures of cameras
    # the bodies that the robot met, and which sensors saw them
    obstacles: Annotated[tuple[ObstacleData, ...], Field(max_length=MAX_OBSTACLES)] = ()
    # the points of the path that the commands ask for, world frame, in m; empty without one
    commanded_path: Annotated[tuple[scene_data.Place, ...], Field(max_length=1_000)] = ()
    # the names of sensors that nothing in the run read
    unread: Annotated[tuple[scene_data.Text, ...], Field(max_length=MAX_SENSORS)] = ()
    # the golden trajectories that the run is compared with
    golden: Annotated[tuple[GoldenData, ...], Field(max_length=MAX_GOLDEN)] = ()

    @model_validator(mode="after")
    def _fits_together(self, info: ValidationInfo) -> Self:
        # The reader sets the scene afterwards.
        if info.context is not WITHOUT_SCENE and (problem := first_problem(self)) is not None:
            raise ValueError(problem)
        return self


def first_problem(replay: Replay) -> str | None:
    """Return the first inconsistency of a replay, or None."""
    return next(_problems(replay), None)


def _problems(replay: Replay) -> Iterator[str]:
    scene, frames = replay.scene, replay.frames
    yield from scene_data.scene_problems(scene, len(frames.joints), len(frames.tracks))
    yield from _of_frames(frames)
    if len(replay.joint_names) != len(frames.joints):
        yield "the number of joint names differs from the number of joint columns"
    if len(frames.commanded) not in {0, len(frames.joints)}:
        yield "the number of commanded columns differs from the number of joint columns"
    if any(contact.link >= len(scene.links) or contact.body >= len(scene.bodies) for contact in replay.contacts):
        yield "a contact refers to a link or body that does not exist"
    if not all(contact.is_whole for contact in replay.contacts):
        yield "the forces or places of a contact are not complete"
    if any(mark.link is not None and mark.link >= len(scene.links) for mark in replay.marks):
        yield "a mark refers to a link that does not exist"
    yield from _of_sensors(replay)
    if not all(_is_whole(signal, frames.count) for signal in replay.signals):
        yield "a signal has another number of values than moments"
    if not all(_is_whole_channel(channel, frames.count) for channel in replay.channels):
        yield "a channel has another number of values than moments"
    if not all(golden.fits(len(frames.joints)) for golden in replay.golden):
        yield "a golden trajectory is not complete, or has a joint that does not exist"


def _of_sensors(replay: Replay) -> Iterator[str]:
    if any(scan.link >= len(replay.scene.links) for scan in replay.scans):
        yield "a scan refers to a link that does not exist"
    if not all(scan.is_whole for scan in replay.scans) or sum(len(scan.ranges) for scan in replay.scans) > MAX_RANGES:
        yield "the scans of a sensor are not complete, or there are too many of them"
    if not all(camera.is_whole for camera in replay.cameras):
        yield "the times of pictures do not increase"
    if sum(camera.size for camera in replay.cameras) > 2 * MAX_PICTURE_BYTES:
        yield "the pictures are too large"
    if any(obstacle.body >= len(replay.scene.bodies) for obstacle in replay.obstacles):
        yield "an obstacle refers to a body that does not exist"


def _of_frames(frames: Frames) -> Iterator[str]:
    if not all(column.fits(frames.count) for column in frames.columns):
        yield "a column has another number of values than moments"
    if not frames.time.rises:
        yield "the times do not increase, or are too large"
    if not all(column.is_motion for column in (*frames.base, *frames.joints)):
        yield "the motion of the robot has a gap, or is too large"
    if len(frames.columns) * frames.count > MAX_VALUES:
        yield "the motion has too many values"


def _is_whole(signal: SignalData, frames: int) -> bool:
    if signal.time is None:
        return signal.values.fits(frames)
    return signal.time.rises and signal.values.fits(1 + len(signal.time.deltas))


def _is_whole_channel(channel: ChannelData, frames: int) -> bool:
    count = frames if channel.time is None else channel.time.count
    return (channel.time is None or channel.time.rises) and channel.values.fits(count)


MAX_PACKED_BYTES: Final = 8_000_000  # the largest size of a file

MAX_UNPACKED_BYTES: Final = 24_000_000
"""The largest unpacked size: 20,000 moments of 30 joints and 50 bodies. Reading takes ten times as much memory."""

_LEVEL: Final = 6  # a higher level takes twice the time and saves almost nothing


class ReplayError(ValueError):
    """An error for a file that is not a valid replay."""


def write_replay(replay: Replay, path: Path) -> None:
    """Write a replay completely or not at all. Raises OSError, or ValueError if it is too large to be read."""
    data = replay.model_dump_json(exclude_defaults=True).encode()
    if len(data) > MAX_UNPACKED_BYTES:
        raise ValueError(
            f"the replay has {len(data) // 1_000_000} MB; the limit is {MAX_UNPACKED_BYTES // 1_000_000} MB"
        )
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:
        file.write(gzip.compress(data, _LEVEL, mtime=0))


def read_replay(path: Path) -> Replay:
    """Read a replay file, which may come from anywhere. Raises ReplayError."""
    return ReplayReader().read(path)


class ReplayReader:
    """Reads replay files one after another. Equal scenes, for example of variations, are read once and shared."""

    def __init__(self) -> None:
        """Start without a known scene."""
        self._scene: SceneData | None = None
        # The beginning of files with the known scene.
        self._beginning = b""

    def read(self, path: Path) -> Replay:
        """Read a replay file, which may come from anywhere. Raises ReplayError."""
        try:
            with open_regular(path, follow_link=False) as file:
                packed = file.read(MAX_PACKED_BYTES + 1)
            return self._parsed(_unpacked(packed))
        except ValidationError as error:
            details = error.errors(include_url=False, include_context=False)[0]
            if details["loc"] == ("version",) and isinstance(version := details.get("input"), int):
                raise ReplayError(f"{path.name}: {_OTHER_VERSION.format(version=version)}") from None
            reason = details["msg"].removeprefix("Value error, ")
        except OSError as error:
            reason = system_reason(error)
        except (ValueError, zlib.error) as error:
            reason = str(error)
        # The error is on a page that others read, so it has no path of this machine.
        raise ReplayError(f"{path.name}: not a valid replay: {reason}")

    def _parsed(self, data: bytes) -> Replay:
        """Return the replay. Raise ValueError."""
        if self._scene is not None and data.startswith(self._beginning):
            rest = data[len(self._beginning) :]
            replay = Replay.model_validate_json(_BEFORE_SCENE + _NO_SCENE + b"," + rest, context=WITHOUT_SCENE)
            # A second scene in the file would replace the first one.
            if replay.scene.links[0].name == replay.scene.robot == _UNNAMED:
                replay = replay.model_copy(update={"scene": self._scene})
                if (problem := first_problem(replay)) is not None:
                    raise ValueError(problem)
                return replay
        replay = Replay.model_validate_json(data)
        scene = replay.scene.model_dump_json(exclude_defaults=True).encode()
        self._scene, self._beginning = replay.scene, _BEFORE_SCENE + scene + b","
        return replay


_OTHER_VERSION: Final = "was written by another version of sim-action (format {version}; this one reads 1 and 2)"
_BEFORE_SCENE: Final = b'{"version":2,"scene":'
_UNNAMED: Final = "?"
_NO_SCENE: Final = b'{"robot":"?","links":[{"name":"?"}]}'


def _unpacked(packed: bytes) -> bytes:
    """Unpack data with a limit, because a small file may unpack to a large one."""
    if len(packed) > MAX_PACKED_BYTES:
        raise ValueError(f"the file has more than {MAX_PACKED_BYTES // 1_000_000} MB")
    unpacker = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    data = unpacker.decompress(packed, MAX_UNPACKED_BYTES + 1)
    if len(data) > MAX_UNPACKED_BYTES:
        raise ValueError(f"the unpacked data has more than {MAX_UNPACKED_BYTES // 1_000_000} MB")
    if not unpacker.eof:
        raise ValueError("the file is truncated")
    return data
