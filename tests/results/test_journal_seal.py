"""The seal of the journal: what is changed, moved or written with another key does not fit."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.results.journal_seal import Seal, distrusted, key_file

KEY = bytes(range(32))
LINE = b'{"at":1.0,"event":"finished","place":0,"key":"a","outcome":{"name":"a"}}\n'


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = key_file()
    assert path is not None
    return path


@given(st.binary(min_size=1, max_size=64), st.binary(max_size=300))
def test_a_line_fits_the_key_that_it_was_written_with(key: bytes, body: bytes) -> None:
    sealed = Seal(key).on(b'{"a":"' + body + b'"}\n')
    assert Seal(key).fits(sealed)
    assert not Seal(key + b"1").fits(sealed)


@given(st.integers(0, 10_000), st.integers(0, 255))
def test_no_byte_can_change(place: int, byte: int) -> None:
    sealed = bytearray(Seal(KEY).on(LINE))
    place %= len(sealed)
    assume(sealed[place] != byte)
    sealed[place] = byte
    assert not Seal(KEY).fits(bytes(sealed))


def test_a_line_without_a_seal_or_with_that_of_another_does_not_fit() -> None:
    for line in (b"", b"\n", LINE, b',"seal":"', b'{"seal":""}\n', b"\xff"):
        assert not Seal(KEY).fits(line)
    other = LINE.replace(b'"place":0', b'"place":1')
    seal = Seal(KEY).on(LINE).rpartition(b',"seal"')[2]
    assert not Seal(KEY).fits(other.removesuffix(b"}\n") + b',"seal"' + seal)


def test_the_key_is_made_once_and_only_for_its_user(cache: Path) -> None:
    first = Seal.of_user()
    assert first is not None
    assert Seal.of_user() == first
    assert cache.read_bytes() == first.key
    assert len(set(cache.parent.iterdir())) == 1
    if sys.platform != "win32":
        assert stat.S_IMODE(cache.stat().st_mode) == 0o600


@pytest.mark.parametrize("content", [b"", b"1", bytes(33)])
def test_a_key_that_is_none_is_replaced(cache: Path, content: bytes) -> None:
    cache.parent.mkdir(parents=True)
    cache.write_bytes(content)
    first = Seal.of_user()
    assert first is not None
    assert first == Seal.of_user()
    assert first.key != content


def test_without_a_place_for_the_key_there_is_no_seal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Path
) -> None:
    cache.parent.mkdir(parents=True)
    cache.symlink_to(tmp_path / "other")
    (tmp_path / "other").write_bytes(KEY)
    assert Seal.of_user() is None
    (tmp_path / "file").touch()
    for place in (str(tmp_path / "file"), "/a\0b"):
        monkeypatch.setattr("sim_action.results.journal_seal.cache_folder", lambda _, place=place: Path(place, "x"))
        assert Seal.of_user() is None
    monkeypatch.setattr("sim_action.results.journal_seal.cache_folder", lambda _: None)
    assert Seal.of_user() is None


def test_a_file_outside_of_every_checkout_is_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("job", "other"):
        (tmp_path / name).mkdir()
    (tmp_path / "link").symlink_to("job")
    monkeypatch.chdir(tmp_path / "other")
    monkeypatch.delenv("GITHUB_WORKSPACE", raising=False)
    assert distrusted(tmp_path / "job/results.jsonl") is None
    monkeypatch.setenv("GITHUB_WORKSPACE", os.fspath(tmp_path / "link"))
    for name in ("job/results.jsonl", "link/a/results.jsonl", "other/results.jsonl"):
        assert "without a git repository" in (distrusted(tmp_path / name) or "")
    assert distrusted(tmp_path / "jobs/results.jsonl") is None


def git(folder: Path, *words: str) -> None:
    identity = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "protocol.file.allow=always")
    subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True)


def without_git(folder: Path) -> str:
    return "without a git repository that names its own files"


def committed(folder: Path) -> str:
    git(folder, "init", "-q")
    git(folder, "add", "-Af")
    git(folder, "commit", "-qm", "a")
    return "belongs to the git repository"


def staged_under_another_spelling(folder: Path) -> str:
    """As a file system sees it that does not distinguish letter case: one file with two names."""
    committed(folder)
    git(folder, "mv", "-f", "sim-results", "SIM-RESULTS")
    (folder / "sim-results").mkdir()
    for path in (folder / "SIM-RESULTS").rglob("*"):
        place = folder / "sim-results" / path.relative_to(folder / "SIM-RESULTS")
        place.mkdir() if path.is_dir() else place.hardlink_to(path)
    return "belongs to the git repository"


def scenarios_in_submodule(folder: Path) -> str:
    origin = folder.parent / "origin"
    shutil.move(folder / "sim", origin)
    committed(origin)
    git(folder, "init", "-q")
    git(folder, "submodule", "add", "-q", str(origin), "sim")
    return committed(folder)


def scenarios_in_nested_repository(folder: Path) -> str:
    git(folder / "sim", "init", "-q")
    git(folder, "init", "-q")
    git(folder, "add", "-f", "sim-results")
    return "belongs to the git repository"


def everything_in_submodule_without_repository(folder: Path) -> str:
    origin = folder.parent / "origin"
    shutil.copytree(folder, origin)
    committed(origin)
    shutil.rmtree(folder)
    git(folder.parent, "init", "-q")
    git(folder.parent, "submodule", "add", "-q", str(origin), folder.name)
    (folder / ".git").unlink()
    return "is a submodule without a repository"


def broken_repository(folder: Path) -> str:
    (folder / ".git").mkdir()
    return "git cannot list its files"


def repository_around(folder: Path) -> str:
    """The nearest repository does not know the journal, one around it does."""
    git(folder.parent, "init", "-q")
    git(folder.parent, "add", "-Af", folder.name)
    git(folder, "init", "-q")
    return "belongs to the git repository"


def worktree(folder: Path) -> str:
    main = folder.rename(folder.parent / "main")
    committed(main)
    git(main, "worktree", "add", "-q", "--detach", str(folder))
    return "belongs to the git repository"


@pytest.mark.process
@pytest.mark.parametrize(
    "layout",
    [
        without_git,
        committed,
        staged_under_another_spelling,
        scenarios_in_submodule,
        scenarios_in_nested_repository,
        everything_in_submodule_without_repository,
        broken_repository,
        repository_around,
        worktree,
    ],
)
def test_a_journal_that_may_be_of_the_checkout_is_not_trusted(
    tmp_path: Path, layout: Callable[[Path], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "outer/job"
    for path in (folder / "sim/a.sim.yml", folder / "sim-results/results.jsonl"):
        path.parent.mkdir(parents=True)
        path.touch()
    reason = layout(folder)
    monkeypatch.setenv("GITHUB_WORKSPACE", str(folder))
    assert reason in (distrusted(folder / "sim-results/results.jsonl") or "")
