"""Read xacro files into the DOM that xacro works on, with the file and line of each element.

xacro copies and moves elements. The place is user data of DOM Level 3, so a handler can pass it to each copy.

A file is also checked without running it: included files exist, are well-formed, and declare the arguments. A xacro
file is code, and `validate` runs no code: conditions, macros and expressions are not evaluated. An include is followed
if its name is plain text, or starts with `$(find package)`.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Final
from xml.dom.expatbuilder import ExpatBuilderNS
from xml.dom.minidom import Document, Element, Node
from xml.parsers import expat

from sim_action.core.errors import Location
from sim_action.core.files import read_at_most
from sim_action.core.wording import did_you_mean
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.xml_document import explain_xml_error, shown_file, shown_place
from sim_action.robot.model.findings import Finding, finding, refuse_errors

_MAX_BYTES: Final = 5_000_000
_MAX_DEPTH: Final = 100
_MAX_FILES: Final = 1_000
_MAX_COPIES: Final = 200_000
_KEY: Final = "place"
# As $(arg NAME) or, in an expression, as xacro.arg('NAME').
_USED_ARGUMENT: Final = re.compile(r"""\$\(arg\s+([^\s()]+)\s*\)|\bxacro\.arg\(\s*['"]([^'"]+)['"]""")


class XacroError(Exception):
    """A problem in a xacro file, with its place; `rule`: one of the audit."""

    def __init__(self, rule: str, message: str, location: Location) -> None:
        self.rule = rule
        self.message = message
        self.location = location
        super().__init__(f"{location}: {message}")

    def finding(self) -> Finding:
        """Return the error as a finding of the audit."""
        return finding(self.rule, self.message, shown_place(self.location))


class UnknownArgument(XacroError):
    """A name in `robot.args` that no file declares or uses; `argument`: that name."""

    def __init__(self, argument: str, declared: set[str], path: Path) -> None:
        self.argument = argument
        message = f"robot.args: no <xacro:arg> has the name '{argument}'{did_you_mean(argument, declared)}"
        super().__init__("unknown-argument", message, Location(str(path)))


def place_of(node: object) -> Location | None:
    """Return the place of a node, or of its nearest parent with a place."""
    while isinstance(node, Node):
        place = node.getUserData(_KEY)
        if isinstance(place, Location):
            return place
        node = node.parentNode
    return None


class XacroDocuments:
    """Reads the files of one expansion. Bounds their number, and the number of elements that macros create."""

    def __init__(self) -> None:
        self.declared: set[str] = set()
        """The names of all arguments that are declared or used, also in parts that were not evaluated."""
        self._files = 0
        self._copies = 0

    def read(self, path: Path) -> Document:
        """Parse a file. Raises XacroError for its content, and OSError if it cannot be read."""
        where = Location(str(path))
        self._files += 1
        if self._files > _MAX_FILES:
            raise XacroError("bad-xacro", f"more than {_MAX_FILES} files are included", where)
        data = read_bytes(path)
        try:
            document = _Builder(path, self).parseString(data)
        except expat.ExpatError as error:
            raise XacroError("bad-xml", explain_xml_error(error, data), Location(str(path), error.lineno)) from None
        except (LookupError, ValueError) as error:  # an encoding that Python does not know
            raise XacroError("bad-xml", f"{error}; save the file as UTF-8", Location(str(path), 1)) from None
        arguments = document.getElementsByTagName("xacro:arg")
        self.declared.update(argument.getAttribute("name") for argument in arguments)
        self.declared.update(match[1] or match[2] for match in _USED_ARGUMENT.finditer(data.decode(errors="replace")))
        return document

    def handle(self, _operation: int, key: str, data: Location, _source: Node, copy: Node | None) -> None:
        """Copy the place to a copied element; DOM calls this method."""
        self._copies += 1
        if self._copies > _MAX_COPIES:
            raise XacroError("bad-xacro", f"macros create more than {_MAX_COPIES:,} elements", data)
        if copy is not None:
            copy.setUserData(key, data, self)


def read_bytes(path: Path) -> bytes:
    """Return the content of a file. Raises OSError, and XacroError if it is too large."""
    if (data := read_at_most(path, _MAX_BYTES)) is None:
        raise XacroError(
            "bad-xacro", f"the file is too large: at most {_MAX_BYTES // 1_000_000} MB are allowed", Location(str(path))
        )
    return data


class _Builder(ExpatBuilderNS):
    """The parser of minidom, which xacro uses, extended by places and a limit on depth."""

    def __init__(self, path: Path, documents: XacroDocuments) -> None:
        super().__init__()
        self._path = path
        self._documents = documents
        self._depth = 0

    def start_element_handler(self, name: str, attributes: list[str]) -> None:
        super().start_element_handler(name, attributes)
        place = self._place()
        self.curNode.setUserData(_KEY, place, self._documents)
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise XacroError("bad-xml", f"more than {_MAX_DEPTH} elements inside each other", place)

    def end_element_handler(self, name: str) -> None:
        super().end_element_handler(name)
        self._depth -= 1

    def start_doctype_decl_handler(self, *_: object) -> None:
        raise XacroError("bad-xml", "a DOCTYPE is not allowed in a model", self._place())

    def _place(self) -> Location:
        return Location(str(self._path), self.getParser().CurrentLineNumber)


_FIND: Final = re.compile(r"(?<!\$)\$\(find\s+([^\s()$]+)\s*\)")
_WILDCARDS: Final = frozenset("*?[")
_MAYBE: Final = frozenset({"xacro:if", "xacro:unless", "xacro:macro"})


def check_xacro_text(path: Path, arguments: Iterable[str], packages: Packages) -> tuple[str, ...]:
    """Check a xacro file without evaluating it. Return what could not be checked. Raises ModelError."""
    check = XacroCheck(path, arguments, packages)
    refuse_errors([problem.finding() for problem in check.problems])
    return tuple(check.notes)


class XacroCheck:
    """The problems of a xacro file and its includes, and notes on parts that were not checked."""

    def __init__(self, path: Path, arguments: Iterable[str], packages: Packages) -> None:
        """`arguments`: the names in `robot.args`."""
        self.problems: list[XacroError] = []
        self.notes: list[str] = []
        self._all_followed = True
        self._path, self._packages, self._documents = path, packages, XacroDocuments()
        self._seen, self._waiting = {path}, deque([path])
        while self._waiting:
            file = self._waiting.popleft()
            try:
                document = self._documents.read(file)
            except XacroError as error:
                self.problems.append(error)
            except OSError as error:
                self.problems.append(
                    XacroError("missing-include", f"the file cannot be read: {error}", Location(str(file)))
                )
            else:
                for element in document.getElementsByTagName("xacro:include"):
                    self._include(element, file)
        files = "1 file" if len(self._seen) == 1 else f"{len(self._seen)} files"
        evaluated = f"xacro evaluates {shown_file(self._path)} when the scenario runs"
        self.notes.append(f"links and joints: {evaluated} ({files} checked as text)")
        self._check_arguments(arguments)

    def _check_arguments(self, arguments: Iterable[str]) -> None:
        """Report unknown arguments, if all files were read: any other file may declare them."""
        if self.problems or not self._all_followed:
            return
        declared = self._documents.declared
        self.problems += [UnknownArgument(name, declared, self._path) for name in sorted({*arguments} - declared)]

    def _include(self, element: Element, path: Path) -> None:
        stated = element.getAttribute("filename")
        place = place_of(element) or Location(str(path))
        try:
            name = _FIND.sub(lambda match: self._package_folder(match[1], place), stated)
            if "$" in name or _WILDCARDS & set(name):
                self._pass_over(f"{shown_place(place)}: include '{stated}': its name is not known before the run")
                return
            file = self._packages.included(path.parent / name, stated)
            self.notes += [f"{shown_place(place)}: {note.text}" for note in file.notes]
            target = file.path
        except PackageError as error:
            self._absent(element, XacroError(_rule(error), str(error), place))
            return
        if target not in self._seen:
            self._seen.add(target)
            self._waiting.append(target)

    def _package_folder(self, name: str, place: Location) -> str:
        package = self._packages.find(name, Path(place.file))
        self.notes += [f"{shown_place(place)}: {note.text}" for note in package.notes]
        return str(package.path)

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
