"""The processes of a launch: nodes, tests, and programs that start nodes. Read from /proc (Linux)."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path, PurePath
from typing import Final

_PROC: Final = Path("/proc")
_READ_BYTES: Final = 65536
_MAX_HEADER_BYTES: Final = 64
_RESULT: Final = b"--gtest_output=xml:"


class ChildProcesses:
    """The children of a process. Its files stay open, because they are read at every step."""

    def __init__(self, pid: int) -> None:
        self._tasks = f"/proc/{pid}/task"
        self._count = -1
        self._open: list[int] = []

    def look(self) -> frozenset[int]:
        """Return the ids of the current children, including ended ones that the parent has not waited for."""
        try:
            count = os.stat(self._tasks).st_nlink  # noqa: PTH116 - looked at thousands of times
            if count != self._count:
                self._reopen()
                self._count = count
            told = [os.pread(descriptor, _READ_BYTES, 0) for descriptor in self._open]
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
    """Return the ids of the current children of a process."""
    found: set[int] = set()
    with suppress(OSError):
        for thread in (_PROC / str(pid) / "task").iterdir():
            found.update(map(int, (thread / "children").read_text().split()))
    return frozenset(found)


def descendants(pid: int) -> frozenset[int]:
    """Return the ids of all current descendants of a process."""
    found: set[int] = set()
    waiting = [pid]
    while waiting:
        new = children(waiting.pop()) - found
        found |= new
        waiting += new
    return frozenset(found)


def rostest_result_path(pid: int) -> Path | None:
    """Return the path of the result file of a test process of rostest; None for other processes."""
    with suppress(OSError):
        for word in (_PROC / str(pid) / "cmdline").read_bytes().split(b"\0"):
            if word.startswith(_RESULT):
                return Path(os.fsdecode(word.removeprefix(_RESULT)))
    return None


def is_result_written(result: Path) -> bool:
    """Return True if a test has written its result. The file exists from the start, with only a header."""
    try:
        return result.stat().st_size > _MAX_HEADER_BYTES and b"</testsuite" in result.read_bytes()[-_MAX_HEADER_BYTES:]
    except OSError:
        return False


def process_name(pid: int) -> str:
    """Return a short name of a process: the first words of its command line."""
    with suppress(OSError):
        words = (_PROC / str(pid) / "cmdline").read_bytes().decode(errors="replace").split("\0")
        return " ".join(PurePath(word).name for word in words[:2] if word)
    return f"process {pid}"
