"""An entry of the cache is given back as it was written, or not at all; what goes wrong with it costs time alone."""

from __future__ import annotations

import builtins
import errno
import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import content_cache, files
from sim_action.core.content_cache import Entry, cache_folder

CONTENT = b"o hull\nv 1 2 3\n\n# \xff\0 end"


def stored(folder: Path, source: bytes = b"source", *made_with: object) -> Entry:
    entry = Entry.of(folder, "obj", source, *made_with)
    entry.write(CONTENT)
    return entry


def file_of(entry: Entry) -> Path:
    assert entry.path is not None
    return entry.path


def test_what_is_written_is_read(tmp_path: Path) -> None:
    entry = stored(tmp_path / "deep" / "cache")
    assert entry.read() == CONTENT
    assert Entry.of(tmp_path / "deep" / "cache", "obj", b"source").read() == CONTENT
    assert list((tmp_path / "deep" / "cache").iterdir()) == [file_of(entry)]


def test_what_differs_has_an_entry_of_its_own(tmp_path: Path) -> None:
    made: list[list[object]] = [[], [1], [2], [(1.0, 2.0), "stl"], [(1.0, 2.0), "obj"]]
    entries = [stored(tmp_path, source, *made_with) for source in (b"a", b"b") for made_with in made]
    assert len({entry.path for entry in entries}) == len(entries)


def _cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def _empty(path: Path) -> None:
    path.write_bytes(b"")


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _dangling(path: Path) -> None:
    path.unlink()
    path.symlink_to("nowhere")


def _other_source(path: Path) -> None:
    other = stored(path.parent / "other", b"another source")
    file_of(other).replace(path)


def _older(path: Path) -> None:
    """As before entries had a checksum."""
    path.write_bytes(CONTENT)


DAMAGES: list[Callable[[Path], None]] = [_cut, _empty, _folder, _pipe, _dangling, _other_source, _older]


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_not_read_and_written_again(damage: Callable[[Path], None], tmp_path: Path) -> None:
    entry = stored(tmp_path)
    damage(file_of(entry))
    assert entry.read() is None
    entry.write(CONTENT)
    if damage is not _folder:
        assert entry.read() == CONTENT


@given(data=st.data())
def test_no_flip_of_bits_is_read(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    entry = stored(tmp_path_factory.getbasetemp() / "flips")
    whole = bytearray(file_of(entry).read_bytes())
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] ^= data.draw(st.integers(1, 255))
    file_of(entry).write_bytes(bytes(whole))
    assert entry.read() is None


@pytest.mark.parametrize("code", [errno.EIO, errno.EACCES, errno.ENOSPC, errno.EROFS, errno.ESTALE, errno.EMFILE])
def test_a_cache_that_fails_is_none(code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = stored(tmp_path)

    def fail(*_: object, **__: object) -> Any:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(content_cache, "read_at_most", fail)
    assert entry.read() is None
    for module, name in ((os, "replace"), (builtins, "open"), (io, "open"), (Path, "open"), (Path, "mkdir")):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, name, fail)
            stored(tmp_path / "new")


def test_an_entry_that_is_too_large_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(content_cache, "MAX_ENTRY_BYTES", 100)
    assert stored(tmp_path).read() is None
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()
    entry = stored(tmp_path)
    monkeypatch.setattr(content_cache, "MAX_ENTRY_BYTES", 100)
    assert entry.read() is None


def test_without_a_folder_nothing_is_kept() -> None:
    entry = Entry.of(None, "obj", b"source")
    entry.write(CONTENT)
    assert (entry.path, entry.read()) == (None, None)


def test_a_folder_that_cannot_be_made_is_no_cache(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert stored(tmp_path / "file" / "cache").read() is None
    assert stored(Path("nul\0", "cache")).read() is None


@pytest.mark.parametrize("stated", ["", "relative/cache"])
def test_the_folder_is_that_of_the_specification(stated: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder("meshes") == tmp_path / "sim-action" / "meshes"
    monkeypatch.setenv("XDG_CACHE_HOME", stated)
    monkeypatch.setenv("HOME", "/home/somebody")
    assert cache_folder("meshes") == Path("/home/somebody/.cache/sim-action/meshes")


def test_who_has_no_home_has_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr(Path, "home", homeless)
    assert cache_folder("meshes") is None


WRITER = """
import sys
from pathlib import Path
from sim_action.core.content_cache import Entry

entry = Entry.of(Path(sys.argv[1]), "obj", b"source")
for number in range(100):
    entry.write(b"x" * 200_000)
    found = entry.read()
    assert found == b"x" * 200_000, found
"""


@pytest.mark.process
def test_parallel_writers_never_show_half_an_entry(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITER, str(tmp_path)]
    writers = [subprocess.Popen(command, cwd=Path(files.__file__).parents[2]) for _ in range(4)]
    assert [writer.wait() for writer in writers] == [0] * 4
    assert len(list(tmp_path.iterdir())) == 1
