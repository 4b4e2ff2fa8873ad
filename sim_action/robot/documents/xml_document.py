"""Read the XML of a model, with the file and line of each element, and explain XML errors.

The input is not trusted: its size, depth and number of elements are bounded, and a DOCTYPE is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, NoReturn
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element
from xml.parsers import expat

from sim_action.core.errors import Location, ModelError
from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass, field, replace
from sim_action.core.workspace import file_name
from sim_action.robot.model.findings import Finding, finding, refuse_errors

MAX_BYTES: Final = 20_000_000  # the largest size of a model, all its files together
_MAX_DEPTH: Final = 100
# With the largest number of links that the engine supports, this is 300 elements per link. Each takes 300 bytes.
MAX_ELEMENTS: Final = 50_000  # the largest number of elements of a model, all included files together

_MAX_ATTRIBUTES: Final = 500_000
_CODES: Final = expat.errors.codes
_MISPLACED: Final = _CODES[expat.errors.XML_ERROR_MISPLACED_XML_PI]
_MISMATCHED: Final = _CODES[expat.errors.XML_ERROR_TAG_MISMATCH]
_NO_TEXT_OF_XML: Final = _CODES[expat.errors.XML_ERROR_SYNTAX]
_NO_CHARACTER: Final = _CODES[expat.errors.XML_ERROR_INVALID_TOKEN]
_NO_ENTITY: Final = _CODES[expat.errors.XML_ERROR_UNDEFINED_ENTITY]
_UNBOUND: Final = _CODES[expat.errors.XML_ERROR_UNBOUND_PREFIX]
_HEAD: Final = 64  # an image or an archive has a NUL within this many bytes
_MAX_SHOWN_CHARS: Final = 60

# The start of a comment or of a section of characters, or a bare `&`.
_LENIENT: Final = re.compile(rb"<!--|<!\[CDATA\[|&(?!#\d+;|#x[0-9a-fA-F]+;|[A-Za-z_][\w.:-]*;)")

# Each comment, section and bare `&` counts twice; a file with more is refused as it stands.
_MAX_LENIENT: Final = 100_000

_ENCODING: Final = re.compile(rb"""encoding\s*=\s*["']([\w.-]+)["']""")
_CLOSING: Final = re.compile(rb"</([^\s>]*)")


@dataclass(frozen=True, eq=False)
class ModelDocument:
    """A parsed file, or a document that was generated."""

    root: Element  # the root element
    places: Mapping[Element, Location] = field(repr=False)  # the file and line of each element
    # for elements whose relative paths do not start from the model's own file: the file that they start from
    files: Mapping[Element, Path] = field(default_factory=dict, repr=False)
    size: int = 0  # size of the file in bytes; 0 for a generated document
    findings: tuple[Finding, ...] = ()  # notes on the XML of the file

    def finding(self, rule: str, element: Element, message: str) -> Finding:
        """Return a finding at an element."""
        return finding(rule, message, self.places[element])

    def refuse(self, rule: str, element: Element, message: str) -> NoReturn:
        """Raise RefusedModel with a finding at an element; the rule is fatal."""
        refuse_errors([self.finding(rule, element, message)])
        raise AssertionError("a fatal finding raises")

    def elements(self, *paths: str) -> Iterator[Element]:
        """Yield all elements at the paths below the root, in the order of the paths."""
        for path in paths:
            yield from self.root.findall(path)


def read_document(path: Path) -> ModelDocument:
    """Read and parse a file. Raises ModelError."""
    file = shown_file(path)
    where = Location(file)
    try:
        data = read_at_most(path, MAX_BYTES)
    except OSError as error:
        raise ModelError(f"cannot be read: {error.strerror}", where) from None
    if data is None:
        raise ModelError(f"the file is too large: a model may have at most {MAX_BYTES // 1_000_000} MB", where)
    return _parsed(data, file)


def parse_document(data: bytes, file: str) -> ModelDocument:
    """Parse the content of a file; `file` is its name in messages. Raises ModelError."""
    if len(data) > MAX_BYTES:
        raise ModelError(f"it is too large: a model may have at most {MAX_BYTES // 1_000_000} MB", Location(file))
    return _parsed(data, file)


def shown_file(path: Path) -> str:
    """Return the name of a file for reports: relative to the current folder if it lies below it."""
    return file_name(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def shown_place(place: Location) -> Location:
    """Return a place with the name of its file as in `shown_file`."""
    return Location(shown_file(Path(place.file)), place.line, place.column)


def _parsed(data: bytes, file: str) -> ModelDocument:
    """Parse a file; as in ROS and Gazebo, a declaration may be late, and `--` in a comment or a bare `&` is read."""
    try:
        return _parsed_strictly(data, file)
    except ModelError:
        strict, first = _strict(data)
        if first is None:
            raise
    document = _parsed_strictly(strict, file)
    message = "'--' in a comment or a bare '&', which strict readers such as xacro refuse: write '- -' or '&amp;'"
    note = finding("lenient-xml", message, Location(file, 1 + data.count(b"\n", 0, first)))
    return replace(document, findings=(*document.findings, note))


def _strict(data: bytes) -> tuple[bytes, int | None]:
    """Return a text with `=` for `-` in bad comments, and an entity for a bare `&`; and where the first change is."""
    parts = list[bytes]()
    at = 0
    first = None
    while len(parts) < _MAX_LENIENT and (token := _LENIENT.search(data, at)) is not None:
        start, begin = token.span()
        if token[0] == b"&":
            parts += data[at:start], b"&amp;"
            at, first = begin, start if first is None else first
            continue
        end = data.find(b"-->" if token[0] == b"<!--" else b"]]>", begin)
        if end < 0:
            break
        inner = data[begin:end]
        if token[0] == b"<!--" and (b"--" in inner or inner.endswith(b"-")):
            first = start if first is None else first
            inner = inner.replace(b"-", b"=")
        parts += data[at:begin], inner
        at = end
    return b"".join((*parts, data[at:])), first


def _parsed_strictly(data: bytes, file: str) -> ModelDocument:
    try:
        return _Parser(file).parse(data)
    except _LateDeclaration as late:
        line, text = late.line, data[late.start : late.end]
        # White space in its place keeps the line numbers of the file.
        blank = data[: late.start] + re.sub(rb"[^\n]", b" ", text) + data[late.end :]
    stated = _ENCODING.search(text)
    document = _Parser(file, stated[1].decode() if stated else "utf-8").parse(blank)
    message = "<?xml ...?> follows white space or a comment, which strict readers refuse: move it to the first line"
    note = finding("late-declaration", message, Location(file, line))
    return replace(document, findings=(note,))


class _LateDeclaration(Exception):
    """An XML declaration after white space or comments: its line, and where it starts and ends in the file in bytes."""

    def __init__(self, line: int, start: int, end: int) -> None:
        super().__init__(line, start, end)
        self.line, self.start, self.end = line, start, end


class _Parser:
    """The state of parsing one file."""

    def __init__(self, file: str, encoding: str | None = None) -> None:
        """`encoding`: for a file whose declaration was late, and is blank now; None: the file states its own."""
        self._file, self._may_be_late = file, encoding is None
        self._builder = ET.TreeBuilder()
        self._expat = expat.ParserCreate(encoding)
        self._expat.StartElementHandler, self._expat.EndElementHandler = self._start, self._end
        self._expat.CharacterDataHandler, self._expat.StartDoctypeDeclHandler = self._builder.data, self._doctype
        self._places: dict[Element, Location] = {}
        self._depth = 0

    def parse(self, data: bytes) -> ModelDocument:
        if data.count(b"=") > _MAX_ATTRIBUTES:  # expat holds all attributes of an element in memory before it calls us
            self._refuse(f"more than {_MAX_ATTRIBUTES:,} attributes", 1)
        try:
            self._expat.Parse(data, True)
            return ModelDocument(self._builder.close(), self._places, size=len(data))
        except expat.ExpatError as error:
            start = self._expat.ErrorByteIndex
            end = data.find(b"?>", start) + 2
            if self._may_be_late and error.code == _MISPLACED and not self._places and end > start:
                raise _LateDeclaration(error.lineno, start, end) from None
            self._refuse(explain_xml_error(error, data), error.lineno)
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


def explain_xml_error(error: expat.ExpatError, data: bytes) -> str:
    """Return a message with the cause of a parser error, and the next step."""
    return f"not well-formed XML: {_trouble(error, data)}"


def _trouble(error: expat.ExpatError, data: bytes) -> str:
    said, line, code = expat.errors.messages[error.code], _line(error, data), error.code
    if code == _MISPLACED:
        return "there is text before <?xml ...?>, which must come first in the file; remove the text or <?xml ...?>"
    if error.lineno == 1 and b"\0" in data[:_HEAD]:
        return f"{said}; the file is not text: is it a model?"
    if line[error.offset : error.offset + 1] == b"\0":
        return "a NUL character; remove it"
    if code == _MISMATCHED:
        return f"{said}{_unclosed(error, data, line)}"
    if code == _UNBOUND:
        example = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">'
        return f"{said}; declare the prefix in the root element, as in {example}"
    return f"{said}{_hint(code, line[: error.offset + 1])}"


def _hint(code: int, line: bytes) -> str:
    """Return the next step; `line` ends at the error."""
    if code == _NO_TEXT_OF_XML:
        return "; a model is a .urdf, .xacro or .sdf file, or an .xml file for MuJoCo"
    last = line[-1:]
    if code == _NO_CHARACTER and last > b"\x7f":
        return f"; the byte 0x{last.hex()} is not UTF-8: save the file as UTF-8"
    if code == _NO_ENTITY:
        return "; write a literal & as &amp;"
    if code == _NO_CHARACTER and line == b"<<":
        return "; resolve the conflict that a merge left here"
    return "; write a literal < as &lt;" if code == _NO_CHARACTER and b"<" in line[-2:] else ""


def _line(error: expat.ExpatError, data: bytes) -> bytes:
    lines = data.split(b"\n")
    return lines[error.lineno - 1] if error.lineno <= len(lines) else b""


def _unclosed(error: expat.ExpatError, data: bytes, line: bytes) -> str:
    """Return the end tag that was found, and the one that was expected."""
    closing = next((end for end in _CLOSING.finditer(line) if end.end() >= error.offset), None)
    # The elements that are open where the parser stops: their names and first lines.
    parser = expat.ParserCreate()
    opened = list[tuple[str, int]]()
    parser.StartElementHandler = lambda name, _: opened.append((name, parser.CurrentLineNumber))
    parser.EndElementHandler = lambda _: opened.pop()
    with suppress(expat.ExpatError, LookupError, ValueError):
        parser.Parse(data, True)
    if closing is None or not opened:
        return ""
    name, begun = opened[-1]
    end = _shown(closing[1].decode(errors="replace"))
    return f": found </{end}>, expected the end of <{_shown(name)}> from line {begun}"


def _shown(name: str) -> str:
    return name if len(name) <= _MAX_SHOWN_CHARS else f"{name[:_MAX_SHOWN_CHARS]}..."
