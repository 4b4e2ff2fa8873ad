"""Check a xacro file without running it: included files exist, are well-formed, and declare the arguments.

A xacro file is code, and `validate` runs no code: conditions, macros and expressions are not evaluated. An include is
followed if its name is plain text, or starts with `$(find package)`.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Final
from xml.dom.minidom import Element, Node

from sim_action.core.errors import Location
from sim_action.core.records import dataclass
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.xml_document import shown_file, shown_place
from sim_action.robot.model.findings import refuse_errors
from sim_action.robot.reading.xacro_documents import UnknownArgument, XacroDocuments, XacroError, place_of

_FIND: Final = re.compile(r"(?<!\$)\$\(find\s+([^\s()$]+)\s*\)")
_WILDCARDS: Final = frozenset("*?[")
_MAYBE: Final = frozenset({"xacro:if", "xacro:unless", "xacro:macro"})


@dataclass(frozen=True, slots=True)
class XacroCheck:
    """The problems of a xacro file, and notes on parts that were not checked."""

    problems: tuple[XacroError, ...]
    notes: tuple[str, ...]


def check_xacro_text(path: Path, arguments: Iterable[str], packages: Packages) -> tuple[str, ...]:
    """Check a xacro file without evaluating it. Return what could not be checked. Raises ModelError."""
    check = check_xacro(path, arguments, packages)
    refuse_errors([problem.finding() for problem in check.problems])
    return check.notes


def check_xacro(path: Path, arguments: Iterable[str], packages: Packages) -> XacroCheck:
    """Check a xacro file and its includes.

    :param arguments: the names in `robot.args`.
    """
    checker = _Checker(path, packages)
    checker.follow_all()
    checker.check_arguments(arguments)
    return XacroCheck(tuple(checker.problems), tuple(checker.notes))


class _Checker:
    def __init__(self, path: Path, packages: Packages) -> None:
        self.problems: list[XacroError] = []
        self.notes: list[str] = []
        self._all_followed = True
        self._path = path
        self._packages = packages
        self._documents = XacroDocuments()
        self._seen = {path}
        self._waiting = deque([path])

    def follow_all(self) -> None:
        while self._waiting:
            self._read(self._waiting.popleft())
        files = "1 file" if len(self._seen) == 1 else f"{len(self._seen)} files"
        evaluated = f"xacro evaluates {shown_file(self._path)} when the scenario runs"
        self.notes.append(f"links and joints: {evaluated} ({files} checked as text)")

    def check_arguments(self, arguments: Iterable[str]) -> None:
        """Report unknown arguments, if all files were read: any other file may declare them."""
        if self.problems or not self._all_followed:
            return
        declared = self._documents.declared
        self.problems += [UnknownArgument(name, declared, self._path) for name in sorted({*arguments} - declared)]

    def _read(self, path: Path) -> None:
        try:
            document = self._documents.read(path)
        except XacroError as error:
            self.problems.append(error)
        except OSError as error:
            self.problems.append(
                XacroError("missing-include", f"the file cannot be read: {error}", Location(str(path)))
            )
        else:
            for element in document.getElementsByTagName("xacro:include"):
                self._include(element, path)

    def _include(self, element: Element, path: Path) -> None:
        stated = element.getAttribute("filename")
        place = place_of(element) or Location(str(path))
        try:
            name = _FIND.sub(lambda found: self._package_folder(found[1], place), stated)
            if "$" in name or _WILDCARDS & set(name):
                self._pass_over(f"{shown_place(place)}: include '{stated}': its name is not known before the run")
                return
            found = self._packages.included(path.parent / name, stated)
            self.notes += [f"{shown_place(place)}: {note.text}" for note in found.notes]
            target = found.path
        except PackageError as error:
            self._absent(element, XacroError(_rule(error), str(error), place))
            return
        if target not in self._seen:
            self._seen.add(target)
            self._waiting.append(target)

    def _package_folder(self, name: str, place: Location) -> str:
        found = self._packages.find(name, Path(place.file))
        self.notes += [f"{shown_place(place)}: {note.text}" for note in found.notes]
        return str(found.path)

    def _pass_over(self, note: str) -> None:
        self._all_followed = False
        self.notes.append(note)

    def _absent(self, element: Element, error: XacroError) -> None:
        """Report a missing include; only as a note if it is optional or conditional."""
        if element.hasAttribute("optional") or _is_conditional(element):
            self._pass_over(
                f"{shown_place(error.location)}: {error.message}; this matters only if the file is included"
            )
        else:
            self.problems.append(error)


def _rule(error: PackageError) -> str:
    return "missing-include" if error.rule == "missing-file" else error.rule


def _is_conditional(element: Element) -> bool:
    around: Node | None = element.parentNode
    while isinstance(around, Element):
        if around.tagName in _MAYBE:
            return True
        around = around.parentNode
    return False
