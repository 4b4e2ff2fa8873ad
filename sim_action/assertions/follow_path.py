"""`follow_path: {path: [{x: 0, y: 0}, {x: 2, y: 0}], max_error: 10 cm}`: the robot, or a link, follows a path."""

from __future__ import annotations

import csv
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Final, NamedTuple, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Reference
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.bounds import Goal, Invariant, joined
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.core import units
from sim_action.core.errors import FileProblem
from sim_action.core.field_types import FrozenModel, Metres, NamesFile, PositiveMetres
from sim_action.core.files import read_at_most
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import did_you_mean, shown
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Circle, Mark, Polyline, Signal, Verdict
from sim_action.world.claims import COVERED_SHARE, ClaimFinding, Findings, JudgedRun
from sim_action.world.robot_reach import LinkRange
from sim_action.world.scene import Scene

_MAX_POINTS: Final = 10_000
_MAX_DRAWN: Final = 2_000
_MAX_BYTES: Final = 2_000_000
_MAX_COORDINATE_M: Final = 1e6  # beyond this, squared floats cannot resolve millimetres


class PathPoint(FrozenModel):
    """A point of a path, on the ground plane of the frame, or in space."""

    x: Annotated[Metres, Field(ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M)]
    y: Annotated[Metres, Field(ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M)]
    z: Annotated[
        Metres | None,
        Field(
            ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M, description="for all points or for none; default: any height"
        ),
    ] = None

    @property
    def place(self) -> Point:
        """Two or three coordinates in m."""
        return (self.x, self.y) if self.z is None else (self.x, self.y, self.z)


class PathEnd(FrozenModel):
    """The goal at the end of a path."""

    tolerance: Annotated[PositiveMetres, Field(description="distance from the last point")] = 0.1


