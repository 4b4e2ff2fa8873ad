"""This process and its programs: signals that end it, output without a reader, garbage, and programs on PATH."""

from __future__ import annotations

import errno
import gc
import io
import os
import select
import signal
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Final, Self

from typing_extensions import override

if TYPE_CHECKING:
    import socket

    from _typeshed import ReadableBuffer

# On Windows, a cancelled workflow sends Ctrl-C, then Ctrl-Break. A closed terminal sends SIGHUP.
_SIGNALS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK") if hasattr(signal, name)
)
_CHILD_ENDED: Final[signal.Signals | None] = getattr(signal, "SIGCHLD", None)


def hold_signals() -> None:
    """Let the signals that end this process wait until `release_signals`, or until an `Interruption` handles them.

    Imports take a moment. A signal meanwhile would end the process without any report. Windows cannot do this.
    """
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)


def release_signals() -> None:
    """Deliver the signals that `hold_signals` has held, and all later signals."""
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


class Interruption:
    """A context in which Ctrl-C, SIGTERM, SIGHUP and SIGQUIT only set a flag and end a `wait`.

    A cancelled workflow sends SIGTERM, a closed terminal SIGHUP. An exception raised by a signal handler could come
    after a child process has started and before it is known, or in the middle of a report. `happened`: True after the
    first signal.
    """

    def __init__(self) -> None:
        self.happened = False
        self._awakened: int | socket.socket
        self._written_to: int | socket.socket
        if sys.platform == "win32":
            # Windows cannot wait for anything else together with sockets.
            import socket

            self._awakened, self._written_to = socket.socketpair()
            self._written_to.setblocking(False)
        else:
            self._awakened, self._written_to = os.pipe()
            os.set_blocking(self._written_to, False)

    def __enter__(self) -> Self:
        self._handlers = {}
        # Python gives signals to the main thread only.
        if threading.current_thread() is threading.main_thread():
            self._wakeup = signal.set_wakeup_fd(_descriptor(self._written_to))
            handled = [number for number in _SIGNALS if not _is_silenced(number)]
            self._handlers = {number: signal.signal(number, self._notice) for number in handled}
            if _CHILD_ENDED is not None and signal.getsignal(_CHILD_ENDED) is signal.SIG_IGN:
                # The parent of this process ignored it: the system would keep no exit status of its children.
                self._handlers[_CHILD_ENDED] = signal.signal(_CHILD_ENDED, signal.SIG_DFL)
            release_signals()
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        if self._handlers:
            signal.set_wakeup_fd(self._wakeup)
        for end in (self._awakened, self._written_to):
            if isinstance(end, int):
                os.close(end)
            else:
                end.close()

    def wait(self, seconds: float, *readable: int | socket.socket) -> None:
        """Wait until a signal arrives, one of `readable` can be read, or the time is over."""
        awaited = (self._awakened, *readable)
        if sys.platform == "win32":
            select.select(awaited, [], [], seconds)
            return
        # `select.select` refuses descriptors from 1024 on, and epoll needs a descriptor of its own.
        poll = select.poll()
        for descriptor in awaited:
            poll.register(descriptor, select.POLLIN)
        poll.poll(seconds * 1000)

    def _notice(self, _number: int, _frame: FrameType | None) -> None:
        self.happened = True


def _descriptor(end: int | socket.socket) -> int:
    return end if isinstance(end, int) else end.fileno()


def _is_silenced(number: signal.Signals) -> bool:
    return number.name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN


class _ForgivingFile(io.FileIO):
    """An open descriptor that drops what it cannot write because the terminal or the reader has gone."""

    @override
    def write(self, data: ReadableBuffer, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in (errno.EIO, errno.EPIPE):
                raise
            return memoryview(data).nbytes


def forgive_closed_output() -> None:
    """Let standard output and standard error drop what has no reader any more: it changes no verdict and no report.

    Without effect on Windows, and on streams that a caller has replaced.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if os.name == "posix" and type(stream) is io.TextIOWrapper:
            stream.flush()
            file = io.BufferedWriter(_ForgivingFile(stream.fileno(), "w", closefd=False))
            style = {key: getattr(stream, key) for key in ("encoding", "errors", "line_buffering", "write_through")}
            setattr(sys, name, io.TextIOWrapper(file, **style))


BEFORE_IMPORTS: Final = {
    # A process that forks must not have threads, and results must not depend on the number of cores.
    "OPENBLAS_NUM_THREADS": "1",
    # The search for plugins takes longer than reading a scenario, and no plugin is wanted.
    "PYDANTIC_DISABLE_PLUGINS": "__all__",
}
"""Environment variables of a process that runs scenarios, to be set before numpy and pydantic are imported."""


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_GC_THRESHOLD: Final = 500_000  # Python's own default is 700 (2,000 from 3.13 on)


def collect_garbage_rarely() -> None:
    """Let the garbage collector run less often here and in forks without user code: imports stay alive."""
    gc.set_threshold(_GC_THRESHOLD)


_PROGRAM_SUFFIX: Final = ".exe" if os.name == "nt" else ""


def program_on_path(name: str, *workspaces: Path) -> Path | None:
    """Return the absolute path of a program, from the folders of PATH; None: it was not found.

    A folder counts if its name is absolute, and if it is not the current folder and not inside one of `workspaces` or
    the workspace of the job: no program that a repository holds may be started. Windows, and `shutil.which` there,
    would look in the current folder first.
    """
    job = os.environ.get("GITHUB_WORKSPACE")
    untrusted = [Path(os.path.realpath(folder)) for folder in (*workspaces, *([Path(job)] if job else []))]
    for entry in os.environ.get("PATH", "").split(os.pathsep):
        folder = Path(entry.strip('"'))
        if not folder.is_absolute():
            continue
        real = Path(os.path.realpath(folder))
        if real == Path.cwd() or any(real.is_relative_to(place) for place in untrusted):
            continue
        program = folder / f"{name}{_PROGRAM_SUFFIX}"
        if program.is_file() and os.access(program, os.X_OK):
            return program
    return None
