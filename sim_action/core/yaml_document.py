"""Strict YAML: the core schema of YAML 1.2, no tags, no duplicate keys, bounded size, a place for every value.

Problems in a document are collected with their places. Dotted keys, such as `world.objects.wall.pose.x`, lead to its
values: a step into a list is the name of an entry or its index from 0, and a key or name that contains dots counts as a
whole.

PyYAML follows YAML 1.1, in which `on` is true, `1:30` is 90 and the last of two equal keys wins; its scanner and parser
are used here, its interpretation is not.
"""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import yaml

from sim_action.core.errors import InvalidScenario, Location, Problem
from sim_action.core.records import dataclass, field
from sim_action.core.wording import did_you_mean, escaped_line, shown

MAX_BYTES: Final = 1_000_000
MAX_DEPTH: Final = 40
MAX_VALUES: Final = 20_000
MAX_DIGITS: Final = 400
_Mark = Any  # PyYAML's two parsers have a class each, with line and column from 0.
KeyPath = tuple[str | int, ...]  # the keys and list indices that lead to a value
SpecProblem = tuple[KeyPath, str]  # the keys that lead to a problem in a scenario, and its message
SpecProblems = Iterator[SpecProblem]
_INT: Final = re.compile(r"[-+]?[0-9]+")
_OCTAL_OR_HEX: Final = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_LINE_END: Final = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
_SURROGATE: Final = re.compile("[\ud800-\udfff]")
_FLOAT: Final = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_CONSTANTS: Final[dict[str, object]] = (
    dict.fromkeys(("", "~", "null", "Null", "NULL"))
    | dict.fromkeys(("true", "True", "TRUE"), True)
    | dict.fromkeys(("false", "False", "FALSE"), False)
    | dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), float("inf"))
    | dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf"))
    | dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan"))
)


def is_plain_text(text: str) -> bool:
    """Return True if a scalar without quotes is text, and no number or constant."""
    return text not in _CONSTANTS and not any(pattern.fullmatch(text) for pattern in (_FLOAT, _INT, _OCTAL_OR_HEX))


def plain_value(text: str) -> object:
    """Return the value of a scalar without quotes: a number, a constant or text. Raise ValueError."""
    if is_plain_text(text):
        return text
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    whole = _INT.fullmatch(text)
    based = _OCTAL_OR_HEX.fullmatch(text)
    if (whole or based) and len(text) > MAX_DIGITS:
        raise ValueError(f"a number of {len(text)} digits; the maximum is {MAX_DIGITS}")
    if whole:
        return int(text)
    return int(text, 0) if based else float(text)


