"""The processes that roslaunch has started beside the simulation: nodes, tests, what starts nodes (Linux, /proc)."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path, PurePath
from typing import Final

_PROC: Final = Path("/proc")
_ROOM: Final = 65536
_HEAD: Final = 64
_RESULT: Final = b"--gtest_output=xml:"


class ChildProcesses:
    """The children of a process; its files are kept open, since they are looked at again and again."""

    def __init__(self, pid: int) -> None:
        self._tasks = f"/proc/{pid}/task"
        self._count = -1
        self._open: list[int] = []

    def look(self) -> frozenset[int]:
        """Those that are there now, and those that have ended and were not asked after by their parent yet."""
        try:
            count = os.stat(self._tasks).st_nlink  # noqa: PTH116 - looked at thousands of times
            if count != self._count:
                self._reopen()
                self._count = count
            told = [os.pread(descriptor, _ROOM, 0) for descriptor in self._open]
        except OSError:
            self._count = -1
            return frozenset()
        return frozenset(int(word) for words in told for word in words.split())

    def _reopen(self) -> None:
        for descriptor in self._open:
            os.close(descriptor)
        self._open = []
        for thread in os.listdir(self._tasks):  # noqa: PTH208 - names are wanted
            with suppress(OSError):
                self._open.append(os.open(f"{self._tasks}/{thread}/children", os.O_RDONLY | os.O_CLOEXEC))


def children(pid: int) -> frozenset[int]:
    """Of a process, those that are there now."""
    found: set[int] = set()
    with suppress(OSError):
        for thread in (_PROC / str(pid) / "task").iterdir():
            found.update(map(int, (thread / "children").read_text().split()))
    return frozenset(found)


def descendants(pid: int) -> frozenset[int]:
    """Of a process, all that are there now."""
    found: set[int] = set()
    waiting = [pid]
    while waiting:
        new = children(waiting.pop()) - found
        found |= new
        waiting += new
    return frozenset(found)


def test_result_path(pid: int) -> Path | None:
    """Where a test that rostest has started will write what it found; None of a process that is none."""
    with suppress(OSError):
        for word in (_PROC / str(pid) / "cmdline").read_bytes().split(b"\0"):
            if word.startswith(_RESULT):
                return Path(os.fsdecode(word.removeprefix(_RESULT)))
    return None


def is_result_written(result: Path) -> bool:
    """Whether a test has told what it found; its file is there from its start, with nothing but a head."""
    try:
        return result.stat().st_size > _HEAD and b"</testsuite" in result.read_bytes()[-_HEAD:]
    except OSError:
        return False


def process_name(pid: int) -> str:
    """What was called: the first words of its command line that tell it from others."""
    with suppress(OSError):
        words = (_PROC / str(pid) / "cmdline").read_bytes().decode(errors="replace").split("\0")
        return " ".join(PurePath(word).name for word in words[:2] if word)
    return f"process {pid}"
