"""The drawings of a run as SVG: path of the robot from above with bodies and goals, and the path alone, very small."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from itertools import groupby, islice
from typing import TYPE_CHECKING, Final

import numpy as np

from sim_action.core.geometry import ZERO, Pose, compose, convex_hull, rotate, scale
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass
from sim_action.recording.replay import scene_data
from sim_action.recording.replay.replay_data import Replay
from sim_action.reports.html.document import Html, element
from sim_action.results.outcome import DisplayStatus, ExpectationOutcome, Outcome

if TYPE_CHECKING:
    from sim_action.recording.replay.sightings import SightingData

_MAX_POINTS: Final = 120
_MAX_SOLIDS: Final = 200
_ARROW_M: Final = 0.3
# A body that moves by more is in view where it is nearer to the way of the robot than so many lengths of this way.
_MOVED_M: Final = 0.05
_NEAR: Final = 3
_MIN_MARGIN_M: Final = 0.35  # the margin in m around everything that is drawn


class SceneOutlines:
    """The outlines that do not depend on the motion: variations with the same scene and start share them."""

    def __init__(self) -> None:
        """Start without a scene."""
        self._scene: scene_data.SceneData | None = None
        self._start: _Posture | None = None
        self._bodies: list[FloatArray] = []
        self._robot: list[FloatArray] = []

    def bodies(self, scene: scene_data.SceneData) -> list[FloatArray]:
        """Return the outline (N, 2) in m of each shape of the bodies at their initial poses."""
        if scene is not self._scene:
            owners = [(shape, body.pose) for body in scene.bodies for shape in body.shapes]
            self._bodies = [outline(shape, pose_of(pose), scene.meshes) for shape, pose in owners]
            self._scene, self._start = scene, None
        return self._bodies

    def robot(self, scene: scene_data.SceneData, start: _Posture) -> list[FloatArray]:
        """Return the outline (N, 2) in m of each shape of the robot at the start."""
        self.bodies(scene)
        if start != self._start:
            self._start, self._robot = start, _outlines(scene, start)
        return self._robot


def drawing(replay: Replay, outcome: Outcome, outlines: SceneOutlines | None = None) -> Html:
    """Return an SVG with 1 unit per metre and y up; the style sheet gives its size on the page.

    `outlines`: the outlines of earlier drawings.
    """
    outlines = outlines or SceneOutlines()
    # (N, 2) positions of the base in m, evenly sampled, with the first and the last one.
    count = replay.frames.count
    places = np.column_stack([column.decoded(count) for column in replay.frames.base[:2]])
    rows = np.linspace(0, count - 1, min(count, _MAX_POINTS)).astype(int)
    way = np.asarray(places[rows])
    first, last = _postures(replay, 0, replay.frames.count - 1)
    start = outlines.robot(replay.scene, first)
    end = _outlines(replay.scene, last)
    marks = _marks_in_world(replay)
    x, y, width, height = _view(np.concatenate([way, *start, *end, *_mark_points(marks), *_passages(replay, way)]))
    box = (x, y, x + width, y + height)
    failed = frozenset(number for number, expected in enumerate(outcome.expectations) if _missed(expected))
    return element(
        "svg",
        element("title", f"The path of the robot from above, {width:.2g} m wide"),
        *(_polygon(corners, "body") for corners in islice(_in_view(outlines.bodies(replay.scene), box), _MAX_SOLIDS)),
        *(part for mark in marks for part in _mark(mark, failed)),
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


def _passages(replay: Replay, way: FloatArray) -> Iterator[FloatArray]:
    """Yield the places (N, 2) of each body that moves, as far as it comes near the way of the robot.

    The views of the player are framed in the same way, see `passages` in player/motion.js.
    """
    count = replay.frames.count
    rows = np.linspace(0, count - 1, min(count, _MAX_POINTS)).astype(int)
    time = replay.frames.time.decoded(count)[rows]
    low, high = way.min(axis=0), way.max(axis=0)
    reach = _NEAR * max(_LEAST_EXTENT_M, float(np.linalg.norm(high - low)))
    for body in replay.scene.bodies:
        if body.track is None:
            continue
        places = np.column_stack([column.decoded(count)[rows] for column in replay.frames.tracks[body.track][:2]])
        present = (time >= (body.appears or -math.inf)) & (time < (body.disappears or math.inf))
        if present.any() and np.ptp(places[present], axis=0).max() > _MOVED_M:
            yield places[present & ((places > low - reach) & (places < high + reach)).all(axis=1)]


def _view(points: FloatArray) -> tuple[float, float, float, float]:
    """Return left edge, lower edge, width and height of the view in m; it is at most three times as wide as high."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(_MIN_MARGIN_M, 0.1 * float((high - low).max()))
    middle, size = (low + high) / 2, high - low + 2 * margin
    width, height = max(size[0], size[1] / 1.2), max(size[1], size[0] / 3)
    return float(middle[0] - width / 2), float(middle[1] - height / 2), float(width), float(height)


