"""The job of a child process: the scenario to run, and the files for its results."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from sim_action.core.discovery import file_name
from sim_action.core.errors import Location
from sim_action.core.records import dataclass, field, replace
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
    here: Path = field(default_factory=Path.cwd)  # the folder that reports name files from

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
        return replace(place, file=file_name(file.relative_to(self.here))) if file.is_relative_to(self.here) else place

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
