"""The child process of one scenario, as the parent sees it, and the number of them that the system allows."""

from __future__ import annotations

import errno
import os
import re
import stat
import sys
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, Self

from sim_action.core.errors import Location
from sim_action.runner.job import BEGUN, JUDGED, ChildReport, Job
from sim_action.scenario.child_environment import code_environment

if TYPE_CHECKING:
    import socket


# The message that a child process cannot begin, with the number of the error.
REFUSED: Final = b"refused "
PACKAGE_ROOT: Final = Path(__file__).resolve().parents[3]


_Identity = tuple[int, int, int]
Former = dict[Path, _Identity | None]


class ChildProcess(ABC):
    """A running child process."""

    forks: ClassVar[bool]  # True if child processes may be forks of this process, with its imported modules
    limits_memory: ClassVar[bool]  # True if the scenario's `memory_limit` is enforced
    descriptors: ClassVar[int] = 1  # the most descriptors of this process that a running child process takes
    tasks: ClassVar[int] = 2  # the processes and threads that a child process without user code's own takes, at most

    def __init__(self, job: Job, progress: int | socket.socket, former: Former | None = None) -> None:
        """Take the process of a job; `former`: the files before it started, None: it waits, and cannot write yet."""
        self.job = job
        self.progress = progress  # readable for `select` if there is progress, or if the child process has ended
        self.sim_time = 0.0  # the last reported sim time, in s
        self.moved: float | None = None  # `time.monotonic()` when it first reported that sim time; None: not yet
        self.silent = False  # True if there will be no more progress
        self.judged: float | None = None  # `time.monotonic()` when it reported that its outcome is written
        self.exit_call: Location | None = None  # the line that called `os._exit`, as the child process says
        self.started = time.monotonic()
        self.begun = False  # True if it has begun to run its job
        # The error of the system if it could not begin, before any code of the scenario has run.
        self.refusal: OSError | None = None
        # After `close`: the number of processes that it left behind and that were ended, as far as known; the largest
        # resident memory of one of its processes in bytes, 0 if not known; the content of its files; True if runs
        # before it in the same process may have changed how it ended.
        self.left = 0
        self.peak_memory = 0
        self.report = ChildReport()
        self.is_doubtful = False
        self._unread = b""
        self._former = former_files(job) if former is None else former

    @classmethod
    @abstractmethod
    def start(cls, job: Job) -> Self:
        """Start a child process for this job. Raise OSError."""

    @classmethod
    def starter(cls, job: Callable[[int], Job]) -> Starter:  # noqa: ARG003 - types that share processes use it
        """Return a starter for jobs, given by index; several may share a child process where the system allows it."""
        return Starter(cls)

    @abstractmethod
    def poll(self) -> int | None:
        """Return the exit status after the end (negative: the signal that ended it), else None."""

    @abstractmethod
    def kill(self) -> None:
        """End the child process."""

    @abstractmethod
    def close(self) -> None:
        """Clean up after its end: end the processes that it left behind, as far as they are known; set `report`."""

    @property
    def printed(self) -> int:
        """The size of the printed output in bytes, as far as known."""
        return 0

    def wrote(self, path: Path) -> bool:
        """Return True if a regular file is here that was not there before the start."""
        return _identity(path) not in (None, self._former[path])

    def listen(self) -> None:
        """Read the progress of the child process: sim times, one per line."""
        with suppress(BlockingIOError):
            heard = self._heard()
            self.silent = not heard
            self._unread += heard
        *lines, self._unread = self._unread[-65536:].split(b"\n")
        self.begun = self.begun or BEGUN in lines
        for line in lines:
            with suppress(ValueError):
                self._take(line)

    def _take(self, line: bytes) -> None:
        """Handle a line of progress. Raise ValueError."""
        if line == JUDGED:
            self.judged = self.judged or time.monotonic()
        elif line.startswith(REFUSED):
            number = int(line.removeprefix(REFUSED))
            self.refusal = OSError(number, os.strerror(number))
        elif (call := _EXIT_CALL.fullmatch(line)) is not None:
            self.exit_call = Location(os.fsdecode(call["file"]), int(call["line"]))
        else:
            before, self.sim_time = self.sim_time, float(line)
            if self.sim_time > before:
                self.moved = time.monotonic()

    @abstractmethod
    def _heard(self) -> bytes:
        """Return the available bytes; nothing at the end. Raise BlockingIOError while there are none yet."""


