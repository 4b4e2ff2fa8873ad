"""XML of a model with the place of each element, read from bytes that may be a stranger's."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element
from xml.parsers import expat

from sim_action.core.discovery import file_name
from sim_action.core.errors import Location, ModelError
from sim_action.core.files import read_at_most
from sim_action.robot.audit.rules import finding, refuse_errors
from sim_action.robot.robot_model import Finding

MAX_BYTES: Final = 20_000_000
"""Of a model, with all the files that it is made of."""

_MAX_DEPTH: Final = 100
# A model of as many links as the engine takes has 300 for each. Read in the caller's process, each takes 300 bytes.
MAX_ELEMENTS: Final = 50_000
"""Of a model, with all that it includes."""

_MAX_ATTRIBUTES: Final = 500_000


@dataclass(frozen=True, eq=False)
class ModelDocument:
    """A parsed file.

    Attributes:
        root: of all elements.
        places: where each element was written.
        files: the file from which relative paths of an element start, where that is not the model's own.
        size: of the file, in bytes; 0 for what was made here.
    """

    root: Element
    places: Mapping[Element, Location] = field(repr=False)
    files: Mapping[Element, Path] = field(default_factory=dict, repr=False)
    size: int = 0

    def finding(self, rule: str, element: Element, message: str) -> Finding:
        """A finding at an element."""
        return finding(rule, message, self.places[element])

    def elements(self, *paths: str) -> Iterator[Element]:
        """All elements at paths below the root, in the order of the paths."""
        for path in paths:
            yield from self.root.findall(path)


def read_document(path: Path) -> ModelDocument:
    """Reads and parses a file. Raises ModelError."""
    file = shown_file(path)
    return _Parser(file).parse(_bytes(path, Location(file)))


def shown_file(path: Path) -> str:
    """How reports call a file: as people name it, seen from the current folder."""
    return file_name(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def shown_place(place: Location) -> Location:
    """How reports call a place in a file, likewise."""
    return Location(shown_file(Path(place.file)), place.line, place.column)


def _bytes(path: Path, where: Location) -> bytes:
    try:
        data = read_at_most(path, MAX_BYTES)
    except OSError as error:
        raise ModelError(f"cannot be read: {error.strerror}", where) from None
    if data is None:
        raise ModelError(f"a model of more than {MAX_BYTES // 1_000_000} MB is not read", where)
    return data


class _Parser:
    """One file while it is parsed: elements, and the place of each."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._builder = ET.TreeBuilder()
        self._expat = expat.ParserCreate()
        self._expat.StartElementHandler, self._expat.EndElementHandler = self._start, self._end
        self._expat.CharacterDataHandler, self._expat.StartDoctypeDeclHandler = self._builder.data, self._doctype
        self._places: dict[Element, Location] = {}
        self._depth = 0

    def parse(self, data: bytes) -> ModelDocument:
        if data.count(b"=") > _MAX_ATTRIBUTES:  # all those of an element are in memory before it is seen
            self._refuse(f"more than {_MAX_ATTRIBUTES:,} attributes", 1)
        try:
            self._expat.Parse(data, True)
            return ModelDocument(self._builder.close(), self._places, size=len(data))
        except expat.ExpatError as error:
            self._refuse(explained(error, data), error.lineno)
        except (LookupError, ValueError) as error:  # an encoding that Python does not know
            self._refuse(f"{error}; save the model as UTF-8", 1)
        raise AssertionError("unreachable")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            self._refuse(f"more than {_MAX_DEPTH} elements inside each other", self._expat.CurrentLineNumber)
        if len(self._places) == MAX_ELEMENTS:
            self._refuse(f"more than {MAX_ELEMENTS:,} elements", self._expat.CurrentLineNumber)
        place = Location(self._file, self._expat.CurrentLineNumber)
        self._places[self._builder.start(tag, attributes)] = place

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._builder.end(tag)

    def _doctype(self, *_: object) -> None:
        self._refuse("a DOCTYPE is not allowed in a model", self._expat.CurrentLineNumber)

    def _refuse(self, message: str, line: int) -> None:
        refuse_errors([finding("bad-xml", message, Location(self._file, line))])


