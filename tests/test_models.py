"""From what a scenario names to a robot model."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.errors import ModelError
from sim_action.models import BUILT_IN, load_model
from sim_action.workspace import Workspace

URDF = '<robot name="box"><link name="base"/></robot>'


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_a_built_in_model_is_named_without_a_path(name: str, tmp_path: Path) -> None:
    assert load_model(name, Workspace(tmp_path, tmp_path)).name == name


def test_a_file_of_the_workspace_is_read(tmp_path: Path) -> None:
    (tmp_path / "box.urdf").write_text(URDF)
    assert load_model("box.urdf", Workspace(tmp_path, tmp_path)).source == str(tmp_path / "box.urdf")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("turtlebot3", "unknown robot 'turtlebot3'; did you mean 'turtlebot3_burger'?"),
        ("zzz", "unknown robot 'zzz' (allowed: turtlebot3_burger), or the path of a .urdf file"),
        ("package://a/b.urdf", "addresses are not read yet; give the path of the file"),
        ("robot.urdf.xacro", "xacro is not read yet; expand it first: xacro robot.urdf.xacro > robot.urdf"),
        ("absent.urdf", "'absent.urdf' does not exist"),
        ("../box.urdf", "is outside the workspace"),
        (".", "'.' is a folder"),
        ("a\0.urdf", "cannot be a file"),
    ],
)
def test_what_is_no_model_is_told_with_what_would_be(name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError) as raised:
        load_model(name, Workspace(tmp_path, tmp_path))
    assert message in str(raised.value)
