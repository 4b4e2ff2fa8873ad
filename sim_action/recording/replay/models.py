"""The replay file, version 1: JSON in gzip, of one run. SI units, world frame; quaternions x, y, z, w."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel
from sim_action.recording.replay.columns import Column, Index
from sim_action.recording.replay.consistency import problem_of
from sim_action.recording.replay.marks import MarkData
from sim_action.recording.replay.shapes import Digest, Length, MeshData, Number, Place, PoseNumbers, Shapes

MAX_LINKS: Final = 1_000
MAX_BODIES: Final = 5_000
MAX_MESHES: Final = 2_000
MAX_CONTACTS: Final = 200
MAX_SIGNALS: Final = 200
MAX_MARKS: Final = 500

MOST_LETTERS: Final = 300

Text = Annotated[str, Field(max_length=MOST_LETTERS)]
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
