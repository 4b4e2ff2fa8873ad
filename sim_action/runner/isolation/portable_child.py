"""The way of macOS and Windows: a fresh interpreter for every scenario, by what the standard library has everywhere.

It runs, and is tested, on Linux too. A thread of this process sends the job, and passes on what the child says to a
socket, since that is what `select` can wait for on Windows. The child ends when this process does, whatever that dies
of. What `linux` does and this way cannot:

- End all that a script leaves behind. Where there are process groups (macOS), those that stay in the group of the child
  are ended, and not counted; on Windows, where a job object would do it, none are.
- Hold a script to `memory_limit`, or bound the files that it writes: the machine's memory is the limit. What it prints
  is bounded.
- Be quick: a fresh interpreter imports the engine again.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import traceback
from contextlib import suppress
from typing import Final, NoReturn, Self

from sim_action.runner.isolation.child_process import ChildProcess, environment
from sim_action.runner.job import Job

# A process that the script left behind may hold the pipe, in s.
_LAST_WORDS: Final = 1.0


class PortableChild(ChildProcess):
    """A running child; where there are process groups, the leader of one."""

    forks = False
    limits_memory = False

    def __init__(self, job: Job, process: subprocess.Popen[bytes]) -> None:
        progress, passed_on = socket.socketpair()
        progress.setblocking(False)
        super().__init__(job, progress)
        self._progress = progress
        self._process = process
        self._relay = threading.Thread(target=_relay, args=(pickle.dumps(job), process, passed_on), daemon=True)
        self._relay.start()

    @classmethod
    def start(cls, job: Job) -> Self:
        """Starts a fresh interpreter. Raises OSError."""
        # What goes wrong before the child sees to its own output is told in the same place.
        with job.output_file.open("ab") as words:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "sim_action.runner.isolation.portable_child"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=words,
                env=environment(job.hash_seed),
                # Ctrl-C goes to this process alone: the first is for POSIX, the second for Windows.
                start_new_session=True,
                creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
            )
        try:
            return cls(job, process)
        except OSError:
            process.kill()
            process.wait()
            raise

    def poll(self) -> int | None:
        """The exit status if the child is gone (negative: the signal that ended it), else None.

        Windows knows no signals: what ended a child there is a positive number.
        """
        return self._process.poll()

    def kill(self) -> None:
        """Ends the child and, where there are process groups, its group."""
        self._process.kill()
        self._kill_group()

    def close(self) -> None:
        """After its end: ends what it left behind in its group, and forgets it."""
        self._process.wait()
        # While the group has a member, no other process gets its number; it was reaped a moment ago, if it has none.
        self._kill_group()
        self._relay.join(_LAST_WORDS)
        self.listen()
        self._progress.close()
        if self._process.stdin:
            with suppress(OSError):
                self._process.stdin.close()

    def _kill_group(self) -> None:
        if sys.platform != "win32":
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _heard(self) -> bytes:
        try:
            return self._progress.recv(65536)
        except ConnectionError:
            # On Windows, this is a connection of TCP, which can end so, too.
            return b""


def _relay(job: bytes, process: subprocess.Popen[bytes], progress: socket.socket) -> None:
    """Sends the job, and passes on what the child says until it says no more."""
    assert process.stdin
    assert process.stdout
    # A child may be gone before it has read its job; the end of this pipe tells it that its caller is gone.
    with suppress(OSError):
        process.stdin.write(job)
        process.stdin.flush()
    with process.stdout, progress, suppress(OSError):
        while said := os.read(process.stdout.fileno(), 65536):
            progress.sendall(said)


def main() -> NoReturn:
    """Run the child process: a fresh interpreter that has done nothing else.

    The job comes on standard input, which stays open as long as the caller is there; progress goes to standard output.
    """
    from sim_action.runner.child_main import leave, received_job, run_job, turn_to

    try:
        caller, progress = os.dup(0), os.dup(1)
        job = received_job()
        turn_to(job)
        # Not before standard input is another: on Windows, whoever asks anything of a pipe that is read has to wait.
        threading.Thread(target=_end_with, args=(caller,), daemon=True).start()
        run_job(job, progress)
        leave()
    except BaseException:  # noqa: BLE001 - threads that the user's code has left would hold up the end
        traceback.print_exc()
    finally:
        os._exit(1)


def _end_with(caller: int) -> None:
    """A caller that is killed outright cannot end its children."""
    with suppress(OSError):
        os.read(caller, 1)
        os._exit(1)


if __name__ == "__main__":
    main()
