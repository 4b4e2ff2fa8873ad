"""A separate process that has imported what a call needs, has one thread, and is forked for each call.

Programs that embed sim-action may have threads, large memories and settings of their own. A fork of such a process is
not safe, and a fresh interpreter for each scenario takes most of a second. So a call runs in a fork of the warm
process, with the current folder, the environment, the umask and the module path of the caller. It ends with the
caller.

    caller          a call ->                     <- events, and what the call returns or raises
    warm process    forks, waits for the fork     passes a wish to stop on as SIGTERM
    fork            runs the call, sends events

Linux only: on other systems each scenario has an interpreter of its own anyway, and a call runs in the caller.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from pickle import PicklingError
from typing import Any, Final, NoReturn

from sim_action.core.errors import InternalError
from sim_action.core.process import BEFORE_IMPORTS, collect_garbage_rarely
from sim_action.core.records import dataclass
from sim_action.engines import ENGINES
from sim_action.runner.isolation import process_control
from sim_action.runner.isolation.child_process import PACKAGE_ROOT
from sim_action.runner.process_output import is_open, muted

assert sys.platform == "linux"

Emit = Callable[[Any], None]
Function = Callable[..., Any]
"""A function of a module. It gets the arguments of the call, and `emit`, which sends an event to the caller."""

_ROOTS: Final = ("sim_action", "numpy", *(engine.package for engine in ENGINES.values()))
"""Packages that a call imports in advance if an earlier one has imported them; they import the rest."""

_STDERR: Final = 2
_ENDING_TIMEOUT_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class _Call:
    function: Function
    arguments: Sequence[Any]
    prepare: Callable[..., object] | None
    folder: str
    environment: Mapping[str, str]
    umask: int
    path: Sequence[str]
    modules: Sequence[str]


@dataclass(frozen=True, slots=True)
class _Event:
    event: Any


@dataclass(frozen=True, slots=True)
class _Returned:
    value: Any
    modules: Sequence[str]


@dataclass(frozen=True, slots=True)
class _Raised:
    error: BaseException


@dataclass(frozen=True, slots=True)
class _Ended:
    status: int


class WarmProcess:
    """A warm process as its caller sees it; it runs one call at a time."""

    def __init__(self) -> None:
        """Start it. Raise OSError."""
        with _standard_streams():
            ours, theirs = socket.socketpair()
        with ours, theirs:
            path = os.pathsep.join(filter(None, (str(PACKAGE_ROOT), os.environ.get("PYTHONPATH"))))
            environment = {**os.environ, **BEFORE_IMPORTS, "PYTHONPATH": path}
            self._process = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing from a scenario
                [sys.executable, "-P", "-m", "sim_action.runner.warm_process", str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                # A file that has got the number of a closed standard error is not inherited.
                stderr=None if is_open(_STDERR) and os.get_inheritable(_STDERR) else subprocess.DEVNULL,
                env=environment,
                # Ctrl-C is for the caller, which asks the call to stop.
                start_new_session=True,
            )
            self._connection = Connection(ours.detach())
        self._modules: Sequence[str] = ()

    def call(
        self, function: Function, arguments: Sequence[Any], listen: Emit, prepare: Callable[..., object] | None = None
    ) -> Any:
        """Run a function of a module in a fork, and return what it returns, or raise what it raises.

        `prepare` is called with the same arguments in the warm process itself: what it imports and makes is there for
        the forks of all later calls, too.

        `listen` receives its events. If it raises an exception, or the caller is interrupted, the call and this process
        end first. Raise InternalError if the call ends without an answer.
        """
        answer: _Returned | _Raised | None = None
        folder = os.getcwd()  # noqa: PTH109 - a text
        environment = dict(os.environ)
        try:
            call = _Call(function, arguments, prepare, folder, environment, _umask(), sys.path, self._modules)
            self._connection.send(call)
            while not isinstance(message := self._connection.recv(), _Ended):
                if isinstance(message, _Event):
                    listen(message.event)
                else:
                    answer = message
        except (EOFError, ConnectionError):
            self.close()
            raise InternalError("the process that should run the scenarios has ended") from None
        except BaseException:
            self.close()
            raise
        if answer is None:
            self.close()
            raise InternalError(f"the process that ran the scenarios has ended with status {message.status}")
        if isinstance(answer, _Raised):
            raise answer.error
        self._modules = answer.modules
        return answer.value

    @property
    def is_open(self) -> bool:
        """Return True if it takes another call."""
        return not self._connection.closed and self._process.poll() is None

    def close(self) -> None:
        """End the process, and the call that it runs."""
        self._connection.close()
        try:
            self._process.wait(_ENDING_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def forget(self) -> None:
        """Let a fork of the caller leave the process alone."""
        self._connection.close()
        self._process.returncode = 0


@contextmanager
def _standard_streams() -> Iterator[None]:
    """Occupy the numbers of closed standard streams: what writes to them must not write to other files."""
    opened = [os.open(os.devnull, os.O_RDWR) for number in range(_STDERR + 1) if not is_open(number)]
    try:
        yield
    finally:
        for descriptor in opened:
            os.close(descriptor)


def _umask() -> int:
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(status.partition("\nUmask:")[2].partition("\n")[0], 8)


class _Pool:
    """The warm processes of this process, which wait for a call or run one."""

    def __init__(self) -> None:
        self._waiting: list[WarmProcess] = []
        self._busy: list[WarmProcess] = []
        self._lock = threading.Lock()

    @contextmanager
    def taken(self) -> Iterator[WarmProcess]:
        """Take a warm process for a call, or start one. Raise InternalError."""
        with self._lock:
            process = next((candidate for candidate in self._popped() if candidate.is_open), None)
        try:
            process = process or WarmProcess()
        except OSError as error:
            raise InternalError.of(error) from error
        self._busy.append(process)
        try:
            yield process
        finally:
            with self._lock:
                self._busy.remove(process)
                if process.is_open:
                    self._waiting.append(process)

    def _popped(self) -> Iterator[WarmProcess]:
        """Yield the processes, and remove them from the list; close processes that have ended."""
        while self._waiting:
            process = self._waiting.pop()
            if process.is_open:
                yield process
            else:
                process.close()

    def close(self) -> None:
        """End all that wait."""
        with self._lock:
            for process in self._popped():
                process.close()

    def forget(self) -> None:
        """Leave all of them to the process that this one is a fork of."""
        self._lock = threading.Lock()
        for process in (*self._waiting, *self._busy):
            process.forget()
        self._waiting = []


_POOL: Final = _Pool()
atexit.register(_POOL.close)
os.register_at_fork(after_in_child=_POOL.forget)


def call_beside(
    function: Function, arguments: Sequence[Any], listen: Emit, prepare: Callable[..., object] | None = None
) -> Any:
    """Run a function in a fork of a warm process, from any thread; see `WarmProcess.call`. Raises InternalError."""
    with _POOL.taken() as process:
        return process.call(function, arguments, listen, prepare)


def main() -> NoReturn:
    """Run the warm process until its caller closes the connection, whose descriptor is the argument."""
    connection = Connection(int(sys.argv[1]))
    os.set_inheritable(connection.fileno(), False)
    collect_garbage_rarely()
    # The caller may ignore it, and the system would keep no exit status of a fork.
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    own = os.getpid()
    with suppress(EOFError, ConnectionError):
        while True:
            call = connection.recv()
            with muted():
                for name in call.modules:
                    # A missing module is an error of the call that needs it.
                    with suppress(ImportError, OSError):
                        importlib.import_module(name)
            if call.prepare is not None:
                # The call prepares the rest, or reports why it cannot.
                with suppress(ImportError, OSError, MemoryError):
                    call.prepare(*call.arguments)
            gc.freeze()
            if (pid := os.fork()) == 0:
                _run(call, connection, own)
            gc.unfreeze()
            connection.send(_Ended(_awaited(pid, connection)))
    os._exit(0)


def _awaited(pid: int, connection: Connection) -> int:
    """Return the exit status of a fork; end it if the caller has gone."""
    descriptor = os.pidfd_open(pid)
    try:
        if connection in wait([connection, descriptor]):
            # The caller sends nothing while a call runs: it has gone.
            os.kill(pid, signal.SIGTERM)
    finally:
        os.close(descriptor)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def _run(call: _Call, connection: Connection, parent: int) -> NoReturn:
    """Run a call in a fork of `parent`, and never return."""
    try:
        process_control.end_with_parent(parent, signal.SIGTERM)
        os.environ.clear()
        os.environ.update({**call.environment, **BEFORE_IMPORTS})
        sys.path[:] = call.path
        answer: _Returned | _Raised
        try:
            os.chdir(call.folder)
            os.umask(call.umask)
            value = call.function(*call.arguments, emit=lambda event: connection.send(_Event(event)))
            answer = _Returned(value, [name for name in sys.modules if name.partition(".")[0] in _ROOTS])
        except BaseException as error:  # noqa: BLE001 - the caller raises it
            answer = _Raised(error)
        try:
            connection.send(answer)
        except (TypeError, AttributeError, PicklingError) as error:
            connection.send(_Raised(InternalError.of(error)))
    finally:
        os._exit(0)


if __name__ == "__main__":
    # Messages are of the classes of this module by its name.
    importlib.import_module("sim_action.runner.warm_process").main()
