"""The files of child processes in memory (memfd_create(2)), as the parent makes and reads them.

The parent reads through its own descriptors: a child process cannot remove these files, but it can write anything.
"""

from __future__ import annotations

import fcntl
import os
import pickle
import resource
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from sim_action.runner.child_files import (
    LENGTH,
    MAX_OUTCOME_BYTES,
    MAX_OUTCOMES,
    MAX_OUTPUT_BYTES,
    MAX_STACK_DUMP_BYTES,
    ChildFiles,
    ChildReport,
)

assert sys.platform == "linux"

# A mapping of a file that is cut off would crash the process that reads it.
_SEALS: Final = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL


class MemoryFiles:
    """The files of one child process in memory.

    Attributes:
        output: the descriptor for printed output.
        inherited: the files as the child process knows them.
    """

    def __init__(self, scratch: Path) -> None:
        """Make the files. Raise OSError."""
        made: list[int] = []
        try:
            outcome = os.memfd_create("outcome", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
            made.append(outcome)
            # The file is sparse: it takes only as much memory as is written.
            _reserve(outcome, MAX_OUTCOME_BYTES)
            fcntl.fcntl(outcome, fcntl.F_ADD_SEALS, _SEALS)
            for name in ("output", "stack dump"):
                made.append(os.memfd_create(name))
                # Each program that the script starts adds to the end.
                fcntl.fcntl(made[-1], fcntl.F_SETFL, os.O_APPEND)
        except OSError:
            _close(made)
            raise
        self._outcome, self.output, self._stack_dump = made
        self.inherited = ChildFiles(scratch, *made)
        _OPEN.append(self)

    @property
    def printed(self) -> int:
        """The size of the printed output in bytes."""
        return os.fstat(self.output).st_size

    def read(self) -> ChildReport:
        """Return the content, within its limits, after the child process has ended."""
        return ChildReport(
            _last_outcome(self._outcome),
            _end_of(self.output, MAX_OUTPUT_BYTES),
            _end_of(self._stack_dump, MAX_STACK_DUMP_BYTES),
        )

    def empty(self) -> None:
        """Forget the outcome and the printed output of a run, before the same child process begins the next one."""
        os.pwrite(self._outcome, LENGTH.pack(0), 0)
        if self.printed:
            os.ftruncate(self.output, 0)

    def close(self) -> None:
        """Free the memory; the child process must have ended."""
        _OPEN.remove(self)
        _close(self.inherited.descriptors)


_OPEN: Final[list[MemoryFiles]] = []


def close_others(own: ChildFiles) -> None:
    """Close the files of other child processes in a forked one, which would keep them in memory until its end."""
    for files in [each for each in _OPEN if each.inherited is not own]:
        files.close()


@contextmanager
def pickled(value: object) -> Iterator[int]:
    """Pickle a value into memory, and give a descriptor at its start. Raise OSError."""
    descriptor = os.memfd_create("job")
    with os.fdopen(descriptor, "r+b") as file:
        pickle.dump(value, file)
        file.seek(0)
        yield descriptor


def _reserve(descriptor: int, size: int) -> None:
    limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    os.ftruncate(descriptor, size if limit == resource.RLIM_INFINITY else min(size, limit))


def _close(descriptors: Iterable[int]) -> None:
    for descriptor in descriptors:
        with suppress(OSError):
            os.close(descriptor)


def _last_outcome(descriptor: int) -> bytes:
    """Return the last whole outcome; nothing if there is none."""
    size, at, found = os.fstat(descriptor).st_size, 0, (0, 0)
    for _ in range(MAX_OUTCOMES):
        head = os.pread(descriptor, LENGTH.size, at)
        length = LENGTH.unpack(head)[0] if len(head) == LENGTH.size else 0
        at += LENGTH.size
        if not 0 < length <= size - at:
            break
        found = (length, at)
        at += length
    return os.pread(descriptor, *found)


def _end_of(descriptor: int, most: int) -> bytes:
    return os.pread(descriptor, most, max(0, os.fstat(descriptor).st_size - most))
