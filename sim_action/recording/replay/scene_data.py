"""The scene of a replay: the links of the robot, the bodies of the world and their shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Final, Literal

from pydantic import Field

from sim_action.core.field_types import FrozenModel
from sim_action.recording.replay.columns import Index
from sim_action.recording.replay.shapes import (
    Colour,
    Digest,
    Length,
    MeshData,
    MeshShape,
    Number,
    Place,
    PoseNumbers,
    Shapes,
)

MAX_LINKS: Final = 1_000
MAX_BODIES: Final = 5_000
MAX_MESHES: Final = 2_000
MAX_NOTES: Final = 8

MAX_TEXT_LENGTH: Final = 300

Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH)]


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


class GroundData(FrozenModel):
    """The look of the plane z = 0; red, green and blue from 0 to 1.

    Attributes:
        checker: the colour of every other square; null without squares.
        square: the side of a square in m.
    """

    color: Colour
    checker: Colour | None = None
    square: Annotated[float, Field(ge=0.01, le=1_000, allow_inf_nan=False)] = 1.0


class SceneData(FrozenModel):
    """The links of the robot, the bodies of the world and the meshes.

    Attributes:
        robot: the name of the model.
        ground: its look as the world states it; null if it does not.
        notes: the differences between the drawing and the model, a sentence each.
    """

    robot: Text
    links: Annotated[tuple[LinkData, ...], Field(min_length=1, max_length=MAX_LINKS)]
    bodies: Annotated[tuple[BodyData, ...], Field(max_length=MAX_BODIES)] = ()
    patches: Annotated[tuple[PatchData, ...], Field(max_length=50)] = ()
    meshes: Annotated[dict[Digest, MeshData], Field(max_length=MAX_MESHES)] = Field(default_factory=dict)
    ground: GroundData | None = None
    notes: Annotated[tuple[Text, ...], Field(max_length=MAX_NOTES)] = ()


def scene_problems(scene: SceneData, joints: int, tracks: int) -> Iterator[str]:
    """Yield the inconsistencies of a scene with its numbers of joint columns and of tracks."""
    yield from _of_links(scene, joints)
    yield from _of_bodies(scene, tracks)


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
