from __future__ import annotations

import errno
import os
import tempfile
import threading
from pathlib import Path
from typing import Final
from unittest.mock import Mock

import pytest

from sim_action.runner.isolation import child_process
from sim_action.runner.isolation.child_process import (
    ChildProcess,
    cause_of,
    job_environment,
    most_children,
    remove,
    scratch_folder,
)
from sim_action.runner.isolation.linux_child import LinuxChild
from sim_action.runner.isolation.portable_child import PortableChild
from tests.patience import wait_until


def use(monkeypatch: pytest.MonkeyPatch, folder: Path, *full: Path) -> None:
    """Let `tempfile` use a folder; nothing can be written below those that are full."""
    write = Path.write_bytes

    def written(path: Path, data: bytes) -> int:
        if any(path.is_relative_to(each) for each in full):
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", written)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))


@pytest.mark.parametrize("is_full", [True, False])
def test_a_full_or_missing_folder_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_full: bool) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    second.mkdir()
    if is_full:
        first.mkdir()
    use(monkeypatch, first, first)
    monkeypatch.setenv("TMPDIR", str(second))
    scratch = scratch_folder()
    assert Path(scratch.name).parent == second
    assert not is_full or list(first.iterdir()) == []
    remove(scratch)
    assert list(second.iterdir()) == []


def test_without_any_usable_folder_the_first_reason_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, tmp_path, Path(tmp_path.anchor))
    with pytest.raises(OSError, match="No space left on device"):
        scratch_folder()
    assert tempfile.gettempdir() == str(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_folders_are_removed_also_without_a_free_descriptor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, tmp_path)
    scratch = scratch_folder()
    Path(scratch.name).rmdir()
    remove(scratch)
    use(monkeypatch, tmp_path)
    scratch = scratch_folder()
    too_many = OSError(errno.EMFILE, os.strerror(errno.EMFILE))
    with monkeypatch.context() as patch:
        patch.setattr(scratch, "cleanup", Mock(side_effect=too_many))
        remove(scratch)
    assert list(tmp_path.iterdir()) == []
    scratch.cleanup()


@pytest.mark.parametrize(("runs_code", "value"), [(True, "ssl.cnf"), (False, None)])
def test_libraries_of_a_child_without_code_see_no_variable_of_the_scenario(runs_code: bool, value: str | None) -> None:
    scenario = Mock(environment={"OPENSSL_CONF": "ssl.cnf"}, runs_user_code=runs_code)
    job = Mock(loaded=Mock(scenario=scenario, workspace=Mock(pass_env=())), hash_seed=None)
    assert job_environment(job).get("OPENSSL_CONF") == value


INFINITY: Final = float("inf")


def descriptors_in_use() -> int:
    return len(list(Path("/proc/self/fd").iterdir())) - 1


def limited(monkeypatch: pytest.MonkeyPatch, descriptors: float = INFINITY, tasks: float = INFINITY) -> None:
    limits = {"RLIMIT_NOFILE": descriptors, "RLIMIT_NPROC": tasks}
    monkeypatch.setattr(child_process, "_soft_limit", limits.__getitem__)
    monkeypatch.setattr(os, "getuid", lambda: 1234)


@pytest.mark.parametrize("child_type", [LinuxChild, PortableChild])
def test_descriptors_in_use_and_a_reserve_stay(child_type: type[ChildProcess], monkeypatch: pytest.MonkeyPatch) -> None:
    in_use = descriptors_in_use()
    limited(monkeypatch, descriptors=in_use + child_process._RESERVED_DESCRIPTORS + 10 * child_type.descriptors)
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
    monkeypatch.setattr(child_process, "_all_tasks", lambda: all_tasks)
    monkeypatch.setattr(child_process, "_tasks_of", lambda user: {1234: 50}[user])
    assert most_children(LinuxChild, 256) == (100 - 50 - child_process._RESERVED_TASKS) // LinuxChild.tasks


def test_limits_that_need_no_count(monkeypatch: pytest.MonkeyPatch) -> None:
    # A far limit needs no count.
    limited(monkeypatch, tasks=90_000)
    monkeypatch.setattr(child_process, "_tasks_of", lambda _: pytest.fail("/proc is read"))
    monkeypatch.setattr(child_process, "_all_tasks", lambda: 500.0)
    assert most_children(LinuxChild, 256) == 256
    # Root has no limit of processes.
    limited(monkeypatch, tasks=1)
    monkeypatch.setattr(os, "getuid", lambda: 0)
    assert most_children(LinuxChild, 256) == 256


def test_threads_are_counted() -> None:
    def counts_own_threads() -> bool:
        before, release = child_process._tasks_of(os.getuid()), threading.Event()
        threads = [threading.Thread(target=release.wait) for _ in range(200)]
        for thread in threads:
            thread.start()
        now = child_process._tasks_of(os.getuid())
        release.set()
        for thread in threads:
            thread.join()
        return now > before + 100

    # Other processes come and go.
    wait_until(counts_own_threads)
    assert child_process._all_tasks() > 1


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
