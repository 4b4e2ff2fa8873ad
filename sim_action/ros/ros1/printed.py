"""What a launch has printed, searched for the reasons of its end in the words of roslaunch and rostest."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePath
from signal import Signals
from typing import Final

# Colours, as they are and as rosunit writes them.
_COLOURS: Final = re.compile(r"(?:\x1b|&#x001B;)(?:\[[0-9;]*m|\][^\x07\n]*(?:\x07|&#x0007;))")
# Of a folder that is gone by the time that anybody reads it.
_LOGS: Final = re.compile(r"^(?:log file: .*\*\.log|\.\.\. logging to .*|rostest log file is in .*)\n?", re.MULTILINE)
_NODE: Final = r"\[([\w/.-]+?)(?:-\d+)?\]"
_HOW: Final = r"process has (?:died \[pid \d+, exit code (-?\d+), cmd (\S+)|finished cleanly)"
_DEAD: Final = re.compile(rf"{_NODE} {_HOW}")
_REQUIRED: Final = re.compile(rf"REQUIRED process {_NODE} has died!\s+{_HOW}")
_NO_PACKAGE: Final = re.compile(r"^(?:rospkg\.\w+\.)?(?:ResourceNotFound|Resource not found): *(\S+)$", re.MULTILINE)
_REFUSED: Final = (
    re.compile(r"^ERROR: (cannot launch node of type .+)$", re.MULTILINE),
    re.compile(r"^(?:roslaunch\.\w+\.)?(?:RLException|XmlParseException|LaunchParamException): *(.+)$", re.MULTILINE),
)
_EXCEPTION: Final = re.compile(r"^[A-Za-z_][\w.]*(?:Error|Exception|Interrupt|Exit)(?:: .*)?$", re.MULTILINE)
_XACRO: Final = re.compile(r"^xacro: (.+)$", re.MULTILINE)

_LAST: Final = 4_000


@dataclass(frozen=True, slots=True)
class Death:
    """A node that has ended on its own; `exit_code` negative: the number of a signal; `program`: empty if not known."""

    node: str
    exit_code: int
    program: str = ""

    def __str__(self) -> str:
        return f"the node '{self.node}' ended with {_ended(self.exit_code)}"


def plain(text: str) -> str:
    """Without colours, titles of windows, and places of logs."""
    return _LOGS.sub("", _COLOURS.sub("", text).replace("\r", ""))


def required_deaths(text: str) -> Iterator[Death]:
    """Of nodes that nothing goes on without."""
    return (Death(name, int(code or 0), program) for name, code, program in _REQUIRED.findall(text))


def deaths(text: str) -> Iterator[Death]:
    """Of nodes that did not end well."""
    return (Death(name, int(code), program) for name, code, program in _DEAD.findall(text) if code)


def missing_package(text: str) -> str | None:
    """What a launch file has looked for and not found."""
    found = _NO_PACKAGE.search(text)
    return found[1] if found else None


def refused(text: str) -> str | None:
    """Why a launch file cannot be launched."""
    return next((found[1].strip() for pattern in _REFUSED if (found := pattern.search(text))), None)


def xacro_error(text: str) -> str | None:
    """What our xacro has said of a file."""
    found = _XACRO.search(text)
    return found[1] if found else None


def last_exception(text: str, program: str) -> str | None:
    """The exception that a program of Python ended with: the one that follows the last mention of its file."""
    name = PurePath(program).name
    place = text.rfind(f'/{name}", line ') if name else -1
    found = _EXCEPTION.search(text, place) if place >= 0 else None
    return found[0] if found else None


def last_words(text: str) -> str:
    """The end of what was printed."""
    return text.strip("\n")[-_LAST:]


def signal_name(number: int) -> str:
    """Such as SIGKILL."""
    return Signals(number).name if number in set(Signals) else f"signal {number}"


def _ended(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal_name(-code)
