"""Read xacro files into the DOM that xacro works on, with the file and line of each element.

xacro copies and moves elements. The place is user data of DOM Level 3, so a handler can pass it to each copy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.dom.expatbuilder import ExpatBuilderNS
from xml.dom.minidom import Document, Node
from xml.parsers import expat

from sim_action.core.errors import Location
from sim_action.core.files import read_at_most
from sim_action.core.wording import did_you_mean
from sim_action.robot.documents.xml_document import explain_xml_error, shown_place
from sim_action.robot.model.findings import finding
from sim_action.robot.model.robot_model import Finding

_MAX_BYTES: Final = 5_000_000
_MAX_DEPTH: Final = 100
_MAX_FILES: Final = 1_000
_MAX_COPIES: Final = 200_000
_KEY: Final = "place"


class XacroError(Exception):
    """A problem in a xacro file, with its place.

    `rule` is bad-xml, bad-xacro, unknown-argument, missing-include, or a rule of PackageError.
    """

    def __init__(self, rule: str, message: str, location: Location) -> None:
        self.rule = rule
        self.message = message
        self.location = location
        super().__init__(f"{location}: {message}")

    def finding(self) -> Finding:
        """Return the error as a finding of the audit."""
        return finding(self.rule, self.message, shown_place(self.location))


class UnknownArgument(XacroError):
    """A name in `robot.args` that no file declares; `argument`: that name."""

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
        """The names of all <xacro:arg>, also in parts that were not evaluated."""
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
        place = self._here()
        self.curNode.setUserData(_KEY, place, self._documents)
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise XacroError("bad-xml", f"more than {_MAX_DEPTH} elements inside each other", place)

    def end_element_handler(self, name: str) -> None:
        super().end_element_handler(name)
        self._depth -= 1

    def start_doctype_decl_handler(self, *_: object) -> None:
        raise XacroError("bad-xml", "a DOCTYPE is not allowed in a model", self._here())

    def _here(self) -> Location:
        return Location(str(self._path), self.getParser().CurrentLineNumber)
