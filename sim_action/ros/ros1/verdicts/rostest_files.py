"""The `<test>` tags of the launch files of rostest."""

from __future__ import annotations

import re
import xml.parsers.expat
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass

_MAX_LAUNCH_FILE_BYTES: Final = 4_000_000
_SUBSTITUTION: Final = re.compile(r"\$\([^)]*\)")

DEFAULT_TIME_LIMIT_S: Final = 60.0
"""s that rostest gives a test without a time-limit (wiki.ros.org/roslaunch/XML/test)."""


@dataclass(frozen=True, slots=True)
class TestTag:
    """A `<test>` tag: line, name, package, type, and time limit in s. `$(...)` is not replaced."""

    line: int
    name: str
    package: str
    type: str
    time_limit: float
    retry: int

    def is_called(self, name: str) -> bool:
        """Return True if a test name can result from this tag, once its `$(...)` are replaced."""
        parts = map(re.escape, _SUBSTITUTION.split(self.name))
        return re.fullmatch(".*".join(parts), name) is not None


def test_tags(path: Path) -> tuple[TestTag, ...]:
    """Return the `<test>` tags of a file itself, in their order; in broken XML, those before the error."""
    found: list[TestTag] = []
    parser = xml.parsers.expat.ParserCreate()

    def begun(tag: str, given: dict[str, str]) -> None:
        if tag == "test":
            found.append(_tag(parser.CurrentLineNumber, given))

    parser.StartElementHandler = begun
    # roslaunch reports what is wrong with the file.
    with suppress(OSError, xml.parsers.expat.ExpatError):
        parser.Parse(read_at_most(path, _MAX_LAUNCH_FILE_BYTES) or b"", True)
    return tuple(found)


def _tag(line: int, given: dict[str, str]) -> TestTag:
    return TestTag(
        line,
        given.get("test-name", ""),
        given.get("pkg", ""),
        given.get("type", ""),
        _number(given.get("time-limit"), DEFAULT_TIME_LIMIT_S),
        int(_number(given.get("retry"), 0)),
    )


def _number(text: str | None, default: float) -> float:
    try:
        return float(text or default)
    except ValueError:
        return default
