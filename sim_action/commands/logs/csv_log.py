"""Logs in CSV: a header, then one row per command, with `time` in s, and a twist or joint targets.

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
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from decimal import Decimal
from io import TextIOWrapper
from pathlib import Path
from typing import Final

from sim_action.commands.logs import KINDS, JointColumn, TimedCommand, row_targets, used_columns
from sim_action.core.errors import Location, RecordingError
from sim_action.core.files import open_regular
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean, escaped_line, shown
from sim_action.state.command import Command

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


def read_commands(path: Path, name: str) -> Iterator[TimedCommand]:
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
