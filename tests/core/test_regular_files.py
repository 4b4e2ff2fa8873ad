"""A file is read, and nothing else that has a name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.core.regular_files import open_regular, read_at_most


def test_a_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"a\r\nb")
    with open_regular(tmp_path / "file", follow_link=False) as file:
        assert file.read() == b"a\r\nb"


def test_a_link_is_followed_only_if_that_is_asked_for(tmp_path: Path) -> None:
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
