"""Child processes on Linux, and their files in memory: whatever the child does, the parent reads them safely."""

from __future__ import annotations

import errno
import gc
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.runner.job import LENGTH, MAX_OUTCOME_BYTES, ChildFiles, ChildReport, Job, OutcomeWriter
from sim_action.scenario.loading import load_scenario

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems use another class")

if sys.platform == "linux":
    from sim_action.runner.isolation.linux_child import LinuxChild, MemoryFiles, fork, pickled

SCENARIO = "name: n\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\n"


def refuse(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.EAGAIN, "Resource temporarily unavailable")


def job(folder: Path, hash_seed: int | None, more: str = "") -> Job:
    (folder / "a.sim.yml").write_text(SCENARIO + more)
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
def test_a_file_written_before_the_parent_goes_on_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.fixture
def files(tmp_path: Path) -> Iterator[MemoryFiles]:
    made = MemoryFiles(tmp_path)
    yield made
    made.close()


def outcome_descriptor(files: MemoryFiles) -> int:
    assert isinstance(files.inherited.outcome, int)
    return files.inherited.outcome


def test_outcomes_that_are_missing_cut_off_or_too_large(files: MemoryFiles) -> None:
    # What was not written is empty.
    report = files.read()
    assert (report.outcome, report.output, report.stack_dump) == (b"", b"", b"")
    assert files.printed == 0
    # An outcome that is cut off leaves the earlier.
    OutcomeWriter(files.inherited.outcome).write(b"first")
    # Its length comes last.
    os.pwrite(outcome_descriptor(files), b"the sec", 2 * LENGTH.size + len(b"first"))
    assert files.read().outcome == b"first"
    # An outcome that has no room leaves the earlier.
    writer = OutcomeWriter(files.inherited.outcome)
    writer.write(b"first")
    with pytest.raises(ValueError, match="the outcome is larger than 32 MiB, the maximum"):
        writer.write(b"x" * (MAX_OUTCOME_BYTES - 8))
    assert files.read().outcome == b"first"
    # No child can cut off or extend the file.
    for size in (0, MAX_OUTCOME_BYTES + 1):
        with pytest.raises(PermissionError):
            os.ftruncate(outcome_descriptor(files), size)


def test_an_outcome_is_written_although_its_descriptor_was_closed(files: MemoryFiles) -> None:
    # As in a child: the parent's own descriptor stays open.
    own = os.dup(outcome_descriptor(files))
    writer = OutcomeWriter(own)
    os.close(own)
    writer.write(b"first")
    assert files.read().outcome == b"first"


@given(st.lists(st.lists(st.binary(min_size=1, max_size=60), max_size=3), max_size=5))
def test_files_of_one_run_hold_nothing_of_those_before_it(runs: list[list[bytes]]) -> None:
    files = MemoryFiles(Path())
    try:
        for outcomes in runs:
            files.empty()
            writer = OutcomeWriter(outcome_descriptor(files))
            for outcome in outcomes[:2]:
                writer.write(outcome)
                os.write(files.output, outcome)
            written = outcomes[:2]
            assert files.read() == ChildReport((b"", *written)[-1], b"".join(written))
    finally:
        files.close()


@given(st.binary(max_size=60) | st.lists(st.integers(0, 1 << 64 - 1), max_size=5).map(lambda n: b"".join(map(pack, n))))
def test_anything_in_the_place_of_an_outcome_is_read(written: bytes) -> None:
    files = MemoryFiles(Path())
    try:
        os.pwrite(outcome_descriptor(files), written, 0)
        assert len(files.read().outcome) <= MAX_OUTCOME_BYTES
    finally:
        files.close()


def pack(number: int) -> bytes:
    return LENGTH.pack(number % (1 << 64))


def test_the_end_of_printed_output_is_read(files: MemoryFiles) -> None:
    os.write(files.output, b"x" * 64_000)
    # A program that opens it again does not overwrite it.
    with Path(f"/proc/self/fd/{files.output}").open("ab") as again:
        again.write(b"the end")
    assert files.printed == 64_007
    assert files.read().output == b"x" * 63_993 + b"the end"


def test_a_value_is_pickled_into_memory() -> None:
    with pickled([1, "two"]) as descriptor, os.fdopen(os.dup(descriptor), "rb") as file:
        assert pickle.load(file) == [1, "two"]


@pytest.mark.parametrize("fails", [1, 2, 3])
def test_files_that_cannot_be_made_leave_none_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: int) -> None:
    create, before = os.memfd_create, open_descriptors()
    calls = iter(range(1, 4))

    def refused(name: str, *flags: int) -> int:
        if next(calls) == fails:
            raise OSError(24, "Too many open files")
        return create(name, *flags)

    monkeypatch.setattr(os, "memfd_create", refused)
    with pytest.raises(OSError, match="Too many open files"):
        MemoryFiles(tmp_path)
    assert open_descriptors() == before


# Run a scenario, whose memory is limited to 512 MiB, in a process that holds so many MiB; then print the kind of its
# end, or of its failure if the engine aborts.
HELD = """
import os, sys, time
from pathlib import Path
from sim_action.runner import child_main
from sim_action.runner.child_outcome import outcome_of
from tests.runner.isolation.test_linux_child import LinuxChild, job
held = b"x" * (int(sys.argv[1]) << 20)
if sys.argv[2] == "abort":
    child_main.simulate = lambda *_, **__: os.abort()
child = LinuxChild.start(job(Path(sys.argv[3]), None, "memory_limit: 512 MiB\\n"))
while (status := child.poll()) is None:
    time.sleep(0.01)
child.close()
outcome = outcome_of(child, status)
print(outcome.status, *(failure.kind for failure in outcome.failures))
"""


@pytest.mark.process
@pytest.mark.parametrize("held", [0, 600])
@pytest.mark.parametrize(("act", "end"), [("run", "passed"), ("abort", "error crash")])
def test_the_memory_of_the_caller_is_not_that_of_the_scenario(held: int, act: str, end: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", HELD, str(held), act, str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == end
