"""The elements of a COLLADA file, and the lines that they begin on."""

from __future__ import annotations

from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element
from xml.parsers import expat

from sim_action.meshes.mesh import MeshError

_MAX_DEPTH: Final = 200
_MAX_ELEMENTS: Final = 200_000
_MAX_ATTRIBUTES: Final = 1_000_000

Lines = dict[Element, int]


def parse(data: bytes) -> tuple[Element, Lines]:
    """The root, and the line of each element. Tags come without their namespace. Raises MeshError."""
    return _Parser().parse(data)


class _Parser:
    """One file while it is parsed."""

    def __init__(self) -> None:
        self._builder = ET.TreeBuilder()
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler, self._expat.EndElementHandler = self._start, self._end
        self._expat.CharacterDataHandler, self._expat.StartDoctypeDeclHandler = self._builder.data, self._doctype
        self._lines: Lines = {}
        self._depth = 0

    def parse(self, data: bytes) -> tuple[Element, Lines]:
        if data.count(b"=") > _MAX_ATTRIBUTES:  # all those of an element are in memory before it is seen
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
        if self._depth > _MAX_DEPTH:
            self._refuse("broken-mesh", f"more than {_MAX_DEPTH} elements inside each other")
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
