from __future__ import annotations

from pathlib import Path

from sim_action.core.errors import Location
from sim_action.reports import ReportOptions
from sim_action.reports.paths import place, seen_from


def test_from_a_folder_below_the_workspace(options: ReportOptions, tmp_path: Path) -> None:
    assert seen_from(tmp_path.parent, "a/b.yml") == f"{tmp_path.name}/a/b.yml"


def test_inside_by_its_absolute_path(options: ReportOptions, tmp_path: Path) -> None:
    assert seen_from(tmp_path, tmp_path / "a" / ".." / "b.yml") == "b.yml"


def test_outside_is_absolute(options: ReportOptions, tmp_path: Path) -> None:
    assert seen_from(tmp_path, "../b.yml") == (tmp_path.parent / "b.yml").as_posix()


def test_workspace_behind_a_link(options: ReportOptions, tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    assert seen_from(tmp_path / "link", tmp_path / "real" / "b.yml") == "b.yml"


def test_a_link_inside_keeps_its_name(options: ReportOptions, tmp_path: Path) -> None:
    (tmp_path / "link.yml").symlink_to("/dev/null")
    assert seen_from(tmp_path, "link.yml") == "link.yml"


def test_what_is_no_path_is_text(options: ReportOptions, tmp_path: Path) -> None:
    assert seen_from(tmp_path, "a\x00b").endswith("a\x00b")


def test_place(options: ReportOptions, tmp_path: Path) -> None:
    assert place(tmp_path, Location("a.yml", 3, 7)) == "a.yml:3"
    assert place(tmp_path, Location("a.yml")) == "a.yml"
