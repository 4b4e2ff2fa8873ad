"""The drawing of a run that needs no script: the way of the robot from above, what stands there, where it had to go."""

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
_LEAST_MARGIN: Final = 0.35
"""m around what has to be seen."""


def drawing(replay: Replay, outcome: Outcome) -> Html:
    """An SVG, a metre a unit, north up; its size on the page is the style sheet's."""
    way = _way(replay)
    start, end = robot_outlines(replay, 0), robot_outlines(replay, replay.frames.count - 1)
    x, y, width, height = _view(np.concatenate([way, *start, *end, *_mark_points(replay.marks)]))
    box = (x, y, x + width, y + height)
    failed = frozenset(number for number, expected in enumerate(outcome.expectations) if _missed(expected))
    return element(
        "svg",
        element("title", f"The way of the robot from above, {width:.2g} m wide"),
        *(_polygon(corners, "body") for corners in islice(_bodies(replay, box), _MAX_SOLIDS)),
        *(_mark(mark, failed) for mark in replay.marks),
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
    """(N, 2): some of the places that the base came by, its first and last among them."""
    count = replay.frames.count
    places = np.column_stack([column.decoded(count) for column in replay.frames.base[:2]])
    rows = np.linspace(0, count - 1, min(count, _MAX_POINTS)).astype(int)
    return np.asarray(places[rows])


def _view(points: FloatArray) -> tuple[float, float, float, float]:
    """Left, lower end, width and height in m of what is to be seen; no more than three times as wide as high."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(_LEAST_MARGIN, 0.1 * float((high - low).max()))
    middle, size = (low + high) / 2, high - low + 2 * margin
    width, height = max(size[0], size[1] / 1.2), max(size[1], size[0] / 3)
    return float(middle[0] - width / 2), float(middle[1] - height / 2), float(width), float(height)


def _bodies(replay: Replay, box: tuple[float, float, float, float]) -> Iterator[FloatArray]:
    """Outlines of what stands in the view, where it began."""
    for body in replay.scene.bodies:
        for shape in body.shapes:
            corners = outline(shape, Frame.of(body.pose), replay.scene.meshes)
            low, high = corners.min(axis=0), corners.max(axis=0)
            if low[0] < box[2] and high[0] > box[0] and low[1] < box[3] and high[1] > box[1]:
                yield corners


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
    """Where a frame is: rotation (3, 3) and position (3,) in m, seen from its parent or the world."""

    rotation: FloatArray
    position: FloatArray

    @classmethod
    def of(cls, numbers: Iterable[float]) -> Frame:
        """From x, y, z and a quaternion x, y, z, w, of whatever length."""
        px, py, pz, *quaternion = numbers
        x, y, z, w = np.array(quaternion) / (math.hypot(*quaternion) or 1.0)
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return cls(np.array(rows), np.array([px, py, pz]))

    def after(self, other: Frame) -> Frame:
        """This frame, given in the other one, as that one's parent sees it."""
        return Frame(other.rotation @ self.rotation, other.rotation @ self.position + other.position)

    def place(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) of this frame, as its parent sees them."""
        return points @ self.rotation.T + self.position


def robot_outlines(replay: Replay, moment: int) -> list[FloatArray]:
    """Of each shape of the robot at one of its moments: (N, 2) in m, world frame."""
    frames = _link_frames(replay, moment)
    solids = ((shape, frame) for link, frame in zip(replay.scene.links, frames, strict=True) for shape in link.shapes)
    return [outline(shape, frame, replay.scene.meshes) for shape, frame in solids]


def outline(shape: Shape, owner: Frame, meshes: dict[str, MeshData]) -> FloatArray:
    """Of one shape of what stands at `owner`: the corners of its hull, seen from above."""
    points = Frame.of(shape.pose).after(owner).place(_shape_points(shape, meshes))
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
    """Points (N, 3) in the frame of the shape, whose hull is near enough its own."""
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
    """Corners of the convex hull of points (N, 2), against the clock."""
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
