"""The job of a child process: the scenario to run, the files for its results, and those for its parent.

For its parent it writes its outcome, its printed output, and a stack dump. On Linux these are files in memory
(memfd_create(2)), and the child process inherits their descriptors: a full disk, or a script that removes files, cannot
harm them. On other systems they lie in the scratch folder of the child process.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Final, Self

from sim_action.core.errors import Location
from sim_action.core.files import whole_file
from sim_action.core.records import dataclass, field, replace
from sim_action.core.workspace import file_name
from sim_action.scenario.model import LoadedScenario

FORKED: Final = b"forked "  # the message of a supervisor that a preloaded interpreter has forked, with its number
BEGUN: Final = b"begun"  # the message of a child process that has its job and begins to run it
JUDGED: Final = b"judged"  # the message of a child process that its outcome is written while it still writes recordings

ENDED: Final = b"ended"
"""The message of a shared child process that its run has ended and that it waits for the next one."""

ENDED_LAST: Final = b"ended last"
"""The message of a shared child process that its run has ended and that it takes no other one."""


@dataclass(frozen=True, slots=True)
class Job:
    """The order to run one scenario, with absolute paths of its files: a script may change the current folder."""

    loaded: LoadedScenario
    trace: Path  # the file for the trace
    results: Path  # the folder that outcomes name the trace from
    memory_is_limited: bool = True  # True if the scenario's `memory_limit` is enforced
    replay: Path | None = None  # the file for the replay; None: no replay is written
    recordings: tuple[Path, ...] = ()  # the files for recordings; each suffix names the format
    hash_seed: int | None = None  # the hash seed of a fresh interpreter; None: a fork is allowed
    deadline: float | None = None  # the time on `time.monotonic()` at which the child process is ended; None: never
    motion: Path | None = None  # the file for the motion at every step; None: the run is not compared with another one
    working_folder: Path = field(default_factory=Path.cwd)  # the folder that reports name files from

    def __post_init__(self) -> None:
        """Make all paths absolute."""
        for name in ("trace", "results", "replay", "motion"):
            if (path := getattr(self, name)) is not None:
                object.__setattr__(self, name, path.absolute())
        object.__setattr__(self, "recordings", tuple(path.absolute() for path in self.recordings))

    @property
    def evidence(self) -> tuple[Path, ...]:
        """All files that the run may write for reports and comparisons."""
        return tuple(path for path in (self.trace, self.replay, self.motion, *self.recordings) if path is not None)

    @property
    def trace_name(self) -> str:
        """The name of the trace in outcomes, the same on every system."""
        return self.named(self.trace)

    def named_from_here(self, place: Location) -> Location:
        """Return a place as reports name it: files below the caller's folder from there."""
        file = Path(place.file)
        return (
            replace(place, file=file_name(file.relative_to(self.working_folder)))
            if file.is_relative_to(self.working_folder)
            else place
        )

    def named(self, path: Path) -> str:
        """Return the name of a file of the run in outcomes, the same on every system."""
        if path.is_relative_to(self.results):
            return path.relative_to(self.results).as_posix()
        return Path(os.path.relpath(path, self.results)).as_posix()


def out_of_memory(job: Job) -> str:
    """Return the message for a scenario that reached its memory limit."""
    scenario = job.loaded.scenario
    if not job.memory_is_limited:
        return "it needs more memory than this machine has"
    return f"it needs more than the {scenario.memory_bytes / 2**30:.4g} GiB of memory that it is allowed (memory_limit)"


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
