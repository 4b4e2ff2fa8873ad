"""The replay file, version 1: the data model, consistency checks, reading and writing.

A replay is the recording of one run for `report.html`: gzipped JSON with SI units in the world frame, quaternions
x, y, z, w. A file that is read may come from anywhere, so its sizes and indices are checked.
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
from sim_action.recording.replay.columns import Column, Index
from sim_action.recording.replay.shapes import Digest, Length, MeshData, MeshShape, Number, Place, PoseNumbers, Shapes


class _Mark(FrozenModel):
    """A place that an expectation is about; `expectation` is its number, counted from 0, or null.

    Coordinates are in the world frame, or in that of `link`, with which the mark moves.
    """

    expectation: Index | None = None
    link: Index | None = None


class CircleMark(_Mark):
    """A circle at height `z`, in m."""

    kind: Literal["circle"]
    x: Number
    y: Number
    z: Number = 0.0
    radius: Length


class PolygonMark(_Mark):
    """A closed area on the ground plane; points x, y in m."""

    kind: Literal["polygon"]
    points: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3, max_length=10_000)]


class PolylineMark(_Mark):
    """A path; points x, y, z in m."""

    kind: Literal["polyline"]
    points: Annotated[tuple[Place, ...], Field(min_length=2, max_length=10_000)]


class ArrowMark(_Mark):
    """A position and heading on the ground plane, in m and rad about the z axis."""

    kind: Literal["arrow"]
    x: Number
    y: Number
    yaw: Number


MarkData = Annotated[CircleMark | PolygonMark | PolylineMark | ArrowMark, Field(discriminator="kind")]


MAX_LINKS: Final = 1_000
MAX_BODIES: Final = 5_000
MAX_MESHES: Final = 2_000
MAX_CONTACTS: Final = 200
MAX_SIGNALS: Final = 200
MAX_MARKS: Final = 500

MAX_TEXT_LENGTH: Final = 300

Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH)]
PoseColumns = tuple[Column, Column, Column, Column, Column, Column, Column]
"""x, y, z, then the quaternion x, y, z, w."""


class JointMotion(FrozenModel):
    """The motion of a link on its parent: rotation (rad) or translation (m) by multiplier * column + offset.

    Attributes:
        axis: the unit vector in the frame given by the `origin` of the link.
        column: the index of the joint's column in `Frames.joints`.
    """

    type: Literal["revolute", "prismatic"]
    axis: Place
    column: Index
    multiplier: Number = 1.0
    offset: Number = 0.0


class LinkData(FrozenModel):
    """A link of the robot. The base is the first link, and parents come before their children.

    Attributes:
        parent: the index of the parent; null only for the base.
        origin: the pose of the link in its parent before the joint moves it; unused for the base.
        joint: the motion relative to the parent; null if it is fixed.
        shapes: the shapes in the frame of the link.
    """

    name: Text
    parent: Index | None = None
    origin: PoseNumbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    joint: JointMotion | None = None
    shapes: Shapes = ()


class BodyData(FrozenModel):
    """A body of the world.

    Attributes:
        pose: the initial pose in the world.
        track: the index of its columns in `Frames.tracks`; null if it does not move.
        appears: the time in s at which it appears; null if it always exists.
    """

    name: Text
    pose: PoseNumbers
    track: Index | None = None
    appears: Length | None = None
    shapes: Shapes = ()


class PatchData(FrozenModel):
    """An area of the ground with its own friction: x and y of its centre and full sizes, in m."""

    x: Number
    y: Number
    size: tuple[Length, Length]
    friction: Number


class SceneData(FrozenModel):
    """The links of the robot, the bodies of the world and the meshes; `robot` is the name of the model."""

    robot: Text
    links: Annotated[tuple[LinkData, ...], Field(min_length=1, max_length=MAX_LINKS)]
    bodies: Annotated[tuple[BodyData, ...], Field(max_length=MAX_BODIES)] = ()
    patches: Annotated[tuple[PatchData, ...], Field(max_length=50)] = ()
    meshes: Annotated[dict[Digest, MeshData], Field(max_length=MAX_MESHES)] = Field(default_factory=dict)


class Frames(FrozenModel):
    """The motion of a run at 30 Hz, including the last moment; all columns are as long as `time`.

    Attributes:
        time: the sim time in s.
        base: the pose of the base link in the world.
        joints: the joint positions in rad (m if prismatic), in the order of `Replay.joint_names`.
        commanded: the commanded joint positions in the same order, null for a joint that has none; empty if no joint
            has one.
        speed: the speed of the base link in m/s.
        tilt: the angle in rad between the z axes of the base and the world.
        tracks: the poses of moving bodies in the world.
    """

    time: Column
    base: PoseColumns
    joints: Annotated[tuple[Column, ...], Field(max_length=MAX_LINKS)] = ()
    commanded: Annotated[tuple[Column | None, ...], Field(max_length=MAX_LINKS)] = ()
    speed: Column
    tilt: Column
    tracks: Annotated[tuple[PoseColumns, ...], Field(max_length=MAX_BODIES)] = ()

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


class ContactData(FrozenModel):
    """An uninterrupted contact of a link with a body, from `time` to `until` in s.

    Attributes:
        link: the index of the link.
        body: the index of the body.
        position: the position of the first contact point in m, world frame.
        force: the largest mean force over 50 ms in N; None if engines compute none, see `Contact.has_force`.
        impulse: the impulse of the whole contact in N s.
    """

    time: Number
    until: Number
    link: Index
    body: Index
    position: Place
    force: Number | None
    impulse: Number


class SignalData(FrozenModel):
    """One signal of an expectation over time.

    Attributes:
        expectation: the number of the expectation, counted from 0.
        unit: the SI unit of values and limits.
        time: the times in s; null for the moments of `Frames.time`.
        values: the values, with gaps where the signal does not exist.
        lower, upper: the limits of the values; null for none.
        start, end: the window in s in which the limits apply; an end of null means the end of the run.
    """

    expectation: Index
    name: Text
    unit: Text
    time: Column | None = None
    values: Column
    lower: Number | None = None
    upper: Number | None = None
    start: Number = 0.0
    end: Number | None = None


_WITHOUT_SCENE: Final = object()
"""The context of pydantic for a replay whose scene is known already."""


class Replay(FrozenModel):
    """The recording of a run for the report.

    Attributes:
        contacts: the contacts with the largest forces, at most 200, in the order of time.
        contacts_left_out: the number of further contacts.
    """

    version: Literal[1]
    scene: SceneData
    joint_names: Annotated[tuple[Text, ...], Field(max_length=MAX_LINKS)] = ()
    frames: Frames
    contacts: Annotated[tuple[ContactData, ...], Field(max_length=MAX_CONTACTS)] = ()
    contacts_left_out: Annotated[int, Field(ge=0, le=2**53)] = 0
    signals: Annotated[tuple[SignalData, ...], Field(max_length=MAX_SIGNALS)] = ()
    marks: Annotated[tuple[MarkData, ...], Field(max_length=MAX_MARKS)] = ()

    @model_validator(mode="after")
    def _fits_together(self, info: ValidationInfo) -> Self:
        # The reader sets the scene afterwards.
        if info.context is not _WITHOUT_SCENE and (problem := _first_problem(self)) is not None:
            raise ValueError(problem)
        return self


def _first_problem(replay: Replay) -> str | None:
    """Return the first inconsistency of a replay, or None."""
    return next(_problems(replay), None)


def _problems(replay: Replay) -> Iterator[str]:
    scene, frames = replay.scene, replay.frames
    yield from _of_links(scene, len(frames.joints))
    yield from _of_bodies(scene, len(frames.tracks))
    yield from _of_frames(frames)
    if len(replay.joint_names) != len(frames.joints):
        yield "the number of joint names differs from the number of joint columns"
    if len(frames.commanded) not in {0, len(frames.joints)}:
        yield "the number of commanded columns differs from the number of joint columns"
    if any(contact.link >= len(scene.links) or contact.body >= len(scene.bodies) for contact in replay.contacts):
        yield "a contact refers to a link or body that does not exist"
    if any(mark.link is not None and mark.link >= len(scene.links) for mark in replay.marks):
        yield "a mark refers to a link that does not exist"
    if not all(_is_whole(signal, frames.count) for signal in replay.signals):
        yield "a signal has another number of values than moments"


def _of_links(scene: SceneData, joints: int) -> Iterator[str]:
    for number, link in enumerate(scene.links):
        if (link.parent is None) != (number == 0) or (link.parent or 0) >= max(1, number):
            yield "the first link must be the base, and each other link must have a parent before it"
        if link.joint is not None and link.joint.column >= joints:
            yield "a link moves by a joint column that does not exist"


def _of_bodies(scene: SceneData, tracks: int) -> Iterator[str]:
    if any(body.track is not None and body.track >= tracks for body in scene.bodies):
        yield "a body refers to a track that does not exist"
    drawn = [owner.shapes for owner in scene.links] + [owner.shapes for owner in scene.bodies]
    shapes = (shape for several in drawn for shape in several)
    if any(isinstance(shape, MeshShape) and shape.mesh not in scene.meshes for shape in shapes):
        yield "a shape refers to a mesh that does not exist"
    if not all(mesh.is_whole for mesh in scene.meshes.values()):
        yield "a mesh has a triangle with a point that does not exist"


def _of_frames(frames: Frames) -> Iterator[str]:
    if not all(column.fits(frames.count) for column in frames.columns):
        yield "a column has another number of values than moments"
    if frames.time.gaps or any(delta <= 0 for delta in frames.time.deltas):
        yield "the times do not increase"


def _is_whole(signal: SignalData, frames: int) -> bool:
    if signal.time is None:
        return signal.values.fits(frames)
    rises = not signal.time.gaps and all(delta > 0 for delta in signal.time.deltas)
    return rises and signal.values.fits(1 + len(signal.time.deltas))


MAX_PACKED_BYTES: Final = 8_000_000
"""The largest size of a file."""

MAX_UNPACKED_BYTES: Final = 24_000_000
"""The largest unpacked size: 20,000 moments of 30 joints and 50 bodies. Reading takes ten times as much memory."""

# A higher level takes twice the time and saves almost nothing.
_LEVEL: Final = 6


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
    """Reads replay files one after another. Equal scenes, such as those of variations, are read once and shared."""

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
            found = error.errors(include_url=False, include_input=False, include_context=False)[0]
            raise ReplayError(f"{path}: not a valid replay: {found['msg']}") from None
        except (OSError, ValueError, zlib.error) as error:
            raise ReplayError(f"{path}: not a valid replay: {error}") from None

    def _parsed(self, data: bytes) -> Replay:
        """Return the replay. Raise ValueError."""
        if self._scene is not None and data.startswith(self._beginning):
            rest = data[len(self._beginning) :]
            replay = Replay.model_validate_json(_BEFORE_SCENE + _NO_SCENE + b"," + rest, context=_WITHOUT_SCENE)
            # A second scene in the file would replace the first one.
            if replay.scene.links[0].name == replay.scene.robot == _UNNAMED:
                replay = replay.model_copy(update={"scene": self._scene})
                if (problem := _first_problem(replay)) is not None:
                    raise ValueError(f"Value error, {problem}")
                return replay
        replay = Replay.model_validate_json(data)
        scene = replay.scene.model_dump_json(exclude_defaults=True).encode()
        self._scene, self._beginning = replay.scene, _BEFORE_SCENE + scene + b","
        return replay


_BEFORE_SCENE: Final = b'{"version":1,"scene":'
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
