"""Digests of files: equal for equal contents, and unknown for a file that changes."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.core import git_tree as module
from sim_action.core.git_tree import MISSING, FileDigests
from tests.soak import examples

LATER_NS = 3_600_000_000_000


def digests() -> FileDigests:
    """Those of a call that begins long after all files were written."""
    return FileDigests(time.time_ns() + LATER_NS)


@settings(examples(50), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=100), st.binary(max_size=100))
def test_contents_are_equal_if_the_bytes_are(tmp_path: Path, one: bytes, other: bytes) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_bytes(one)
    second.write_bytes(other)
    found = digests()
    assert (found.of(first) == found.of(second)) == (one == other)


def test_the_content_of_a_large_file_counts_to_its_last_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_PART_BYTES", 4)
    found = set()
    for end in (b"1", b"2"):
        (tmp_path / "a").write_bytes(b"0123456789" + end)
        found.add(digests().of(tmp_path / "a"))
    assert len(found) == 2


def test_a_file_that_does_not_exist_is_missing(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    assert digests().of(tmp_path / "none") == digests().of(tmp_path / "file/none") == MISSING
    assert digests().of(tmp_path / "file") != MISSING


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    assert digests().of(tmp_path / "a") is not None


def test_a_file_that_changed_after_the_beginning_is_not_known(tmp_path: Path) -> None:
    before = FileDigests(time.time_ns())
    (tmp_path / "a").write_bytes(b"")
    assert before.of(tmp_path / "a") is None


@pytest.mark.parametrize("written", ["a", "b"])
def test_a_call_that_begins_right_after_a_change_knows_the_file(tmp_path: Path, written: str) -> None:
    (tmp_path / written).write_bytes(b"")
    # A file of a name with a NUL does not exist; a new file next to a named one changes its folder.
    found = FileDigests(module.beginning_ns([tmp_path / "a", Path("\0")]))
    assert found.of(tmp_path / written) is not None


@pytest.mark.skipif(sys.platform == "win32", reason="the time of the last change is that of the content")
def test_an_old_time_stamp_hides_no_change(tmp_path: Path) -> None:
    before = FileDigests(time.time_ns())
    (tmp_path / "a").write_bytes(b"")
    os.utime(tmp_path / "a", ns=(0, 0))
    assert before.of(tmp_path / "a") is None


def test_a_file_is_read_once(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"1")
    found = digests()
    first = found.of(tmp_path / "a")
    (tmp_path / "a").write_bytes(b"2")
    assert found.of(tmp_path / "a") == first


def test_beyond_the_limit_the_status_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MAX_READ_BYTES", 4)
    (tmp_path / "a").write_bytes(b"12345")
    before = digests().of(tmp_path / "a")
    assert digests().of(tmp_path / "a") == before
    (tmp_path / "b").write_bytes(b"12345")
    assert digests().of(tmp_path / "b") != before