def _in_view(bodies: Iterable[FloatArray], box: tuple[float, float, float, float]) -> Iterator[FloatArray]:
    """Yield the outlines (N, 2) of bodies in the view."""
    for corners in bodies:
        low, high = corners.min(axis=0), corners.max(axis=0)
        if low[0] < box[2] and high[0] > box[0] and low[1] < box[3] and high[1] > box[1]:
            yield corners


def _marks_in_world(replay: Replay) -> list[scene_data.MarkData]:
    """Return the marks in the world frame; marks that move with a link are drawn where they are at the end."""
    if all(mark.link is None for mark in replay.marks):
        return list(replay.marks)
    frames = _link_frames(replay.scene, _postures(replay, replay.frames.count - 1)[0])
    return [mark if mark.link is None else _in_world(mark, frames[mark.link]) for mark in replay.marks]


def _in_world(mark: scene_data.MarkData, frame: Pose) -> scene_data.MarkData:
    match mark:
        case scene_data.CircleMark():
            ((x, y, z),) = _placed(np.array([(mark.x, mark.y, mark.z)]), frame).tolist()
            return mark.model_copy(update={"x": x, "y": y, "z": z})
        case scene_data.ArrowMark():
            ahead = (mark.x + math.cos(mark.yaw), mark.y + math.sin(mark.yaw), 0.0)
            (x, y, _), (tip_x, tip_y, _) = _placed(np.array([(mark.x, mark.y, 0.0), ahead]), frame).tolist()
            return mark.model_copy(update={"x": x, "y": y, "yaw": math.atan2(tip_y - y, tip_x - x)})
        case scene_data.PolygonMark():
            corners = _placed(np.array([(x, y, 0.0) for x, y in mark.points]), frame)
            return mark.model_copy(update={"points": tuple(map(tuple, corners[:, :2].tolist()))})
        case scene_data.PolylineMark():
            return mark.model_copy(update={"points": tuple(map(tuple, _placed(np.array(mark.points), frame).tolist()))})


def _mark_points(marks: Sequence[scene_data.MarkData]) -> Iterator[FloatArray]:
    for mark in marks:
        match mark:
            case scene_data.CircleMark():
                yield np.array([(mark.x + dx, mark.y + dy) for dx in (-mark.radius, mark.radius) for dy in (-0.1, 0.1)])
            case scene_data.ArrowMark():
                yield np.array([(mark.x, mark.y)])
            case scene_data.PolylineMark() if mark.is_aside:
                continue
            case scene_data.PolylineMark() | scene_data.PolygonMark():
                yield np.array([point[:2] for point in mark.points])


def _mark(mark: scene_data.MarkData, failed: frozenset[int]) -> Iterator[Html]:
    kind = "goal missed" if mark.expectation in failed else "goal"
    match mark:
        case scene_data.CircleMark():
            yield element("circle", class_=kind, cx=_number(mark.x), cy=_number(-mark.y), r=_number(mark.radius))
        case scene_data.PolygonMark():
            yield _polygon(np.array(mark.points), kind)
        case scene_data.PolylineMark():
            points = np.array(mark.points)[:, :2]
            if mark.tolerance:
                band = kind.replace("goal", "band")
                yield element("polyline", class_=band, points=_points(points), stroke_width=_number(2 * mark.tolerance))
            yield _line(points, f"{kind} path")
        case scene_data.ArrowMark():
            if mark.tolerance:
                angles = mark.yaw + np.linspace(-mark.tolerance, mark.tolerance, _ROUND)
                yield _polygon(np.vstack([(mark.x, mark.y), *map(partial(_towards, mark), angles)]), kind)
            yield _line(np.array([(mark.x, mark.y), _towards(mark, mark.yaw)]), f"{kind} path")


def _towards(mark: scene_data.ArrowMark, angle: float) -> tuple[float, float]:
    return mark.x + _ARROW_M * math.cos(angle), mark.y + _ARROW_M * math.sin(angle)


def _touch(position: tuple[float, float, float]) -> Html:
    return element("circle", class_="touch", cx=_number(position[0]), cy=_number(-position[1]), r="0.02")


def _polygon(corners: FloatArray, kind: str) -> Html:
    return element("polygon", class_=kind, points=_points(corners))


def _line(points: FloatArray, kind: str) -> Html:
    return element("polyline", class_=kind, points=_points(points))


