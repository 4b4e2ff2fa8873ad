"""Child processes on macOS and Windows: a fresh interpreter for every scenario, with the standard library only.

It also runs, and is tested, on Linux. A thread of this process sends the job, and copies the progress to a socket,
because `select` on Windows can wait for sockets only. The child process ends when this process ends, even when that is
killed. Differences from `linux_child`:

- Processes that a script leaves behind are not all ended. On macOS, those in the child's process group are ended, but
  not counted. On Windows, none are ended; this would need a job object.
- `memory_limit` is not enforced, and written files are not limited: the memory of the machine is the limit. Printed
  output is limited.
- It is slower: a fresh interpreter imports the engine again.
"""

from __future__ import annotations

import errno
import os
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Final, NoReturn, Self

from sim_action.core.files import open_regular
from sim_action.runner.isolation.child_process import ChildProcess, job_environment, remove, scratch_folder
from sim_action.runner.job import (
    MAX_OUTCOME_BYTES,
    MAX_OUTPUT_BYTES,
    MAX_STACK_DUMP_BYTES,
    OUTCOME_FILE,
    OUTPUT_FILE,
    STACK_DUMP_FILE,
    ChildFiles,
    ChildReport,
    Job,
)

_RELAY_TIMEOUT_S: Final = 1.0  # a process that the script left behind may keep the pipe open


class PortableChild(ChildProcess):
    """A running child process, the leader of a group where there are process groups."""

    forks = False
    limits_memory = False
    descriptors = 4
    tasks = 3

    def __init__(self, job: Job, process: subprocess.Popen[bytes], scratch: tempfile.TemporaryDirectory[str]) -> None:
        """Send the job to the process. Raise OSError."""
        progress, passed_on = socket.socketpair()
        try:
            progress.setblocking(False)
            super().__init__(job, progress)
            self._progress = progress
            self._process = process
            self._scratch = scratch
            self._folder = Path(scratch.name)
            sent = pickle.dumps((job, ChildFiles.in_folder(self._folder)))
            self._relay = threading.Thread(target=_relay, args=(sent, process, passed_on), daemon=True)
            try:
                self._relay.start()
            except RuntimeError:
                raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN)) from None
        except OSError:
            progress.close()
            passed_on.close()
            raise

    @classmethod
    def start(cls, job: Job) -> Self:
        """Start a fresh interpreter. Raise OSError."""
        with ExitStack() as undone:
            scratch = scratch_folder()
            undone.callback(remove, scratch)
            # Errors before the child redirects its output go to the same file.
            with Path(scratch.name, OUTPUT_FILE).open("ab") as words:
                process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "sim_action.runner.isolation.portable_child"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=words,
                    env=job_environment(job),
                    # Ctrl-C goes to this process alone: the first is for POSIX, the second for Windows.
                    start_new_session=True,
                    creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
                )
            try:
                child = cls(job, process, scratch)
            except OSError:
                process.kill()
                process.wait()
                for pipe in filter(None, (process.stdin, process.stdout)):
                    pipe.close()
                raise
            # From here on `close` cleans up.
            undone.pop_all()
            return child

    def poll(self) -> int | None:
        """Return the exit status after the end, else None; without signals, a crash on Windows is positive."""
        return self._process.poll()

    def kill(self) -> None:
        """End the child process and, where there are process groups, its group."""
        self._process.kill()
        self._kill_group()

    def close(self) -> None:
        """Clean up after its end: end the processes in its group."""
        self._process.wait()
        # The number of a group with members is not reused; an empty group was reaped a moment ago.
        self._kill_group()
        self._relay.join(_RELAY_TIMEOUT_S)
        self.listen()
        self._progress.close()
        if self._process.stdin:
            with suppress(OSError):
                self._process.stdin.close()
        self.report = ChildReport(
            _end_of(self._folder / OUTCOME_FILE, MAX_OUTCOME_BYTES),
            _end_of(self._folder / OUTPUT_FILE, MAX_OUTPUT_BYTES),
            _end_of(self._folder / STACK_DUMP_FILE, MAX_STACK_DUMP_BYTES),
        )
        remove(self._scratch)

    @property
    def printed(self) -> int:
        """The size of the printed output in bytes."""
        try:
            return (self._folder / OUTPUT_FILE).lstat().st_size
        except OSError:
            return 0

    def _kill_group(self) -> None:
        if sys.platform != "win32":
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _heard(self) -> bytes:
        try:
            return self._progress.recv(65536)
        except ConnectionError:
            # On Windows this is a TCP connection, which can end with an error.
            return b""


def _end_of(path: Path, most: int) -> bytes:
    """Return the last bytes of a file; nothing if it is not a regular file."""
    try:
        file = open_regular(path, follow_link=False)
    except OSError:
        return b""
    with file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - most))
        return file.read(most)


def _relay(job: bytes, process: subprocess.Popen[bytes], progress: socket.socket) -> None:
    """Send the job, and pass on the progress until there is no more."""
    assert process.stdin
    assert process.stdout
    # The child may end before it reads its job. The end of this pipe reports the end of the caller.
    with suppress(OSError):
        process.stdin.write(job)
        process.stdin.flush()
    with process.stdout, progress, suppress(OSError):
        while said := os.read(process.stdout.fileno(), 65536):
            progress.sendall(said)


def main() -> NoReturn:
    """Run the child process, a fresh interpreter: the job comes on standard input, progress goes to its output."""
    # only where it is asked for
    from sim_action.runner.child_main import become_child, exit_child, received_job, run_job

    try:
        caller, progress = os.dup(0), os.dup(1)
        job, files = received_job()
        become_child(files, progress)
        # Only after standard input is replaced: on Windows, each call on a pipe waits for a pending read.
        threading.Thread(target=_end_with, args=(caller,), daemon=True).start()
        run_job(job, files, progress)
        exit_child()
    except BaseException:  # noqa: BLE001 - threads of user code would delay the end
        traceback.print_exc()
    finally:
        os._exit(1)


def _end_with(caller: int) -> None:
    with suppress(OSError):
        os.read(caller, 1)
        os._exit(1)


if __name__ == "__main__":
    main()
