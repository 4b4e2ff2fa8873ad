"""Each model of a suite is read once, and only what is read in the same way counts as the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.loading import ModelLibrary
from sim_action.robot.robot_model import RobotModel
from sim_action.robot.spec import Robot
from tests.robot.bad_models import GOOD


def read(library: ModelLibrary, root: Path, folder: str, **robot: object) -> RobotModel:
    (root / folder).mkdir(exist_ok=True)
    return library.load(Robot.model_validate(robot), Workspace(root / folder, root))


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    for name in ("arm", "other"):
        (tmp_path / f"{name}.urdf").write_text(GOOD)
    return tmp_path


def test_a_file_is_read_once_wherever_it_is_seen_from(workspace: Path) -> None:
    library = ModelLibrary()
    first = read(library, workspace, "a", model="../arm.urdf")
    (workspace / "arm.urdf").write_text("broken")
    assert read(library, workspace, "a", model="../arm.urdf") is first
    assert read(library, workspace, "b", model="../b/../arm.urdf", pose={"x": 1}, base="fixed") is first
    with pytest.raises(ModelError):
        read(ModelLibrary(), workspace, "a", model="../arm.urdf")


def test_a_built_in_model_is_read_once(workspace: Path) -> None:
    library = ModelLibrary()
    burger = read(library, workspace, "a", model="turtlebot3_burger")
    assert read(library, workspace, "b", model="turtlebot3_burger") is burger


def test_what_is_read_in_another_way_is_another_model(workspace: Path) -> None:
    library = ModelLibrary()
    ways: list[dict[str, object]] = [
        {"model": "../arm.urdf"},
        {"model": "../other.urdf"},
        {"model": "../arm.urdf", "allow": ("zero-mass",)},
        {"model": "../arm.urdf", "packages": {"p": "."}},
    ]
    models = [read(library, workspace, "a", **way) for way in ways]
    # A package is looked for from the scenario's own folder.
    models.append(read(library, workspace, "b", **ways[-1]))
    assert len({id(model) for model in models}) == len(models)


def test_another_workspace_admits_other_files(workspace: Path) -> None:
    library = ModelLibrary()
    robot = Robot(model=str(workspace / "arm.urdf"))
    (workspace / "a").mkdir()
    library.load(robot, Workspace(workspace, workspace))
    with pytest.raises(ModelError, match="outside the workspace"):
        library.load(robot, Workspace(workspace / "a", workspace / "a"))


@pytest.mark.parametrize("model", ["nosuch.urdf", "nosuch", "a\0b.urdf", "nosuch://a/b", "x" * 300 + ".urdf"])
def test_what_cannot_be_read_is_told_by_who_reads_it(model: str, workspace: Path) -> None:
    library = ModelLibrary()
    for _ in range(2):
        with pytest.raises(ModelError):
            read(library, workspace, "a", model=model)


def test_what_cannot_be_read_is_not_read_again(workspace: Path) -> None:
    library = ModelLibrary()
    (workspace / "arm.urdf").write_text("broken")
    errors = list[ModelError]()
    for folder in ("a", "b", "a"):
        with pytest.raises(ModelError) as raised:
            read(library, workspace, folder, model="../arm.urdf")
        errors.append(raised.value)
        (workspace / "arm.urdf").write_text(GOOD)
    assert errors[0] is errors[1] is errors[2]
    assert read(ModelLibrary(), workspace, "a", model="../arm.urdf").root == "base"


def test_an_error_that_is_kept_keeps_nothing_of_what_was_read(workspace: Path) -> None:
    library = ModelLibrary()
    (workspace / "arm.urdf").write_text("<robot>")
    depths = set[int]()
    for _ in range(3):
        with pytest.raises(ModelError) as raised:
            read(library, workspace, "a", model="../arm.urdf")
        assert raised.value.__context__ is None
        depths.add(len(raised.traceback))
    assert len(depths) == 1
