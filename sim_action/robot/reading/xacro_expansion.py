"""Expand xacro to URDF with the package `xacro`, without ROS.

A xacro file is code: `expand` runs only in the child process of a scenario. During an expansion, four parts of xacro
are replaced:
- `xacro.parse`, which reads included files: our version stays in the workspace and records the line of each element;
- `open` in the module xacro, which `load_yaml` uses: our version stays in the workspace;
- `ament_index_python.packages`, which xacro imports for `$(find package)`: our version asks `Packages`;
- `os.environ` in `xacro.substitution_args`.
The tests need each of them, so they fail if a new version of xacro works differently.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Final
from xml.dom.minidom import Document
from xml.etree import ElementTree as ET

from sim_action.core.errors import Location
from sim_action.core.records import dataclass
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.references import Note
from sim_action.robot.documents.xml_document import ModelDocument, shown_file, shown_place
from sim_action.robot.model.findings import finding, refuse_errors
from sim_action.robot.model.robot_model import Finding
from sim_action.robot.reading.xacro_documents import UnknownArgument, XacroDocuments, XacroError, place_of, read_bytes
from sim_action.robot.reading.xacro_errors import explain_xacro_error

Argument = str | bool | int | float

_MAX_OUTPUT_CHARS: Final = 20_000_000
_MAX_WARNINGS_CHARS: Final = 20_000
_MAX_NESTING: Final = 10
# Beginnings of lines in which xacro prints the place of the warning in the line before.
_LOCATION_LINES: Final = ("when ", "in file:", "included from:", "instantiated from:")


@dataclass(frozen=True, slots=True)
class Expansion:
    """The result of expanding a xacro file.

    Attributes:
        text: the URDF.
        places: the place of each of its elements, in document order.
        notes: the warnings of xacro, one line each.
        package_notes: how packages were found, if that is not plain.
    """

    text: str
    places: tuple[Location, ...]
    notes: tuple[str, ...]
    package_notes: tuple[Note, ...] = ()


def read_xacro(
    path: Path, arguments: Mapping[str, Argument], packages: Packages
) -> tuple[ModelDocument, list[Finding]]:
    """Evaluate a xacro file, which runs the expressions in it. Return the URDF and xacro's warnings. Raises ModelError.

    The elements of the document know their places in the .xacro files.
    """
    try:
        expansion = expand(path, arguments, packages)
    except XacroError as error:
        refuse_errors([error.finding()])
        raise
    root = ET.fromstring(expansion.text)  # noqa: S314 - written by xacro from documents without a DOCTYPE
    places = {element: shown_place(place) for element, place in zip(root.iter(), expansion.places, strict=True)}
    place = Location(shown_file(path))
    warnings = [finding("xacro-warning", note, place) for note in expansion.notes]
    found = [finding(note.rule, note.text, place) for note in expansion.package_notes]
    return ModelDocument(root, places), [*warnings, *found]


def expand(path: Path, arguments: Mapping[str, Argument], packages: Packages) -> Expansion:
    """Evaluate a xacro file with the environment of `packages`. Raises XacroError."""
    return _Expander(path, _Arguments(arguments), packages).expansion()


class _Arguments(dict[str, str]):
    """The arguments as text, as xacro needs them; xacro adds the defaults of missing arguments."""

    def __init__(self, given: Mapping[str, Argument]) -> None:
        super().__init__({name: _as_text(value) for name, value in given.items()})
        self.unused = set(given)

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
                document = self._processed()
                self._check_arguments()
                text = _written(document, self._path)
            except UnknownArgument:
                raise
            except (Exception, SystemExit) as error:  # noqa: BLE001 - expressions raise anything
                raise explain_xacro_error(error, self._path) from None
        elements = document.getElementsByTagName("*")
        places = tuple(place_of(element) or Location(str(self._path)) for element in elements)
        return Expansion(text, places, tuple(_warnings(printed.getvalue())), tuple(self._package_notes))

    def _processed(self) -> Document:
        self._xacro.init_stacks(str(self._path))
        document = self._documents.read(self._path)
        self._xacro.process_doc(document, mappings=self._arguments)
        return document

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
        found = self._packages.find(name, self._current_file())
        self._package_notes.update(dict.fromkeys(found.notes))
        return str(found.path)

    def _parse(self, _text: None, filename: str) -> Document:
        """Parse an included file, as xacro.parse does: a missing file is removed from the stack of files."""
        stack: list[str] = self._xacro.filestack
        if stack.count(filename) > _MAX_NESTING:
            circle = " -> ".join(Path(name).name for name in _circle(stack))
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
            found = self._packages.included(Path(filename), stated)
        except PackageError as error:
            if error.rule == "missing-file":
                raise FileNotFoundError(str(error)) from None
            raise
        self._package_notes.update(dict.fromkeys(found.notes))
        return found.path

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


def _circle(stack: list[str]) -> list[str]:
    before = len(stack) - 2 - stack[-2::-1].index(stack[-1])
    return stack[before:]


def _warnings(printed: str) -> list[str]:
    notes: list[str] = []
    for line in filter(None, map(str.strip, printed.splitlines())):
        if notes and line.startswith(_LOCATION_LINES):
            notes[-1] += f", {line}"
        else:
            notes.append(line.removeprefix("warning: "))
    return list(dict.fromkeys(notes))
