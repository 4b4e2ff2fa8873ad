"""Calls in a fork of a warm process: what they see, what comes back, and how they end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.errors import InternalError, InvalidScenario, Location, Problem
from sim_action.runner.warm_process import WarmProcess, call_beside
from tests.patience import PATIENCE, wait_until

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="other systems have no warm process"),
    pytest.mark.process,
]

Emit = Callable[[Any], None]
ROOT = Path(__file__).resolve().parents[2]


def seen(name: str, *, emit: Emit) -> dict[str, Any]:
    tasks = Path("/proc/self/task")
    emit(("begun", name))
    return {
        "folder": str(Path.cwd()),
        "variable": os.environ.get(name),
        "blas": os.environ["OPENBLAS_NUM_THREADS"],
        "path": sys.path[0],
        "umask": os.umask(0),
        "threads": len(list(tasks.iterdir())),
        "parent": os.getppid(),
        "numpy": "numpy" in sys.modules,
    }


def imports_numpy(*, emit: Emit) -> None:
    import numpy as np

    emit(float(np.sqrt(4.0)))


def refuses(*, emit: Emit) -> None:
    raise InvalidScenario([Problem(Location("a.sim.yml", 3, 1), "wrong")])


def dies(*, emit: Emit) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def lasts(*, emit: Emit) -> None:
    emit(os.getpid())
    signal.pause()


def prints(*, emit: Emit) -> int:
    for descriptor in (1, 2):
        os.write(descriptor, b"text that is no message")
    return 7


def returns_a_function(*, emit: Emit) -> object:
    return lambda: None


def waits(done: str, *, emit: Emit) -> None:
    """Wait for SIGTERM, as a run does, and write that it came."""
    signal.signal(signal.SIGTERM, lambda *_: Path(done).write_text("ended"))
    emit(os.getpid())
    while not Path(done).exists():
        time.sleep(0.01)


def ignore(_: object) -> None:
    pass


def test_a_call_has_the_folder_and_the_variables_of_its_caller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[object] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OF_CALLER", "yes")
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    monkeypatch.syspath_prepend(str(tmp_path))
    found = call_beside(seen, ("OF_CALLER",), events.append)
    assert events == [("begun", "OF_CALLER")]
    assert found["folder"] == found["path"] == str(tmp_path)
    assert (found["variable"], found["blas"], found["threads"]) == ("yes", "1", 1)
    monkeypatch.delenv("OF_CALLER")
    again = call_beside(seen, ("OF_CALLER",), ignore)
    assert (again["variable"], again["parent"]) == (None, found["parent"])


def test_a_call_has_the_umask_of_its_caller() -> None:
    call_beside(seen, ("HOME",), ignore)
    former = os.umask(0o027)
    try:
        assert call_beside(seen, ("HOME",), ignore)["umask"] == 0o027
    finally:
        os.umask(former)


def test_a_call_finds_imported_what_an_earlier_one_has_imported() -> None:
    process = WarmProcess()
    try:
        assert not process.call(seen, ("HOME",), ignore)["numpy"]
        process.call(imports_numpy, (), ignore)
        assert process.call(seen, ("HOME",), ignore)["numpy"]
    finally:
        process.close()


def test_an_error_of_the_call_is_raised_as_it_is() -> None:
    with pytest.raises(InvalidScenario, match=r"^a\.sim\.yml:3:1: wrong$") as error:
        call_beside(refuses, (), ignore)
    assert error.value.problems == (Problem(Location("a.sim.yml", 3, 1), "wrong"),)


@pytest.mark.parametrize(("function", "message"), [(dies, "status -9"), (returns_a_function, "pickle")])
def test_a_call_without_an_answer_is_an_error(function: Callable[..., Any], message: str) -> None:
    with pytest.raises(InternalError, match=message):
        call_beside(function, (), ignore)
    assert call_beside(seen, ("HOME",), ignore)["threads"] == 1


def test_a_process_that_was_killed_is_an_error_and_the_next_call_has_another() -> None:
    killed = False

    def kill(_: object) -> None:
        nonlocal killed
        killed = True
        os.kill(parent, signal.SIGKILL)

    parent = call_beside(seen, ("HOME",), ignore)["parent"]
    with pytest.raises(InternalError, match="the process that should run the scenarios has ended"):
        call_beside(lasts, (), kill)
    assert killed
    assert call_beside(seen, ("HOME",), ignore)["parent"] != parent


def test_an_exception_of_the_listener_ends_the_call(tmp_path: Path) -> None:
    def interrupted(number: object) -> None:
        running.append(number)
        raise KeyboardInterrupt

    running: list[Any] = []
    with pytest.raises(KeyboardInterrupt):
        call_beside(waits, (str(tmp_path / "done"),), interrupted)
    assert (tmp_path / "done").read_text() == "ended"
    assert not Path(f"/proc/{running[0]}").exists()


def test_threads_call_at_the_same_time() -> None:
    barrier = threading.Barrier(2)
    parents: list[int] = []

    def meet(_: object) -> None:
        barrier.wait(PATIENCE)

    def call() -> None:
        found = call_beside(seen, ("HOME",), meet)
        parents.append(found["parent"])

    threads = [threading.Thread(target=call) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(parents)) == 2


def test_a_fork_of_the_caller_leaves_its_process_alone() -> None:
    parent = call_beside(seen, ("HOME",), ignore)["parent"]
    if (pid := os.fork()) == 0:
        os._exit(call_beside(seen, ("HOME",), ignore)["parent"] == parent)
    assert os.waitpid(pid, 0)[1] == 0
    assert call_beside(seen, ("HOME",), ignore)["parent"] == parent


def test_a_fork_during_a_call_does_not_keep_the_call_alive(tmp_path: Path) -> None:
    """The caller dies by SIGKILL, and a fork that it made in another thread lives on."""
    program = f"""
