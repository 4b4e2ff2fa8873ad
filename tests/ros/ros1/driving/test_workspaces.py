"""Which workspace the nodes of a scenario are of."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.workspace import PathError, Workspace
from sim_action.ros.ros1.driving.workspaces import packages_in, workspace_of
from tests.ros_workspace import ros_package, written


def around(root: Path, folder: str) -> Workspace:
    (root / folder).mkdir(parents=True, exist_ok=True)
    return Workspace(root / folder, root)


def test_the_nearest_one_around_the_scenario_counts(tmp_path: Path) -> None:
    ros_package(tmp_path / "src/far")
    ros_package(tmp_path / "robots/src/near")

    assert workspace_of(None, around(tmp_path, "robots/src/near/simulation")) == tmp_path / "robots"
    assert workspace_of(None, around(tmp_path, "simulation")) == tmp_path


def test_the_code_of_a_package_is_no_workspace(tmp_path: Path) -> None:
    package = ros_package(tmp_path / "ws/src/driver")
    ros_package(package / "src/driver/inner")

    assert workspace_of(None, around(tmp_path, "ws/src/driver/simulation")) == tmp_path / "ws"


def test_packages_that_lie_in_the_repository_itself_are_found(tmp_path: Path) -> None:
    ros_package(tmp_path / "driver")

    found = workspace_of(None, around(tmp_path, "simulation"))

    assert found == tmp_path
    assert packages_in(found) == {"driver": tmp_path / "driver"}


def test_a_workspace_that_is_named_is_seen_from_the_scenario(tmp_path: Path) -> None:
    ros_package(tmp_path / "ws/src/driver")

    assert workspace_of("../ws", around(tmp_path, "simulation")) == tmp_path / "ws"


@pytest.mark.parametrize(
    ("named", "message"), [("../..", "outside"), ("nowhere", "does not exist"), ("a", "no folder")]
)
def test_what_is_no_folder_of_the_repository_is_refused(named: str, message: str, tmp_path: Path) -> None:
    workspace = around(tmp_path / "repository", "simulation")
    written(workspace.directory / "a", "")

    with pytest.raises(PathError, match=message):
        workspace_of(named, workspace)
