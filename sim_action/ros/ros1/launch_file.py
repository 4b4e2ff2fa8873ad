"""The `<test>` tags of a launch file: where each stands, and how long it may take."""

from __future__ import annotations

import re
import xml.parsers.expat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.core.files import read_at_most

_MOST_BYTES: Final = 4_000_000
_SUBSTITUTION: Final = re.compile(r"\$\([^)]*\)")

TIME_LIMIT: Final = 60.0
"""s that rostest gives a test that states none (wiki.ros.org/roslaunch/XML/test)."""


@dataclass(frozen=True, slots=True)
class TestTag:
    """One `<test>`: its line, and its name, package, type and time limit in s as far as they are written out."""

    line: int
    name: str
    package: str
    type: str
    time_limit: float
    retry: int

    def is_called(self, name: str) -> bool:
        """Whether the name of a test can be this one's, once its `$(...)` are replaced."""
        parts = map(re.escape, _SUBSTITUTION.split(self.name))
        return re.fullmatch(".*".join(parts), name) is not None


def test_tags(path: Path) -> tuple[TestTag, ...]:
    """Those of a file itself, in their order; as many as there are before what is no XML."""
    found: list[TestTag] = []
    parser = xml.parsers.expat.ParserCreate()

    def begun(tag: str, given: dict[str, str]) -> None:
        if tag == "test":
            found.append(_tag(parser.CurrentLineNumber, given))

    parser.StartElementHandler = begun
    # What is wrong with it, roslaunch says.
    with suppress(OSError, xml.parsers.expat.ExpatError):
        parser.Parse(read_at_most(path, _MOST_BYTES) or b"", True)
    return tuple(found)


def _tag(line: int, given: dict[str, str]) -> TestTag:
    return TestTag(
        line,
        given.get("test-name", ""),
        given.get("pkg", ""),
        given.get("type", ""),
        _number(given.get("time-limit"), TIME_LIMIT),
        int(_number(given.get("retry"), 0)),
    )


def _number(text: str | None, default: float) -> float:
    try:
        return float(text or default)
    except ValueError:
        return default
