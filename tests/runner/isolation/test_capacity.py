"""The number of children that resource limits allow, and the reason why one cannot be started."""

from __future__ import annotations

import errno
import os
import tempfile
import threading
from pathlib import Path
from typing import Final

import pytest

from sim_action.runner.isolation import capacity
from sim_action.runner.isolation.capacity import cause_of, most_children
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.isolation.linux_child import LinuxChild
from sim_action.runner.isolation.portable_child import PortableChild

INFINITY: Final = float("inf")


def descriptors_in_use() -> int:
    return len(list(Path("/proc/self/fd").iterdir())) - 1


def limited(monkeypatch: pytest.MonkeyPatch, descriptors: float = INFINITY, tasks: float = INFINITY) -> None:
    limits = {"RLIMIT_NOFILE": descriptors, "RLIMIT_NPROC": tasks}
    monkeypatch.setattr(capacity, "_soft_limit", limits.__getitem__)
    monkeypatch.setattr(os, "getuid", lambda: 1234)


@pytest.mark.parametrize("child_type", [LinuxChild, PortableChild])
def test_descriptors_in_use_and_a_reserve_are_kept(
    child_type: type[ChildProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    in_use = descriptors_in_use()
    limited(monkeypatch, descriptors=in_use + capacity._RESERVED_DESCRIPTORS + 10 * child_type.descriptors)
    assert most_children(child_type, 256) == 10
    assert most_children(child_type, 4) == 4
    with Path(os.devnull).open():
        assert most_children(child_type, 256) == 9


@pytest.mark.parametrize("left", [0, 1, 16])
def test_at_least_one_child_is_tried(left: int, monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, descriptors=descriptors_in_use() + left, tasks=left)
    assert most_children(LinuxChild, 256) == 1


@pytest.mark.parametrize("all_tasks", [300, 100_000, INFINITY])
def test_processes_of_this_user_count(all_tasks: float, monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, tasks=100)
    monkeypatch.setattr(capacity, "_all_tasks", lambda: all_tasks)
    monkeypatch.setattr(capacity, "_tasks_of", lambda user: {1234: 50}[user])
    assert most_children(LinuxChild, 256) == (100 - 50 - capacity._RESERVED_TASKS) // LinuxChild.tasks


def test_a_far_limit_needs_no_count(monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, tasks=90_000)
    monkeypatch.setattr(capacity, "_tasks_of", lambda _: pytest.fail("/proc is read"))
    monkeypatch.setattr(capacity, "_all_tasks", lambda: 500.0)
    assert most_children(LinuxChild, 256) == 256


def test_root_has_no_limit_of_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, tasks=1)
    monkeypatch.setattr(os, "getuid", lambda: 0)
    assert most_children(LinuxChild, 256) == 256


def test_threads_are_counted() -> None:
    before, release = capacity._tasks_of(os.getuid()), threading.Event()
    threads = [threading.Thread(target=release.wait) for _ in range(200)]
    for thread in threads:
        thread.start()
    now = capacity._tasks_of(os.getuid())
    release.set()
    for thread in threads:
        thread.join()
    # Other processes come and go.
    assert now > before + 100
    assert capacity._all_tasks() > 1


CAUSES: Final = {
    errno.EMFILE: 'too many open files (RLIMIT_NOFILE is 24); raise this limit with "ulimit -n"',
    errno.EAGAIN: "resource temporarily unavailable (RLIMIT_NPROC is 7); end other processes of this user, or raise "
    'the limit with "ulimit -u"',
    errno.ENOSPC: "no space left on device; free some space in /full, or set TMPDIR to another folder",
    errno.ENOMEM: "cannot allocate memory; this machine has too little memory: end other processes, or use a machine "
    "with more memory",
    errno.EACCES: "permission denied: some/file",
}


@pytest.mark.parametrize("number", CAUSES)
def test_the_cause_is_in_plain_words(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, descriptors=24, tasks=7)
    monkeypatch.setattr(tempfile, "tempdir", "/full")
    assert cause_of(OSError(number, os.strerror(number), "some/file")) == CAUSES[number]


def test_memory_that_python_lacks_is_told_as_that_of_the_system() -> None:
    assert cause_of(MemoryError()) == CAUSES[errno.ENOMEM]
    assert cause_of(OSError("nothing known")) == "nothing known"
