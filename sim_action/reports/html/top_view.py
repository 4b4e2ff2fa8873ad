"""The drawing of a run as SVG, shown without scripts: path of the robot from above, bodies of the world, goals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final

import numpy as np

from sim_action.recording.replay.replay_file import (
    ArrowMark,
    CircleMark,
    JointMotion,
    MarkData,
    PolygonMark,
    PolylineMark,
    Replay,
)
from sim_action.recording.replay.shapes import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    MeshData,
    MeshShape,
    Shape,
)
from sim_action.reports.html.document import Html, element
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.state.trace import FloatArray

_MAX_POINTS: Final = 120
_MAX_SOLIDS: Final = 200
_MIN_MARGIN_M: Final = 0.35
"""The margin in m around everything that is drawn."""


def drawing(replay: Replay, outcome: Outcome) -> Html:
    """Return an SVG with 1 unit per metre and y up; the style sheet gives its size on the page."""
    way = _way(replay)
    start, end = robot_outlines(replay, 0), robot_outlines(replay, replay.frames.count - 1)
    marks = _marks_in_world(replay)
    x, y, width, height = _view(np.concatenate([way, *start, *end, *_mark_points(marks)]))
    box = (x, y, x + width, y + height)
    failed = frozenset(number for number, expected in enumerate(outcome.expectations) if _missed(expected))
    return element(
        "svg",
        element("title", f"The path of the robot from above, {width:.2g} m wide"),
        *(_polygon(corners, "body") for corners in islice(_bodies(replay, box), _MAX_SOLIDS)),
        *(_mark(mark, failed) for mark in marks),
        *(_polygon(corners, "start") for corners in start),
        *(_polygon(corners, "robot") for corners in end),
        _line(way, "way"),
        *(_touch(contact.position) for contact in replay.contacts[:20]),
        class_="drawing",
        role="img",
        viewBox=f"{x:.3f} {-y - height:.3f} {width:.3f} {height:.3f}",
    )


def _missed(expected: ExpectationOutcome) -> bool:
    return expected.failed and not expected.verdict.cut_off


def _way(replay: Replay) -> FloatArray:
    """Return (N, 2) positions of the base in m, evenly sampled, with the first and the last one."""
    count = replay.frames.count
    places = np.column_stack([column.decoded(count) for column in replay.frames.base[:2]])
    rows = np.linspace(0, count - 1, min(count, _MAX_POINTS)).astype(int)
    return np.asarray(places[rows])


def _view(points: FloatArray) -> tuple[float, float, float, float]:
    """Return left edge, lower edge, width and height of the view in m; it is at most three times as wide as high."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(_MIN_MARGIN_M, 0.1 * float((high - low).max()))
    middle, size = (low + high) / 2, high - low + 2 * margin
    width, height = max(size[0], size[1] / 1.2), max(size[1], size[0] / 3)
    return float(middle[0] - width / 2), float(middle[1] - height / 2), float(width), float(height)


def _bodies(replay: Replay, box: tuple[float, float, float, float]) -> Iterator[FloatArray]:
    """Yield the outlines (N, 2) of the bodies in the view at their initial poses."""
    for body in replay.scene.bodies:
        for shape in body.shapes:
            corners = outline(shape, Frame.of(body.pose), replay.scene.meshes)
            low, high = corners.min(axis=0), corners.max(axis=0)
            if low[0] < box[2] and high[0] > box[0] and low[1] < box[3] and high[1] > box[1]:
                yield corners


def _marks_in_world(replay: Replay) -> list[MarkData]:
    """Return the marks in the world frame; those that move with a link are drawn where they are at the end."""
    if all(mark.link is None for mark in replay.marks):
        return list(replay.marks)
    frames = _link_frames(replay, replay.frames.count - 1)
    return [mark if mark.link is None else _in_world(mark, frames[mark.link]) for mark in replay.marks]


def _in_world(mark: MarkData, frame: Frame) -> MarkData:
    match mark:
        case CircleMark():
            ((x, y, z),) = frame.transform(np.array([(mark.x, mark.y, mark.z)])).tolist()
            return mark.model_copy(update={"x": x, "y": y, "z": z})
        case ArrowMark():
            ahead = (mark.x + math.cos(mark.yaw), mark.y + math.sin(mark.yaw), 0.0)
            (x, y, _), (tip_x, tip_y, _) = frame.transform(np.array([(mark.x, mark.y, 0.0), ahead])).tolist()
            return mark.model_copy(update={"x": x, "y": y, "yaw": math.atan2(tip_y - y, tip_x - x)})
        case PolygonMark():
            corners = frame.transform(np.array([(x, y, 0.0) for x, y in mark.points]))
            return mark.model_copy(update={"points": tuple(map(tuple, corners[:, :2].tolist()))})
        case PolylineMark():
            return mark.model_copy(
                update={"points": tuple(map(tuple, frame.transform(np.array(mark.points)).tolist()))}
            )


def _mark_points(marks: Sequence[MarkData]) -> Iterator[FloatArray]:
    for mark in marks:
        match mark:
            case CircleMark():
                yield np.array([(mark.x + dx, mark.y + dy) for dx in (-mark.radius, mark.radius) for dy in (-0.1, 0.1)])
            case ArrowMark():
                yield np.array([(mark.x, mark.y)])
            case PolylineMark() | PolygonMark():
                yield np.array([point[:2] for point in mark.points])


