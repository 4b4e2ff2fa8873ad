"""xacro -> URDF by the package `xacro`, without ROS. A xacro file is code: `expand` runs in a scenario's child only.

xacro is left as it is but for four things, for as long as one expansion lasts:
- `xacro.parse`, which reads what is included: ours keeps to the workspace, and each element's line;
- `open` in the module xacro, with which `load_yaml` reads: ours keeps to the workspace;
- `ament_index_python.packages`, which xacro imports for `$(find package)`: ours asks `Packages`;
- `os.environ` as `xacro.substitution_args` sees it.
The tests expand files that need each of them: a xacro that works otherwise fails there, before it is released.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Final
from xml.dom.minidom import Document
from xml.etree import ElementTree as ET

from sim_action.core.errors import Location
from sim_action.robot.audit.rules import finding, refuse_errors
from sim_action.robot.packages import PackageError, Packages
from sim_action.robot.robot_model import Finding
from sim_action.robot.xacro_documents import XacroDocuments, XacroError, place_of, read_bytes, unknown_argument
from sim_action.robot.xacro_errors import explained
from sim_action.robot.xml_document import ModelDocument, shown_file, shown_place

Argument = str | bool | int | float

_MAX_OUTPUT: Final = 20_000_000
_MAX_CHATTER: Final = 20_000
_MAX_NESTING: Final = 10
# How xacro's lines go on that say where the line before them came from.
_LOCATION_LINES: Final = ("when ", "in file:", "included from:", "instantiated from:")


@dataclass(frozen=True, slots=True)
class Expansion:
    """What became of a xacro file.

    Attributes:
        text: the URDF.
        places: where each of its elements was written, in the order in which they begin.
        notes: what xacro warned of, one line each.
    """

    text: str
    places: tuple[Location, ...]
    notes: tuple[str, ...]


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
    warnings = [finding("xacro-warning", note, Location(shown_file(path))) for note in expansion.notes]
    return ModelDocument(root, places), warnings


def expand(path: Path, arguments: Mapping[str, Argument], packages: Packages) -> Expansion:
    """Evaluates a xacro file with the environment of `packages`. Raises XacroError."""
    return _Expander(path, _Arguments(arguments), packages).expansion()


class _Arguments(dict[str, str]):
    """The arguments as xacro has them, as text; it adds the defaults of those that nobody gave."""

    def __init__(self, given: Mapping[str, Argument]) -> None:
        super().__init__({name: _as_text(value) for name, value in given.items()})
        self.unused = set(given)

    def __getitem__(self, name: str) -> str:
        self.unused.discard(name)
        return super().__getitem__(name)


def _as_text(value: Argument) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


class _Expander:
    """One file while it is expanded."""

    def __init__(self, path: Path, arguments: _Arguments, packages: Packages) -> None:
        # Not before it is needed: this is the scenario's child, and most scenarios have no xacro.
        import xacro
        import xacro.substitution_args

        self._xacro: Any = xacro
        self._path = path
        self._arguments = arguments
        self._packages = packages
        self._documents = XacroDocuments()
        self._warnings: dict[str, None] = {}

    def expansion(self) -> Expansion:
        chatter = _Bounded(_MAX_CHATTER)
        with self._standing_in(), redirect_stdout(chatter), redirect_stderr(chatter):
            try:
                document = self._processed()
                self._check_arguments()
                text = _written(document, self._path)
            except (Exception, SystemExit) as error:  # noqa: BLE001 - expressions raise anything
                raise explained(error, self._path) from None
        elements = document.getElementsByTagName("*")
        places = tuple(place_of(element) or Location(str(self._path)) for element in elements)
        return Expansion(text, places, (*self._warnings, *_as_notes(chatter.getvalue())))

    def _processed(self) -> Document:
        self._xacro.init_stacks(str(self._path))
        document = self._documents.read(self._path)
        self._xacro.process_doc(document, mappings=self._arguments)
        return document

    def _check_arguments(self) -> None:
        if unknown := sorted(self._arguments.unused - self._documents.declared):
            raise unknown_argument(unknown[0], self._documents.declared, self._path)

    # --- what stands in for xacro's own ---

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
        if found.warning:
            self._warnings[found.warning] = None
        return str(found.path)

    def _parse(self, _text: None, filename: str) -> Document:
        """As xacro's: a file that is not there is off the stack of files when this raises."""
        stack: list[str] = self._xacro.filestack
        if stack.count(filename) > _MAX_NESTING:
            circle = " -> ".join(Path(name).name for name in _circle(stack))
            raise self._xacro.XacroException(f"files include each other without end: {circle}")
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
            raise XacroError("bad-xacro", "not UTF-8 text; save the file as UTF-8", Location(filename)) from None

    def _admitted(self, filename: str, *, included_by: Path) -> Path:
        """Raises OSError for what is not there, so that an include may be optional."""
        stated = filename.removeprefix(f"{included_by.parent}/")
        if "://" in stated:
            raise self._xacro.XacroException(f"'{stated}': in xacro, a package's file is $(find name)/path/of/the/file")
        try:
            return self._packages.file(Path(filename), stated)
        except PackageError as error:
            if error.rule == "missing-file":
                raise FileNotFoundError(str(error)) from None
            raise

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
    """Keeps the beginning of what is written."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.left = size

    def write(self, text: str) -> int:
        super().write(text[: max(self.left, 0)])
        self.left -= len(text)
        return len(text)


def _written(document: Document, path: Path) -> str:
    root = document.documentElement
    assert root is not None  # xacro changes what is in it, and never removes it
    file = _Bounded(_MAX_OUTPUT)
    root.writexml(file, "", "  ", "\n")
    if file.left < 0:
        raise XacroError("bad-xacro", f"expands to more than {_MAX_OUTPUT // 1_000_000} MB", Location(str(path)))
    return file.getvalue()


def _circle(stack: list[str]) -> list[str]:
    """From one time that a file is included to the next."""
    before = len(stack) - 2 - stack[-2::-1].index(stack[-1])
    return stack[before:]


def _as_notes(chatter: str) -> list[str]:
    notes: list[str] = []
    for line in filter(None, map(str.strip, chatter.splitlines())):
        if notes and line.startswith(_LOCATION_LINES):
            notes[-1] += f", {line}"
        else:
            notes.append(line.removeprefix("warning: "))
    return list(dict.fromkeys(notes))
