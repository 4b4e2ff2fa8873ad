"""The replay file, version 1: JSON in gzip, of one run. SI units, world frame; quaternions x, y, z, w."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, ValidationError, model_validator

from sim_action.core.field_types import FrozenModel
from sim_action.core.files import open_regular, whole_file
from sim_action.recording.replay.columns import Column, Index
from sim_action.recording.replay.shapes import Digest, Length, MeshData, MeshShape, Number, Place, PoseNumbers, Shapes


class _Mark(FrozenModel):
    """A mark; `expectation`: the number of the one that it belongs to, counted from 0; null: of none."""

    expectation: Index | None = None


class CircleMark(_Mark):
    """On the ground plane, or as high as `z`; in m."""

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
    """A way; points x, y, z in m."""

    kind: Literal["polyline"]
    points: Annotated[tuple[Place, ...], Field(min_length=2, max_length=10_000)]


class ArrowMark(_Mark):
    """A heading at a place on the ground plane: m, and rad about the z axis."""

    kind: Literal["arrow"]
    x: Number
    y: Number
    yaw: Number


MarkData = Annotated[CircleMark | PolygonMark | PolylineMark | ArrowMark, Field(discriminator="kind")]


def problem_of(replay: Replay) -> str | None:
    """The first thing that does not fit, if there is one."""
    return next(_problems(replay), None)


def _problems(replay: Replay) -> Iterator[str]:
    scene, frames = replay.scene, replay.frames
    yield from _of_links(scene, len(frames.joints))
    yield from _of_bodies(scene, len(frames.tracks))
    yield from _of_frames(frames)
    if len(replay.joint_names) != len(frames.joints):
        yield "there are as many joint names as columns of joints"
    if any(contact.link >= len(scene.links) or contact.body >= len(scene.bodies) for contact in replay.contacts):
        yield "a contact names a link or a body that is not there"
    if not all(_is_whole(signal, frames.count) for signal in replay.signals):
        yield "a signal has as many values as moments"


def _of_links(scene: SceneData, joints: int) -> Iterator[str]:
    for number, link in enumerate(scene.links):
        if (link.parent is None) != (number == 0) or (link.parent or 0) >= max(1, number):
            yield "the first link is the base, and each other one has a parent before it"
        if link.joint is not None and link.joint.column >= joints:
            yield "a link moves by a joint that has no column"


def _of_bodies(scene: SceneData, tracks: int) -> Iterator[str]:
    if any(body.track is not None and body.track >= tracks for body in scene.bodies):
        yield "a body moves on a track that is not there"
    drawn = [owner.shapes for owner in scene.links] + [owner.shapes for owner in scene.bodies]
    shapes = (shape for several in drawn for shape in several)
    if any(isinstance(shape, MeshShape) and shape.mesh not in scene.meshes for shape in shapes):
        yield "a shape names a mesh that is not there"
    if not all(mesh.is_whole for mesh in scene.meshes.values()):
        yield "a mesh has triangles between points that are not there"


def _of_frames(frames: Frames) -> Iterator[str]:
    if not all(column.fits(frames.count) for column in frames.columns):
        yield "a column has as many values as there are moments"
    if frames.time.gaps or any(delta <= 0 for delta in frames.time.deltas):
        yield "the time rises"


def _is_whole(signal: SignalData, frames: int) -> bool:
    if signal.time is None:
        return signal.values.fits(frames)
    rises = not signal.time.gaps and all(delta > 0 for delta in signal.time.deltas)
    return rises and signal.values.fits(1 + len(signal.time.deltas))


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
    """How a link moves on its parent: turned (rad) or slid (m) along `axis` by multiplier * column + offset.

    Attributes:
        axis: unit vector in the frame that the link's `origin` gives.
        column: number of the joint's column in `Frames.joints`.
    """

    type: Literal["revolute", "prismatic"]
    axis: Place
    column: Index
    multiplier: Number = 1.0
    offset: Number = 0.0


class LinkData(FrozenModel):
    """A link of the robot; parents stand before their children, and the base is the first.

    Attributes:
        parent: number of its parent; null for the base alone.
        origin: of its frame in its parent's, before the joint moves it; of the base: nothing.
        joint: null: it is fixed to its parent.
        shapes: in its own frame.
    """

    name: Text
    parent: Index | None = None
    origin: PoseNumbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    joint: JointMotion | None = None
    shapes: Shapes = ()


class BodyData(FrozenModel):
    """A body of the world.

    Attributes:
        pose: of its frame in the world, at first.
        track: number of its columns in `Frames.tracks`; null: it stays.
        appears: s before which it is not there; null: it always is.
    """

    name: Text
    pose: PoseNumbers
    track: Index | None = None
    appears: Length | None = None
    shapes: Shapes = ()


class PatchData(FrozenModel):
    """An area of the ground with a friction of its own: x and y of its middle, full sizes, in m."""

    x: Number
    y: Number
    size: tuple[Length, Length]
    friction: Number


class SceneData(FrozenModel):
    """What there is to see; `robot`: what its model calls itself."""

    robot: Text
    links: Annotated[tuple[LinkData, ...], Field(min_length=1, max_length=MAX_LINKS)]
    bodies: Annotated[tuple[BodyData, ...], Field(max_length=MAX_BODIES)] = ()
    patches: Annotated[tuple[PatchData, ...], Field(max_length=50)] = ()
    meshes: Annotated[dict[Digest, MeshData], Field(max_length=MAX_MESHES)] = Field(default_factory=dict)


class Frames(FrozenModel):
    """The run, 30 moments a second and the last one; all columns are as long as `time`.

    Attributes:
        time: s since the first command.
        base: of the base link in the world.
        joints: rad (m if prismatic), in the order of `Replay.joint_names`.
        speed: m/s of the base link.
        tilt: rad between the base's z axis and the world's.
        tracks: of the bodies that move, in the world.
    """

    time: Column
    base: PoseColumns
    joints: Annotated[tuple[Column, ...], Field(max_length=MAX_LINKS)] = ()
    speed: Column
    tilt: Column
    tracks: Annotated[tuple[PoseColumns, ...], Field(max_length=MAX_BODIES)] = ()

    @property
    def count(self) -> int:
        """How many moments there are."""
        return 1 + len(self.time.deltas)

    @property
    def columns(self) -> tuple[Column, ...]:
        """All of them."""
        tracks = (column for track in self.tracks for column in track)
        return (self.time, *self.base, *self.joints, self.speed, self.tilt, *tracks)


class ContactData(FrozenModel):
    """A link of the robot at a body, from `time` to `until`, in s, without a gap.

    Attributes:
        link: number of the link.
        body: number of the body.
        position: where it began, in m, world frame.
        force: N, the largest of all points of a step together.
    """

    time: Number
    until: Number
    link: Index
    body: Index
    position: Place
    force: Number


class SignalData(FrozenModel):
    """One curve of an expectation.

    Attributes:
        expectation: its number, counted from 0.
        unit: of values and limits, an SI symbol.
        time: s; null: the moments of `Frames.time`.
        values: with gaps where there is nothing.
        lower, upper: limits: what the values have to be above, and below; null: none.
        start, end: s, the window that the limits hold for; an end of null: until the end of the run.
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


