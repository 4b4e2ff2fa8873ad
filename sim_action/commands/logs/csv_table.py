"""Tables of commands in CSV: a header, then one row per command, with a time and a twist or joint targets.

    time,linear,angular
    0.0,0.2,0
    1.5,0.2,0.5

A unit may follow a name: `speed [km/h]`. The columns of other tools are recognised: PlotJuggler, `rostopic echo -p`,
pandas, bagpy, and the recordings of sim-action. The file is not trusted: its size is bounded, and only numbers, dates
and names are read from it.
"""

from __future__ import annotations

import csv
import difflib
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from decimal import Decimal
from io import TextIOWrapper
from itertools import chain, pairwise
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import Final

from sim_action.commands.logs import KINDS, MAX_ROWS, Content, JointColumn, Recorded, TimedRow
from sim_action.core import units
from sim_action.core.errors import Location, RecordingError
from sim_action.core.files import open_regular
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean, escaped_line, first_of, shown

MAX_BYTES: Final = 25_000_000
MAX_COLUMNS: Final = 1_000
# The count of digits is bounded, because long numbers are slow to convert.
_DIGITS: Final = r"[-+]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][-+]?[0-9]{1,3})?"
_NUMBER: Final = re.compile(_DIGITS)
_NUMBERS: Final = re.compile(f"{_DIGITS}(?:,{_DIGITS})*")
_NO_READING: Final = frozenset({"", "nan"})
TIME: Final = "time"
TWIST: Final = ("linear", "lateral", "angular")
COLUMNS: Final = (TIME, *TWIST, *(f"{kind}.<joint>" for kind in KINDS))
"""The meanings of columns: names in the header, and keys of `columns:`."""

# Names of the time column, the preferred first, and the default unit.
_TIMES: Final = MappingProxyType({TIME: "s", "%time": "ns", "__time": "s", "timestamp": "s", "Time": "s", "stamp": "s"})
_POWERS: Final = MappingProxyType({"s": 0, "ms": -3, "us": -6, "ns": -9})
_FACTORS: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        TIME: {unit: 10.0**power for unit, power in _POWERS.items()},
        "linear": units.SPEED.factors,
        "lateral": units.SPEED.factors,
        "angular": units.ANGULAR_SPEED.factors,
        "position": {**units.ANGLE.factors, **units.LENGTH.factors},
        "velocity": {**units.ANGULAR_SPEED.factors, **units.SPEED.factors},
        "effort": {**units.TORQUE.factors, **units.FORCE.factors},
    }
)
_UNITS: Final = frozenset(chain.from_iterable(_FACTORS.values()))
_WITH_UNIT: Final = re.compile(r"(.*\S)\s*\[([^\[\]]+)\]")
_AXES: Final = MappingProxyType({"linear.x": "linear", "linear.y": "lateral", "angular.z": "angular"})
_TWIST: Final = re.compile(
    r"(?:(?P<topic>.*?)[/.])??(?:field\.)?(?:twist[/.])?(?P<kind>linear|angular)[/.](?P<axis>[xyz])"
)
_JOINT: Final = re.compile(
    r"(?:(?P<plain>position|velocity|effort)(?:\.| of )(?P<name>.+)"
    r"|(?P<topic>/.+)/(?P<joint>[^/]+)/(?P<kind>position|velocity|effort)"
    r"|field\.(?P<group>position|velocity|effort)(?P<number>[0-9]+))"
)
_ALIKE: Final = 0.8  # similar to a name of ours: a spelling mistake, not a column of something else
_YEAR_S: Final = 365.25 * 86_400
_MAX_SPAN_S: Final = 30 * 86_400
# After the year 5000.
_MAX_TIME_S: Final = 1e11
_MAX_COUNTED_S: Final = 1e30
# Rows whose times are whole numbers at least this far apart count ms.
_SLOW_S: Final = 10.0
_FEW_ROWS: Final = 5
_SHORT_S: Final = 1e-3  # logs have no shorter times between their rows
# On average, with several topics at once. Rows of 1 Hz whose times are in days are 1.2e-5 apart.
_DENSE_S: Final = 2e-5
Line = tuple[int, list[str]]  # the number of a line, from 1, and its cells


