"""Expand xacro to URDF with the package `xacro`, without ROS.

A xacro file is code: `expand` runs only in the child process of a scenario. During an expansion, four parts of xacro
are replaced:
- `xacro.parse`, which reads included files: our version stays in the workspace and records the line of each element;
- `open` in the module xacro, which `load_yaml` uses: our version stays in the workspace;
- `ament_index_python.packages`, which xacro imports for `$(find package)`: our version asks `Packages`;
- `os.environ` in `xacro.substitution_args`.
The tests need each of them, so they fail if a new version of xacro works differently.

xacro's exceptions have no place. The stack frames of xacro have one: they hold the current element as `node` or `elt`.
If a later version of xacro renames these variables, the message stays and the line is lost.
"""

from __future__ import annotations

import difflib
import io
import os
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from itertools import islice
from pathlib import Path
from types import FrameType, ModuleType, SimpleNamespace
from typing import Any, Final
from xml.dom.minidom import Document, Element, Node
from xml.etree import ElementTree as ET

from sim_action.core.errors import Location
from sim_action.core.records import dataclass
from sim_action.robot.documents.packages import Note, PackageError, Packages
from sim_action.robot.documents.xml_document import ModelDocument, shown_file, shown_place
from sim_action.robot.model.findings import Finding, finding, refuse_errors
from sim_action.robot.reading.xacro_documents import UnknownArgument, XacroDocuments, XacroError, place_of, read_bytes

Argument = str | bool | int | float
_MAX_OUTPUT_CHARS: Final = 20_000_000
_MAX_WARNINGS_CHARS: Final = 20_000
_MAX_NESTING: Final = 10
# Beginnings of lines in which xacro prints the place of the warning in the line before.
_LOCATION_LINES: Final = ("when ", "in file:", "included from:", "instantiated from:")


@dataclass(frozen=True, slots=True)
class Expansion:
    """The result of expanding a xacro file."""

    text: str  # the URDF
    places: tuple[Location, ...]  # the place of each of its elements, in document order
    notes: tuple[str, ...]  # the warnings of xacro, one line each
    package_notes: tuple[Note, ...] = ()  # how packages were found, if that is not plain


def read_xacro(
    path: Path, arguments: Mapping[str, Argument], packages: Packages
) -> tuple[ModelDocument, list[Finding]]:
    """Evaluate a xacro file. Return the URDF, with places in the .xacro files, and warnings. Raises ModelError."""
    try:
        expansion = expand(path, arguments, packages)
    except XacroError as error:
        refuse_errors([error.finding()])
        raise
    root = ET.fromstring(expansion.text)  # noqa: S314 - written by xacro from documents without a DOCTYPE
    places = {element: shown_place(place) for element, place in zip(root.iter(), expansion.places, strict=True)}
    place = Location(shown_file(path))
    warnings = [finding("xacro-warning", note, place) for note in expansion.notes]
    package_warnings = [finding(note.rule, note.text, place) for note in expansion.package_notes]
    return ModelDocument(root, places), [*warnings, *package_warnings]


def expand(path: Path, arguments: Mapping[str, Argument], packages: Packages) -> Expansion:
    """Evaluate a xacro file with the environment of `packages`. Raises XacroError."""
    return _Expander(path, _Arguments(arguments), packages).expansion()


class _Arguments(dict[str, str]):
    """The arguments as text, as xacro needs them; xacro adds the defaults of missing arguments."""

    def __init__(self, arguments: Mapping[str, Argument]) -> None:
        super().__init__({name: _as_text(value) for name, value in arguments.items()})
        self.unused = set(arguments)

    def __getitem__(self, name: str) -> str:
        self.unused.discard(name)
        return super().__getitem__(name)


def _as_text(value: Argument) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


