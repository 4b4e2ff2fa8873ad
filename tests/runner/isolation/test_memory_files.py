"""Files in memory between a child process and its parent: whatever the child does, the parent reads them safely."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such files")

if sys.platform == "linux":
    from sim_action.runner.isolation.linux_child import MemoryFiles, pickled
    from sim_action.runner.job import LENGTH, MAX_OUTCOME_BYTES, ChildReport, OutcomeWriter


@pytest.fixture
def files(tmp_path: Path) -> Iterator[MemoryFiles]:
    made = MemoryFiles(tmp_path)
    yield made
    made.close()


def outcome_descriptor(files: MemoryFiles) -> int:
    assert isinstance(files.inherited.outcome, int)
    return files.inherited.outcome


def open_descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_outcomes_that_are_missing_or_cut_off(files: MemoryFiles) -> None:
    # What was not written is empty.
    report = files.read()
    assert (report.outcome, report.output, report.stack_dump) == (b"", b"", b"")
    assert files.printed == 0
    # An outcome that is cut off leaves the earlier.
    OutcomeWriter(files.inherited.outcome).write(b"first")
    # Its length comes last.
    os.pwrite(outcome_descriptor(files), b"the sec", 2 * LENGTH.size + len(b"first"))
    assert files.read().outcome == b"first"


def test_an_outcome_that_has_no_room_leaves_the_earlier(files: MemoryFiles) -> None:
    writer = OutcomeWriter(files.inherited.outcome)
    writer.write(b"first")
    with pytest.raises(ValueError, match="the outcome is larger than 32 MiB, the maximum"):
        writer.write(b"x" * (MAX_OUTCOME_BYTES - 8))
    assert files.read().outcome == b"first"


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


def test_no_child_can_cut_off_or_extend_the_file_of_outcomes(files: MemoryFiles) -> None:
    for size in (0, MAX_OUTCOME_BYTES + 1):
        with pytest.raises(PermissionError):
            os.ftruncate(outcome_descriptor(files), size)


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
def test_files_that_cannot_all_be_made_leave_none_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: int
) -> None:
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
