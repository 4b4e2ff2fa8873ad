"""A child process for one scenario: how it is born, listened to, and ended with everything that it left behind.

Where no code of the user's runs, it is a fork of this process, and has no children. Else it is a `supervisor`, whose
child is the scenario's own process.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Final, NoReturn, Self

from sim_action.process_table import processes
from sim_action.worker import Job, run_job

CAN_FORK: Final = sys.platform == "linux"

# What a user's script has no business to see (the names that GitHub documents for runners).
_SECRET_NAMES: Final = frozenset(
    {"GITHUB_TOKEN", "GH_TOKEN", "GITHUB_ENV", "GITHUB_OUTPUT", "GITHUB_PATH", "GITHUB_STATE", "GITHUB_STEP_SUMMARY"}
)
_SECRET_PREFIXES: Final = ("ACTIONS_", "INPUT_")
_PACKAGE_ROOT: Final = Path(__file__).resolve().parent.parent


# How long a supervisor may take to end what it is there for, in s: longer, if the machine is busy or it was stopped.
_ENDING: Final = 5.0
_ENDING_POLL: Final = 0.001


class Child:
    """A running child. Its process is the leader of a session and group of its own.

    Attributes:
        progress: descriptor to read sim times from, one a line; at its end when the child is gone.
        sim_time: the last of them.
        left: after `close`, how many processes it left behind that were ended.
        peak_memory: after `close`, the most that was resident of one of its processes, in bytes; 0 if not known.
        silent: whether the pipe has come to its end.
        started: `time.monotonic()` at its birth.
    """

    def __init__(self, job: Job, pid: int, progress: int, *, supervised: bool) -> None:
        self.job = job
        self.progress = progress
        self.sim_time = 0.0
        self.left = 0
        self.peak_memory = 0
        self.silent = False
        self.started = time.monotonic()
        self._pid = pid
        self._supervised = supervised
        self._unread = b""

    @classmethod
    def start(cls, job: Job) -> Self:
        """Forks this process, or starts a fresh interpreter where forking is not to be had or user code will run."""
        reader, writer = os.pipe()
        os.set_blocking(reader, False)
        try:
            alone = job.loaded.scenario.runs_user_code or not CAN_FORK or threading.active_count() > 1
            pid = _spawn(job, writer) if alone else _fork(job, writer)
        finally:
            os.close(writer)
        return cls(job, pid, reader, supervised=alone)

    def listen(self) -> None:
        """Takes in what the child has said of its progress."""
        with suppress(BlockingIOError):
            read = os.read(self.progress, 65536)
            self.silent = not read
            self._unread += read
        *lines, self._unread = self._unread[-65536:].split(b"\n")
        for line in lines[-2:]:
            with suppress(ValueError):
                if line.startswith(b"end "):
                    self.left, self.peak_memory = map(int, line.split()[1:])
                else:
                    self.sim_time = float(line)

    def poll(self) -> int | None:
        """The exit status if the child is gone (negative: the signal that ended it), else None.

        It is not reaped yet: until `close`, its number cannot become another process's.
        """
        ended = os.waitid(os.P_PID, self._pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if ended is None:
            return None
        return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status

    def kill(self) -> None:
        """Ends the child, also one that has not become the leader of its group yet."""
        if not self._supervised:
            os.kill(self._pid, signal.SIGKILL)
            return
        os.kill(self._pid, signal.SIGTERM)
        os.kill(self._pid, signal.SIGCONT)

    def close(self) -> None:
        """After its end: ends the processes that it left behind, and forgets it."""
        if self._supervised:
            self._await_supervisor()
        else:
            self._kill_group()
        _, _, usage = os.wait4(self._pid, 0)
        if not self._supervised:
            self.peak_memory = usage.ru_maxrss << 10
        self.listen()
        os.close(self.progress)

    def _kill_group(self) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._pid, signal.SIGKILL)

    def _await_supervisor(self) -> None:
        patience = time.monotonic() + _ENDING
        while (status := self.poll()) is None and time.monotonic() < patience:
            time.sleep(_ENDING_POLL)
        if status is None or status == -signal.SIGKILL:
            # The supervisor itself may have been killed, by what it should have ended.
            os.kill(self._pid, signal.SIGKILL)
            self._kill_session()

    def _kill_session(self) -> None:
        for process in processes():
            if process.session == self._pid != process.number:
                with suppress(ProcessLookupError, PermissionError):
                    os.kill(process.number, signal.SIGKILL)


def _fork(job: Job, writer: int) -> int:
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid == 0:
        _child_main(job, writer)
    return pid


def _child_main(job: Job, writer: int) -> NoReturn:
    """Never returns into the parent's code, whatever happens."""
    code = 1
    try:
        signal.set_wakeup_fd(-1)
        os.setsid()
        run_job(job, writer)
        code = 0
    except BaseException:  # noqa: BLE001 - nothing may return into the parent's code
        traceback.print_exc()
    finally:
        with suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _spawn(job: Job, writer: int) -> int:
    with tempfile.TemporaryFile() as stdin:
        pickle.dump(job, stdin)
        stdin.seek(0)
        process = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing from a scenario
            [sys.executable, "-P", "-m", "sim_action.supervisor", str(writer)],
            stdin=stdin,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(writer,),
            start_new_session=True,
            env=_environment(),
        )
    # This object would wait for the process too; from here on, its number is all that counts.
    process.returncode = 0
    return process.pid


def _environment() -> dict[str, str]:
    """The caller's, without what a stranger's script could act with. Hygiene, not a boundary."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in _SECRET_NAMES and not name.startswith(_SECRET_PREFIXES)
    }
    path = os.pathsep.join(filter(None, (str(_PACKAGE_ROOT), os.environ.get("PYTHONPATH"))))
    # With a random seed, a controller that walks through a set would give another result every time.
    return {**kept, "PYTHONPATH": path, "PYTHONHASHSEED": "0"}
