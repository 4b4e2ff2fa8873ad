"""Turn exceptions of xacro into messages with a place, and the macros and includes that led there.

xacro's exceptions have no place. The stack frames of xacro have one: they hold the current element as `node` or `elt`.
If a later version of xacro renames these variables, the message stays and the line is lost.
"""

from __future__ import annotations

import difflib
import traceback
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from types import FrameType
from typing import Final
from xml.dom.minidom import Element, Node

from sim_action.core.errors import Location
from sim_action.core.records import dataclass
from sim_action.robot.documents.packages import PackageError
from sim_action.robot.documents.xml_document import shown_place
from sim_action.robot.reading.xacro_documents import XacroError, place_of

_STEPS_SHOWN: Final = 4
_LIKENESS: Final = 0.8  # all names of `math` are candidates: with a lower value, 'foo' would match 'floor'
_UNDEFINED_ARGUMENT: Final = "ArgException"
_UNKNOWN_MACRO: Final = "unknown macro name: xacro:"
_IN_PLAIN_WORDS: Final = ("XacroException", "RuntimeError", "SubstitutionException")


def explain_xacro_error(error: BaseException, path: Path) -> XacroError:
    """Return an error with a message, a rule and a place.

    :param path: the file that xacro was expanding.
    """
    trail = _trail(error)
    cause = _cause(error)
    place = cause.location if isinstance(cause, XacroError) else trail[-1].place if trail else Location(str(path))
    message = " ".join(_Explanation(error, cause, trail).message().split())
    return XacroError(_rule(cause), message + _way(trail, place), place)


@dataclass(frozen=True, slots=True)
class _Step:
    """A stack frame of xacro that was working on an element."""

    frame: FrameType
    node: Node
    place: Location


def _trail(error: BaseException) -> list[_Step]:
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    of_xacro = (frame for frame in frames if str(frame.f_globals.get("__name__")).startswith("xacro"))
    return [step for frame in of_xacro if (step := _step(frame))]


def _step(frame: FrameType) -> _Step | None:
    node = frame.f_locals.get("node", frame.f_locals.get("elt"))
    place = place_of(node)
    return _Step(frame, node, place) if isinstance(node, Node) and place else None


def _cause(error: BaseException) -> BaseException:
    while isinstance(inner := getattr(error, "exc", None), Exception):
        error = inner
    return error


def _way(trail: list[_Step], end: Location) -> str:
    """Return a text such as ", in macro 'wheel' called at robot.xacro:12, included at robot.urdf.xacro:3"."""
    # The place of the error itself is already known. Recursive macros repeat the same steps.
    outer = trail[:-1] if trail and trail[-1].place == end else trail
    said = list(dict.fromkeys(filter(None, map(_said, reversed(outer)))))
    more = len(said) - _STEPS_SHOWN
    return "".join(f", {step}" for step in said[:_STEPS_SHOWN]) + (f", and {more} more" if more > 0 else "")


def _said(step: _Step) -> str:
    match step.frame.f_code.co_name, step.node:
        case "handle_macro_call", Element(tagName=tag):
            return f"in macro '{tag.removeprefix('xacro:')}' called at {shown_place(step.place)}"
        case "process_include", _:
            return f"included at {shown_place(step.place)}"
    return ""


def _rule(cause: BaseException) -> str:
    match cause:
        case XacroError() | PackageError():
            return cause.rule
        case OSError():
            return "missing-include"
    return "unknown-argument" if type(cause).__name__ == _UNDEFINED_ARGUMENT else "bad-xacro"


@dataclass(frozen=True, slots=True)
class _Explanation:
    """One error, with all that its message is made from."""

    error: BaseException
    cause: BaseException
    trail: list[_Step]

    def message(self) -> str:
        """Return the message: the cause and the next step."""
        match self.cause:
            case XacroError(message=message):
                return message
            case PackageError() | OSError():
                return str(self.cause)
            case NameError(name=str(name)):
                return f"property '{name}' is not defined{self._near(name, 'symbols')}{self._expression()}"
            case RecursionError():
                return "macros call each other without end, or too deeply; end a recursive macro with an <xacro:if>"
            case MemoryError():
                return "out of memory: the macros create too many elements"
        return self._of_xacro()

    def _of_xacro(self) -> str:
        """Return xacro's own message if it is written for users, else Python's message with the type of the error."""
        cause = self.cause
        text, kind = cause.msg if isinstance(cause, SyntaxError) else str(cause), type(cause).__name__
        if text.startswith(_UNKNOWN_MACRO):
            name = text.removeprefix(_UNKNOWN_MACRO)
            return f"unknown macro '{name}'{self._near(name, 'macros')}; check that its file is included"
        if kind == _UNDEFINED_ARGUMENT:
            return _undefined_argument(text)
        called = "".join(f"macro '{macro.body.getAttribute('name')}': " for macro in getattr(self.error, "macros", ()))
        return f"{called}{text if kind in _IN_PLAIN_WORDS else f'{kind}: {text}'}{self._expression()}"

    def _expression(self) -> str:
        suffix = getattr(self.error, "suffix", None)
        return f", {suffix.strip()}" if isinstance(suffix, str) else ""

    def _near(self, name: str, table: str) -> str:
        """Return a hint with the nearest name in scope."""
        if not self.trail:
            return ""
        known = list(islice(_names(self.trail[-1].frame.f_locals.get(table)), 10_000))
        near = difflib.get_close_matches(name, known, n=1, cutoff=_LIKENESS)
        return f"; did you mean '{near[0]}'?" if near else ""


def _names(table: object) -> Iterator[str]:
    while isinstance(table, dict):
        yield from (str(name).lstrip("*") for name in table)
        table = getattr(table, "parent", None)


def _undefined_argument(name: str) -> str:
    declaration = f'<xacro:arg name="{name}" default="..."/>'
    return f"argument '{name}' has no value: set it in robot.args, or declare it before its use with {declaration}"
