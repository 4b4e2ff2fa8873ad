"""`follow_path: {path: [{x: 0, y: 0}, {x: 2, y: 0}], max_error: 10 cm}`: how closely the robot keeps to a path."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.reference_path import Point, ReferencePath, smoothed
from sim_action.core import units
from sim_action.core.field_types import FrozenModel, Metres, NamesFile, PositiveMetres
from sim_action.core.files import read_at_most
from sim_action.core.messages import did_you_mean, shown
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.verdict import Circle, Mark, Polyline
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation

_MOST_POINTS: Final = 10_000
_MOST_DRAWN: Final = 2_000
_MOST_BYTES: Final = 2_000_000
# In m: where floats no longer tell millimetres apart once they are squared.
_FURTHEST: Final = 1e6


class PathPoint(FrozenModel):
    """A point of a path, in the world frame."""

    x: Annotated[Metres, Field(ge=-_FURTHEST, le=_FURTHEST)]
    y: Annotated[Metres, Field(ge=-_FURTHEST, le=_FURTHEST)]


class PathEnd(FrozenModel):
    """The goal of a path."""

    tolerance: Annotated[PositiveMetres, Field(description="from the last point")] = 0.1


class FollowPath(Assertion):
    """The base keeps to a path, and comes to its end: the distance of its origin from the path on the ground.

    The path is in the world frame, wherever the robot begins: from point to point in straight lines, or with
    `smooth` in curves. The robot is held against the place of the path that it has come to, which only ever moves on
    along it: where a path crosses itself or leads back, the other branch does not count until its turn. Beyond the
    last point, it is the distance from there. `max_error` is an invariant; `rms`, the root mean square over all
    steps, is judged when the run is over; `end` is a goal, after which neither is looked at any more.
    """

    key: ClassVar[str] = "follow_path"

    path: Annotated[
        tuple[PathPoint, ...] | None,
        Field(min_length=2, max_length=_MOST_POINTS, description="points, in the order in which they are passed"),
    ] = None
    file: Annotated[
        str | None, NamesFile(), Field(min_length=1, description="a CSV file instead, with the columns x and y, in m")
    ] = None
    smooth: Annotated[bool, Field(description="curves through the points instead of straight lines")] = False
    max_error: Annotated[PositiveMetres | None, Field(description="an invariant: of the distance at any step")] = None
    rms: Annotated[PositiveMetres | None, Field(description="of the distances at all steps, judged at the end")] = None
    end: Annotated[PathEnd | None, Field(description="a goal: the last point must be reached, in order")] = None

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if (self.path is None) == (self.file is None):
            raise ValueError("give either 'path' or 'file'")
        if self.max_error is None and self.rms is None and self.end is None:
            raise ValueError("give 'max_error', 'rms', 'end' or several of them")
        if (twice := _twice([(point.x, point.y) for point in self.path or ()])) is not None:
            raise ValueError(f"point {twice + 1} of the path is the same as the one before; leave one of them out")
        return self

    @property
    def title(self) -> str:
        """See Assertion.title."""
        limits = (("max error", self.max_error), ("rms", self.rms))
        asked = [f"{name} {units.display(value, 'm')}" for name, value in limits if value is not None]
        if self.end is not None:
            asked.append(f"to its end within {units.display(self.end.tolerance, 'm')}")
        return f"follow_path {', '.join(asked)}"

    @property
    def reads_file(self) -> bool:
        """See Assertion.reads_file."""
        return self.file is not None

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """A file that is not there, or holds no path."""
        if self.file is None:
            return
        try:
            read_points(workspace.file(self.file))
        except PathError as error:
            yield ("file",), str(error)
        except (OSError, ValueError, csv.Error) as error:
            yield ("file",), f"{self.file}: {error}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.path_monitor import PathLimits, PathMonitor, Progress

        x, y, _ = start.pose.position_xyz
        path = ReferencePath(self._points(scene))
        limits = PathLimits(self.max_error, self.rms, None if self.end is None else self.end.tolerance)
        return PathMonitor(limits, Progress.at_start(path, (x, y)))

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks."""
        points = self._points(scene)
        coarse = points[: -1 : 1 + len(points) // _MOST_DRAWN]
        way = Polyline(tuple((x, y, 0.0) for x, y in (*coarse, points[-1])))
        return (way,) if self.end is None else (way, Circle(*points[-1], self.end.tolerance))

    def _points(self, scene: Scene) -> tuple[Point, ...]:
        points = [(point.x, point.y) for point in self.path or ()]
        points = read_points(scene.workspace.file(self.file)) if self.file is not None else points
        return tuple(smoothed(points) if self.smooth else points)


def read_points(path: Path) -> list[Point]:
    """The points of a CSV file. Raises OSError, ValueError and csv.Error with what is wrong with it."""
    if (data := read_at_most(path, _MOST_BYTES)) is None:
        raise ValueError(f"a path of more than {_MOST_BYTES // 1_000_000} MB is not read")
    points = list(_rows(data.decode("utf-8-sig").splitlines()))
    if not 2 <= len(points) <= _MOST_POINTS:
        raise ValueError(f"expected 2 to {_MOST_POINTS} points, found {len(points)}")
    if (twice := _twice(points)) is not None:
        raise ValueError(f"point {twice + 1} is the same as the one before; leave one of them out")
    return points


def _rows(lines: list[str]) -> Iterator[Point]:
    table = csv.DictReader(lines, skipinitialspace=True)
    columns = [name.strip() for name in table.fieldnames or ()]
    table.fieldnames = columns
    for name in ("x", "y"):
        if name not in columns:
            raise ValueError(f"its first line names no column '{name}'{did_you_mean(name, columns)}")
    for row in table:
        yield (_number(row["x"], table.line_num), _number(row["y"], table.line_num))


def _number(text: str | None, line: int) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not abs(value) <= _FURTHEST:
        raise ValueError(f"line {line}: expected a number of m, at most {_FURTHEST:g}, found {shown(text)}")
    return value


def _twice(points: list[Point]) -> int | None:
    """The first point that is the same as the one before."""
    pairs = enumerate(pairwise(points), start=1)
    return next((index for index, (before, point) in pairs if before == point), None)