class HeaderError(ValueError):
    """A header that is not valid."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column that is used."""

    place: int  # its index in the file
    name: str  # as the file has it, without its unit
    unit: str  # of its numbers; empty if the file does not state it
    meaning: str | JointColumn  # "time", a name of `TWIST`, or a quantity of a joint

    @property
    def kind(self) -> str:
        """The key of its units."""
        return self.meaning if isinstance(self.meaning, str) else self.meaning.kind

    @property
    def factor(self) -> float:
        """The SI value of its unit."""
        return _FACTORS[self.kind][self.unit] if self.unit else 1.0


@dataclass(frozen=True, slots=True)
class Header:
    """The columns of a file."""

    count: int  # of all its columns
    time: Column  # the column of the times
    used: tuple[Column, ...]  # the columns of the commands
    ignored: tuple[str, ...] = ()  # names of the others

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        columns: Mapping[str, str] | None = None,
        topic: str | None = None,
        first: Sequence[str] = (),
    ) -> Header:
        """Return the header for the names of columns. Raises HeaderError.

        `columns`: meaning -> column, as in the key of this name; None: they are recognised by their names; `topic`:
        the topic whose columns are used; `first`: the cells of the first row, which may have names of joints.
        """
        if len(names) > MAX_COLUMNS:
            raise HeaderError(f"{len(names):,} columns; at most {MAX_COLUMNS:,} are allowed")
        for name, count in Counter(filter(None, names)).items():
            if count > 1:
                raise HeaderError(f"{count} columns have the name {shown(name)}")
        used = _stated(names, columns) if columns is not None else _recognised(names, topic, first)
        time = next((column for column in used if column.meaning == TIME), None)
        if time is None:
            raise HeaderError(
                f"the column '{TIME}' is missing: it is the time of each row; name it in 'columns', or add it"
            )
        commands = tuple(column for column in used if column is not time)
        if not commands:
            raise HeaderError(f"there is no command column besides '{time.name}'{did_you_mean('', COLUMNS[1:])}")
        twists = [column.name for column in commands if isinstance(column.meaning, str)]
        of_joints = [column.name for column in commands if not isinstance(column.meaning, str)]
        if twists and of_joints:
            raise HeaderError(
                f"'{twists[0]}' commands the base, {shown(of_joints[0])} a joint; select one with 'columns' or 'topic'"
            )
        taken = {column.place for column in used}
        others = () if columns is not None else tuple(n for place, n in enumerate(names) if n and place not in taken)
        return cls(len(names), time, commands, others)

    @property
    def holds_twists(self) -> bool:
        """Return True if the file has twists of the base."""
        return isinstance(self.used[0].meaning, str)

    @property
    def joint_names(self) -> frozenset[str]:
        """The joints that the file commands."""
        return frozenset(column.meaning.joint for column in self.used if isinstance(column.meaning, JointColumn))


def _split(name: str) -> tuple[str, str]:
    match = _WITH_UNIT.fullmatch(name)
    return (match[1], match[2]) if match and match[2] in _UNITS else (name, "")


def _stated(names: Sequence[str], columns: Mapping[str, str]) -> list[Column]:
    """Return the columns that the scenario names. Raises HeaderError."""
    bare = [_split(name) for name in names]
    used = []
    for key, text in columns.items():
        kind, _, joint = key.partition(".")
        meaning = key if key in (TIME, *TWIST) else _joint_column(kind, joint)
        if meaning is None:
            raise HeaderError(f"columns: unknown meaning {shown(key)}{did_you_mean(key, COLUMNS)}")
        name, unit = (text, "") if text in names else _split(text)
        places = [place for place, (column, _) in enumerate(bare) if name in (column, names[place])]
        if not places:
            raise HeaderError(f"columns: there is no column {shown(name)}{did_you_mean(name, filter(None, names))}")
        stated = bare[places[0]][1]
        if unit and stated and unit != stated:
            raise HeaderError(f"columns: {shown(name)} is in {stated}, as the file states, not in {unit}")
        used.append(_column(places[0], bare[places[0]][0], unit or stated, meaning))
    return used