class Starter:
    """Starts a child process of its own for each job."""

    def __init__(self, child_type: type[ChildProcess]) -> None:
        """Take the type of child processes."""
        self._child_type = child_type

    def start(self, index: int, job: Job, *, alone: bool, most_waiting: int) -> ChildProcess:
        """Start a job. Raise OSError.

        Args:
            index: that in the list of all jobs.
            job: the job.
            alone: True if it needs a child process of its own.
            most_waiting: how many child processes may then wait for a next job.
        """
        return self._child_type.start(job)

    def end_waiting(self) -> None:
        """End the processes that wait for a next job."""


_PROBE_BYTES: Final = 4096
# The message of `child_main` that user code calls `os._exit`.
_EXIT_CALL: Final = re.compile(rb"exit (?P<line>[0-9]{1,9}) (?P<file>.+)")


def scratch_folder() -> tempfile.TemporaryDirectory[str]:
    """Make the scratch folder of a child process, in another place if TMPDIR is full or missing. Raise OSError."""
    try:
        return _writable_folder()
    except OSError as error:
        former, tempfile.tempdir = tempfile.tempdir, None
        try:
            # `tempfile` searches again for a folder that can be written.
            return _writable_folder()
        except OSError:
            tempfile.tempdir = former
            raise error from None


def _writable_folder() -> tempfile.TemporaryDirectory[str]:
    # On Windows, processes that a script left running may keep files open in it.
    folder = tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True)
    try:
        # On a full disk, an empty folder can often be made.
        probe = Path(folder.name, "probe")
        probe.write_bytes(bytes(_PROBE_BYTES))
        probe.unlink()
    except OSError:
        remove(folder)
        raise
    return folder


def remove(scratch: tempfile.TemporaryDirectory[str]) -> None:
    """Remove a scratch folder, as far as possible: a script may have put anything into it."""
    with suppress(OSError):
        # An empty folder can be removed even without a free descriptor.
        Path(scratch.name).rmdir()
    with suppress(OSError, RecursionError):
        scratch.cleanup()


def former_files(job: Job) -> Former:
    """Return the identity of each file that the job may write."""
    return {path: _identity(path) for path in job.evidence}


