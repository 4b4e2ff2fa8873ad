"""What a child is, whichever way it was born: the scenario's own process, as its caller sees it."""

from __future__ import annotations

import os
import socket
import time
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import ClassVar, Final, Self

from sim_action.runner.job import JUDGED, Job

# What a user's script has no business to see (the names that GitHub documents for runners).
_SECRET_NAMES: Final = frozenset(
    {"GITHUB_TOKEN", "GH_TOKEN", "GITHUB_ENV", "GITHUB_OUTPUT", "GITHUB_PATH", "GITHUB_STATE", "GITHUB_STEP_SUMMARY"}
)
_SECRET_PREFIXES: Final = ("ACTIONS_", "INPUT_")
_PACKAGE_ROOT: Final = Path(__file__).resolve().parents[3]


class ChildProcess(ABC):
    """A running child.

    Attributes:
        forks: whether children may be copies of this process, with what it has imported.
        limits_memory: whether a child is held to its scenario's `memory_limit`.
        progress: what `select` can wait for; there is something to hear, or the child is gone.
        sim_time: the last that was heard, in s.
        left: after `close`, how many processes it left behind that were ended, as far as known.
        peak_memory: after `close`, the most that was resident of one of its processes, in bytes; 0 if not known.
        silent: whether there will be nothing more to hear.
        judged: `time.monotonic()` when it said that its outcome is written, and it goes on; None: it has not.
        started: `time.monotonic()` at its birth.
    """

    forks: ClassVar[bool]
    limits_memory: ClassVar[bool]

    def __init__(self, job: Job, progress: int | socket.socket) -> None:
        self.job = job
        self.progress = progress
        self.sim_time = 0.0
        self.left = 0
        self.peak_memory = 0
        self.silent = False
        self.judged: float | None = None
        self.started = time.monotonic()
        self._unread = b""

    @classmethod
    @abstractmethod
    def start(cls, job: Job) -> Self:
        """A child for this job. Raises OSError."""

    @abstractmethod
    def poll(self) -> int | None:
        """The exit status if the child is gone (negative: the signal that ended it), else None."""

    @abstractmethod
    def kill(self) -> None:
        """Ends the child."""

    @abstractmethod
    def close(self) -> None:
        """After its end: ends the processes that it left behind, as far as they can be known, and forgets it."""

    def listen(self) -> None:
        """Takes in what the child has said of its progress: sim times, one a line."""
        with suppress(BlockingIOError):
            heard = self._heard()
            self.silent = not heard
            self._unread += heard
        *lines, self._unread = self._unread[-65536:].split(b"\n")
        for line in lines[-2:]:
            with suppress(ValueError):
                self._take(line)

    def _take(self, line: bytes) -> None:
        """Raises ValueError."""
        if line == JUDGED:
            self.judged = self.judged or time.monotonic()
        else:
            self.sim_time = float(line)

    @abstractmethod
    def _heard(self) -> bytes:
        """What there is to hear; nothing at the end. Raises BlockingIOError as long as there is nothing yet."""


def environment(hash_seed: int | None = None) -> dict[str, str]:
    """The caller's, without what a stranger's script could act with. Hygiene, not a boundary."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in _SECRET_NAMES and not name.startswith(_SECRET_PREFIXES)
    }
    path = os.pathsep.join(filter(None, (str(_PACKAGE_ROOT), os.environ.get("PYTHONPATH"))))
    # With a random seed, a controller that walks through a set would give another result every time.
    return {**kept, "PYTHONPATH": path, "PYTHONHASHSEED": str(hash_seed or 0)}