class _Expander:
    """The expansion of one file."""

    def __init__(self, path: Path, arguments: _Arguments, packages: Packages) -> None:
        # Imported here because most scenarios have no xacro.
        import xacro
        import xacro.substitution_args

        self._xacro: Any = xacro
        self._path = path
        self._arguments = arguments
        self._packages = packages
        self._documents = XacroDocuments()
        self._package_notes: dict[Note, None] = {}

    def expansion(self) -> Expansion:
        printed = _Bounded(_MAX_WARNINGS_CHARS)
        with self._standing_in(), redirect_stdout(printed), redirect_stderr(printed):
            try:
                self._xacro.init_stacks(str(self._path))
                document = self._documents.read(self._path)
                self._xacro.process_doc(document, mappings=self._arguments)
                self._check_arguments()
                text = _written(document, self._path)
            except UnknownArgument:
                raise
            except (Exception, SystemExit) as error:  # noqa: BLE001 - expressions raise anything
                raise explain_xacro_error(error, self._path) from None
        elements = document.getElementsByTagName("*")
        places = tuple(place_of(element) or Location(str(self._path)) for element in elements)
        return Expansion(text, places, tuple(_warnings(printed.getvalue())), tuple(self._package_notes))

    def _check_arguments(self) -> None:
        if unknown := sorted(self._arguments.unused - self._documents.declared):
            raise UnknownArgument(unknown[0], self._documents.declared, self._path)

    # --- replacements for parts of xacro ---

    @contextmanager
    def _standing_in(self) -> Iterator[None]:
        substitutions = self._xacro.substitution_args
        environment = SimpleNamespace(**{**vars(os), "environ": self._packages.environment})
        ament: Any = ModuleType("ament_index_python.packages")
        ament.get_package_share_directory = self._package_folder
        with ExitStack() as stack:
            stack.enter_context(_replaced(vars(self._xacro), "parse", self._parse))
            stack.enter_context(_replaced(vars(self._xacro), "open", self._open))
            stack.enter_context(_replaced(vars(substitutions), "os", environment))
            stack.enter_context(_replaced(sys.modules, ament.__name__, ament))
            yield

    def _package_folder(self, name: str) -> str:
        package = self._packages.find(name, self._current_file())
        self._package_notes.update(dict.fromkeys(package.notes))
        return str(package.path)

    def _parse(self, _text: None, filename: str) -> Document:
        """Parse an included file, as xacro.parse does: a missing file is removed from the stack of files."""
        stack: list[str] = self._xacro.filestack
        if stack.count(filename) > _MAX_NESTING:
            before = len(stack) - 2 - stack[-2::-1].index(stack[-1])
            circle = " -> ".join(Path(name).name for name in stack[before:])
            raise self._xacro.XacroException(f"files include each other in a loop: {circle}")
        try:
            return self._documents.read(self._admitted(filename, included_by=Path(stack[-2])))
        except OSError as error:
            stack.pop()
            raise self._xacro.XacroException(exc=error) from None

    def _open(self, filename: str) -> io.StringIO:
        path = self._admitted(filename, included_by=self._current_file())
        try:
            return io.StringIO(read_bytes(path).decode("utf-8-sig"))
        except UnicodeDecodeError:
            raise XacroError("bad-xacro", "the file is not UTF-8 text; save it as UTF-8", Location(filename)) from None

    def _admitted(self, filename: str, *, included_by: Path) -> Path:
        """Return the path of a file that may be read. Raises OSError if it is missing: an include may be optional."""
        stated = filename.removeprefix(f"{included_by.parent}/")
        if "://" in stated:
            raise self._xacro.XacroException(
                f"'{stated}': in xacro, write $(find name)/path/of/the/file for a file of a package"
            )
        try:
            file = self._packages.included(Path(filename), stated)
        except PackageError as error:
            if error.rule == "missing-file":
                raise FileNotFoundError(str(error)) from None
            raise
        self._package_notes.update(dict.fromkeys(file.notes))
        return file.path

    def _current_file(self) -> Path:
        return Path(self._xacro.filestack[-1])


@contextmanager
def _replaced(names: dict[str, Any], name: str, value: object) -> Iterator[None]:
    absent = object()
    before = names.get(name, absent)
    names[name] = value
    try:
        yield
    finally:
        if before is absent:
            del names[name]
        else:
            names[name] = before


class _Bounded(io.StringIO):
    """A text buffer that keeps the first `size` characters."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.left = size

    def write(self, text: str) -> int:
        super().write(text[: max(self.left, 0)])
        self.left -= len(text)
        return len(text)


def _written(document: Document, path: Path) -> str:
    root = document.documentElement
    assert root is not None  # xacro changes the root element, but never removes it
    file = _Bounded(_MAX_OUTPUT_CHARS)
    root.writexml(file, "", "  ", "\n")
    if file.left < 0:
        raise XacroError(
            "bad-xacro", f"the file expands to more than {_MAX_OUTPUT_CHARS // 1_000_000} MB", Location(str(path))
        )
    return file.getvalue()


def _warnings(printed: str) -> list[str]:
    notes: list[str] = []
    for line in filter(None, map(str.strip, printed.splitlines())):
        if notes and line.startswith(_LOCATION_LINES):
            notes[-1] += f", {line}"
        else:
            notes.append(line.removeprefix("warning: "))
    return list(dict.fromkeys(notes))


_STEPS_SHOWN: Final = 4
_LIKENESS: Final = 0.8  # all names of `math` are candidates: with a lower value, 'foo' would match 'floor'
_UNDEFINED_ARGUMENT: Final = "ArgException"
_UNKNOWN_MACRO: Final = "unknown macro name: xacro:"
_IN_PLAIN_WORDS: Final = ("XacroException", "RuntimeError", "SubstitutionException")


def explain_xacro_error(error: BaseException, path: Path) -> XacroError:
    """Return an error with a message, a rule and a place. `path`: the file that xacro was expanding."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    of_xacro = (frame for frame in frames if str(frame.f_globals.get("__name__")).startswith("xacro"))
    trail = [step for frame in of_xacro if (step := _step(frame))]
    cause = _cause(error)
    place = cause.location if isinstance(cause, XacroError) else trail[-1].place if trail else Location(str(path))
    message = " ".join(_Explanation(error, cause, trail).message().split())
    return XacroError(_rule(cause), message + _way(trail, place), place)