def _mark(mark: MarkData, failed: frozenset[int]) -> Html:
    kind = "goal missed" if mark.expectation in failed else "goal"
    match mark:
        case CircleMark():
            return element("circle", class_=kind, cx=_number(mark.x), cy=_number(-mark.y), r=_number(mark.radius))
        case PolygonMark():
            return _polygon(np.array(mark.points), kind)
        case PolylineMark():
            return _line(np.array(mark.points)[:, :2], f"{kind} path")
        case ArrowMark():
            tip = np.array([mark.x + 0.3 * np.cos(mark.yaw), mark.y + 0.3 * np.sin(mark.yaw)])
            return _line(np.array([(mark.x, mark.y), tip]), f"{kind} path")


def _touch(position: tuple[float, float, float]) -> Html:
    return element("circle", class_="touch", cx=_number(position[0]), cy=_number(-position[1]), r="0.02")


def _polygon(corners: FloatArray, kind: str) -> Html:
    return element("polygon", class_=kind, points=_points(corners))


def _line(points: FloatArray, kind: str) -> Html:
    return element("polyline", class_=kind, points=_points(points))


def _points(points: FloatArray) -> str:
    return " ".join(f"{_number(x)},{_number(-y)}" for x, y in points.tolist())


def _number(value: float) -> str:
    return f"{value + 0.0:.3f}".rstrip("0").rstrip(".")


_ROUND: Final = 16
_MAX_MESH_POINTS: Final = 500


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame: rotation (3, 3) and position (3,) in m, relative to its parent or the world."""

    rotation: FloatArray
    position: FloatArray

    @classmethod
    def of(cls, numbers: Iterable[float]) -> Frame:
        """Return the frame for x, y, z in m and a quaternion x, y, z, w, which need not have unit length."""
        px, py, pz, *quaternion = numbers
        x, y, z, w = np.array(quaternion) / (math.hypot(*quaternion) or 1.0)
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return cls(np.array(rows), np.array([px, py, pz]))

    def after(self, other: Frame) -> Frame:
        """Return this frame, given relative to `other`, relative to the parent of `other`."""
        return Frame(other.rotation @ self.rotation, other.rotation @ self.position + other.position)

    def transform(self, points: FloatArray) -> FloatArray:
        """Transform points (N, 3) from this frame to its parent."""
        return points @ self.rotation.T + self.position


def robot_outlines(replay: Replay, moment: int) -> list[FloatArray]:
    """Return the outline (N, 2) in m, world frame, of each shape of the robot at one moment."""
    frames = _link_frames(replay, moment)
    solids = ((shape, frame) for link, frame in zip(replay.scene.links, frames, strict=True) for shape in link.shapes)
    return [outline(shape, frame, replay.scene.meshes) for shape, frame in solids]


def outline(shape: Shape, owner: Frame, meshes: dict[str, MeshData]) -> FloatArray:
    """Return the convex outline (N, 2) of a shape, seen from above; `owner` is the frame of its link or body."""
    points = Frame.of(shape.pose).after(owner).transform(_shape_points(shape, meshes))
    return _hull(points[:, :2])


def _link_frames(replay: Replay, moment: int) -> list[Frame]:
    count = replay.frames.count
    joints = [float(column.decoded(count)[moment]) for column in replay.frames.joints]
    found = [Frame.of(float(column.decoded(count)[moment]) for column in replay.frames.base)]
    for link in replay.scene.links[1:]:
        assert link.parent is not None
        own = Frame.of(link.origin)
        if link.joint is not None:
            own = _motion(link.joint, joints[link.joint.column]).after(own)
        found.append(own.after(found[link.parent]))
    return found


def _motion(joint: JointMotion, value: float) -> Frame:
    moved = joint.multiplier * value + joint.offset
    axis = np.array(joint.axis)
    if joint.type == "prismatic":
        return Frame(np.eye(3), axis * moved)
    return Frame.of((0.0, 0.0, 0.0, *(axis * math.sin(moved / 2)), math.cos(moved / 2)))


def _shape_points(shape: Shape, meshes: dict[str, MeshData]) -> FloatArray:
    """Return points (N, 3) in the frame of the shape; their hull approximates the shape."""
    match shape:
        case BoxShape():
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            return np.asarray(signs * np.array(shape.size) / 2)
        case EllipsoidShape():
            return np.asarray(_ball() * np.array(shape.half))
        case CapsuleShape():
            caps = [_ball() * shape.radius + np.array([0, 0, end * shape.length / 2]) for end in (-1, 1)]
            return np.concatenate(caps)
        case CylinderShape():
            return np.concatenate([_ring(shape.radius, end * shape.length / 2) for end in (-1, 1)])
        case MeshShape():
            mesh = meshes[shape.mesh]
            points = np.asarray(mesh.decoded()[0] * mesh.scale, dtype=np.float64)
            return points[:: max(1, len(points) // _MAX_MESH_POINTS)]


def _ring(radius: float, height: float) -> FloatArray:
    angles = np.linspace(0, 2 * math.pi, _ROUND, endpoint=False)
    return np.column_stack((radius * np.cos(angles), radius * np.sin(angles), np.full(_ROUND, height)))


def _ball() -> FloatArray:
    heights = np.linspace(-1, 1, 7)
    return np.concatenate([_ring(math.sqrt(1 - height**2), height) for height in heights])


def _hull(points: FloatArray) -> FloatArray:
    """Return the corners of the convex hull of points (N, 2), counter-clockwise."""
    ordered = sorted({(round(float(x), 4), round(float(y), 4)) for x, y in points})
    if len(ordered) < 3:
        return np.array(ordered)
    return np.array(_half(ordered)[:-1] + _half(ordered[::-1])[:-1])


def _half(ordered: list[tuple[float, float]]) -> list[tuple[float, float]]:
    kept: list[tuple[float, float]] = []
    for x, y in ordered:
        while len(kept) > 1:
            (ax, ay), (bx, by) = kept[-2:]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                break
            kept.pop()
        kept.append((x, y))
    return kept
