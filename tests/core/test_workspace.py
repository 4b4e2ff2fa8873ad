"""Which files a scenario may name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import PathError, Workspace
from sim_action.robot.packages import PackageError, Packages
from sim_action.scenario.loading import load_scenario

SCRIPTED = """\
name: n
robot: {model: turtlebot3_burger}
commands:
  - twist: [{linear: 1.0}]
  - script: controller.py
expect: [no_collision]
time_limit: 1 s
"""


def test_a_refused_script_is_an_error_on_its_line(tmp_path: Path) -> None:
    (tmp_path / "controller.py").write_text("def control(observation): ...\n")
    path = tmp_path / "scripted.sim.yml"
    path.write_text(SCRIPTED)
    assert load_scenario(path).scenario.runs_user_code
    with pytest.raises(InvalidScenario) as caught:
        load_scenario(path, Permissions(scripts_refused="no scripts here"))
    [problem] = caught.value.problems
    assert problem.location.line == 5
    assert problem.message == "commands.1.script: no scripts here"


def test_scenarios_without_scripts_run_all_the_same(tmp_path: Path) -> None:
    path = tmp_path / "driven.sim.yml"
    path.write_text(SCRIPTED.replace("  - script: controller.py\n", ""))
    load_scenario(path, Permissions(scripts_refused="no scripts here"))


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository with scenarios, robots and a link that leads out of it."""
    root = tmp_path / "repository"
    (root / ".git").mkdir(parents=True)
    (root / "scenarios").mkdir()
    (root / "robot.urdf").touch()
    (tmp_path / "outside.urdf").touch()
    (root / "link.urdf").symlink_to(tmp_path / "outside.urdf")
    (root / "folder_link").symlink_to(tmp_path)
    (root / "inner.urdf").symlink_to(root / "robot.urdf")
    return root


def around(repository: Path, *, allow_outside: bool = False) -> Workspace:
    return Workspace.around(repository / "scenarios/a.sim.yml", allow_outside=allow_outside)


def test_the_root_is_the_repository(repository: Path) -> None:
    assert around(repository) == Workspace(repository / "scenarios", repository)


def test_without_a_repository_the_root_is_the_current_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a/b").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "a")
    assert Workspace.around(Path("b/s.sim.yml")).root == tmp_path / "a"


def test_a_scenario_from_elsewhere_has_its_own_folder_as_root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    monkeypatch.chdir(tmp_path / "b")
    assert Workspace.around(tmp_path / "a/s.sim.yml").root == tmp_path / "a"


def test_a_path_is_relative_to_the_scenario(repository: Path) -> None:
    assert around(repository).file("../robot.urdf") == repository / "robot.urdf"


def test_an_absolute_path_inside_the_root_is_fine(repository: Path) -> None:
    assert around(repository).file(str(repository / "robot.urdf")) == repository / "robot.urdf"


def test_a_link_that_stays_inside_is_fine(repository: Path) -> None:
    assert around(repository).file("../inner.urdf") == repository / "robot.urdf"


@pytest.mark.parametrize(
    "path", ["../../outside.urdf", "../link.urdf", "../folder_link/outside.urdf", "/etc/passwd", "../../absent"]
)
def test_a_path_that_leads_outside_is_refused(repository: Path, path: str) -> None:
    with pytest.raises(PathError, match=f"is outside the workspace {repository}; allow it with --allow-outside"):
        around(repository).file(path)


@pytest.mark.parametrize("path", ["../../outside.urdf", "../link.urdf", "../folder_link/outside.urdf"])
def test_allow_outside_lifts_it(repository: Path, path: str) -> None:
    assert around(repository, allow_outside=True).file(path).name == "outside.urdf"


@pytest.mark.parametrize(
    "path", [".git/config", "scenarios/../.git/config", ".GIT/config", "linked", "sub/.git/config"]
)
@pytest.mark.parametrize("allow_outside", [False, True])
def test_files_of_git_are_never_read(path: str, allow_outside: bool, repository: Path) -> None:
    (repository / "linked").symlink_to(".git/config")
    for folder in (".git", ".GIT", "sub/.git"):
        (repository / folder).mkdir(parents=True, exist_ok=True)
        (repository / folder / "config").write_text("secret")
    workspace = Workspace(repository, repository, allow_outside=allow_outside)
    with pytest.raises(PathError, match=r"is in the folder \.git of .*; name another file"):
        workspace.file(path)
    with pytest.raises(PackageError, match=r"is in the folder \.git of .*; name another file"):
        Packages(workspace, {}).file(repository / path, path)


def test_a_name_that_resembles_that_of_git_is_fine(repository: Path) -> None:
    (repository / ".github").mkdir()
    (repository / ".github/a.csv").write_text("x")
    assert Workspace(repository, repository).file(".github/a.csv").name == "a.csv"


def test_a_sibling_whose_name_begins_alike_is_outside(repository: Path) -> None:
    sibling = repository.with_name("repository2")
    sibling.mkdir()
    (sibling / "robot.urdf").touch()
    with pytest.raises(PathError, match="outside"):
        around(repository).file("../../repository2/robot.urdf")


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("absent.urdf", "'absent.urdf' does not exist \\(looked for .*/scenarios/absent.urdf\\)"),
        ("..", "'..' is a folder"),
        ("a\0b", "'a\\\\x00b' is not a valid path: .*embedded null"),
        ("a" * 300, "is not a valid path: .*File name too long"),
        ("\ud800", "is not a valid path"),
    ],
)
def test_what_names_no_file_is_a_path_error(repository: Path, path: str, message: str) -> None:
    with pytest.raises(PathError, match=message):
        around(repository).file(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_not_a_file(repository: Path) -> None:
    os.mkfifo(repository / "scenarios/pipe")
    with pytest.raises(PathError, match=r"'pipe' is not a regular file \(looked for .*/scenarios/pipe\)"):
        around(repository).file("pipe")


def test_links_in_a_circle_are_a_path_error(repository: Path) -> None:
    (repository / "scenarios/a").symlink_to("b")
    (repository / "scenarios/b").symlink_to("a")
    with pytest.raises(PathError, match=r"is not a valid path|does not exist"):
        around(repository).file("a")


def test_what_may_be_a_folder_too_is_held_to_the_same_bounds(repository: Path) -> None:
    here = around(repository)
    assert here.file_or_folder("../scenarios") == repository / "scenarios"
    assert here.file_or_folder("../robot.urdf") == repository / "robot.urdf"
    for outside in ("../..", "../folder_link"):
        with pytest.raises(PathError, match="is outside the workspace"):
            here.file_or_folder(outside)
    with pytest.raises(PathError, match="does not exist"):
        here.file_or_folder("absent")


def test_a_new_file_may_have_new_folders_around_it(tmp_path: Path) -> None:
    around = Workspace(tmp_path.resolve(), tmp_path.resolve())
    assert around.new_file("deep/../golden/x.csv") == tmp_path.resolve() / "golden/x.csv"
    assert around.may_make("golden/x.csv")


@pytest.mark.parametrize(
    "path", ["../x.csv", "/etc/x.csv", ".git/x.csv", "a/../../x.csv", "link/x.csv", "x\0.csv", "."]
)
@pytest.mark.parametrize("outside", [False, True])
def test_no_file_is_made_outside_or_behind_a_link(path: str, outside: bool, tmp_path: Path) -> None:
    folder = tmp_path.resolve() / "workspace"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path, target_is_directory=True)
    around = Workspace(folder, folder, allow_outside=outside)
    with pytest.raises(PathError):
        around.new_file(path)
    assert not around.may_make(path)