class FollowPath(MotionAssertion):
    """The base follows `path` on the ground: the distance from it never exceeds `max_error`, and its `end` is reached.

    The points are joined by straight lines, or with `smooth` by curves. If they have a `z`, the path is one in space.
    The error is the distance of the origin of the base link, or of `link`, from the path. The progress on the path
    never goes back, so where a path crosses itself, only the current branch counts. `max_error` is an invariant. `rms`,
    the root mean square over all steps, is judged at the end. `end` is a goal; once it is met, neither is checked
    further.
    """

    key: ClassVar[str] = "follow_path"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "`max_error`: invariant; `end`: goal; `rms`: judged at the end",
        "The distance exceeded `max_error` at no step, its `rms` is within the limit, and the `end` was reached.",
        "The distance exceeded `max_error` at a step, its `rms` is greater, or the `end` was not reached.",
    )
    subject_ends: ClassVar[str] = ": "

    path: Annotated[
        tuple[PathPoint, ...] | None,
        Field(min_length=2, max_length=_MAX_POINTS, description="points, in driving order"),
    ] = None
    file: Annotated[
        str | None,
        NamesFile(),
        Field(
            min_length=1, description="CSV file with the columns x and y in m, with 'link' also z, instead of 'path'"
        ),
    ] = None
    smooth: Annotated[bool, Field(description="curves through the points instead of straight lines")] = False
    max_error: Annotated[
        PositiveMetres | None, Field(description="an invariant: maximum distance from the path at any step")
    ] = None
    rms: Annotated[
        PositiveMetres | None, Field(description="maximum root mean square of the distance, judged at the end")
    ] = None
    end: Annotated[
        PathEnd | None, Field(description="a goal: the end of the path must be reached, after all of the path")
    ] = None

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if (self.path is None) == (self.file is None):
            raise ValueError("give either 'path' or 'file'")
        if self.max_error is None and self.rms is None and self.end is None:
            raise ValueError("give 'max_error', 'rms', 'end' or several of them")
        if len({point.z is None for point in self.path or ()}) > 1:
            raise ValueError("give 'z' for all points of the path, or for none of them")
        if (twice := _twice([point.place for point in self.path or ()])) is not None:
            raise ValueError(f"point {twice + 1} of the path equals the point before it; remove one of them")
        return self

    @property
    @override
    def is_over_time(self) -> bool:
        return self.max_error is not None

    @override
    def range_claims(self, limits: LinkRange) -> Findings:
        places = [dict(zip("xyz", point.place, strict=False)) for point in self.path or ()]
        if places and not self.smooth:
            most = max(map(limits.farthest, places))
            yield from limits.too_wide(most, "this path", {"max_error": self.max_error, "rms": self.rms})
        for index, place in enumerate(places):
            is_end = self.end is not None and index == len(places) - 1
            errors = (self.max_error, self.end.tolerance if self.end is not None and is_end else None)
            tolerance = min((error for error in errors if error is not None), default=math.inf)
            if findings := list(limits.out_of_reach(("path", index), place, tolerance)):
                yield findings[0]
                return

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return False

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield an error that is longer than the path, or that no run comes to, and a small share that was driven."""
        judged = run.verdict.judged
        if self.end is not None or run.verdict.status != "passed" or judged is None or judged.first is None:
            return
        watched = self.watched(run.scene)
        path = ReferencePath(self._points(run.scene))
        error = min(limit for limit in (self.max_error, self.rms) if limit is not None)
        if error >= path.length:
            message = f"an error of {units.display(error, 'm')} is allowed, and the path is {path.length:.4g} m long"
            yield ClaimFinding("limit-beyond-range", (), f"{message}; give a smaller limit, or a longer path")
        elif self.watches_base:
            yield from run.beyond_drive(error, "give a smaller limit")
        places = watched.seen(run.trace.between(judged.first, judged.last or 0.0)).base_position_xyz.tolist()
        if not places:
            return
        size = len(path.points[0])
        progress = Progress.at_start(path, tuple(places[0][:size]))
        for place in places:
            progress = progress.to(tuple(place[:size]))
        share = progress.foot.along / path.length
        if share < COVERED_SHARE:
            message = f"only {share:.0%} of the path was driven: {progress.foot.along:.4g} m of {path.length:.4g} m"
            yield ClaimFinding("partly-compared", (), f"{message}; run for longer, or add 'end'")

    @override
    def title_of(self, watched: Watched) -> str:
        limits = (("max error", self.max_error), ("rms", self.rms))
        asked = [f"{name} {units.display(value, 'm')}" for name, value in limits if value is not None]
        if self.end is not None:
            asked.append(f"to its end within {units.display(self.end.tolerance, 'm')}")
        return f"{self.key_of(watched)} {', '.join(asked)}"

    @property
    @override
    def reads_file(self) -> bool:
        return self.file is not None

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """Yield a missing file, and a file that holds no valid path."""
        if self.file is None:
            return
        try:
            read_points(workspace.file(self.file), in_space=self.link is not None)
        except PathError as error:
            yield ("file",), str(error)
        except FileProblem as error:
            yield ("file",), f"{self.file}: {error}"

    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        """See MotionAssertion.opened_on. Raises FileProblem."""
        path = ReferencePath(self._points(scene))
        place = start.pose.position_xyz[: len(path.points[0])]
        limits = PathLimits(self.max_error, self.rms, None if self.end is None else self.end.tolerance)
        return PathMonitor(limits, Progress.at_start(path, place))

    @override
    def marks_in(self, watched: Watched, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        points = self._points(scene)
        coarse = points[: -1 : 1 + len(points) // _MAX_DRAWN]
        corners = [(*point, 0.0) for point in (*coarse, points[-1])]
        way = Polyline(tuple((x, y, z) for x, y, z, *_ in corners), tolerance=self.max_error or 0.0)
        x, y, z, *_ = corners[-1]
        return (way,) if self.end is None else (way, Circle(x, y, self.end.tolerance, z))

    def _points(self, scene: Scene) -> tuple[Point, ...]:
        """Return the points of the path. Raises FileProblem."""
        points = [point.place for point in self.path or ()]
        if self.file is not None:
            try:
                points = read_points(scene.workspace.file(self.file), in_space=self.link is not None)
            except (PathError, FileProblem) as error:
                raise FileProblem(f"{self.file}: {error}") from None
        return tuple(smoothed(points) if self.smooth else points)


def read_points(path: Path, *, in_space: bool = False) -> list[Point]:
    """Return the points of a CSV file, with its column z if they are `in_space`. Raises FileProblem with the reason."""
    try:
        return _points_in(path, in_space)
    except OSError as error:
        raise FileProblem(f"cannot be read: {error.strerror}") from None
    except (ValueError, csv.Error) as error:
        raise FileProblem(str(error)) from None


def _points_in(path: Path, in_space: bool) -> list[Point]:
    if (data := read_at_most(path, _MAX_BYTES)) is None:
        raise ValueError(f"the file is larger than {_MAX_BYTES // 1_000_000} MB, the limit for a path")
    points = list(_rows(data.decode("utf-8-sig").splitlines(), in_space))
    if not 2 <= len(points) <= _MAX_POINTS:
        raise ValueError(f"expected 2 to {_MAX_POINTS} points, found {len(points)}")
    if (twice := _twice(points)) is not None:
        raise ValueError(f"point {twice + 1} equals the point before it; remove one of them")
    return points


def _rows(lines: list[str], in_space: bool) -> Iterator[Point]:
    table = csv.DictReader(lines, skipinitialspace=True)
    columns = [name.strip() for name in table.fieldnames or ()]
    table.fieldnames = columns
    for name in ("x", "y"):
        if name not in columns:
            raise ValueError(f"the first line has no column '{name}'{did_you_mean(name, columns)}")
    axes = ("x", "y", "z") if in_space and "z" in columns else ("x", "y")
    for row in table:
        yield tuple(_number(row[axis], table.line_num) for axis in axes)


def _number(text: str | None, line: int) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not abs(value) <= _MAX_COORDINATE_M:
        raise ValueError(f"line {line}: expected a number in m, at most {_MAX_COORDINATE_M:g}, found {shown(text)}")
    return value


def _twice(points: list[Point]) -> int | None:
    pairs = enumerate(pairwise(points), start=1)
    return next((index for index, (before, point) in pairs if before == point), None)


Point = tuple[float, ...]  # two coordinates on the ground plane, or three in space, in m
_PIECES: Final = 16  # segments of a curve between two points


class Foot(NamedTuple):
    """The projection of a point onto a path: its arc length and its distance, both in m."""

    along: float
    distance: float


@dataclass(frozen=True)
class ReferencePath:
    """A polyline whose segments all have a length greater than 0."""

    points: tuple[Point, ...]

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """Arc length of each point in m."""
        lengths = [0.0]
        for before, after in pairwise(self.points):
            lengths.append(lengths[-1] + math.dist(before, after))
        return tuple(lengths)

    @property
    def length(self) -> float:
        """Length of the whole path in m."""
        return self.lengths[-1]

    def foot(self, place: Point, begin: float, end: float) -> Foot:
        """Return the closest point of the path between two arc lengths in m; of several, the first."""
        best = Foot(begin, math.inf)
        piece = max(0, min(bisect_left(self.lengths, begin) - 1, len(self.points) - 2))
        while True:
            foot = self._foot_on(piece, place, begin, end)
            if foot.distance < best.distance:
                best = foot
            piece += 1
            if piece > len(self.points) - 2 or self.lengths[piece] > end:
                return best

    def _foot_on(self, piece: int, place: Point, begin: float, end: float) -> Foot:
        if len(place) == 3:
            return self._foot_in_space(piece, place, begin, end)
        (x, y), (end_x, end_y), start = self.points[piece], self.points[piece + 1], self.lengths[piece]
        length = self.lengths[piece + 1] - start
        ahead_x, ahead_y = (end_x - x) / length, (end_y - y) / length
        along = (place[0] - x) * ahead_x + (place[1] - y) * ahead_y
        along = min(max(along, begin - start, 0.0), end - start, length)
        distance = math.hypot(place[0] - x - along * ahead_x, place[1] - y - along * ahead_y)
        return Foot(start + along, distance)

    def _foot_in_space(self, piece: int, place: Point, begin: float, end: float) -> Foot:
        at, start = self.points[piece], self.lengths[piece]
        length = self.lengths[piece + 1] - start
        ahead = [(to - origin) / length for origin, to in zip(at, self.points[piece + 1], strict=True)]
        away = [to - origin for origin, to in zip(at, place, strict=True)]
        along = away[0] * ahead[0] + away[1] * ahead[1] + away[2] * ahead[2]
        along = min(max(along, begin - start, 0.0), end - start, length)
        return Foot(start + along, math.hypot(*(to - along * unit for to, unit in zip(away, ahead, strict=True))))


def smoothed(points: Sequence[Point]) -> list[Point]:
    """Return a polyline along a centripetal Catmull-Rom curve through the points.

    E. Catmull and R. Rom, A Class of Local Interpolating Splines, 1974. The parametrisation avoids loops and cusps: C.
    Yuksel, S. Schaefer and J. Keyser, Parameterization and Applications of Catmull-Rom Curves, 2011.
    """
    if len(points) < 3:
        return list(points)
    before, after = _mirrored(points[1], points[0]), _mirrored(points[-2], points[-1])
    around = [before, *points, after]
    curve = [points[0]]
    for index in range(len(points) - 1):
        four = around[index : index + 4]
        knots = [0.0]
        for one, other in pairwise(four):
            knots.append(knots[-1] + math.sqrt(math.dist(one, other)))
        times = (knots[1] + (knots[2] - knots[1]) * part / _PIECES for part in range(1, _PIECES))
        curve += [*(_at(time, four, knots) for time in times), four[2]]
    return curve


def _mirrored(point: Point, about: Point) -> Point:
    return tuple(2 * middle - at for middle, at in zip(about, point, strict=True))


def _at(time: float, points: Sequence[Point], knots: Sequence[float]) -> Point:
    """Return a point of the curve, by the pyramid of P. J. Barry and R. N. Goldman, 1988."""
    # The knots between which each of the three rows above the points interpolates.
    for spans in (((0, 1), (1, 2), (2, 3)), ((0, 2), (1, 3)), ((1, 2),)):
        shares = ((time - knots[first]) / (knots[last] - knots[first]) for first, last in spans)
        points = [
            tuple(begin + share * (end - begin) for begin, end in zip(*pair, strict=True))
            for pair, share in zip(pairwise(points), shares, strict=True)
        ]
    return points[0]


# Maximum progress per step, relative to motion plus error: enough for a corner that the robot cuts.
_MAX_PROGRESS_RATIO: Final = 2.0


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a robot along a path."""

    path: ReferencePath
    place: Point  # position of the robot in m
    foot: Foot  # projection of the position onto the path

    @classmethod
    def at_start(cls, path: ReferencePath, place: Point) -> Self:
        """Return the progress before the first step."""
        return cls(path, place, Foot(0.0, math.dist(place, path.points[0])))

    def to(self, place: Point) -> Self:
        """Return the progress after the robot moved to a position."""
        along, distance = self.foot
        ahead = _MAX_PROGRESS_RATIO * (distance + math.dist(place, self.place))
        return type(self)(self.path, place, self.path.foot(place, along, min(along + ahead, self.path.length)))

    @property
    def remaining(self) -> float:
        """Distance to the end of the path in m: along the path or straight, whichever is greater."""
        return max(self.path.length - self.foot.along, math.dist(self.place, self.path.points[-1]))


