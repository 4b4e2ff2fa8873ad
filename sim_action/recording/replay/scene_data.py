"""The data of the scene of a replay: links, bodies and their shapes, and the marks of expectations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_action.core.field_types import FrozenModel
from sim_action.recording.replay.columns import Index

IntArray = NDArray[np.int64]
MAX_SHAPES: Final = 5_000  # the largest number of shapes of a link or body; a map has at most 2,000 walls
MAX_POINTS: Final = 40_000  # the largest number of points of a mesh
MAX_ABS_VALUE: Final = 1e9  # the largest absolute value of any number in its unit
Number = Annotated[float, Field(ge=-MAX_ABS_VALUE, le=MAX_ABS_VALUE, allow_inf_nan=False)]
Length = Annotated[float, Field(ge=0, le=MAX_ABS_VALUE, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Colour = tuple[Share, Share, Share]  # red, green and blue
Place = tuple[Number, Number, Number]  # a position x, y, z in m

PoseNumbers = tuple[Number, Number, Number, Number, Number, Number, Number]
"""A pose: x, y, z in m and quaternion x, y, z, w."""


def numbers(values: Iterable[float]) -> tuple[float, ...]:
    """Round numbers to 1e-5 (m or quaternion components): this is enough for display and compresses better."""
    return tuple(round(value, 5) for value in values)


Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{16,64}$")]
Coordinates = Annotated[
    tuple[Annotated[int, Field(ge=-(2**31), le=2**31)], ...], Field(min_length=9, max_length=3 * MAX_POINTS)
]
Corners = Annotated[
    tuple[Annotated[int, Field(gt=-MAX_POINTS, lt=MAX_POINTS)], ...], Field(min_length=3, max_length=6 * MAX_POINTS)
]


class _Shape(FrozenModel):
    """A shape in the frame of its link or body; `color` is red, green, blue from 0 to 1."""

    pose: PoseNumbers
    color: Colour
    opacity: Share = 1.0


class BoxShape(_Shape):
    """A box, centred; full sizes in m."""

    kind: Literal["box"]
    size: tuple[Length, Length, Length]


class CylinderShape(_Shape):
    """A cylinder along z, centred; in m."""

    kind: Literal["cylinder"]
    radius: Length
    length: Length


class EllipsoidShape(_Shape):
    """An ellipsoid, centred; half axes in m."""

    kind: Literal["ellipsoid"]
    half: tuple[Length, Length, Length]


class CapsuleShape(_Shape):
    """A capsule along z, centred; `length` is the length in m of the cylinder between the hemispheres."""

    kind: Literal["capsule"]
    radius: Length
    length: Length


class MeshShape(_Shape):
    """A mesh of the scene, by its digest."""

    kind: Literal["mesh"]
    mesh: Digest


Shape = Annotated[BoxShape | CylinderShape | EllipsoidShape | CapsuleShape | MeshShape, Field(discriminator="kind")]
Shapes = Annotated[tuple[Shape, ...], Field(max_length=MAX_SHAPES)]


class MeshData(FrozenModel):
    """A triangle mesh, visible from both sides; numbers are stored as differences, which compress well."""

    scale: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]  # the size in m of a step of `points`
    points: Coordinates  # x, y, z of the first point in steps, then the differences of each point from the one before
    # for each triangle its first corner minus the first corner of the triangle before (0 for the first triangle), then
    # the other two corners minus the first. Corners are indices of points, counter-clockwise seen from outside.
    triangles: Corners

    @classmethod
    def encoded(cls, points: IntArray, corners: IntArray, scale: float) -> MeshData:
        """Return the mesh of points (P, 3) in steps of `scale` m and corners (T, 3), indices of points."""
        first = corners[:, 0]
        turned = np.column_stack((np.diff(first, prepend=0), corners[:, 1] - first, corners[:, 2] - first))
        away = np.diff(points, axis=0, prepend=0)
        return cls(scale=scale, points=tuple(away.ravel().tolist()), triangles=tuple(turned.ravel().tolist()))

    def decoded(self) -> tuple[IntArray, IntArray]:
        """Return points (P, 3) in steps of `scale` m, and corners (T, 3)."""
        points = np.cumsum(np.array(self.points, dtype=np.int64).reshape(-1, 3), axis=0)
        turned = np.array(self.triangles, dtype=np.int64).reshape(-1, 3)
        first = np.cumsum(turned[:, 0])
        return points, np.column_stack((first, turned[:, 1] + first, turned[:, 2] + first))

    @cached_property
    def is_whole(self) -> bool:
        """True if points and triangles are complete and all corners exist."""
        if len(self.points) % 3 or len(self.triangles) % 3:
            return False
        points, corners = self.decoded()
        return int(corners.min()) >= 0 and int(corners.max()) < len(points)


MAX_LINKS: Final = 1_000
MAX_BODIES: Final = 5_000
MAX_MESHES: Final = 2_000
MAX_NOTES: Final = 8
MAX_TEXT_LENGTH: Final = 300
Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH)]


class JointMotion(FrozenModel):
    """The motion of a link on its parent: rotation (rad) or translation (m) by multiplier * column + offset."""

    type: Literal["revolute", "prismatic"]
    axis: Place  # the unit vector in the frame given by the `origin` of the link
    column: Index  # the index of the joint's column in `Frames.joints`
    multiplier: Number = 1.0
    offset: Number = 0.0


class LinkData(FrozenModel):
    """A link of the robot. The base is the first link, and parents come before their children."""

    name: Text
    parent: Index | None = None  # the index of the parent; null only for the base
    # the pose of the link in its parent before the joint moves it; unused for the base
    origin: PoseNumbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    joint: JointMotion | None = None  # the motion relative to the parent; null if it is fixed
    shapes: Shapes = ()  # the shapes in the frame of the link


class BodyData(FrozenModel):
    """A body of the world."""

    name: Text
    pose: PoseNumbers  # the initial pose in the world
    track: Index | None = None  # the index of its columns in `Frames.tracks`; null if it does not move
    # appears, disappears: the times in s between which it is there; null if it always exists
    appears: Length | None = None
    disappears: Length | None = None
    shapes: Shapes = ()


class PatchData(FrozenModel):
    """An area of the ground with its own friction: x and y of its centre and full sizes, in m."""

    x: Number
    y: Number
    size: tuple[Length, Length]
    friction: Number


class GroundData(FrozenModel):
    """The look of the plane z = 0; red, green and blue from 0 to 1."""

    color: Colour
    checker: Colour | None = None  # the colour of every other square; null without squares
    square: Annotated[float, Field(ge=0.01, le=1_000, allow_inf_nan=False)] = 1.0  # the side of a square in m


class SceneData(FrozenModel):
    """The links of the robot, the bodies of the world and the meshes."""

    robot: Text  # the name of the model
    links: Annotated[tuple[LinkData, ...], Field(min_length=1, max_length=MAX_LINKS)]
    bodies: Annotated[tuple[BodyData, ...], Field(max_length=MAX_BODIES)] = ()
    patches: Annotated[tuple[PatchData, ...], Field(max_length=50)] = ()
    meshes: Annotated[dict[Digest, MeshData], Field(max_length=MAX_MESHES)] = Field(default_factory=dict)
    ground: GroundData | None = None  # its look as the world states it; null if it does not
    # the differences between the drawing and the model, a sentence each
    notes: Annotated[tuple[Text, ...], Field(max_length=MAX_NOTES)] = ()


def scene_problems(scene: SceneData, joints: int, tracks: int) -> Iterator[str]:
    """Yield the inconsistencies of a scene with its numbers of joint columns and of tracks."""
    for number, link in enumerate(scene.links):
        if (link.parent is None) != (number == 0) or (link.parent or 0) >= max(1, number):
            yield "the first link must be the base, and each other link must have a parent before it"
        if link.joint is not None and link.joint.column >= joints:
            yield "a link moves by a joint column that does not exist"
    if any(body.track is not None and body.track >= tracks for body in scene.bodies):
        yield "a body refers to a track that does not exist"
    drawn = [owner.shapes for owner in scene.links] + [owner.shapes for owner in scene.bodies]
    shapes = (shape for several in drawn for shape in several)
    if any(isinstance(shape, MeshShape) and shape.mesh not in scene.meshes for shape in shapes):
        yield "a shape refers to a mesh that does not exist"
    if not all(mesh.is_whole for mesh in scene.meshes.values()):
        yield "a mesh has a triangle with a point that does not exist"


Angle = Annotated[float, Field(ge=0, le=4)]  # a difference between two headings in rad


class _Mark(FrozenModel):
    """A place that an expectation is about; `expectation` is its number, counted from 0, or null.

    Coordinates are in the world frame, or in the frame of `link`, with which the mark moves.
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
    tolerance: Length = 0.0  # the distance from it that is allowed, in m
    is_aside: bool = False  # True if a view need not show all of it


class ArrowMark(_Mark):
    """A position and heading on the ground plane, in m and rad about the z axis; `tolerance` in rad to both sides."""

    kind: Literal["arrow"]
    x: Number
    y: Number
    yaw: Number
    tolerance: Angle = 0.0


MarkData = Annotated[CircleMark | PolygonMark | PolylineMark | ArrowMark, Field(discriminator="kind")]
MAX_MARKS: Final = 500
