"""Child processes on Linux: those that cannot start leave nothing behind, and quick ones keep their files."""

from __future__ import annotations

import errno
import gc
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NoReturn

import pytest

from sim_action.runner.job import ChildFiles, Job
from sim_action.scenario.loading import load_scenario

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems use another class")

if sys.platform == "linux":
    from sim_action.runner.isolation.linux_child import LinuxChild, MemoryFiles, fork

SCENARIO = "name: n\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\n"


def refuse(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.EAGAIN, "Resource temporarily unavailable")


def job(folder: Path, hash_seed: int | None) -> Job:
    (folder / "a.sim.yml").write_text(SCENARIO)
    return Job(load_scenario(folder / "a.sim.yml"), folder / "t.npz", folder, hash_seed=hash_seed)


def open_descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.parametrize(
    ("module", "name", "hash_seed"),
    [(os, "fork", None), (subprocess, "Popen", 1), (os, "pipe", None), (os, "memfd_create", 1)],
)
def test_a_start_that_fails_leaves_no_file_and_no_descriptor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: object, name: str, hash_seed: int | None
) -> None:
    ordered, scratch = job(tmp_path, hash_seed), tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    monkeypatch.setattr(module, name, refuse)
    before, frozen = open_descriptors(), gc.get_freeze_count()
    with pytest.raises(OSError, match="temporarily unavailable"):
        LinuxChild.start(ordered)
    assert open_descriptors() == before
    assert gc.get_freeze_count() == frozen
    assert list(scratch.iterdir()) == []


@pytest.mark.process
def test_a_file_that_is_written_before_the_parent_goes_on_is_that_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A busy machine may let the child run to its end first."""
    ordered, fork = job(tmp_path, None), os.fork
    (tmp_path / "t.npz").write_text("of an earlier run")

    def quick() -> int:
        pid = fork()
        if pid == 0:
            (tmp_path / "t.npz").unlink()
            (tmp_path / "t.npz").write_text("of this run")
            os._exit(0)
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        return pid

    monkeypatch.setattr(os, "fork", quick)
    child = LinuxChild.start(ordered)
    child.close()
    assert child.wrote(tmp_path / "t.npz")


@pytest.mark.process
def test_a_fork_keeps_no_files_in_memory_of_its_siblings(tmp_path: Path) -> None:
    ordered = job(tmp_path, None)

    def count(_: ChildFiles, writer: int) -> None:
        kept = [entry for entry in Path("/proc/self/fd").iterdir() if "memfd:" in str(entry.resolve())]
        os.write(writer, b"%d" % len({entry.stat().st_ino for entry in kept}))

    sibling, own, (reader, writer) = MemoryFiles(tmp_path), MemoryFiles(tmp_path), os.pipe()
    try:
        os.waitpid(fork(count, ordered, own, writer), 0)
        assert os.read(reader, 9) == b"3"
    finally:
        for descriptor in (reader, writer):
            os.close(descriptor)
        for files in (sibling, own):
            files.close()
