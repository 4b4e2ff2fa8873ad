"""Parse the XML of COLLADA files, with line numbers, and look up identifiers, attributes and numbers."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element
from xml.parsers import expat

from sim_action.core.wording import shown
from sim_action.meshes.mesh import MeshError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


_MAX_ELEMENT_DEPTH: Final = 200
_MAX_ELEMENTS: Final = 200_000
_MAX_ATTRIBUTES: Final = 1_000_000

Lines = dict[Element, int]


def parse(data: bytes) -> tuple[Element, Lines]:
    """Return the root element and the line of each element. Tags lose their namespace. Raises MeshError."""
    return _Parser().parse(data)


class _Parser:
    """The parser of one file."""

    def __init__(self) -> None:
        self._builder = ET.TreeBuilder()
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler, self._expat.EndElementHandler = self._start, self._end
        self._expat.CharacterDataHandler, self._expat.StartDoctypeDeclHandler = self._builder.data, self._doctype
        self._lines: Lines = {}
        self._depth = 0

    def parse(self, data: bytes) -> tuple[Element, Lines]:
        if (
            data.count(b"=") > _MAX_ATTRIBUTES
        ):  # all attributes of an element are in memory before its handler is called
            raise MeshError("too-large-mesh", f"more than {_MAX_ATTRIBUTES:,} attributes")
        try:
            self._expat.Parse(data, True)
            return self._builder.close(), self._lines
        except expat.ExpatError as error:
            message = f"is not well-formed XML: {expat.errors.messages[error.code]}"
            raise MeshError("broken-mesh", message, error.lineno) from None
        except (LookupError, UnicodeError) as error:  # an encoding that Python does not know
            raise MeshError("broken-mesh", f"{error}; save it as UTF-8", 1) from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > _MAX_ELEMENT_DEPTH:
            self._refuse("broken-mesh", f"more than {_MAX_ELEMENT_DEPTH} nested elements")
        if len(self._lines) == _MAX_ELEMENTS:
            self._refuse("too-large-mesh", f"more than {_MAX_ELEMENTS:,} elements")
        element = self._builder.start(tag.rpartition(":")[2], attributes)
        self._lines[element] = self._expat.CurrentLineNumber

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._builder.end(tag.rpartition(":")[2])

    def _doctype(self, *_: object) -> None:
        self._refuse("broken-mesh", "a DOCTYPE is not allowed in a mesh")

    def _refuse(self, rule: str, message: str) -> None:
        raise MeshError(rule, message, self._expat.CurrentLineNumber)


class Document:
    """The elements of a file, by identifier."""

    def __init__(self, root: Element, lines: Lines) -> None:
        self.root = root
        self._lines = lines
        self._by_id: dict[tuple[str, str], Element] = {}
        self._numbers: dict[Element, NDArray[np.float64]] = {}
        for element in lines:
            if "id" in element.attrib:
                self._by_id.setdefault((element.tag, element.attrib["id"]), element)

    def error(self, element: Element, message: str, rule: str = "broken-mesh") -> MeshError:
        """Return an error that names an element and its line."""
        return MeshError(rule, f"<{element.tag[:40]}>: {message}", self._lines[element])

    def named(self, element: Element, attribute: str, tag: str) -> Element:
        """Return the element that an attribute refers to. Raises MeshError."""
        name = element.get(attribute, "")
        found = self._by_id.get((tag, name[1:])) if name.startswith("#") else None
        if found is None:
            raise self.error(element, f"{attribute}={shown(name)}: the file has no <{tag}> with this id")
        return found

    def whole(self, element: Element, attribute: str, *, otherwise: int) -> int:
        """Return an attribute that is a whole number from 0. Raises MeshError."""
        text = element.get(attribute, str(otherwise)).strip()
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise self.error(element, f"{attribute}={shown(text)}: expected a whole number from 0")
        return int(text)

    def positive(self, element: Element, attribute: str) -> float:
        """Return an attribute that is a number greater than 0. Raises MeshError."""
        text = element.get(attribute, "1")
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not 0 < number < math.inf:
            raise self.error(element, f"{attribute}={shown(text)}: expected a number greater than 0")
        return number

    def numbers(self, element: Element) -> NDArray[np.float64]:
        """Return the numbers in the text of an element. Raises MeshError."""
        import numpy as np

        text = element.text or ""
        if not text.strip():
            return np.zeros(0)
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # raised for text that is not a number
            try:
                return np.fromstring(text, sep=" ")
            except (ValueError, DeprecationWarning):
                raise self.error(element, "expected numbers, found other text") from None

    def numbers_once(self, element: Element) -> NDArray[np.float64]:
        """Return the same from a cache, for an element with several references."""
        if element not in self._numbers:
            self._numbers[element] = self.numbers(element)
        return self._numbers[element]

    def rows(self, element: Element) -> NDArray[np.int64]:
        """Return the whole numbers from 0 in the text of an element. Raises MeshError."""
        import numpy as np

        found = self.numbers(element)
        if not ((found >= 0) & (found < 2**31) & (found == np.floor(found))).all():
            raise self.error(element, "expected whole numbers from 0", "mesh-index")
        return found.astype(np.int64)
