"""Marker topics: /world with the bodies of the world, /contacts with the contact points of the robot."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Final, Literal

import numpy as np

from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.meshes.convex_hull import hull_faces
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.messages import CdrForm
from sim_action.recording.export.ros2.topics import Frames, Topic, nanoseconds, stamps
from sim_action.sensors.rendering import PALETTE
from sim_action.state.trace import FloatArray
from sim_action.world.parts import (
    BoxPart,
    CylinderPart,
    GridPart,
    HullPart,
    Part,
    SpherePart,
    SurfacePart,
    grid_surface,
)

Kind = Literal["cube", "sphere", "cylinder", "sphere list", "triangle list"]
_TYPES: Final[dict[Kind, int]] = {"cube": 1, "sphere": 2, "cylinder": 3, "sphere list": 7, "triangle list": 11}


@dataclass(frozen=True, slots=True)
class Marker:
    """The fixed fields of a visualization_msgs/Marker; its time stamp and its points are gaps.

    Attributes:
        group: the namespace, which identifies a marker together with `number`.
        scale: the size in m: diameters of a sphere; diameters and height of a cylinder.
        points: the number of points.
        lifetime: the lifetime in s; 0 means forever.
    """

    kind: Kind
    frame: str
    group: str
    number: int = 0
    pose: Pose = field(default_factory=Pose)
    scale: Vector3 = (1.0, 1.0, 1.0)
    colour: Vector3 = (0.8, 0.8, 0.8)
    points: int = 0
    lifetime: int = 0

    def add_to(self, form: CdrForm) -> None:
        """Append the marker to a message, with gaps for 2 numbers of the time and for 3 numbers of each point."""
        form.gap("<i4", 2).string(self.frame).string(self.group).fixed("<i4", self.number, _TYPES[self.kind], 0)
        form.fixed("<f8", *self.pose.position_xyz, *self.pose.orientation_xyzw, *self.scale)
        form.fixed("<f4", *self.colour, 1.0).fixed("<i4", self.lifetime, 0).fixed("u1", not self.lifetime)
        form.fixed("<u4", self.points).gap("<f8", 3 * self.points)
        self._add_what_is_empty(form)

    def _add_what_is_empty(self, form: CdrForm) -> None:
        form.fixed("<u4", 0)  # colors
        form.string("").fixed("<i4", 0, 0).string("").string("").fixed("<u4", 0, 0)  # texture, uv_coordinates
        form.string("").string("").string("").fixed("<u4", 0).fixed("u1", 0)  # text, mesh_resource, mesh_file


_NO_POINTS: Final = np.empty((0, 3))


def world_markers(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /world: one message with a marker for each part of each body; nothing for an empty world."""
    time = run.trace.time[:1]
    markers = list(_world_markers(run, frames))
    form, columns = CdrForm().fixed("<u4", len(markers)), list[FloatArray]()
    for marker, points in markers:
        marker.add_to(form)
        columns += [stamps(time).astype(np.float64), *([points[None]] if len(points) else [])]
    if markers:
        yield Topic("/world", "visualization_msgs/MarkerArray", nanoseconds(time), form.filled(1, *columns))


def _world_markers(run: RecordedRun, frames: Frames) -> Iterator[tuple[Marker, FloatArray]]:
    """Yield markers and their points, (3 T, 3) for T triangles."""
    for place, body in enumerate(run.scene.world.objects):
        colour = body.color or PALETTE[place % len(PALETTE)]
        for number, part in enumerate(run.scene.parts_of(body)):
            yield _part_marker(
                part, Marker("triangle list", frames.bodies[body.name], body.name, number, colour=colour)
            )


def _part_marker(part: Part, blank: Marker) -> tuple[Marker, FloatArray]:
    if isinstance(part, BoxPart):
        return replace(blank, kind="cube", pose=part.pose, scale=part.size_xyz), _NO_POINTS
    if isinstance(part, CylinderPart):
        across = 2 * part.radius
        return replace(blank, kind="cylinder", pose=part.pose, scale=(across, across, part.height)), _NO_POINTS
    if isinstance(part, SpherePart):
        return replace(blank, kind="sphere", pose=part.pose, scale=(2 * part.radius,) * 3), _NO_POINTS
    points = _triangle_corners(part)
    return replace(blank, points=len(points)), points


def _triangle_corners(part: HullPart | GridPart | SurfacePart) -> FloatArray:
    """Return (3 T, 3) the corners of T triangles."""
    if isinstance(part, HullPart):
        points = np.array(part.points_xyz)
        faces = hull_faces(points - points.mean(axis=0))
        return _NO_POINTS if faces is None else points[faces].reshape(-1, 3)
    surface = grid_surface(part) if isinstance(part, GridPart) else part
    return surface.points_xyz[surface.triangles].reshape(-1, 3)


_CONTACT_SIZE: Final = (0.04, 0.04, 0.04)
_CONTACT_COLOUR: Final = (0.9, 0.1, 0.1)
_CONTACT_LIFETIME_S: Final = 1

ContactPoints = dict[tuple[str, str], list[Vector3]]
"""Link and body -> their contact points in m, world frame."""

ContactKey = tuple[tuple[str, str, int], ...]
"""Link, body and number of contact points, for each pair; messages with the same key have the same size."""


def contacts(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /contacts: a message for each moment with contacts since the moment before; nothing without contacts."""
    alike = defaultdict[ContactKey, list[tuple[int, ContactPoints]]](list)
    for moment, points in _by_moment(run):
        shape = tuple((*pair, len(points[pair])) for pair in sorted(points))
        alike[shape].append((moment, points))
    times, messages = list[int](), list[bytes]()
    for shape, some in alike.items():
        time = run.trace.time[[moment for moment, _ in some]]
        times += nanoseconds(time).tolist()
        columns = [column for *pair, _ in shape for column in _contact_columns((pair[0], pair[1]), time, some)]
        messages += _contacts_form(shape, frames).filled(len(some), *columns)
    if messages:
        yield Topic("/contacts", "visualization_msgs/MarkerArray", np.array(times, dtype=np.int64), messages)


def _contact_columns(
    pair: tuple[str, str], time: np.ndarray, some: list[tuple[int, ContactPoints]]
) -> Iterator[np.ndarray]:
    yield stamps(time)
    yield np.array([points[pair] for _, points in some])


def _contacts_form(shape: ContactKey, frames: Frames) -> CdrForm:
    form = CdrForm().fixed("<u4", len(shape))
    for link, body, count in shape:
        group = f"{link} / {body}"
        Marker(
            "sphere list",
            frames.map,
            group,
            0,
            scale=_CONTACT_SIZE,
            colour=_CONTACT_COLOUR,
            points=count,
            lifetime=_CONTACT_LIFETIME_S,
        ).add_to(form)
    return form


def _by_moment(run: RecordedRun) -> Iterator[tuple[int, ContactPoints]]:
    """Yield moments, and the latest contact points of each pair since the moment before."""
    touches, time = run.trace.contacts, run.trace.time
    moments = np.searchsorted(time, np.array([touch.time for touch in touches]) - TIME_EPSILON_S).clip(
        max=len(time) - 1
    )
    found = defaultdict[int, dict[tuple[str, str], tuple[float, list[Vector3]]]](dict)
    for moment, touch in zip(moments.tolist(), touches, strict=True):
        pairs, pair = found[moment], (touch.link, touch.body)
        if pair not in pairs or pairs[pair][0] < touch.time:
            pairs[pair] = (touch.time, [])
        pairs[pair][1].append(touch.position_xyz)
    return ((moment, {pair: points for pair, (_, points) in pairs.items()}) for moment, pairs in found.items())