@dataclass(frozen=True)
class Document:
    """The content of a file as plain values (maps as dict, lists as tuple), with the place of each value."""

    file: str
    data: object
    marks: Mapping[KeyPath, Location] = field(default_factory=dict)
    # paths of values that are written elsewhere -> their paths in the file, which `marks` has
    moved: Mapping[KeyPath, KeyPath] = field(default_factory=dict)

    def location(self, path: KeyPath) -> Location:
        """Return the place of the key or list item at `path`, or of the nearest map or list around a missing one."""
        path = self._as_written(path)
        while path not in self.marks and path:
            path = path[:-1]
        return self.marks.get(path, Location(self.file, 1, 1))

    def _as_written(self, path: KeyPath) -> KeyPath:
        for size in range(len(path), 0, -1) if self.moved else ():
            if (place := self.moved.get(path[:size])) is not None:
                return (*place, *path[size:])
        return path

    @property
    def files(self) -> set[str]:
        """The names of the files that its values are written in."""
        # Looking up each key of a chain takes much longer.
        parts = self.marks.maps if isinstance(self.marks, ChainMap) else (self.marks,)
        return {place.file for part in parts for place in part.values()}

    @property
    def size(self) -> int:
        """The number of values; aliases count as copies."""
        size = 0
        waiting = [self.data]
        while waiting:
            value = waiting.pop()
            size += 1
            waiting += value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else ()
        return size

    def problem(self, path: KeyPath, message: str) -> Problem:
        """Return a problem at `path`: its file, line and column, and a message that starts with the keys."""
        keys = dotted(self._as_written(path))
        return Problem(self.location(path), escaped_line(f"{keys}: {message}" if keys else message))

    def path_of_key(self, key: str) -> KeyPath:
        """Return the path of the first key of this name; an empty path if there is none."""
        return next((path for path in self.marks if path and path[-1] == key), ())

    def merged(self, over: Document) -> Document:
        """Return this map of keys with another one: maps merge, lists and scalars replace, null removes a key."""
        replaced: set[KeyPath] = set()
        data = _merged(self.data, over.data, (), replaced)
        kept = {
            path: place
            for path, place in self.marks.items()
            if replaced.isdisjoint(path[:size] for size in range(len(path) + 1))
        }
        return Document(over.file, data, {**kept, **over.marks})

    def entries(self, key: str) -> list[Document]:
        """Return the entries of a list below a top-level key, each as a document."""
        assert isinstance(self.data, dict)
        entries: tuple[object, ...] = self.data[key]
        marks: list[dict[KeyPath, Location]] = [{} for _ in entries]
        for path, place in self.marks.items():
            if len(path) > 1 and path[0] == key:
                assert isinstance(path[1], int)
                marks[path[1]][path[2:]] = place
        return [Document(self.file, entry, marks[index]) for index, entry in enumerate(entries)]

    def without(self, *keys: str) -> Document:
        """Return the map without some of its top-level keys."""
        assert isinstance(self.data, dict)
        return Document(
            self.file,
            {key: value for key, value in self.data.items() if key not in keys},
            {path: place for path, place in self.marks.items() if path[:1] not in {(key,) for key in keys}},
        )


def _merged(base: object, over: object, path: KeyPath, replaced: set[KeyPath]) -> object:
    """Return merged data; `replaced` gets the paths whose values are not of `base` any more."""
    if not isinstance(base, dict) or not isinstance(over, dict):
        replaced.add(path)
        return over
    values = dict(base)
    for key, value in over.items():
        if key not in base:
            values[key] = value
        elif value is None:
            replaced.add((*path, key))
            del values[key]
        else:
            values[key] = _merged(base[key], value, (*path, key), replaced)
    return values


def read_document(file: str, text: str) -> Document:
    """Read one YAML document. Raise InvalidScenario."""
    return _Reader(file).read(text)


def location_after(file: str, text: str) -> Location:
    """Return the place after the beginning `text` of a file; lines are counted as in YAML."""
    lines = _LINE_END.split(text)
    return Location(file, len(lines), len(lines[-1]) + 1)


class _Refused(Exception):
    """Ends the reading; its problem has been noted."""


