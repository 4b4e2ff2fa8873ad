"""The failures of programs: exit codes and signals in words, tracebacks, and the reason why a node ended.

The reason is found in the output: an exception, a crash, or the error that was logged last.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from signal import Signals
from typing import Final

from sim_action.core.errors import Location, ScriptError
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.robot.documents.xml_document import shown_file

_MAX_DETAILS_CHARS: Final = 4_000
_FRAME: Final = re.compile(r'^ *File "([^"]+)", line ([0-9]{1,9})(?:, in .*)?\n(?: {4,}(\S.*))?', re.MULTILINE)

# The exception is the first line without indentation, and it may have more lines. A prompt of input() may come before
# the first line.
_TRACEBACK: Final = re.compile(
    r"^.*?Traceback \(most recent call last\):\n(?P<frames>(?:[ ].*\n|\n)*)(?P<said>\S.*)", re.MULTILINE
)
# Python prints no traceback for a syntax error in the program itself.
_SYNTAX: Final = re.compile(
    r'^(?P<frames>  File ".+", line [0-9]{1,9}\n)(?:[ ].*\n){0,3}(?P<said>(?:Syntax|Indentation|Tab)Error: .*)',
    re.MULTILINE,
)
# Written by faulthandler, which nodes run with; the innermost frame comes first.
_CRASH: Final = re.compile(
    r"^Fatal Python error: (?P<said>.+)\n(?:.*\n)*?Current thread .*\(most recent call first\):\n"
    r"(?P<frames>(?: .*(?:\n|\Z))*)",
    re.MULTILINE,
)
_TERMINATED: Final = re.compile(
    r"^terminate called .*'(?P<kind>[^'\n]+)'\n(?:\s*what\(\): *(?P<said>.*))?", re.MULTILINE
)
_UNLOADED: Final = re.compile(r"error while loading shared libraries: (?P<said>[^:\n]+)")
_LOGGED: Final = re.compile(r"^\[(?:ERROR|FATAL)\] \[[\d.]+\] \[[^\]\n]*\]: (?P<said>.+)", re.MULTILINE)
# Python's own libraries of ROS stand in the user's folder if it has a virtual environment.
_OF_ROS: Final = re.compile(r'^ *File "[^"\n]*/(?:site|dist)-packages/(?:rclpy|ros\w*|launch\w*)/.*\n', re.MULTILINE)

_HINTS: Final = {
    "MemoryError": "; memory_limit is the memory that each process may have",
    "ModuleNotFoundError": "; install it for the Python of ROS 2, or use a ROS 2 that has it, such as ros:jazzy",
}
"""The exception that ended a node -> what the user can do."""


def signal_name(number: int) -> str:
    """Return the name of a signal, such as SIGKILL."""
    return Signals(number).name if number in set(Signals) else f"signal {number}"


def exit_text(code: int) -> str:
    """Return an exit code in words, negative for a signal: "exit code 1", or "SIGKILL"."""
    return f"exit code {code}" if code >= 0 else signal_name(-code)


def traceback_location(text: str, workspace: Path) -> Location | None:
    """Return the innermost place of a traceback that is in the workspace."""
    return last_location([(file, int(line)) for file, line, _ in _FRAME.findall(text)], workspace)


def last_location(places: Sequence[tuple[str, int]], workspace: Path) -> Location | None:
    """Return the last of some places, (file, line), that is in the workspace; a line of 0 is not known."""
    root = workspace.resolve()
    for file, line in reversed(places):
        if file.startswith("<"):  # such as <frozen os>, which is no file
            continue
        try:
            path = Path(file).resolve()
        except (OSError, ValueError, RuntimeError):  # too long, with a NUL, or links in a circle
            continue
        if path.is_relative_to(root):
            return Location(shown_file(path), line or None)
    return None


def exception_line(kind: str, text: str) -> str:
    """Return the exception and its message, or the line that raised it if there is no message."""
    said, _, _ = text.partition("\n")
    if not said.strip() or said.startswith("  File "):
        lines = [line for _, _, line in _FRAME.findall(text) if line]
        said = lines[-1] if lines else ""
    return f"{kind}: {said.strip()}" if kind and said.strip() else said.strip() or kind


@dataclass(frozen=True, slots=True)
class Ending:
    """The last words of a node: `said` continues a sentence about its end, such as ": ValueError: no plan"."""

    said: str = ""
    location: Location | None = None


def ending_of(output: str, directory: Path) -> Ending:
    """Return what a failed node said; `directory`: the folder of the user's code."""
    return next(_endings(output, directory), Ending())


def _endings(output: str, directory: Path) -> Iterator[Ending]:
    for pattern in (_TRACEBACK, _SYNTAX):
        if matches := list(pattern.finditer(output)):
            said = matches[-1]["said"].strip()
            yield Ending(f": {said}{_HINTS.get(said.partition(':')[0], '')}", _place(matches[-1]["frames"], directory))
    if matches := list(_CRASH.finditer(output)):
        frames = re.sub(r"(, line [0-9]+) in ", r"\1, in ", matches[-1]["frames"]).splitlines(keepends=True)
        yield Ending(f": {matches[-1]['said'].strip()}", _place("".join(reversed(frames)), directory))
    if matches := list(_TERMINATED.finditer(output)):
        kind, said = matches[-1]["kind"], matches[-1]["said"]
        yield Ending(f": {kind}: {said.strip()}" if said else f": {kind}")
    if matches := list(_UNLOADED.finditer(output)):
        yield Ending(
            f": there is no {matches[-1]['said']}; build it again for this ROS 2, or use one that has this library"
        )
    if matches := list(_LOGGED.finditer(output)):
        yield Ending(f" after it logged the error: {matches[-1]['said'].strip()}")


def _place(frames: str, directory: Path) -> Location | None:
    return traceback_location(_OF_ROS.sub("", frames), directory)


def node_error(node: str, code: int, output: str, directory: Path) -> ScriptError:
    """Return the error for a node that has ended; `directory`: the folder of the user's code."""
    if not code:
        return error_with_output(f"{node} finished during the run, and it is required", output)
    ending = ending_of(output, directory)
    return error_with_output(f"{node} ended with {exit_text(code)}{ending.said}", output, ending.location)


def error_with_output(message: str, output: str, location: Location | None = None) -> ScriptError:
    """Return the error of a program, with the end of its output as details."""
    return ScriptError(escaped_line(message), location, details=output.strip("\n")[-_MAX_DETAILS_CHARS:])