@dataclass(frozen=True, slots=True)
class PathLimits:
    """The limits in m; None: not required. `end` is the tolerance around the last point."""

    max_error: float | None = None
    rms: float | None = None
    end: float | None = None


@dataclass(frozen=True, slots=True)
class PathMonitor(Monitor):
    """The monitor of a robot along its path, up to the end of the path if `end` is required."""

    limits: PathLimits
    progress: Progress
    goal: Goal = Goal()
    worst: Invariant = Invariant()  # the fold of the greatest error; it occurred `worst_along` m along the path
    worst_along: float = 0.0
    squares: float = 0.0  # squares, moments: sum of the squared errors in m^2 and number of steps
    moments: int = 0
    end: float = 0.0  # sim time of the last step, in s

    @property
    @override
    def state(self) -> State:
        if self.limits.end is None:
            return self.worst.state
        # After the end is reached, no later step can lower the RMS.
        is_over = self.goal.state is State.HOLDS and self.limits.rms is not None and self.mean_error > self.limits.rms
        return joined(self.worst.state, State.BROKEN if is_over else self.goal.state)

    @property
    @override
    def is_decided(self) -> bool:
        return self.state is State.BROKEN or self.goal.state is State.HOLDS

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. The progress advances; errors do not count."""
        progress = self.progress
        for place in self._places(trace):
            progress = progress.to(place)
        return replace(self, progress=progress)

    @override
    def observe(self, trace: Trace) -> Self:
        if self.goal.state is State.HOLDS or not len(trace):
            return self
        way = self._way(trace)
        time, errors = trace.time[: len(way)], np.array([one.foot.distance for one in way])
        squares = self.squares
        for error in errors.tolist():
            squares += error * error
        later = replace(self, progress=way[-1], squares=squares, moments=self.moments + len(way), end=float(time[-1]))
        if self.limits.max_error is not None:
            later = later.with_worst(self.worst.observe(time, self.limits.max_error - errors), time, way)
        if self.limits.end is not None:
            remaining = np.array([one.remaining for one in way])
            later = replace(later, goal=self.goal.observe(time, self.limits.end - remaining))
        return later

    def with_worst(self, worst: Invariant, time: FloatArray, way: list[Progress]) -> Self:
        """Return the fold with a new greatest error."""
        if worst is self.worst:
            return self
        return replace(self, worst=worst, worst_along=way[int((time == worst.time).argmax())].foot.along)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. The curves end where the end of the path is reached."""
        way, limits = self._way(trace), self.limits
        time, errors = trace.time[: len(way)], np.array([one.foot.distance for one in way])
        curves = [Signal("distance from the path", "m", time, errors, upper=limits.max_error)]
        if limits.end is not None:
            remaining = np.array([one.remaining for one in way])
            curves.append(Signal("distance to the end of the path", "m", time, remaining, upper=limits.end))
        if limits.rms is not None:
            moments = self.moments + np.arange(1, len(way) + 1)
            means = np.sqrt((self.squares + np.cumsum(errors * errors)) / moments)
            curves.append(Signal("RMS distance from the path", "m", time, means, upper=limits.rms).at_end())
        return tuple(curves)

    def verdict(self) -> Verdict:
        """Return the verdict on a failed limit: `max_error`, `end`, `rms`; else on the first limit that is set."""
        limits = self.limits
        if not self.moments:
            return Verdict(
                False, None, limits.max_error or limits.rms or limits.end, None, "m", None, "no physics step to measure"
            )
        if limits.max_error is not None and self.worst.state is State.BROKEN:
            return self._of_error(limits.max_error)
        if limits.end is not None and self.goal.state is State.PENDING:
            return self._of_end(limits.end)
        if limits.rms is not None and (limits.max_error is None or self.mean_error > limits.rms):
            return self._of_mean(limits.rms)
        if limits.max_error is not None:
            return self._of_error(limits.max_error)
        return self._of_end(limits.end or 0.0)

    @property
    def mean_error(self) -> float:
        """The root mean square of the error so far, in m."""
        return math.sqrt(self.squares / self.moments)

    def _of_error(self, limit: float) -> Verdict:
        margin, time, passed = self.worst.margin, self.worst.time, self.worst.state is State.HOLDS
        assert margin is not None, "there were moments"
        error, allowed = units.display_apart(limit - margin, limit, "m")
        where = f"{error} off the path at {time:.2f} s, {units.display(self.worst_along, 'm')} along it"
        message = f"at most {where}, limit {allowed}" if passed else f"{where}, more than {allowed}"
        return Verdict(passed, limit - margin, limit, margin, "m", time, message)

    def _of_mean(self, limit: float) -> Verdict:
        passed = self.mean_error <= limit
        error, allowed = units.display_apart(self.mean_error, limit, "m")
        message = f"RMS distance from the path {error}, {'limit' if passed else 'more than'} {allowed}"
        return Verdict(passed, self.mean_error, limit, limit - self.mean_error, "m", self.end, message)

    def _of_end(self, limit: float) -> Verdict:
        margin, time, passed = self.goal.margin, self.goal.time, self.goal.state is State.HOLDS
        assert margin is not None, "there were moments"
        length = units.display(self.progress.path.length, "m")
        short, _ = units.display_apart(limit - margin, limit, "m")
        message = (
            f"reached the end of the path within {short} in {time:.2f} s"
            if passed
            else f"came no closer than {short} to the end of the path of {length}, measured along it, in "
            f"{self.end:.1f} s; closest at {time:.2f} s"
        )
        return Verdict(passed, limit - margin, limit, margin, "m", time, message)

    def _way(self, trace: Trace) -> list[Progress]:
        """Return the progress at each step, up to the step that reaches the end."""
        progress, way = self.progress, []
        end = -math.inf if self.limits.end is None else self.limits.end
        for place in self._places(trace):
            progress = progress.to(place)
            way.append(progress)
            if progress.remaining <= end:
                break
        return way

    def _places(self, trace: Trace) -> list[Point]:
        axes = len(self.progress.place)
        return [tuple(place) for place in trace.base_position_xyz[:, :axes].tolist()]