def _joint_column(kind: str, joint: str) -> JointColumn | None:
    interface = next((interface for interface in KINDS if interface == kind), None)
    return JointColumn(interface, joint) if interface and joint else None


def _column(place: int, name: str, unit: str, meaning: str | JointColumn) -> Column:
    column = Column(place, name, unit, meaning)
    if unit and unit not in _FACTORS[column.kind]:
        raise HeaderError(
            f"column {shown(name)}: the unit {shown(unit)} does not fit{did_you_mean(unit, _FACTORS[column.kind])}"
        )
    return column


def _recognised(names: Sequence[str], topic: str | None, first: Sequence[str]) -> list[Column]:
    """Return the columns that are recognised by their names, of one topic. Raises HeaderError."""
    times: dict[str, tuple[int, str]] = {}
    topics: dict[str, list[Column]] = {}
    strange = []
    for place, whole in enumerate(names):
        name, unit = _split(whole)
        if name in _TIMES:
            times.setdefault(name, (place, unit or _TIMES[name] * (name != TIME)))
        elif (meant := _meaning(name, names, first)) is not None:
            owner, meaning = meant
            topics.setdefault(owner, []).append(_column(place, name, unit, meaning))
        elif name:
            strange.append(name)
    if not times and names and not names[0] and first and not first[0].isdigit():
        times[""] = (0, "")  # an index of pandas: dates, or numbers that do not count rows
    time = next((Column(*times[name][:1], name, times[name][1], TIME) for name in (*_TIMES, "") if name in times), None)
    mine = _of_topic(topics, topic)
    if topic is None and (not mine or any(column.name in (*TWIST, TIME) for column in mine) or "" in topics):
        _refuse_misspelt(strange, alone=len(names) == 1)
    return [*([time] if time else []), *mine]


def _of_topic(topics: Mapping[str, list[Column]], topic: str | None) -> list[Column]:
    if topic is not None:
        if topic not in topics:
            raise HeaderError(f"the file has no columns of topic {shown(topic)}{did_you_mean(topic, topics)}")
        return topics[topic]
    if "" in topics:
        return topics[""]
    if len(topics) > 1:
        raise HeaderError(
            f"the file has commands of several topics: {', '.join(sorted(topics))}; select one with 'topic'"
        )
    return next(iter(topics.values()), [])


def _meaning(name: str, names: Sequence[str], first: Sequence[str]) -> tuple[str, str | JointColumn] | None:
    """Return the topic and the meaning of a column; None if it has none."""
    if name in TWIST:
        return "", name
    if match := _TWIST.fullmatch(name):
        axis = _AXES.get(f"{match['kind']}.{match['axis']}")
        return (match["topic"] or "", axis) if axis else None
    if not (match := _JOINT.fullmatch(name)):
        return None
    kind = match["plain"] or match["kind"] or match["group"]
    joint = match["name"] or match["joint"]
    if match["number"]:
        of_name = f"field.name{match['number']}"
        joint = first[names.index(of_name)] if of_name in names and len(first) == len(names) else ""
    column = _joint_column(kind, joint)
    return None if column is None else (match["topic"] or "", column)


def _refuse_misspelt(strange: Iterable[str], *, alone: bool) -> None:
    """Raise HeaderError for a column whose name is nearly one of ours: it must not be ignored."""
    for name in strange:
        head, dot, _ = name.partition(".")
        near = difflib.get_close_matches(head if dot else name, KINDS if dot else (TIME, *TWIST), n=1, cutoff=_ALIKE)
        if near or alone:
            hint = "; separate columns by commas" if alone else ""
            raise HeaderError(f"unknown column {shown(name)}{did_you_mean(name, COLUMNS)}{hint}")