@dataclass(frozen=True, slots=True)
class _Step:
    """A stack frame of xacro that was working on an element."""

    frame: FrameType
    node: Node
    place: Location


def _step(frame: FrameType) -> _Step | None:
    node = frame.f_locals.get("node", frame.f_locals.get("elt"))
    place = place_of(node)
    return _Step(frame, node, place) if isinstance(node, Node) and place else None


def _cause(error: BaseException) -> BaseException:
    while isinstance(inner := getattr(error, "exc", None), Exception):
        error = inner
    return error


def _way(trail: list[_Step], end: Location) -> str:
    """Return a text such as ", in macro 'wheel' called at robot.xacro:12, included at robot.urdf.xacro:3"."""
    # The place of the error itself is already known. Recursive macros repeat the same steps.
    outer = trail[:-1] if trail and trail[-1].place == end else trail
    said = list(dict.fromkeys(filter(None, map(_said, reversed(outer)))))
    more = len(said) - _STEPS_SHOWN
    return "".join(f", {step}" for step in said[:_STEPS_SHOWN]) + (f", and {more} more" if more > 0 else "")


def _said(step: _Step) -> str:
    match step.frame.f_code.co_name, step.node:
        case "handle_macro_call", Element(tagName=tag):
            return f"in macro '{tag.removeprefix('xacro:')}' called at {shown_place(step.place)}"
        case "process_include", _:
            return f"included at {shown_place(step.place)}"
    return ""


def _rule(cause: BaseException) -> str:
    match cause:
        case XacroError() | PackageError():
            return cause.rule
        case OSError():
            return "missing-include"
    return "unknown-argument" if type(cause).__name__ == _UNDEFINED_ARGUMENT else "bad-xacro"


@dataclass(frozen=True, slots=True)
class _Explanation:
    """One error, with all that its message is made from."""

    error: BaseException
    cause: BaseException
    trail: list[_Step]

    def message(self) -> str:
        """Return the message: the cause and the next step."""
        match self.cause:
            case XacroError(message=message):
                return message
            case PackageError() | OSError():
                return str(self.cause)
            case NameError(name=str(name)):
                return f"property '{name}' is not defined{self._near(name, 'symbols')}{self._expression()}"
            case RecursionError():
                return "macros call each other without end, or too deeply; end a recursive macro with an <xacro:if>"
            case MemoryError():
                return "out of memory: the macros create too many elements"
        return self._of_xacro()

    def _of_xacro(self) -> str:
        """Return xacro's own message if it is written for users, else Python's message with the type of the error."""
        cause = self.cause
        text, kind = cause.msg if isinstance(cause, SyntaxError) else str(cause), type(cause).__name__
        if text.startswith(_UNKNOWN_MACRO):
            name = text.removeprefix(_UNKNOWN_MACRO)
            return f"unknown macro '{name}'{self._near(name, 'macros')}; check that its file is included"
        if kind == _UNDEFINED_ARGUMENT:
            return _undefined_argument(text)
        called = "".join(f"macro '{macro.body.getAttribute('name')}': " for macro in getattr(self.error, "macros", ()))
        return f"{called}{text if kind in _IN_PLAIN_WORDS else f'{kind}: {text}'}{self._expression()}"

    def _expression(self) -> str:
        suffix = getattr(self.error, "suffix", None)
        return f", {suffix.strip()}" if isinstance(suffix, str) else ""

    def _near(self, name: str, table: str) -> str:
        """Return a hint with the nearest name in scope."""
        if not self.trail:
            return ""
        names = list(islice(_names(self.trail[-1].frame.f_locals.get(table)), 10_000))
        near = difflib.get_close_matches(name, names, n=1, cutoff=_LIKENESS)
        return f"; did you mean '{near[0]}'?" if near else ""


def _names(table: object) -> Iterator[str]:
    while isinstance(table, dict):
        yield from (str(name).lstrip("*") for name in table)
        table = getattr(table, "parent", None)


def _undefined_argument(name: str) -> str:
    declaration = f'<xacro:arg name="{name}" default="..."/>'
    remedy = f"set it in robot.args, or for inspect by --arg {name}=VALUE"
    return f"argument '{name}' has no value: {remedy}, or declare it before its use with {declaration}"