_CODES: Final = expat.errors.codes
_MISPLACED: Final = _CODES[expat.errors.XML_ERROR_MISPLACED_XML_PI]
_MISMATCHED: Final = _CODES[expat.errors.XML_ERROR_TAG_MISMATCH]
_NO_TEXT_OF_XML: Final = _CODES[expat.errors.XML_ERROR_SYNTAX]
_NO_CHARACTER: Final = _CODES[expat.errors.XML_ERROR_INVALID_TOKEN]
_NO_ENTITY: Final = _CODES[expat.errors.XML_ERROR_UNDEFINED_ENTITY]
_UNBOUND: Final = _CODES[expat.errors.XML_ERROR_UNBOUND_PREFIX]

# Of bytes in which an image or an archive has a zero.
_HEAD: Final = 64
_LONGEST_SHOWN: Final = 60
_REFERENCE: Final = re.compile(rb"&[^;&<>]{0,40}.$")
_CLOSING: Final = re.compile(rb"</([^\s>]*)")


def explained(error: expat.ExpatError, data: bytes) -> str:
    """What the parser says of a whole file, and what to do; also of what other tools let pass."""
    return f"not well-formed XML: {_trouble(error, data)}"


def _trouble(error: expat.ExpatError, data: bytes) -> str:
    said, line, code = expat.errors.messages[error.code], _line(error, data), error.code
    if code == _MISPLACED:
        return "something stands before <?xml ...?>, which must be the first in a file; remove either"
    if error.lineno == 1 and b"\0" in data[:_HEAD]:
        return f"{said}; it does not even begin as text: is this a model?"
    if line[error.offset : error.offset + 1] == b"\0":
        return "a NUL character; remove it"
    if code == _MISMATCHED:
        return f"{said}{_unclosed(error, data, line)}"
    if code == _UNBOUND:
        example = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">'
        return f"{said}; a prefix is declared in the first element, as in {example}"
    return f"{said}{_hint(code, line[: error.offset + 1])}"


def _hint(code: int, line: bytes) -> str:
    """`line`: up to where the error is."""
    if code == _NO_TEXT_OF_XML:
        return "; a model is a .urdf, .xacro or .sdf file, or an .xml file of MuJoCo's"
    last = line[-1:]
    if code == _NO_CHARACTER and last > b"\x7f":
        return f"; the byte 0x{last.hex()} is not UTF-8 text: save the file as UTF-8"
    if code == _NO_ENTITY or (code == _NO_CHARACTER and _REFERENCE.search(line)):
        return "; a & that stands for itself is written &amp;"
    return "; a < that stands for itself is written &lt;" if code == _NO_CHARACTER and b"<" in line[-2:] else ""


def _line(error: expat.ExpatError, data: bytes) -> bytes:
    lines = data.split(b"\n")
    return lines[error.lineno - 1] if error.lineno <= len(lines) else b""


def _unclosed(error: expat.ExpatError, data: bytes, line: bytes) -> str:
    """Which end there is, and which one is due."""
    found = next((end for end in _CLOSING.finditer(line) if end.end() >= error.offset), None)
    opened = _open_elements(data)
    if found is None or not opened:
        return ""
    name, begun = opened[-1]
    return f": </{_shown(found[1].decode(errors='replace'))}> where the <{_shown(name)}> of line {begun} is to end"


def _shown(name: str) -> str:
    return name if len(name) <= _LONGEST_SHOWN else f"{name[:_LONGEST_SHOWN]}..."


def _open_elements(data: bytes) -> list[tuple[str, int]]:
    """What is open where a parser stops: names, and lines on which they begin."""
    parser, opened = expat.ParserCreate(), list[tuple[str, int]]()
    parser.StartElementHandler = lambda name, _: opened.append((name, parser.CurrentLineNumber))
    parser.EndElementHandler = lambda _: opened.pop()
    with suppress(expat.ExpatError, LookupError, ValueError):
        parser.Parse(data, True)
    return opened