@dataclass(frozen=True, slots=True)
class Table:
    """A CSV file as the scenario names it."""

    path: Path
    name: str  # of the file in messages
    # meaning -> column, as in the key `columns`; None: recognised by their names
    columns: Mapping[str, str] | None = None
    topic: str | None = None  # the topic whose columns are used, for files with several

    def header(self) -> Header:
        """Read the header. Raises RecordingError."""
        with self._lines() as lines:
            return self._header(lines)[0]

    def read(self) -> Recorded:
        """Read all rows. Raises RecordingError."""
        with self._lines() as lines:
            header, rest = self._header(lines)
            clock = _Clock(header.time)
            rows: list[TimedRow] = []
            count = 0
            for line, cells in rest:
                if count == MAX_ROWS:
                    raise self._error(line, f"the log has more than {MAX_ROWS:,} rows: keep only the part to replay")
                count += 1
                try:
                    _check_width(cells, header)
                    time_ns = clock.nanoseconds(cells[header.time.place])
                    content = _content(header, cells)
                except ValueError as error:
                    raise self._error(line, str(error)) from None
                if content is not None:
                    rows.append((time_ns, content))
        if not rows:
            empty = "no row has a number in the columns of commands" if count else "there is no row after the header"
            raise RecordingError(f"{self.name}: {empty}, so nothing to replay")
        if problem := _unit_problem(header.time, [time_ns / 1e9 for time_ns, _ in rows], clock.is_whole):
            raise RecordingError(escaped_line(f"{self.name}: {problem}"))
        listed = first_of([*map(shown, header.ignored)], 3)
        notes = (escaped_line(f"{self.name}: columns that are not commands: {listed}"),) if listed else ()
        unused = {"without a number in the columns of commands": count - len(rows)}
        return Recorded(tuple(rows), clock.resolution_s, count, unused, notes)

    @contextmanager
    def _lines(self) -> Iterator[Iterator[Line]]:
        try:
            with open_regular(self.path, follow_link=False) as file:
                if (size := file.seek(0, 2)) > MAX_BYTES:
                    most = f"at most {MAX_BYTES // 1_000_000} MB of CSV are allowed"
                    raise RecordingError(
                        f"{self.name}: the file has {size / 1e6:.0f} MB; {most}: keep only the part to replay"
                    )
                file.seek(0)
                with TextIOWrapper(file, encoding="utf-8-sig", newline="") as text:
                    yield self._cells(text)
        except OSError as error:
            raise RecordingError(f"{self.name}: the file cannot be read: {error.strerror}") from None

    def _cells(self, text: TextIOWrapper) -> Iterator[Line]:
        """Yield the lines that are not blank. Raises RecordingError."""
        reader = csv.reader(text, strict=True)
        try:
            for cells in reader:
                if cells:
                    yield reader.line_num, [cell.strip() for cell in cells]
        except csv.Error as error:
            raise self._error(reader.line_num, f"not valid CSV: {error}") from None
        except UnicodeDecodeError as error:
            raise RecordingError(f"{self.name}: not UTF-8 text ({error.reason}); is this a CSV file?") from None

    def _header(self, lines: Iterator[Line]) -> tuple[Header, Iterator[Line]]:
        """Return the header, and the lines after it."""
        line, names = next(lines, (0, []))
        if not names:
            raise RecordingError(
                f"{self.name}: the file is empty; its first line must name the columns, such as {TIME},linear,angular"
            )
        first = next(lines, None)
        try:
            header = Header.of(names, self.columns, self.topic, first[1] if first else ())
        except HeaderError as error:
            raise self._error(line, str(error)) from None
        return header, chain([first] if first else [], lines)

    def _error(self, line: int, message: str) -> RecordingError:
        return RecordingError(escaped_line(f"{Location(self.name, line)}: {message}"))


class _Clock:
    """Converts times without loss of digits: seconds since 1970 need all of them."""

    def __init__(self, column: Column) -> None:
        self._column = column
        self._power = _POWERS[column.unit or "s"]
        self._last: tuple[int, str] | None = None
        self._exponent: int | None = None

    @property
    def is_whole(self) -> bool:
        """True if all times are whole numbers."""
        return (self._exponent or 0) >= 0

    @property
    def resolution_s(self) -> float:
        """The last digit of the times, in s."""
        return float(10.0 ** ((self._exponent or 0) + self._power)) if self._exponent is not None else 1e-9

    def nanoseconds(self, text: str) -> int:
        """Return a time in ns. Raises ValueError for other text, and for a time before the previous row."""
        time_ns = self._counted(text)
        if self._last is not None and time_ns < self._last[0]:
            raise ValueError(
                f"column '{self._column.name}': {shown(text)} is earlier than the previous row, {self._last[1]}"
            )
        self._last = (time_ns, text)
        return time_ns

    def _counted(self, text: str) -> int:
        if _NUMBER.fullmatch(text) and math.isfinite(float(text)):
            time = Decimal(text)
            _, _, exponent = time.as_tuple()
            assert isinstance(exponent, int)
            self._exponent = exponent if self._exponent is None else min(exponent, self._exponent)
            seconds = time.scaleb(self._power)
            if abs(seconds) <= _MAX_COUNTED_S:
                return int(seconds.scaleb(9).to_integral_value())
        try:
            date = datetime.fromisoformat(text)
        except ValueError:
            expected = f"column {shown(self._column.name)}: expected a finite number, found {shown(text)}"
            raise ValueError(expected) from None
        self._exponent = -6
        since = (date if date.tzinfo else date.replace(tzinfo=UTC)) - datetime(1970, 1, 1, tzinfo=UTC)
        return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1_000