def _identity(path: Path) -> _Identity | None:
    """Return the identity of a regular file, which a rewritten file does not keep; None: there is none."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return (status.st_ino, status.st_mtime_ns, status.st_size) if stat.S_ISREG(status.st_mode) else None


def environment(
    pass_env: Collection[str] = (), stated: Mapping[str, str] | None = None, hash_seed: int | None = None
) -> dict[str, str]:
    """Return the environment of a process that runs code of the repository; `stated`: by the scenario."""
    variables = code_environment(os.environ, pass_env, stated)
    path = os.pathsep.join(filter(None, (str(PACKAGE_ROOT), os.environ.get("PYTHONPATH"))))
    # With a random hash seed, a controller that iterates over a set would differ in every run.
    return {**variables, "PYTHONPATH": path, "PYTHONHASHSEED": str(hash_seed or 0)}


def job_environment(job: Job) -> dict[str, str]:
    """Return the environment of an interpreter that runs a job; variables of a scenario are for its code only."""
    loaded = job.loaded
    stated = loaded.scenario.environment if loaded.scenario.runs_user_code else None
    return environment(loaded.workspace.pass_env, stated, job.hash_seed)


# For the start of one more child process, and for imports, reports and recordings of this process.
_RESERVED_DESCRIPTORS: Final = 16
_RESERVED_TASKS: Final = 4


def most_children(child_type: type[ChildProcess], jobs: int) -> int:
    """Return how many child processes may run at the same time: `jobs`, or fewer if resource limits ask for it."""
    descriptors = (_free_descriptors() - _RESERVED_DESCRIPTORS) / child_type.descriptors
    tasks = (_free_tasks() - _RESERVED_TASKS) / child_type.tasks
    return max(1, int(min(jobs, descriptors, tasks)))


def cause_of(error: OSError | MemoryError) -> str:
    """Return why a child process cannot be started although no other one runs, and the way out, in plain words."""
    if isinstance(error, MemoryError):
        error = OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
    number = error.errno
    said = error.strerror or str(error)
    reason = f"{said[:1].lower()}{said[1:]}"
    if number in (errno.ENOSPC, getattr(errno, "EDQUOT", None)):
        return f"{reason}; free some space in {tempfile.gettempdir()}, or set TMPDIR to another folder"
    if number in _LIMITS:
        name, advice = _LIMITS[number]
        limit = _soft_limit(name)
        shown = "" if limit == float("inf") else f" ({name} is {limit:.0f})"
        return f"{reason}{shown}; {advice}"
    if number in _ADVICE:
        return f"{reason}; {_ADVICE[number]}"
    return reason if error.filename is None else f"{reason}: {error.filename}"


_LIMITS: Final[Mapping[int | None, tuple[str, str]]] = {
    errno.EMFILE: ("RLIMIT_NOFILE", 'raise this limit with "ulimit -n"'),
    errno.EAGAIN: ("RLIMIT_NPROC", 'end other processes of this user, or raise the limit with "ulimit -u"'),
}
_ADVICE: Final[Mapping[int | None, str]] = {
    errno.ENFILE: "this machine has too many open files: end other processes",
    errno.ENOMEM: "this machine has too little memory: end other processes, or use a machine with more memory",
}


def _soft_limit(name: str) -> float:
    """Return a resource limit of this process; infinity if it has none."""
    if sys.platform == "win32":
        return float("inf")
    import resource

    limit, _ = resource.getrlimit(getattr(resource, name))
    return float("inf") if limit == resource.RLIM_INFINITY else limit


def _free_descriptors() -> float:
    """Return how many more descriptors this process may open; infinity if this is not known."""
    for folder in ("/proc/self/fd", "/dev/fd"):
        with suppress(OSError):
            # One of them is open for this list alone.
            return _soft_limit("RLIMIT_NOFILE") - (len(list(Path(folder).iterdir())) - 1)
    return float("inf")


def _free_tasks() -> float:
    """Return how many more processes and threads this user may have; infinity if this is not limited or not known."""
    if sys.platform != "linux" or os.getuid() == 0:
        # Root has no such limit. Other systems do not list threads.
        return float("inf")
    limit = _soft_limit("RLIMIT_NPROC")
    if limit - _MANY_TASKS > _all_tasks():
        return _MANY_TASKS
    return limit - _tasks_of(os.getuid())


# With so many left for all users together, this user's tasks need not be counted: reading /proc takes time.
_MANY_TASKS: Final = 2048


def _all_tasks() -> float:
    """Return the number of all processes and threads of this machine."""
    try:
        return float(Path("/proc/loadavg").read_text("ascii").split()[3].partition("/")[2])
    except (OSError, ValueError, IndexError):
        return float("inf")


def _tasks_of(user: int) -> int:
    """Return the number of processes and threads of a user, as far as they are visible."""
    tasks = 0
    with suppress(OSError):
        for folder in Path("/proc").iterdir():
            # A process may end meanwhile.
            with suppress(OSError, ValueError, KeyError):
                if folder.name.isdigit():
                    lines = (folder / "status").read_text("utf-8", errors="replace").splitlines()
                    status = dict(line.partition(":")[::2] for line in lines)
                    tasks += int(status["Threads"]) if int(status["Uid"].split()[0]) == user else 0
    return tasks
