"""Catkin packages in folders, and the workspace of a scenario."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.workspace import PathError, Workspace
from sim_action.ros.launches import source_folder
from sim_action.ros.ros1.catkin_packages import packages_below, packages_in, packages_of, workspace_of
from tests.ros_workspace import ros_package, written


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
    assert packages_below(tmp_path / "src") == {"robot": robot}


def test_a_package_without_a_name_is_called_as_its_folder(tmp_path: Path) -> None:
    assert packages_below(package(tmp_path / "robot")) == {"robot": tmp_path / "robot"}


@pytest.mark.parametrize("name", ["../../elsewhere", "/elsewhere", "a/b", "..", "two words", "${name}"])
def test_a_name_that_no_folder_can_have_is_none(name: str, tmp_path: Path) -> None:
    assert packages_below(package(tmp_path / "robot", name)) == {"robot": tmp_path / "robot"}


def test_of_two_the_first_counts(tmp_path: Path) -> None:
    first = package(tmp_path / "a/robot", "robot")
    package(tmp_path / "b/robot", "robot")
    alone = package(tmp_path / "c", "c")
    assert packages_of([tmp_path / "a", tmp_path / "b", alone]) == {"robot": first, "c": alone}


def test_sources_are_in_src_but_of_a_package(tmp_path: Path) -> None:
    (tmp_path / "ws/src").mkdir(parents=True)
    robot = package(tmp_path / "robot", "robot")
    (robot / "src").mkdir()
    assert source_folder(tmp_path / "ws") == tmp_path / "ws/src"
    assert source_folder(robot) == robot
    assert source_folder(tmp_path) == tmp_path


def around(root: Path, folder: str) -> Workspace:
    (root / folder).mkdir(parents=True, exist_ok=True)
    return Workspace(root / folder, root)


def test_the_nearest_one_around_the_scenario_counts_unless_another_one_is_named(tmp_path: Path) -> None:
    ros_package(tmp_path / "src/far")
    # The code of a package is no workspace.
    ros_package(ros_package(tmp_path / "robots/src/near") / "src/near/inner")
    assert workspace_of(None, around(tmp_path, "robots/src/near/simulation")) == tmp_path / "robots"
    assert workspace_of(None, around(tmp_path, "simulation")) == tmp_path
    assert workspace_of("../robots", around(tmp_path, "simulation")) == tmp_path / "robots"


def test_packages_that_lie_in_the_repository_itself_are_found(tmp_path: Path) -> None:
    ros_package(tmp_path / "driver")
    found = workspace_of(None, around(tmp_path, "simulation"))
    assert (found, packages_in(found)) == (tmp_path, {"driver": tmp_path / "driver"})


@pytest.mark.parametrize(
    ("named", "message"), [("../..", "outside"), ("nowhere", "does not exist"), ("a", "not a folder")]
)
def test_what_is_no_folder_of_the_repository_is_refused(named: str, message: str, tmp_path: Path) -> None:
    workspace = around(tmp_path / "repository", "simulation")
    written(workspace.directory / "a", "")
    with pytest.raises(PathError, match=message):
        workspace_of(named, workspace)