def _points(points: FloatArray) -> str:
    # Whole millimetres. Adding 0 turns a negative zero into 0.
    rounded = (np.rint(points * (1000.0, -1000.0)) / 1000.0 + 0.0).tolist()
    return " ".join([f"{x:.10g},{y:.10g}" for x, y in rounded])


def _number(value: float) -> str:
    return ("%.3f" % (value + 0.0)).rstrip("0").rstrip(".")


_ROUND: Final = 16
# The product with 1e4 has an error, so it does not decide the rounding of numbers that are so close to the middle.
_TIE: Final = 1e-3
_MAX_MESH_POINTS: Final = 500


def pose_of(numbers: Iterable[float]) -> Pose:
    """Return the pose of x, y, z in m and a quaternion x, y, z, w, which need not have unit length."""
    px, py, pz, *quaternion = numbers
    length = math.hypot(*quaternion) or 1.0
    x, y, z, w = (number / length for number in quaternion)
    return Pose((px, py, pz), (x, y, z, w))


def _placed(points: FloatArray, pose: Pose) -> FloatArray:
    """Return points (N, 3) in the frame of a pose as points of its parent frame."""
    x, y, z = points.T  # The coordinates of all points are rotated at once.
    return np.transpose(rotate(pose.orientation_xyzw, (x, y, z))) + pose.position_xyz


_Posture = tuple[tuple[float, ...], tuple[float, ...]]  # the pose of the base as numbers, and the positions of joints


def _postures(replay: Replay, *moments: int) -> list[_Posture]:
    """Return the posture of the robot at each of some moments."""
    count, rows = replay.frames.count, list(moments)
    base = [column.decoded(count)[rows].tolist() for column in replay.frames.base]
    joints = [column.decoded(count)[rows].tolist() for column in replay.frames.joints]
    return [
        (tuple(column[index] for column in base), tuple(column[index] for column in joints))
        for index in range(len(rows))
    ]


def outline(shape: scene_data.Shape, owner: Pose, meshes: dict[str, scene_data.MeshData]) -> FloatArray:
    """Return the convex outline (N, 2) of a shape, seen from above; `owner` is the frame of its link or body."""
    return _hull(_rounded(_seen(shape, owner, meshes)).tolist())


def _seen(shape: scene_data.Shape, owner: Pose, meshes: dict[str, scene_data.MeshData]) -> FloatArray:
    """Return the points (N, 2) of a shape, seen from above."""
    frame = compose(owner, _fixed_pose(shape.pose))
    if (balls := _balls(shape)) is not None:
        centres, radius = balls
        # A ball is a circle from all sides.
        rings = _placed(centres, frame)[:, None, :2] + _ring(radius, 0.0)[:, :2]
        return np.asarray(rings.reshape(-1, 2))
    points = _mesh_points(meshes[shape.mesh]) if isinstance(shape, scene_data.MeshShape) else _solid_points(shape)
    return _placed(points, frame)[:, :2]


def _balls(shape: scene_data.Shape) -> tuple[FloatArray, float] | None:
    """Return the centres (N, 3) and the radius of the balls whose hull a shape is; None if it is another shape."""
    match shape:
        case scene_data.EllipsoidShape() if len(set(shape.half)) == 1:
            return np.zeros((1, 3)), shape.half[0]
        case scene_data.CapsuleShape():
            half = shape.length / 2
            return np.array([(0.0, 0.0, -half), (0.0, 0.0, half)]), shape.radius
    return None


def _outlines(scene: scene_data.SceneData, posture: _Posture) -> list[FloatArray]:
    links = zip(scene.links, _link_frames(scene, posture), strict=True)
    seen = [_seen(shape, frame, scene.meshes) for link, frame in links for shape in link.shapes]
    # Arrays of few points take long for each call.
    rows = iter(_rounded(np.concatenate(seen)).tolist() if seen else [])
    return [_hull(islice(rows, len(points))) for points in seen]


def _link_frames(scene: scene_data.SceneData, posture: _Posture) -> list[Pose]:
    """Return the frame of each link."""
    base, joints = posture
    frames = [pose_of(base)]
    for link in scene.links[1:]:
        assert link.parent is not None
        own = _fixed_pose(link.origin)
        if link.joint is not None:
            own = compose(own, _motion(link.joint, joints[link.joint.column]))
        frames.append(compose(frames[link.parent], own))
    return frames


@lru_cache(maxsize=4096)
def _fixed_pose(pose: scene_data.PoseNumbers) -> Pose:
    return pose_of(pose)