def _unit_problem(column: Column, times: Sequence[float], is_whole: bool) -> str | None:
    """Return the problem of times (N,) in s that are probably in another unit."""
    span, latest = times[-1] - times[0], max(abs(times[0]), abs(times[-1]))
    steps = [later - earlier for earlier, later in pairwise(times) if later > earlier] or [0.0]
    is_series = not column.unit and len(steps) + 1 >= _FEW_ROWS
    if is_series and 0 < span < max(_SHORT_S, _DENSE_S * len(times)):
        return f"column {shown(column.name)}: the log would last {span:g} s; are its times in days? convert them to s"
    slow = is_whole and is_series and median(steps) >= _SLOW_S
    if span <= _MAX_SPAN_S and latest <= _MAX_TIME_S and not slow:
        return None
    scales = [(unit, 10.0 ** _POWERS[unit]) for unit in ("ns", "us", "ms")]
    if latest > _MAX_TIME_S:
        unit = next((unit for unit, scale in reversed(scales) if latest * scale <= _MAX_TIME_S), "ns")
    else:
        unit = next((unit for unit, scale in scales if median(steps) * scale >= _SHORT_S), "ms")
    years = (span if span > _YEAR_S else latest) / _YEAR_S
    lasts = f"{years:,.0f} years" if years > 1 else f"{span:,.0f} s"
    begins = "the log would last" if span > _YEAR_S or years <= 1 else "its times would be after"
    return f"column {shown(column.name)}: {begins} {lasts}; {_stating(column, unit)}"


def _stating(column: Column, unit: str) -> str:
    return f"if its times are in {unit}, state it: columns: {{{TIME}: '{column.name} [{unit}]', ...}}"


def _check_width(cells: Sequence[str], header: Header) -> None:
    if len(cells) != header.count:
        raise ValueError(f"{len(cells)} cells, but the header has {header.count} columns")


def _content(header: Header, cells: Sequence[str]) -> Content | None:
    """Return the command of a row; None if it has no number. Raises ValueError."""
    texts = [cells[column.place] for column in header.used]
    empty = [text.lower() in _NO_READING for text in texts]
    if all(empty):
        return None
    try:
        numbers = [float(text) for text in texts]
        is_plain = _NUMBERS.fullmatch(",".join(texts)) is not None
    except ValueError:
        is_plain = False
    if not is_plain:
        pairs = zip(header.used, texts, empty, strict=True)
        numbers = [
            math.nan if gap and not header.holds_twists else _number(column, text) for column, text, gap in pairs
        ]
    values = {column.meaning: number * column.factor for column, number in zip(header.used, numbers, strict=True)}
    for column, text in zip(header.used, texts, strict=True):
        if math.isinf(values[column.meaning]):
            _number(column, text)
    if header.holds_twists:
        linear, lateral, angular = (values.get(name, 0.0) for name in TWIST)
        return Twist((linear, lateral, 0.0), (0.0, 0.0, angular))
    return {
        column: value for column, value in values.items() if isinstance(column, JointColumn) and not math.isnan(value)
    }


def _number(column: Column, text: str) -> float:
    if _NUMBER.fullmatch(text) is None or not math.isfinite(float(text) * column.factor):
        raise ValueError(f"column {shown(column.name)}: expected a finite number, found {shown(text)}")
    return float(text)
