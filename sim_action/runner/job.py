"""A job: one scenario to run in a process of its own, and the files by which that answers."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.scenario.model import LoadedScenario

JUDGED: Final = b"judged"
"""What a child says once its outcome is written, and it has more to do."""


@dataclass(frozen=True, slots=True)
class Job:
    """One scenario to run, and where its traces, its replay and its words go.

    Attributes:
        trace: where the trace is written.
        results: the folder that outcomes name the trace from.
        folder: the child's own, for `outcome.json`, `output.txt` and `hang.txt`.
        memory_is_limited: whether the child is held to the scenario's `memory_limit`.
        replay: where the replay is written; None: nobody asks for it.
        recordings: where recordings are written, each of the format that its name ends with.
        hash_seed: with which a fresh interpreter hashes text; None: a fork will do.
        deadline: of `time.monotonic()`, at which the child is given up; None: it is not.
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

    @property
    def trace_name(self) -> str:
        """How outcomes name the trace, on every system."""
        return self.named(self.trace)

    def named(self, path: Path) -> str:
        """How outcomes name a file of the run, on every system."""
        return Path(os.path.relpath(path, self.results)).as_posix()

    @property
    def outcome_file(self) -> Path:
        """Where the child writes its outcome."""
        return self.folder / "outcome.json"

    @property
    def hang_file(self) -> Path:
        """Where the child notes what it is at when its time is up."""
        return self.folder / "hang.txt"

    @property
    def output_file(self) -> Path:
        """Where everything goes that the child prints."""
        return self.folder / "output.txt"

    @property
    def printed(self) -> int:
        """How many bytes that has come to."""
        try:
            return self.output_file.lstat().st_size
        except OSError:
            return 0


def out_of_memory(job: Job) -> str:
    """What to say of a scenario that has come to its limit of memory."""
    scenario = job.loaded.scenario
    if not job.memory_is_limited:
        return "it needs more memory than this machine has"
    return f"it needs more than the {scenario.memory_bytes / 2**30:.4g} GiB of memory that it is allowed (memory_limit)"