import os, sys, threading, time
from tests.runner.test_warm_process import call_beside, waits
running = threading.Event()
numbers = []
def listen(number):
    numbers.append(number)
    running.set()
threading.Thread(target=call_beside, args=(waits, ({str(tmp_path / "done")!r},), listen), daemon=True).start()
running.wait()
if (pid := os.fork()) == 0:
    time.sleep(60)
    os._exit(0)
print(*numbers, pid, flush=True)
time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True) as caller:
        assert caller.stdout is not None
        running, fork = map(int, caller.stdout.readline().split())
        caller.kill()
        try:
            until_gone(running)
        finally:
            os.kill(fork, signal.SIGKILL)


def until_gone(process: int) -> None:
    wait_until(lambda: not Path(f"/proc/{process}").exists())


def test_a_caller_without_standard_streams_runs_calls() -> None:
    program = """
import os
os.closerange(0, 3)
from tests.runner.test_warm_process import call_beside, prints
os._exit(call_beside(prints, (), lambda _: None))
"""
    assert subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=False).returncode == 7
    for closed in ("0", "1", "2", "0, 2", "1, 2"):
        closing = program.replace("os.closerange(0, 3)", f"[os.close(each) for each in ({closed},)]")
        assert subprocess.run([sys.executable, "-c", closing], cwd=ROOT, check=False).returncode == 7, closed
    taken = program.replace("os.closerange(0, 3)", "os.close(2); os.open(os.devnull, os.O_RDWR)")
    assert subprocess.run([sys.executable, "-c", taken], cwd=ROOT, check=False).returncode == 7


def test_a_caller_that_ignores_the_ends_of_its_children_gets_answers() -> None:
    program = """
import os, signal
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
from tests.runner.test_warm_process import call_beside, prints
os._exit(call_beside(prints, (), lambda _: None))
"""
    assert subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=False).returncode == 7


PREPARED: list[str] = []


def prepares(name: str) -> None:
    PREPARED.append(name)
    if name == "broken":
        raise ImportError(name)


def prepared(name: str, *, emit: Emit) -> list[str]:
    return PREPARED


def test_preparations_are_there_for_all_later_calls() -> None:
    process = WarmProcess()
    try:
        assert process.call(prepared, ["one"], print, prepares) == ["one"]
        assert process.call(prepared, ["broken"], print, prepares) == ["one", "broken"]
        assert process.call(prepared, ["other"], print) == ["one", "broken"]
    finally:
        process.close()
    assert PREPARED == []
