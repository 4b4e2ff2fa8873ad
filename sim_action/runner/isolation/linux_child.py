"""The way of Linux: a child that is held to its limits, and ended with everything that it left behind.

Where no code of the user's runs, it is a fork of this process, and has no children. Else, and where a run is repeated,
it is a `supervisor`, whose child is the scenario's own process: copies of one process would share what may differ.
"""

from __future__ import annotations

import gc
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
from typing import Final, NoReturn, Self

from sim_action.runner.child_main import run_job, turn_to
from sim_action.runner.isolation.child_process import ChildProcess, environment
from sim_action.runner.isolation.process_control import impose_limits, processes
from sim_action.runner.job import Job

assert sys.platform == "linux"

# How long a supervisor may take to end what it is there for, in s: longer, if the machine is busy or it was stopped.
_ENDING: Final = 5.0
_ENDING_POLL: Final = 0.001


class LinuxChild(ChildProcess):
    """A running child. Its process is the leader of a session and group of its own."""

    forks = True
    limits_memory = True

    def __init__(self, job: Job, pid: int, progress: int, *, supervised: bool) -> None:
        super().__init__(job, progress)
        self._progress = progress
        self._pid = pid
        self._supervised = supervised

    @classmethod
    def start(cls, job: Job) -> Self:
        """Forks this process, or starts a fresh interpreter where user code will run, threads do, or it is asked for.

        Raises OSError.
        """
        reader, writer = os.pipe()
        os.set_blocking(reader, False)
        # A caller that does not listen is no reason to wait.
        os.set_blocking(writer, False)
        try:
            of_others = job.loaded.scenario.runs_user_code or job.hash_seed is not None
            alone = of_others or threading.active_count() > 1
            pid = _spawn(job, writer) if alone else _fork(job, writer)
        finally:
            os.close(writer)
        return cls(job, pid, reader, supervised=alone)

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
        os.close(self._progress)

    def _heard(self) -> bytes:
        return os.read(self._progress, 65536)

    def _take(self, line: bytes) -> None:
        if line.startswith(b"end "):
            self.left, self.peak_memory = map(int, line.split()[1:])
        else:
            super()._take(line)

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
    # What is there already is no garbage of the child's: to look through it would take time, and copy all its pages.
    gc.freeze()
    pid = os.fork()
    if pid == 0:
        _child_main(job, writer)
    gc.unfreeze()
    return pid


def _child_main(job: Job, writer: int) -> NoReturn:
    """Never returns into the parent's code, whatever happens."""
    code = 1
    try:
        signal.set_wakeup_fd(-1)
        os.setsid()
        turn_to(job)
        impose_limits(job.loaded.scenario.memory_bytes)
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
            [sys.executable, "-P", "-m", "sim_action.runner.isolation.supervisor", str(writer)],
            stdin=stdin,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(writer,),
            start_new_session=True,
            env=environment(job.hash_seed),
        )
    # This object would wait for the process too; from here on, its number is all that counts.
    process.returncode = 0
    return process.pid