class Replay(FrozenModel):
    """What a page needs to show a run.

    Attributes:
        contacts: at most 200, in the order of time: those with the largest forces.
        contacts_left_out: how many more there were.
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
    def _fits_together(self) -> Self:
        if (problem := problem_of(self)) is not None:
            raise ValueError(problem)
        return self


MAX_PACKED_BYTES: Final = 8_000_000
"""Of a file."""

MAX_UNPACKED_BYTES: Final = 24_000_000
"""Of what is in one: 20,000 moments of a robot of 30 joints and 50 bodies. Read, it takes ten times as much memory."""

# More takes twice the time and saves nothing to speak of.
_LEVEL: Final = 6


class ReplayError(ValueError):
    """A file that is no replay."""


def write_replay(replay: Replay, path: Path) -> None:
    """Writes a replay, all of it or nothing. Raises OSError, and ValueError for one that nobody would read."""
    data = replay.model_dump_json(exclude_defaults=True).encode()
    if len(data) > MAX_UNPACKED_BYTES:
        raise ValueError(f"it would have {len(data) // 1_000_000} MB")
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:
        file.write(gzip.compress(data, _LEVEL, mtime=0))


def read_replay(path: Path) -> Replay:
    """Reads what `write` wrote, which may be a stranger's. Raises ReplayError."""
    try:
        with open_regular(path, follow_link=False) as file:
            packed = file.read(MAX_PACKED_BYTES + 1)
        return Replay.model_validate_json(_unpacked(packed))
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False, include_context=False)[0]
        raise ReplayError(f"{path}: not a replay: {found['msg']}") from None
    except (OSError, ValueError, zlib.error) as error:
        raise ReplayError(f"{path}: not a replay: {error}") from None


def _unpacked(packed: bytes) -> bytes:
    """A small file may hold much."""
    if len(packed) > MAX_PACKED_BYTES:
        raise ValueError(f"it has more than {MAX_PACKED_BYTES // 1_000_000} MB")
    unpacker = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    data = unpacker.decompress(packed, MAX_UNPACKED_BYTES + 1)
    if len(data) > MAX_UNPACKED_BYTES:
        raise ValueError(f"it holds more than {MAX_UNPACKED_BYTES // 1_000_000} MB")
    if not unpacker.eof:
        raise ValueError("it was cut off")
    return data
