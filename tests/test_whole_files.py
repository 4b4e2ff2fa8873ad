from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.whole_files import whole_file


def test_a_file_is_replaced_when_all_is_written(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("before")
    with whole_file(path) as file:
        file.write(b"after")
        file.flush()
        assert path.read_text() == "before"
    assert path.read_text() == "after"
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_is_left_of_what_was_not_finished(tmp_path: Path) -> None:
    with pytest.raises(UnicodeEncodeError):
        write_half(tmp_path / "a.json")
    assert list(tmp_path.iterdir()) == []


def write_half(path: Path) -> None:
    with whole_file(path) as file:
        file.write(b"half")
        file.write("\ud800".encode())


def test_a_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("untouched")
    path = tmp_path / "a.json"
    path.symlink_to("target")
    with whole_file(path) as file:
        file.write(b"after")
    assert (tmp_path / "target").read_text() == "untouched"
    assert path.read_text() == "after"
    assert not path.is_symlink()
