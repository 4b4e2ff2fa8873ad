"""An interpreter that has imported what scenarios with user code need, and forks a supervisor for each of them.

A fresh interpreter imports for 0.4 s before it runs a scenario. A call with several such scenarios does that once: no
code of a scenario runs in the interpreter, so that all of its forks begin equal. They are children of the caller
(CLONE_PARENT of clone(2)), like the supervisors that the caller starts itself.
"""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import signal
import subprocess
import sys
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NoReturn

from sim_action.runner.isolation import process_control
from sim_action.runner.job import FORKED

assert sys.platform == "linux"

# Numbers of clone(2).
_SYS_CLONE: Final = {"x86_64": 56, "aarch64": 220}.get(platform.machine())
_CLONE_PARENT: Final = 0x8000
_MAX_DESCRIPTORS: Final = 8


class PreloadedInterpreter:
    """The interpreter, as the caller sees it."""

    def __init__(self, environment: Mapping[str, str], engine: str) -> None:
        """Start it for an engine; it imports while this process goes on. Raise OSError."""
        import socket  # few calls have such scenarios

        if _SYS_CLONE is None:
            raise OSError
        self._channel, others = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # The caller never waits: it has other children to look after.
        self._channel.setblocking(False)
        try:
            with others:
                self._process = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing from a scenario
                    [sys.executable, "-P", "-m", __name__, str(others.fileno()), str(os.getpid()), engine],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    pass_fds=(others.fileno(),),
                    start_new_session=True,
                    env=environment,
                )
        except BaseException:
            self._channel.close()
            raise

    def fork(self, job: int, progress: int, files: Sequence[int]) -> None:
        """Ask for a supervisor; arguments: descriptors, the second file for output. Raise OSError.

        The first line of its progress is its number, see `FORKED`. If the interpreter ends before, the progress ends.
        """
        import socket  # few calls have such scenarios

        socket.send_fds(self._channel, [b"fork"], (job, progress, *files))

    def close(self) -> None:
        """End it; its forks go on."""
        self._channel.close()
        self._process.kill()
        self._process.wait()


def main() -> None:
    """Fork for each message until the channel is closed; arguments: channel, number of the caller, engine."""
    import socket  # `PreloadedInterpreter` needs it later

    channel, parent, engine = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    process_control.end_with_parent(parent, signal.SIGKILL)
    _preload(engine)
    gc.freeze()
    if len(list(Path("/proc/self/task").iterdir())) > 1:
        # A fork would lack the other threads.
        return
    clone = ctypes.PyDLL(None).syscall
    with socket.socket(fileno=channel) as connection:
        while True:
            message, descriptors, _, _ = socket.recv_fds(connection, _MAX_DESCRIPTORS, _MAX_DESCRIPTORS)
            if not message:
                return
            number = clone(_SYS_CLONE, _CLONE_PARENT | signal.SIGCHLD, 0, 0, 0, 0)
            if number == 0:
                _become_supervisor(connection.detach(), parent, descriptors)
            if number < 0:
                return
            for descriptor in descriptors:
                os.close(descriptor)


def _preload(engine: str) -> None:
    # The caller has no use for these imports.
    from sim_action.engines import ENGINES
    from sim_action.results.outcome import ExpectationOutcome, Outcome  # see above
    from sim_action.runner import child_main  # see above

    assert child_main
    ExpectationOutcome.model_rebuild()
    Outcome.model_rebuild()
    # Without it, each scenario reports the error.
    with suppress(Exception):
        ENGINES[engine].load().warm_up()


def _become_supervisor(channel: int, parent: int, descriptors: Sequence[int]) -> NoReturn:
    try:
        from sim_action.runner.isolation.scenario_supervisor import supervise  # the caller has no use for it

        os.close(channel)
        os.setsid()
        job, progress, *files = descriptors
        os.write(progress, FORKED + b"%d\n" % os.getpid())
        os.dup2(job, 0)
        os.close(job)
        os.dup2(files[1], 2)
        supervise(progress, parent, files)
    except BaseException:  # noqa: BLE001 - nothing may return into the code of the interpreter
        traceback.print_exc()
    finally:
        os._exit(1)


if __name__ == "__main__":
    main()
