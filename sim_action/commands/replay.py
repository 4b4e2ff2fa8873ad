"""Replay the commands of a recorded log: `replay: logs/monday.csv`, or `replay: monday.bag` with its `topic:`.

Logs of ROS are read only in the scenario's own process. CSV is read when the scenario is validated: a header, then one
row per command, with `time` in s, and a twist or joint targets.

    time,linear,angular
    0.0,0.2,0
    1.5,0.2,0.5

The input is not trusted: its size is bounded, and it contains only numbers and names.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from decimal import Decimal
from importlib.util import find_spec
from io import TextIOWrapper
from pathlib import Path, PurePath
from typing import Annotated, Final

from pydantic import Field
from typing_extensions import override

from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.commands.controller_answers import Saturation
from sim_action.commands.logs import KINDS, JointColumn, TimedCommand, rosbag, row_targets, used_columns
from sim_action.commands.logs.rosbag import TWISTS, MessageType
from sim_action.core.errors import Location, RecordingError
from sim_action.core.field_types import NamesFile, NonNegativeSeconds, PositiveSeconds
from sim_action.core.files import open_regular
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean, escaped_line, shown
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import Command, JointTargets
from sim_action.world.scene import Scene

_CSV: Final = ".csv"

_ROUNDING: Final = 1e-9
"""In s: a command at the time of a tick belongs to that tick, also if the times differ by rounding."""


class ReplayCommands(CommandSource):
    """Repeats the commands of a recorded log at their original times.

    The log is a CSV file, or a log of ROS: rosbag1 (`.bag`), rosbag2 (its folder, or a single `.db3` or `.mcap` file).
    Its first command is given at t = 0. Commands between two ticks are given at the later tick, so choose a `rate` that
    is at least the rate of the log. A command holds until the next one, and the last one until the end. So the log
    should end with a stop; or set a `timeout`, as real bases have one.

    A CSV file has a header with `time` (s) and either `linear`, `lateral`, `angular` (m/s, rad/s) or
    `position.<joint>`, `velocity.<joint>`, `effort.<joint>` (SI units). From ROS logs, `Twist`, `TwistStamped` and
    `JointState` messages are replayed at the times at which the log received them. If a joint has several of position,
    velocity and effort, the first of them is used. Targets beyond the limits of the model are clipped, with a note.

    ROS logs need `pip install '.[rosbags]'` in a checkout of sim-action, and in a workflow the input `extras: rosbags`.
    """

    replay: Annotated[
        str,
        NamesFile(),
        Field(min_length=1, description="path of the log: .csv, .bag, .db3, .mcap, or the folder of a rosbag2"),
    ]
    topic: Annotated[str | None, Field(min_length=1, description="topic to replay; required for logs of ROS")] = None
    type: Annotated[
        MessageType | None, Field(description="message type of the topic; default: the type in the log")
    ] = None
    only_joints: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, description="joints to move; default: all joints in the log"),
    ] = None
    start: Annotated[NonNegativeSeconds, Field(description="time in the log that corresponds to t = 0")] = 0.0
    timeout: Annotated[
        PositiveSeconds | None, Field(description="time after which a twist expires and the base stops; default: never")
    ] = None

    def problems(self, workspace: Workspace) -> SpecProblems:
        """See CommandSource.problems. A CSV file is read; a log of ROS is not."""
        try:
            path = workspace.file_or_folder(self.replay)
        except PathError as error:
            yield ("replay",), str(error)
        else:
            yield from _log_problems(self, path)

    @property
    @override
    def unchecked(self) -> tuple[str, ...]:
        if _is_csv(self):
            return ()
        return (f"topics of {self.replay}: the log is read when the scenario runs",)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: joints that no motor can move."""
        troubles = (self._why_not_moved(name, scene.model) for name in sorted(self.joints(scene)))
        if trouble := next(filter(None, troubles), None):
            yield (("only_joints",), trouble) if self.only_joints else (("replay",), f"{self.replay}: {trouble}")

    @override
    def gives_twists(self, scene: Scene) -> bool:
        header = self._csv_header(scene.workspace)
        return self.type in TWISTS if header is None else header.holds_twists

    @override
    def joints(self, scene: Scene) -> frozenset[str]:
        if self.gives_twists(scene):
            return frozenset()
        header = self._csv_header(scene.workspace)
        return frozenset(self.only_joints or (() if header is None else header.joint_names))

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises RecordingError, and RunError for a log that does not fit into memory."""
        commands = list(self._read_commands(scene.workspace))
        for key, message in self._mismatches(commands, scene.model):
            raise RecordingError(f"{self.replay}: {message}", key)
        chosen = [(time, self._chosen(command)) for time, command in commands]
        playback, motors = Playback(chosen, self.start, self.timeout), Saturation(scene.model, self.replay)
        holding = _holding(chosen[0][1], scene)
        return OpenLoop(lambda time: motors.clip_answer(playback.command(time)), holding, motors.notes)

    def _csv_header(self, workspace: Workspace) -> Header | None:
        """Return the header of a CSV log; None for other logs, and if it cannot be read, which `problems` reports."""
        try:
            path = workspace.file_or_folder(self.replay)
            return read_header(path, self.replay) if _is_csv(self) else None
        except (PathError, RecordingError):
            return None

    def _read_commands(self, workspace: Workspace) -> Iterable[TimedCommand]:
        """Return all commands of the log. Raises RecordingError."""
        try:
            path = workspace.file_or_folder(self.replay)
            if _is_csv(self):
                return read_csv(path, self.replay)
            for file in rosbag.files_of(path, self.replay) if path.is_dir() else ():
                workspace.file(str(path / file))
        except PathError as error:
            raise RecordingError(f"{self.replay}: {error}") from None
        return rosbag.read_commands(path, self.replay, self.topic or "", self.type)

    def _chosen(self, command: Command) -> Command:
        if self.only_joints is None or not isinstance(command, JointTargets):
            return command
        return JointTargets(
            position={name: command.position[name] for name in self.only_joints if name in command.position},
            velocity={name: command.velocity[name] for name in self.only_joints if name in command.velocity},
            effort={name: command.effort[name] for name in self.only_joints if name in command.effort},
        )

    def _mismatches(self, commands: Sequence[TimedCommand], model: RobotModel) -> Iterator[tuple[str, str]]:
        """Yield keys that do not fit the log, and joints of the log that do not fit the robot."""
        named = {name for _, command in commands if isinstance(command, JointTargets) for name in command.names()}
        for (key, *_), message in _kind_problems(self, holds_twists=not named):
            yield str(key), message
        if self.start > (end := commands[-1][0]):
            yield "start", f"the log ends before that time, {end:g} s after its first message"
        for name in self.only_joints or ():
            if name not in named:
                yield "only_joints", f"the log has no joint '{name}'{did_you_mean(name, named)}"
        for name in self.only_joints or sorted(named):
            if (trouble := self._why_not_moved(name, model)) is not None:
                yield "only_joints" if self.only_joints else "replay", trouble

    def _why_not_moved(self, name: str, model: RobotModel) -> str | None:
        trouble = model.why_not_driven(name)
        if trouble is None or self.only_joints:
            return trouble
        return f"{trouble}; list the joints to move in 'only_joints'"


def _holding(first: Command, scene: Scene) -> JointTargets:
    """Return the targets before t = 0 for the joints of the first command: initial positions, velocities of 0."""
    if not isinstance(first, JointTargets):
        return JointTargets()
    beginnings = scene.joint_positions
    return JointTargets(
        position={name: beginnings[name] for name in first.position},
        velocity=dict.fromkeys(first.velocity, 0.0),
    )


def _is_csv(spec: ReplayCommands) -> bool:
    return PurePath(spec.replay).suffix == _CSV


def _log_problems(spec: ReplayCommands, path: Path) -> SpecProblems:
    yield from _csv_problems(spec, path) if _is_csv(spec) else _ros_problems(spec, path)


def _kind_problems(spec: ReplayCommands, *, holds_twists: bool) -> SpecProblems:
    """Yield keys that do not fit the content of a log."""
    if holds_twists and spec.only_joints is not None:
        yield ("only_joints",), "the log contains twists, not joints; remove this key"
    if not holds_twists and spec.timeout is not None:
        yield (
            ("timeout",),
            "this applies to twists only, but the log contains joints, which keep their last target; remove this key",
        )


def _csv_problems(spec: ReplayCommands, path: Path) -> SpecProblems:
    for key, value in (("topic", spec.topic), ("type", spec.type)):
        if value is not None:
            yield (key,), "a CSV file has no topics; remove this key"
    try:
        header = read_header(path, spec.replay)
        last = max(time for time, _ in read_csv(path, spec.replay))
    except RecordingError as error:
        yield ("replay",), str(error)
        return
    if spec.start > last:
        yield ("start",), f"the log ends before that time, {last:g} s after its first row"
    yield from _kind_problems(spec, holds_twists=header.holds_twists)
    for name in spec.only_joints or ():
        if not header.holds_twists and name not in header.joint_names:
            yield ("only_joints",), f"the log has no joint '{name}'{did_you_mean(name, header.joint_names)}"


def _ros_problems(spec: ReplayCommands, path: Path) -> SpecProblems:
    if problem := rosbag.path_problem(path):
        yield ("replay",), f"'{spec.replay}' {problem}"
        return
    if spec.topic is None:
        yield ("replay",), "a log of ROS needs a topic to replay, such as topic: /cmd_vel"
    if spec.type is not None:
        yield from _kind_problems(spec, holds_twists=spec.type in TWISTS)
    if find_spec(rosbag.PACKAGE) is None:
        yield ("replay",), rosbag.INSTALL_HINT


class Playback:
    """Selects the commands of a log at each tick; the times of the ticks must rise.

    Args:
        commands: the log; a command holds until the next one.
        start_s: time in the log, in s, that corresponds to t = 0.
        timeout_s: time in s after which a twist expires; None: never.
    """

    def __init__(self, commands: Sequence[TimedCommand], start_s: float, timeout_s: float | None) -> None:
        self._commands = commands
        self._start_s = start_s
        self._timeout_s = float("inf") if timeout_s is None else timeout_s
        self._next = 0

    def command(self, time: float) -> Command | None:
        """Return the new command at a tick, at a sim time in s; None if there is none."""
        now = self._start_s + time
        new: Command | None = None
        while self._next < len(self._commands) and self._commands[self._next][0] <= now + _ROUNDING:
            new = _after(new, self._commands[self._next][1])
            self._next += 1
        last, command = self._commands[max(0, self._next - 1)]
        if isinstance(command, Twist) and now - last > self._timeout_s + _ROUNDING:
            return Twist()
        return new


def _after(earlier: Command | None, later: Command) -> Command:
    if isinstance(earlier, JointTargets) and isinstance(later, JointTargets):
        return earlier.updated_by(later)
    return later


MAX_BYTES: Final = 25_000_000
MAX_ROWS: Final = 250_000
# The count of digits is bounded, because long numbers are slow to convert.
_DIGITS: Final = r"[-+]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][-+]?[0-9]{1,3})?"
_NUMBER: Final = re.compile(_DIGITS)
_NUMBERS: Final = re.compile(f"{_DIGITS}(?:,{_DIGITS})*")

Line = tuple[int, list[str]]
"""The number of a line, from 1, and its cells."""

MAX_COLUMNS: Final = 1_000

TIME: Final = "time"

TWIST: Final = ("linear", "lateral", "angular")

_ALLOWED: Final = (TIME, *TWIST, *(f"{kind}.<joint>" for kind in KINDS))


def read_header(path: Path, name: str) -> Header:
    """Read the header of a file; `name` is its name in messages. Raises RecordingError."""
    with _lines(path, name) as lines:
        return _header(lines, name)


def read_csv(path: Path, name: str) -> Iterator[TimedCommand]:
    """Yield the commands of a file, at least one. Raises RecordingError."""
    with _lines(path, name) as lines:
        header = _header(lines, name)
        command = _twists(header) if header.holds_twists else _joint_targets(header)
        clock, time_column = _Clock(), header.columns.index(TIME)
        for count, (line, cells) in enumerate(lines):
            if count == MAX_ROWS:
                raise _error(name, line, f"the log has more than {MAX_ROWS:,} rows: keep only the part to replay")
            try:
                row = _numbers(cells, header)
                time = clock.since_first(cells[time_column])
            except ValueError as error:
                raise _error(name, line, str(error)) from None
            yield time, command(row)
        if clock.first is None:
            raise RecordingError(f"{name}: there is no row after the header, so nothing to replay")


class _Clock:
    """Converts times without loss of digits: seconds since 1970 need all of them."""

    def __init__(self) -> None:
        self.first: Decimal | None = None
        self._last = Decimal()

    def since_first(self, text: str) -> float:
        """Return the time since the first row, in s. Raises ValueError for a time before the previous row."""
        time = Decimal(text)
        if self.first is None:
            self.first = self._last = time
        if time < self._last:
            raise ValueError(f"column '{TIME}': {shown(text)} is earlier than the previous row, {self._last}")
        self._last = time
        return float(time - self.first)


@contextmanager
def _lines(path: Path, name: str) -> Iterator[Iterator[Line]]:
    try:
        with open_regular(path, follow_link=False) as file:
            if (size := file.seek(0, 2)) > MAX_BYTES:
                most = f"at most {MAX_BYTES // 1_000_000} MB of CSV are allowed"
                raise RecordingError(f"{name}: the file has {size / 1e6:.0f} MB; {most}: keep only the part to replay")
            file.seek(0)
            with TextIOWrapper(file, encoding="utf-8-sig", newline="") as text:
                yield _cells(text, name)
    except OSError as error:
        raise RecordingError(f"{name}: the file cannot be read: {error.strerror}") from None


def _cells(text: TextIOWrapper, name: str) -> Iterator[Line]:
    """Yield the lines that are not blank. Raises RecordingError."""
    reader = csv.reader(text, strict=True)
    try:
        for cells in reader:
            if cells:
                yield reader.line_num, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise _error(name, reader.line_num, f"not valid CSV: {error}") from None
    except UnicodeDecodeError as error:
        raise RecordingError(f"{name}: not UTF-8 text ({error.reason}); is this a CSV file?") from None


def _header(lines: Iterator[Line], name: str) -> Header:
    line, columns = next(lines, (0, []))
    if not columns:
        raise RecordingError(
            f"{name}: the file is empty; its first line must name the columns, such as {TIME},linear,angular"
        )
    try:
        return Header.of(columns)
    except HeaderError as error:
        raise _error(name, line, str(error)) from None


def _numbers(cells: Sequence[str], header: Header) -> list[float]:
    """Return the values of a row. Raises ValueError."""
    if len(cells) != len(header.columns):
        raise ValueError(f"{len(cells)} cells, but the header has {len(header.columns)} columns")
    with suppress(ValueError):
        row = list(map(float, cells))
        # The sum of finite numbers may overflow: then each number is checked.
        if _NUMBERS.fullmatch(",".join(cells)) and math.isfinite(sum(row)):
            return row
    for column, cell in zip(header.columns, cells, strict=True):
        if _NUMBER.fullmatch(cell) is None or not math.isfinite(float(cell)):
            raise ValueError(f"column {shown(column)}: expected a finite number, found {shown(cell)}")
    return list(map(float, cells))


def _twists(header: Header) -> Callable[[list[float]], Command]:
    # A missing column refers to a 0 that is appended to the row.
    linear, lateral, angular = (
        header.columns.index(name) if name in header.columns else len(header.columns) for name in TWIST
    )

    def command(row: list[float]) -> Command:
        row.append(0.0)
        return Twist((row[linear], row[lateral], 0.0), (0.0, 0.0, row[angular]))

    return command


def _joint_targets(header: Header) -> Callable[[list[float]], Command]:
    columns = [(index, column) for index, column in enumerate(header.joints) if column is not None]
    counting = [columns[place] for place in used_columns(column for _, column in columns)]
    return lambda row: row_targets((column, row[index]) for index, column in counting)


def _error(name: str, line: int, message: str) -> RecordingError:
    return RecordingError(escaped_line(f"{Location(name, line)}: {message}"))


class HeaderError(ValueError):
    """A header that is not valid."""


@dataclass(frozen=True, slots=True)
class Header:
    """The columns of a file.

    Attributes:
        columns: the names of the columns, in the order of the file.
        joints: the joint and quantity of each column, None for other columns; empty if the file has twists.
    """

    columns: tuple[str, ...]
    joints: tuple[JointColumn | None, ...] = ()

    @classmethod
    def of(cls, columns: Sequence[str]) -> Header:
        """Return the header for the names of columns. Raises HeaderError."""
        if problem := next(_problems(columns), None):
            raise HeaderError(problem)
        joints = tuple(map(_joint_column, columns))
        return cls(tuple(columns), joints if any(joints) else ())

    @property
    def holds_twists(self) -> bool:
        """Return True if the file has twists of the base."""
        return not self.joints

    @property
    def joint_names(self) -> frozenset[str]:
        """The joints that the file commands."""
        return frozenset(column.joint for column in self.joints if column is not None)


def _problems(columns: Sequence[str]) -> Iterator[str]:
    if len(columns) > MAX_COLUMNS:
        yield f"{len(columns):,} columns; at most {MAX_COLUMNS:,} are allowed"
    for column, count in Counter(columns).items():
        if count > 1:
            yield f"{count} columns have the name {shown(column)}"
    twists = [column for column in columns if column in TWIST]
    of_joints = [column for column in columns if _joint_column(column)]
    for column in columns:
        if column != TIME and column not in twists and column not in of_joints:
            hint = "" if len(columns) > 1 else "; separate columns by commas"
            yield f"unknown column {shown(column)}{did_you_mean(column, _ALLOWED)}{hint}"
    if TIME not in columns:
        yield f"the column '{TIME}' is missing: it is the time of each row in s"
    if not twists and not of_joints:
        yield f"there is no command column besides '{TIME}'{did_you_mean('', _ALLOWED[1:])}"
    if twists and of_joints:
        yield f"'{twists[0]}' commands the base, {shown(of_joints[0])} a joint; split the log into two files"


def _joint_column(column: str) -> JointColumn | None:
    kind = next((kind for kind in KINDS if column.startswith(f"{kind}.")), None)
    joint = column.partition(".")[2]
    return JointColumn(kind, joint) if kind and joint else None
