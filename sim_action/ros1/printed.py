"""What a launch has printed, searched for the reasons of its end in the words of roslaunch and rostest."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

# Colours, as they are and as rosunit writes them.
_COLOURS: Final = re.compile(r"(?:\x1b|&#x001B;)(?:\[[0-9;]*m|\][^\x07]*\x07)")
_DEAD: Final = re.compile(r"\[([\w/.-]+?)-\d+\] process has died \[pid \d+, exit code (-?\d+), cmd (\S+)")
_REQUIRED: Final = re.compile(
    r"REQUIRED process \[([\w/.-]+?)-\d+\] has died!\s+process has (?:died \[pid \d+, exit code (-?\d+)|(finished cleanly))"
)
_REFUSED: Final = (
    re.compile(r"^(?:roslaunch\.\w+\.)?(?:RLException|XmlParseException|LaunchParamException): *(.+)$", re.MULTILINE),
    re.compile(r"^(?:rospkg\.common\.|rospkg\.)?ResourceNotFound: *(.+)$", re.MULTILINE),
    re.compile(r"^ERROR: (cannot launch node of type .+)$", re.MULTILINE),
)
_EXCEPTION: Final = re.compile(r"^[A-Za-z_][\w.]*(?:Error|Exception|Interrupt|Exit)(?:: .*)?$", re.MULTILINE)
_XACRO: Final = re.compile(r"^xacro: (.+)$", re.MULTILINE)

_LAST: Final = 4_000


@dataclass(frozen=True, slots=True)
class Death:
    """A node that has ended on its own; `exit_code` negative: the number of a signal."""

    node: str
    exit_code: int
    required: bool = False

    def __str__(self) -> str:
        return f"the node '{self.node}' ended with {_ended(self.exit_code)}"


def plain(text: str) -> str:
    """Without colours and titles of windows."""
    return _COLOURS.sub("", text).replace("\r", "")


def deaths(text: str) -> Iterator[Death]:
    """Of nodes, those that are required first."""
    for name, code, clean in _REQUIRED.findall(text):
        yield Death(name, 0 if clean else int(code), required=True)
    for name, code, _ in _DEAD.findall(text):
        yield Death(name, int(code))


def refused(text: str) -> str | None:
    """Why a launch file cannot be launched."""
    for pattern in _REFUSED:
        if found := pattern.search(text):
            return found[1].strip()
    return None


def xacro_error(text: str) -> str | None:
    """What our xacro has said of a file."""
    found = _XACRO.search(text)
    return found[1] if found else None


def last_exception(text: str) -> str | None:
    """The last line that is one of Python's exceptions."""
    found = _EXCEPTION.findall(text)
    return found[-1] if found else None


def last_words(text: str) -> str:
    """The end of what was printed."""
    return text.strip("\n")[-_LAST:]


def _ended(code: int) -> str:
    return f"exit code {code}" if code >= 0 else f"signal {-code}"
