"""What is wrong with text that is not well-formed XML, for whoever has to mend it."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Final
from xml.parsers import expat

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
