"""Which files a scenario may name."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.workspace import PathError, Workspace


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
    with pytest.raises(PathError, match=f"is outside the workspace {repository}; --allow-outside lifts this"):
        around(repository).file(path)


@pytest.mark.parametrize("path", ["../../outside.urdf", "../link.urdf", "../folder_link/outside.urdf"])
def test_allow_outside_lifts_it(repository: Path, path: str) -> None:
    assert around(repository, allow_outside=True).file(path).name == "outside.urdf"


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
        ("a\0b", "'a\\\\x00b' cannot be a file: .*embedded null"),
        ("a" * 300, "cannot be a file: .*File name too long"),
        ("\ud800", "cannot be a file"),
    ],
)
def test_what_names_no_file_is_a_path_error(repository: Path, path: str, message: str) -> None:
    with pytest.raises(PathError, match=message):
        around(repository).file(path)


def test_links_in_a_circle_are_a_path_error(repository: Path) -> None:
    (repository / "scenarios/a").symlink_to("b")
    (repository / "scenarios/b").symlink_to("a")
    with pytest.raises(PathError, match=r"cannot be a file|does not exist"):
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
