"""The job of a child process: the scenario to run, and the files for its results."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.scenario.model import LoadedScenario

JUDGED: Final = b"judged"
"""The message of a child process that its outcome is written while it still writes recordings."""


@dataclass(frozen=True, slots=True)
class Job:
    """The order to run one scenario, with the places of its files.

    Attributes:
        trace: the file for the trace.
        results: the folder that outcomes name the trace from.
        folder: the folder of the child process, for `outcome.json`, `output.txt` and `hang.txt`.
        memory_is_limited: True if the scenario's `memory_limit` is enforced.
        replay: the file for the replay; None: no replay is written.
        recordings: the files for recordings; each suffix names the format.
        motion: the file for the motion at every step; None: the run is not compared with another one.
        hash_seed: the hash seed of a fresh interpreter; None: a fork is allowed.
        deadline: the time on `time.monotonic()` at which the child process is ended; None: never.
    """

    loaded: LoadedScenario
    trace: Path
    results: Path
    folder: Path
    memory_is_limited: bool = True
    replay: Path | None = None
    recordings: tuple[Path, ...] = ()
    hash_seed: int | None = None
    deadline: float | None = None
    motion: Path | None = None

    @property
    def trace_name(self) -> str:
        """The name of the trace in outcomes, the same on every system."""
        return self.named(self.trace)

    def named(self, path: Path) -> str:
        """Return the name of a file of the run in outcomes, the same on every system."""
        return Path(os.path.relpath(path, self.results)).as_posix()

    @property
    def outcome_file(self) -> Path:
        """The file for the outcome."""
        return self.folder / "outcome.json"

    @property
    def stack_dump_file(self) -> Path:
        """The file for the stack dump that the child process writes just before its time is up."""
        return self.folder / "hang.txt"

    @property
    def output_file(self) -> Path:
        """The file for everything that the child process prints."""
        return self.folder / "output.txt"

    @property
    def printed(self) -> int:
        """The size of the printed output in bytes."""
        try:
            return self.output_file.lstat().st_size
        except OSError:
            return 0


def out_of_memory(job: Job) -> str:
    """Return the message for a scenario that reached its memory limit."""
    scenario = job.loaded.scenario
    if not job.memory_is_limited:
        return "it needs more memory than this machine has"
    return f"it needs more than the {scenario.memory_bytes / 2**30:.4g} GiB of memory that it is allowed (memory_limit)"
