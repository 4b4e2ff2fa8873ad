"""The files that a child process writes for its parent: its outcome, its printed output, and a stack dump.

On Linux they are files in memory (memfd_create(2)), and the child process inherits their descriptors: a full disk, or a
script that removes files, cannot harm them. On other systems they lie in the scratch folder of the child process.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Final, Self

from sim_action.core.files import whole_file
from sim_action.core.records import dataclass

Place = int | Path  # a descriptor of a file in memory, or a path
# The names in a scratch folder.
OUTCOME_FILE: Final = "outcome.json"
OUTPUT_FILE: Final = "output.txt"
STACK_DUMP_FILE: Final = "hang.txt"

MAX_OUTCOME_BYTES: Final = 32 << 20
MAX_OUTPUT_BYTES: Final = 64_000
MAX_STACK_DUMP_BYTES: Final = 1_000_000
"""The parent reads at most this much; of longer printed output or stack dumps, it reads the end."""

MAX_OUTCOMES: Final = 2  # the verdict, and the verdict with notes about recordings

LENGTH: Final = struct.Struct("<Q")
"""In memory, an outcome follows its length in bytes. The length is written last, and 0 means that there is none."""


@dataclass(frozen=True, slots=True)
class ChildFiles:
    """The files of one child process."""

    scratch: Path  # its scratch folder, for temporary files of user code
    outcome: Place  # receives the outcome, see `OutcomeWriter`
    output: Place  # receives everything that it prints
    stack_dump: Place  # receives the stack just before its time is up

    @classmethod
    def in_folder(cls, scratch: Path) -> Self:
        """Return files that lie in the scratch folder."""
        return cls(scratch, scratch / OUTCOME_FILE, scratch / OUTPUT_FILE, scratch / STACK_DUMP_FILE)

    @property
    def descriptors(self) -> tuple[int, ...]:
        """The descriptors of files in memory."""
        return tuple(place for place in (self.outcome, self.output, self.stack_dump) if isinstance(place, int))


@dataclass(frozen=True, slots=True)
class ChildReport:
    """The content of the files of a child process that has ended; it cannot be trusted."""

    outcome: bytes = b""
    output: bytes = b""
    stack_dump: bytes = b""

    @property
    def verdict(self) -> bytes:
        """The outcome as JSON."""
        return self.outcome.partition(b"\n")[0]

    @property
    def inputs(self) -> bytes:
        """The files that user code has read, as JSON."""
        return self.outcome.partition(b"\n")[2]


class OutcomeWriter:
    """Writes the outcome of this process whole, or not at all if it is killed; opened before user code runs."""

    def __init__(self, place: Place) -> None:
        """Open the file for the outcome. Raise OSError."""
        if isinstance(place, int):
            # Never closed: user code may have closed its descriptor, and opened another file with the same number.
            self._write: Callable[[bytes], None] = _Records(mmap.mmap(place, 0)).append
        else:
            self._path = place
            self._write = self._replace

    def write(self, outcome: bytes) -> None:
        """Replace the outcome. Raise OSError, ValueError if it is too large."""
        if len(outcome) > MAX_OUTCOME_BYTES:
            raise ValueError(_TOO_LARGE)
        self._write(outcome)

    def _replace(self, outcome: bytes) -> None:
        with whole_file(self._path) as file:
            file.write(outcome)


_TOO_LARGE: Final = f"the outcome is larger than {MAX_OUTCOME_BYTES >> 20} MiB, the maximum"


class _Records:
    """Outcomes in memory, one after the other; the last one counts."""

    def __init__(self, memory: mmap.mmap) -> None:
        self._memory = memory
        self._end = 0

    def append(self, outcome: bytes) -> None:
        """Add an outcome. Raise ValueError if there is no room."""
        start = self._end + LENGTH.size
        end = start + len(outcome)
        if end > len(self._memory):
            raise ValueError(_TOO_LARGE)
        self._memory[start:end] = outcome
        # A former run in this process may have left a longer outcome here.
        after = min(end + LENGTH.size, len(self._memory))
        self._memory[end:after] = bytes(after - end)
        self._memory[self._end : start] = LENGTH.pack(len(outcome))
        self._end = end
