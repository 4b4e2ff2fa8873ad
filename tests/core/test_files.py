"""A file is read, and nothing else that has a name."""

from __future__ import annotations

import builtins
import errno
import io
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import files
from sim_action.core.files import (
    Entry,
    append_whole,
    cache_folder,
    open_regular,
    read_at_most,
    similar_path,
    whole_file,
)


@pytest.mark.parametrize("has_flag", [True, False])
def test_a_link_is_followed_only_if_asked(has_flag: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not has_flag:  # as on Windows
        monkeypatch.delattr(os, "O_NOFOLLOW", raising=False)
    (tmp_path / "file").write_text("text")
    (tmp_path / "link").symlink_to("file")
    with open_regular(tmp_path / "link", follow_link=True) as file:
        assert file.read() == b"text"
    with pytest.raises(OSError, match="link"):
        open_regular(tmp_path / "link", follow_link=False)


def test_pipes_devices_and_folders_are_no_files_and_hold_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    paths = [tmp_path / "pipe", tmp_path, Path("/dev/zero")]
    for path in paths:
        with pytest.raises(OSError, match="it is "):
            open_regular(path, follow_link=True)
    still_open = {Path(os.path.realpath(entry)) for entry in Path("/proc/self/fd").iterdir()}
    assert still_open.isdisjoint(path.resolve() for path in paths)


@pytest.mark.parametrize(("most", "found"), [(2, None), (3, b"abc"), (4, b"abc")])
def test_no_more_is_read_than_is_asked_for(tmp_path: Path, most: int, found: bytes | None) -> None:
    (tmp_path / "file").write_bytes(b"abc")
    (tmp_path / "link").symlink_to("file")
    assert read_at_most(tmp_path / "link", most) == found


def test_a_file_is_replaced_when_all_is_written(tmp_path: Path) -> None:
    with pytest.raises(UnicodeEncodeError):
        write_half(tmp_path / "a.json")
    assert list(tmp_path.iterdir()) == []
    path = tmp_path / "a.json"
    path.write_text("before")
    with whole_file(path) as file:
        file.write(b"after")
        file.flush()
        assert path.read_text() == "before"
    assert path.read_text() == "after"
    assert list(tmp_path.iterdir()) == [path]


def write_half(path: Path) -> None:
    with whole_file(path) as file:
        file.write(b"half")
        file.write("\ud800".encode())


def test_on_windows_a_file_is_replaced_when_it_has_been_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    readers = iter([True, True, False])
    replace = Path.replace

    def replace_if_unread(source: Path, target: Path) -> Path:
        if next(readers):
            raise PermissionError(13, "Access is denied")
        return replace(source, target)

    monkeypatch.setattr(Path, "replace", replace_if_unread)
    monkeypatch.setattr(sys, "platform", "win32")
    with whole_file(tmp_path / "a.json") as file:
        file.write(b"after")
    assert (tmp_path / "a.json").read_text() == "after"
    assert next(readers, None) is None


def test_a_folder_that_may_not_be_written_to_is_told_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Path) -> Path:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "replace", refuse)
    monkeypatch.setattr(time, "sleep", lambda _: pytest.fail("it waited"))
    with pytest.raises(PermissionError), whole_file(tmp_path / "a.json"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("untouched")
    path = tmp_path / "a.json"
    path.symlink_to("target")
    with whole_file(path) as file:
        file.write(b"after")
    assert (tmp_path / "target").read_text() == "untouched"
    assert path.read_text() == "after"
    assert not path.is_symlink()


def test_bytes_are_appended_to_a_file_that_need_not_exist(tmp_path: Path) -> None:
    append_whole(tmp_path / "file", b"one\n")
    append_whole(tmp_path / "file", b"two\n")
    assert (tmp_path / "file").read_bytes() == b"one\ntwo\n"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of file sizes")
def test_an_append_that_fails_halfway_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    import resource

    (tmp_path / "file").write_bytes(b"before\n")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            append_whole(tmp_path / "file", b"x" * 200)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (tmp_path / "file").read_bytes() == b"before\n"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no named pipes in folders")
def test_an_append_to_a_pipe_waits_for_no_reader(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="No such device or address"):
        append_whole(tmp_path / "pipe", b"x")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    append_whole(tmp_path / "pipe", b"x")
    assert os.read(reader, 9) == b"x"
    os.close(reader)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_an_append_to_a_full_device_is_an_error() -> None:
    with pytest.raises(OSError, match="No space left on device"):
        append_whole(Path("/dev/full"), b"x")


@pytest.mark.parametrize(
    ("missing", "endings", "hint"),
    [
        ("simulatoin", (), "; did you mean 'simulation'?"),
        ("simulations/a/b.sim.yml", (".sim.yml",), "; did you mean 'simulation'?"),
        ("simulation/delivr.sim.yml", (".sim.yml",), "; did you mean 'simulation/deliver.sim.yml'?"),
        ("simulation/delivr.sim.yml", (), ""),
        ("simulation/deliver.sim.yml/x", (), ""),
        ("simulation/hiden", (), ""),
        ("elsewhere", (), ""),
    ],
)
def test_a_missing_path_has_a_hint_at_a_similar_one(
    missing: str, endings: tuple[str, ...], hint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("simulation/.hidden").mkdir(parents=True)
    Path("simulation/deliver.sim.yml").touch()
    assert similar_path(Path(missing), endings) == hint


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
    made: list[list[object]] = [[], [1], [2], [(1.0, 2.0), "stl"], [(1.0, 2.0), "obj"]]
    entries = [stored(tmp_path, source, *made_with) for source in (b"a", b"b") for made_with in made]
    assert len({entry.path for entry in entries}) == len(entries)


def damage(path: Path, how: str) -> None:
    """Damage an entry; "older": as before entries had a checksum."""
    if how == "cut":
        os.truncate(path, path.stat().st_size // 2)
    elif how == "other source":
        file_of(stored(path.parent / "other", b"another source")).replace(path)
    elif how in ("empty", "older"):
        path.write_bytes(CONTENT if how == "older" else b"")
    else:
        path.unlink()
    if how == "folder":
        path.mkdir()
    elif how == "pipe":
        os.mkfifo(path)
    elif how == "dangling":
        path.symlink_to("nowhere")


@pytest.mark.parametrize("how", ["cut", "empty", "folder", "pipe", "dangling", "other source", "older"])
def test_what_is_damaged_is_not_read_and_written_again(how: str, tmp_path: Path) -> None:
    entry = stored(tmp_path)
    damage(file_of(entry), how)
    assert entry.read() is None
    entry.write(CONTENT)
    if how != "folder":
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

    monkeypatch.setattr(files, "read_at_most", fail)
    assert entry.read() is None
    for module, name in ((os, "replace"), (builtins, "open"), (io, "open"), (Path, "open"), (Path, "mkdir")):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, name, fail)
            stored(tmp_path / "new")


def test_an_entry_that_is_too_large_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "MAX_ENTRY_BYTES", 100)
    assert stored(tmp_path).read() is None
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()
    entry = stored(tmp_path)
    monkeypatch.setattr(files, "MAX_ENTRY_BYTES", 100)
    assert entry.read() is None


def test_without_a_folder_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = Entry.of(None, "obj", b"source")
    entry.write(CONTENT)
    assert (entry.path, entry.read()) == (None, None)
    (tmp_path / "file").write_text("")
    assert stored(tmp_path / "file" / "cache").read() is None
    assert stored(Path("nul\0", "cache")).read() is None

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr(Path, "home", homeless)
    assert cache_folder("meshes") is None


@pytest.mark.parametrize("stated", ["", "relative/cache"])
def test_the_folder_is_that_of_the_specification(stated: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder("meshes") == tmp_path / "sim-action" / "meshes"
    monkeypatch.setenv("XDG_CACHE_HOME", stated)
    monkeypatch.setenv("HOME", "/home/somebody")
    assert cache_folder("meshes") == Path("/home/somebody/.cache/sim-action/meshes")


WRITER = """
import sys
from pathlib import Path
from sim_action.core.files import Entry

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