class _Reader:
    def __init__(self, file: str) -> None:
        self._file = file
        self._problems: list[Problem] = []
        self._marks: dict[KeyPath, Location] = {}
        self._anchors: dict[str, tuple[object, int]] = {}
        self._values = 0

    def read(self, text: str) -> Document:
        data: object = None
        try:
            self._events = self._parsed(text)
            data = self._document()
        except _Refused:
            pass
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            self._note(mark, f"not valid YAML: {' '.join(filter(None, (error.context, error.problem)))}")
        except yaml.reader.ReaderError as error:
            where = location_after(self._file, text[: error.position])
            message = f"the control character U+{ord(text[error.position]):04X} is not allowed; remove it"
            self._problems.append(Problem(where, message))
        if self._problems:
            raise InvalidScenario(self._problems)
        return Document(self._file, data, self._marks)

    def _parsed(self, text: str) -> Iterator[yaml.Event]:
        mark: _Mark | None = None
        try:
            for event in yaml.parse(text, Loader=yaml.SafeLoader):
                mark = event.end_mark
                yield event
        except (ValueError, OverflowError):
            # PyYAML's own: an escape such as "\UFFFFFFFF", a version of 5,000 digits.
            self._note(mark, "not valid YAML: an escape or a number after this place is out of range")
            raise _Refused from None

    def _document(self) -> object:
        data: object = None
        documents = 0
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self._refuse(event, "found a second YAML document; a file holds one scenario")
                data, _ = self._value(next(self._events), ())
        return data

    def _value(self, event: yaml.Event, path: KeyPath) -> tuple[object, int]:
        """Return the value that begins with an event, and its number of values, aliases counted as copies."""
        self._marks.setdefault(path, self._at(event.start_mark))
        if len(path) > MAX_DEPTH:
            raise self._refuse(event, f"more than {MAX_DEPTH} nested maps and lists")
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise self._refuse(event, f"the alias '*{event.anchor}' has no anchor before it")
            value, size = self._anchors[event.anchor]
            self._count(event, size, path)
            built = value, size
        else:
            built = self._node(event, path)
            if anchor := getattr(event, "anchor", None):
                self._anchors[anchor] = built
        return built

    def _node(self, event: yaml.Event, path: KeyPath) -> tuple[object, int]:
        if (tag := getattr(event, "tag", None)) is not None:
            written = tag.replace("tag:yaml.org,2002:", "!!")
            raise self._refuse(event, f"the tag '{written}' is not supported; remove it")
        self._count(event, 1, path)
        if isinstance(event, yaml.MappingStartEvent):
            return self._map(path)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._list(path)
        assert isinstance(event, yaml.ScalarEvent)
        return self._scalar(event), 1

    def _map(self, path: KeyPath) -> tuple[object, int]:
        values: dict[str, object] = {}
        size = 1
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self._refuse(event, "a key must be text; this is a map, a list or an alias")
            key = self._scalar(event)
            if not isinstance(key, str):
                raise self._refuse(event, f"a key must be text; put it in quotes: '{event.value}'")
            if key in values:
                self._note(event.start_mark, f"the key '{key}' is used twice")
            self._marks[(*path, key)] = self._at(event.start_mark)
            values[key], inner = self._value(next(self._events), (*path, key))
            size += inner
        return values, size

    def _list(self, path: KeyPath) -> tuple[object, int]:
        values: list[object] = []
        size = 1
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            value, inner = self._value(event, (*path, len(values)))
            values.append(value)
            size += inner
        return tuple(values), size

    def _scalar(self, event: yaml.ScalarEvent) -> object:
        if _SURROGATE.search(event.value):
            raise self._refuse(event, "half of a surrogate pair is not a character; write the character itself")
        return self._plain(event) if event.style is None else event.value

    def _plain(self, event: yaml.ScalarEvent) -> object:
        try:
            return plain_value(event.value)
        except ValueError as error:
            raise self._refuse(event, str(error)) from None

    def _count(self, event: yaml.Event, values: int, path: KeyPath) -> None:
        self._values += values
        if self._values > MAX_VALUES:
            place, limit = ".".join(map(str, path)), f"more than {MAX_VALUES} values in this file"
            raise self._refuse(
                event, f"{place}: {limit}; maps and lists count, too, and each alias as a copy of its anchor"
            )

    def _at(self, mark: _Mark | None) -> Location:
        return Location(self._file, mark.line + 1, mark.column + 1) if mark else Location(self._file, 1, 1)

    def _note(self, mark: _Mark | None, message: str) -> None:
        self._problems.append(Problem(self._at(mark), escaped_line(message)))

    def _refuse(self, event: yaml.Event, message: str) -> _Refused:
        self._note(event.start_mark, message)
        return _Refused()


def plain_data(value: object) -> Any:
    """Return a copy of a value of a document with lists in place of tuples."""
    if isinstance(value, dict):
        return {key: plain_data(inner) for key, inner in value.items()}
    return [plain_data(inner) for inner in value] if isinstance(value, tuple) else value