def _motion(joint: scene_data.JointMotion, value: float) -> Pose:
    moved = joint.multiplier * value + joint.offset
    if joint.type == "prismatic":
        return Pose(scale(joint.axis, moved))
    return pose_of((*ZERO, *scale(joint.axis, math.sin(moved / 2)), math.cos(moved / 2)))


@lru_cache(maxsize=1024)
def _solid_points(shape: scene_data.BoxShape | scene_data.CylinderShape | scene_data.EllipsoidShape) -> FloatArray:
    """Return points (N, 3) in the frame of the shape; their hull approximates the shape."""
    match shape:
        case scene_data.BoxShape():
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            return np.asarray(signs * np.array(shape.size) / 2)
        case scene_data.EllipsoidShape():
            return np.asarray(_ball() * np.array(shape.half))
        case scene_data.CylinderShape():
            return np.concatenate([_ring(shape.radius, end * shape.length / 2) for end in (-1, 1)])


@lru_cache(maxsize=64)
def _mesh_points(mesh: scene_data.MeshData) -> FloatArray:
    points = np.asarray(mesh.decoded()[0] * mesh.scale, dtype=np.float64)
    return points[:: max(1, len(points) // _MAX_MESH_POINTS)]


@lru_cache(maxsize=256)
def _ring(radius: float, height: float) -> FloatArray:
    angles = np.linspace(0, 2 * math.pi, _ROUND, endpoint=False)
    return np.column_stack((radius * np.cos(angles), radius * np.sin(angles), np.full(_ROUND, height)))


def _ball() -> FloatArray:
    heights = np.linspace(-1, 1, 7)
    return np.concatenate([_ring(math.sqrt(1 - height**2), height) for height in heights])


def _hull(points: Iterable[Sequence[float]]) -> FloatArray:
    """Return the corners (N, 2) of the convex hull of points, counter-clockwise."""
    ordered = sorted({(x, y) for x, y in points})
    return np.array(ordered if len(ordered) < 3 else convex_hull(ordered))


def _rounded(points: FloatArray) -> FloatArray:
    """Return points rounded to 4 decimals exactly as `round` does."""
    scaled = points * 1e4
    whole = np.rint(scaled)
    rounded = np.asarray(whole / 1e4)
    ties = np.abs(scaled - whole) > 0.5 - _TIE
    if ties.any():
        rounded[ties] = [round(value, 4) for value in points[ties].tolist()]
    return rounded


_MAX_SMALL_POINTS: Final = 40
_SMALL_WIDTH: Final = 640
_SMALL_HEIGHT: Final = 400
_SMALL_EDGE: Final = 50
_LEAST_EXTENT_M: Final = 0.5  # a robot that moves less is not magnified further


@dataclass(frozen=True, slots=True)
class RunLook:
    """The parts of a replay that the page of all scenarios shows."""

    path: Html  # the picture of the path
    seen: Mapping[str, SightingData]  # name of a body -> its first sighting, for the bodies that the robot met


def small_path(replay: Replay, status: DisplayStatus) -> Html:
    """Return an SVG of the path from above, as large as it fits: y is up, the start is a circle, the end a dot."""
    count = replay.frames.count
    last, parts = count - 1, max(1, min(count, _MAX_SMALL_POINTS) - 1)
    rows = [number * last // parts for number in range(parts + 1)]
    # For so few numbers, arrays take longer than lists.
    xs, ys = (column.decoded(count)[rows].tolist() for column in replay.frames.base[:2])
    left, right, low, high = min(xs), max(xs), min(ys), max(ys)
    width, height = max(right - left, _LEAST_EXTENT_M), max(high - low, _LEAST_EXTENT_M)
    scale = min((_SMALL_WIDTH - 2 * _SMALL_EDGE) / width, (_SMALL_HEIGHT - 2 * _SMALL_EDGE) / height)
    x0, y0 = _SMALL_WIDTH / 2 - scale * (left + right) / 2, _SMALL_HEIGHT / 2 + scale * (low + high) / 2
    drawn = [(round(x0 + scale * x), round(y0 - scale * y)) for x, y in zip(xs, ys, strict=True)]
    points = [f"{x},{y}" for (x, y), _ in groupby(drawn)]
    return element(
        "svg",
        element("polyline", points=" ".join(points)) if len(points) > 1 else "",
        _dot(drawn[0], "start"),
        _dot(drawn[-1], "end"),
        class_=f"small-path {status}",
        viewBox=f"0 0 {_SMALL_WIDTH} {_SMALL_HEIGHT}",
        aria_hidden="true",
    )


def _dot(place: tuple[int, int], kind: str) -> Html:
    return element("circle", cx=place[0], cy=place[1], r=30, class_=kind)
