"""Calls in a fork of a warm process: what they see, what comes back, and how they end."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.errors import InternalError, InvalidScenario, Location, Problem
from sim_action.runner.warm_process import WarmProcess, call_beside

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="other systems have no warm process"),
    pytest.mark.process,
]

Emit = Callable[[Any], None]


def seen(name: str, *, emit: Emit) -> dict[str, Any]:
    tasks = Path("/proc/self/task")
    emit(("begun", name))
    return {
        "folder": str(Path.cwd()),
        "variable": os.environ.get(name),
        "blas": os.environ["OPENBLAS_NUM_THREADS"],
        "path": sys.path[0],
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
        call_beside(seen, ("HOME",), kill)
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
        barrier.wait(60)

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
