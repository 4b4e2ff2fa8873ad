"""Packages as they lie in folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.ros.ros1.catkin_packages import package_name, packages_below, packages_of, sources


def package(folder: Path, name: str | None = None) -> Path:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><name> {name} </name></package>" if name else "<package")
    return folder


def test_packages_are_found_at_any_depth_but_not_in_what_a_build_has_left(tmp_path: Path) -> None:
    robot = package(tmp_path / "src/deep/robot_folder", "robot")
    package(robot / "inner", "inner")
    package(tmp_path / "src/build/robot", "copy")
    ignored = package(tmp_path / "src/ignored", "ignored")
    (ignored / "CATKIN_IGNORE").touch()

    assert dict(packages_below(tmp_path / "src")) == {"robot": robot}


def test_a_package_without_a_name_is_called_as_its_folder(tmp_path: Path) -> None:
    assert package_name(package(tmp_path / "robot")) == "robot"


@pytest.mark.parametrize("name", ["../../elsewhere", "/elsewhere", "a/b", "..", "two words", "${name}"])
def test_a_name_that_no_folder_can_have_is_none(name: str, tmp_path: Path) -> None:
    assert package_name(package(tmp_path / "robot", name)) == "robot"


def test_of_two_the_first_counts(tmp_path: Path) -> None:
    first = package(tmp_path / "a/robot", "robot")
    package(tmp_path / "b/robot", "robot")
    alone = package(tmp_path / "c", "c")

    assert packages_of([tmp_path / "a", tmp_path / "b", alone]) == {"robot": first, "c": alone}


def test_sources_are_in_src_but_of_a_package(tmp_path: Path) -> None:
    (tmp_path / "ws/src").mkdir(parents=True)
    robot = package(tmp_path / "robot", "robot")
    (robot / "src").mkdir()

    assert sources(tmp_path / "ws") == tmp_path / "ws/src"
    assert sources(robot) == robot
    assert sources(tmp_path) == tmp_path