class ProblemList:
    """A list of problems in one document; each problem is kept once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._problems: dict[tuple[KeyPath, str], Problem] = {}

    def __bool__(self) -> bool:
        return bool(self._problems)

    def note(self, path: KeyPath, message: str) -> None:
        """Add a problem at the keys `path`."""
        self._problems.setdefault((path, message), self._document.problem(path, message))

    def note_all(self, path: KeyPath, problems: SpecProblems) -> None:
        """Add problems of the part of the document at `path`."""
        for below, message in problems:
            self.note((*path, *below), message)

    def note_elsewhere(self, problem: Problem) -> None:
        """Add a problem in another file."""
        self._problems.setdefault(((problem.location.file,), str(problem)), problem)

    def has_below(self, path: KeyPath) -> bool:
        """Return True if there is a problem at a place below `path`."""
        return any(len(noted) > len(path) and noted[: len(path)] == path for noted, _ in self._problems)

    def error(self) -> InvalidScenario:
        """Return all problems as one error, problems of the document first, in the order of its lines."""
        return InvalidScenario(sorted(self._problems.values(), key=self._place))

    def _place(self, problem: Problem) -> tuple[bool, int, int]:
        where = problem.location
        return where.file != self._document.file, where.line or 0, where.column or 0


class NoSuchKey(Exception):
    """A dotted key that leads nowhere."""


def resolved(data: object, written: str) -> KeyPath:
    """Return the path of keys and indices of a dotted key. Its last steps need not exist yet. Raises NoSuchKey."""
    steps = written.split(".")
    if not all(steps):
        raise NoSuchKey("a key is a path of keys with dots, such as robot.pose.yaw")
    path: KeyPath = ()
    while steps:
        if isinstance(data, dict):
            taken = next((size for size in range(len(steps), 1, -1) if ".".join(steps[:size]) in data), 1)
            step: str | int = ".".join(steps[:taken])
            data, steps = data.get(step), steps[taken:]
        elif isinstance(data, tuple):
            step, taken = _entry(data, steps, path)
            data, steps = data[step], steps[taken:]
        elif data is None:
            step, steps = steps[0], steps[1:]
        else:
            raise NoSuchKey(f"{dotted(path)} is {shown(data)}, and has no key '{steps[0]}'")
        path = (*path, step)
    return path


def placed(data: object, path: KeyPath, value: object) -> tuple[object, list[KeyPath]]:
    """Return a copy of the data with a value at `path`, and the paths that are new in it."""
    new, made = _placed(data, path, value)
    return new, [path[:size] for size in range(len(path) - made, len(path) + 1)]


def _placed(data: object, path: KeyPath, value: object) -> tuple[object, int]:
    """Return a copy of the data with the value, and the number of new steps above it."""
    if not path:
        return value, 0
    step = path[0]
    if isinstance(data, tuple):
        assert isinstance(step, int)
        entry, made = _placed(data[step], path[1:], value)
        return (*data[:step], entry, *data[step + 1 :]), made
    values = data if isinstance(data, dict) else {}
    entry, made = _placed(values.get(step), path[1:], value)
    return {**values, step: entry}, made if step in values or len(path) == 1 else len(path) - 1


def _entry(entries: tuple[object, ...], steps: Sequence[str], path: KeyPath) -> tuple[int, int]:
    """Return the index of a list entry and the number of steps that form its name."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    for size in range(len(steps), 0, -1):
        if (name := ".".join(steps[:size])) in names:
            return names.index(name), size
    return _index(names, steps[0], path), 1


def _index(names: Sequence[object], step: str, path: KeyPath) -> int:
    if step.isdecimal() and step.isascii() and int(step) < len(names):
        return int(step)
    text_names = [name for name in names if isinstance(name, str)]
    numbers = f"one of its {len(names)} entries by number, from 0" if names else "it is empty"
    hint = did_you_mean(step, text_names) if text_names else ""
    raise NoSuchKey(f"{dotted(path)} is a list without '{step}'{hint}; {numbers}")


def dotted(path: KeyPath) -> str:
    """Return a path as a dotted key."""
    return ".".join(map(str, path))
