"""/world: the bodies around the robot, each in a frame of its own, told once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from sim_action.meshes.convex_hull import hull_faces
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.cdr import CdrForm
from sim_action.recording.export.ros2.frames import Frames
from sim_action.recording.export.ros2.marker import Marker
from sim_action.recording.export.ros2.topics import Topic, nanoseconds, stamps
from sim_action.sensors.rendering.colours import PALETTE
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

_NO_POINTS: Final = np.empty((0, 3))


def world_markers(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """One message with a marker for each part of each body; no topic of an empty world."""
    time = run.trace.time[:1]
    markers = list(_markers(run, frames))
    form, columns = CdrForm().fixed("<u4", len(markers)), list[FloatArray]()
    for marker, points in markers:
        marker.add_to(form)
        columns += [stamps(time).astype(np.float64), *([points[None]] if len(points) else [])]
    if markers:
        yield Topic("/world", "visualization_msgs/MarkerArray", nanoseconds(time), form.filled(1, *columns))


def _markers(run: RecordedRun, frames: Frames) -> Iterator[tuple[Marker, FloatArray]]:
    """Markers, and the points of each, (3 T, 3) for T triangles."""
    for place, body in enumerate(run.scene.world.objects):
        colour = body.color or PALETTE[place % len(PALETTE)]
        for number, part in enumerate(run.scene.parts_of(body)):
            yield _marker(part, Marker("triangle list", frames.bodies[body.name], body.name, number, colour=colour))


def _marker(part: Part, blank: Marker) -> tuple[Marker, FloatArray]:
    if isinstance(part, BoxPart):
        return replace(blank, kind="cube", pose=part.pose, scale=part.size_xyz), _NO_POINTS
    if isinstance(part, CylinderPart):
        across = 2 * part.radius
        return replace(blank, kind="cylinder", scale=(across, across, part.height)), _NO_POINTS
    if isinstance(part, SpherePart):
        return replace(blank, kind="sphere", scale=(2 * part.radius,) * 3), _NO_POINTS
    points = _corners(part)
    return replace(blank, points=len(points)), points


def _corners(part: HullPart | GridPart | SurfacePart) -> FloatArray:
    """(3 T, 3) three corners for each triangle."""
    if isinstance(part, HullPart):
        points = np.array(part.points_xyz)
        faces = hull_faces(points - points.mean(axis=0))
        return _NO_POINTS if faces is None else points[faces].reshape(-1, 3)
    surface = grid_surface(part) if isinstance(part, GridPart) else part
    return surface.points_xyz[surface.triangles].reshape(-1, 3)
