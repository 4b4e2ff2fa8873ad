from __future__ import annotations

import os
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath

import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import PathError, Workspace, discover, file_name, misnamed, similar_name, unique
from sim_action.robot.documents.packages import PackageError, Packages
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
    return Workspace.around(repository / "scenarios/a.sim.yml", Permissions(outside=allow_outside))


def test_a_path_inside_the_root_is_fine(repository: Path) -> None:
    assert around(repository) == Workspace(repository / "scenarios", repository)
    for path in ("../robot.urdf", str(repository / "robot.urdf"), "../inner.urdf"):
        assert around(repository).file(path) == repository / "robot.urdf"
    (repository / ".github").mkdir()
    (repository / ".github/a.csv").write_text("x")
    assert Workspace(repository, repository).file(".github/a.csv").name == "a.csv"


def test_without_a_repository_the_root_is_the_current_directory_or_the_folder_of_the_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a/b").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "a")
    assert Workspace.around(Path("b/s.sim.yml")).root == tmp_path / "a"
    monkeypatch.chdir(tmp_path / "a/b")
    assert Workspace.around(tmp_path / "a/s.sim.yml").root == tmp_path / "a"


@pytest.mark.parametrize(
    "path", ["../../outside.urdf", "../link.urdf", "../folder_link/outside.urdf", "/etc/passwd", "../../absent"]
)
def test_a_path_that_leads_outside_is_refused_unless_allowed(repository: Path, path: str) -> None:
    with pytest.raises(PathError, match=f"is outside the workspace {repository}; allow it with --allow-outside"):
        around(repository).file(path)
    if path.endswith(".urdf"):
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
    # Python 3.13 finds no file there.
    with pytest.raises(PathError, match=r"^'a' is not a valid path: .*; replace it with a file$|does not exist"):
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


class TestLinksToOtherRepositories:
    """A link inside the surrounding repository must not move the workspace; a link above it may lead anywhere."""

    @pytest.fixture
    def other(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        """Another repository, with a scenario in it and in a folder of it."""
        folder = tmp_path / "other"
        (folder / ".git").mkdir(parents=True)
        (folder / "sub").mkdir()
        for name in ("a.sim.yml", "sub/a.sim.yml"):
            (folder / name).touch()
        monkeypatch.delenv("GITHUB_WORKSPACE", raising=False)
        return folder

    @pytest.mark.parametrize("name", ["linked/a.sim.yml", "linked/sub/a.sim.yml", "./linked/sub/../a.sim.yml"])
    @pytest.mark.parametrize("is_absolute", [False, True])
    def test_a_link_in_the_repository_is_refused(
        self, name: str, is_absolute: bool, repository: Path, other: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (repository / "linked").symlink_to(other)
        monkeypatch.chdir(other.parent if is_absolute else repository)
        path = repository / name if is_absolute else Path(name)
        reason = f"is a link to {other}/.*, outside the workspace {repository}; allow it with --allow-outside"
        with pytest.raises(PathError, match=reason):
            Workspace.around(path)
        assert Workspace.around(path, Permissions(outside=True)).root == other

    def test_a_link_to_a_folder_that_holds_repositories_is_refused(self, repository: Path, other: Path) -> None:
        (repository / "linked").symlink_to(other.parent)
        with pytest.raises(PathError, match=f"outside the workspace {repository};"):
            Workspace.around(repository / "linked/other/a.sim.yml")
        # The link leads to a repository around this one.
        (other.parent / ".git").mkdir()
        with pytest.raises(PathError, match=f"outside the workspace {repository};"):
            Workspace.around(repository / "linked/a.sim.yml")

    def test_a_link_in_an_inner_repository_is_refused(self, repository: Path, other: Path) -> None:
        (repository / "inner/.git").mkdir(parents=True)
        (repository / "third/.git").mkdir(parents=True)
        (repository / "third/a.sim.yml").touch()
        (repository / "inner/linked").symlink_to(repository / "third")
        with pytest.raises(PathError, match=f"outside the workspace {repository / 'inner'};"):
            Workspace.around(repository / "inner/linked/a.sim.yml")

    @pytest.mark.parametrize("boundary", ["current folder", "GITHUB_WORKSPACE", "GITHUB_WORKSPACE through a link"])
    def test_a_link_in_a_folder_without_git_is_refused(
        self, boundary: str, tmp_path: Path, other: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = tmp_path / "folder"
        (folder / "sub").mkdir(parents=True)
        (folder / "linked").symlink_to(other)
        monkeypatch.chdir(folder if boundary == "current folder" else folder / "sub")
        if boundary != "current folder":
            (tmp_path / "way").symlink_to(folder)
            named = tmp_path / "way" if "link" in boundary else folder
            monkeypatch.setenv("GITHUB_WORKSPACE", str(named))
        name = os.path.relpath(folder / "linked/a.sim.yml")
        with pytest.raises(PathError, match=f"outside the workspace {folder};"):
            Workspace.around(Path(name))
        # Without a repository, too.
        (other / ".git").rmdir()
        with pytest.raises(PathError, match=f"outside the workspace {folder};"):
            Workspace.around(Path(name))

    @pytest.mark.parametrize("is_current", [False, True])
    def test_a_link_above_the_repository_is_fine(
        self, is_current: bool, tmp_path: Path, other: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "home").symlink_to(tmp_path / "disk")
        (tmp_path / "disk").mkdir()
        (tmp_path / "disk/projects").symlink_to(tmp_path)
        named = tmp_path / "home/projects/other"
        monkeypatch.chdir(named if is_current else tmp_path)
        monkeypatch.setenv("GITHUB_WORKSPACE", str(named))
        for path in (named / "sub/a.sim.yml", Path(os.path.relpath(other / "sub/a.sim.yml"))):
            assert Workspace.around(path) == Workspace(other / "sub", other)

    def test_the_repository_of_the_current_folder_may_lie_behind_a_link(
        self, repository: Path, other: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # As in a home folder that is a repository of its own; a shell and an editor name the way through the link.
        (repository / "projects").symlink_to(other.parent)
        monkeypatch.chdir(other / "sub")
        assert Workspace.around(repository / "projects/other/sub/a.sim.yml").root == other

    def test_a_worktree_and_a_submodule_are_workspaces(self, repository: Path) -> None:
        (repository / "tree").mkdir()
        (repository / "tree/.git").write_text("gitdir: ../.git/worktrees/tree\n")
        assert Workspace.around(repository / "tree/a.sim.yml").root == repository / "tree"

    def test_a_link_to_a_repository_inside_the_workspace_is_fine(self, repository: Path) -> None:
        (repository / "inner/.git").mkdir(parents=True)
        (repository / "linked").symlink_to("inner")
        assert Workspace.around(repository / "linked/a.sim.yml").root == repository / "inner"


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in (
        "b.sim.yml",
        "a.sim.yml",
        "other.yml",
        "deep/er/c.sim.yml",
        ".hidden/d.sim.yml",
        "node_modules/e.sim.yml",
        "odd [1].sim.yml",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(*patterns: str) -> list[str]:
    return [str(path) for path in unique(discover(patterns))]


@pytest.mark.usefixtures("tree")
@pytest.mark.parametrize(
    ("patterns", "expected"),
    [
        # A folder means the scenarios in it and below, but not hidden ones.
        ([".", "./b.sim.yml", "deep/../b.sim.yml"], ["a.sim.yml", "b.sim.yml", "odd [1].sim.yml", "deep/er/c.sim.yml"]),
        (["*.yml"], ["a.sim.yml", "b.sim.yml", "odd [1].sim.yml", "other.yml"]),
        (["**/*.sim.yml"], ["a.sim.yml", "b.sim.yml", "deep/er/c.sim.yml", "odd [1].sim.yml"]),
        (["d*"], ["deep/er/c.sim.yml"]),
        # Each file counts once, at the first pattern that matches it.
        (["b.sim.yml", "?.sim.yml"], ["b.sim.yml", "a.sim.yml"]),
        # A name without wildcards needs no file.
        (["nowhere.sim.yml"], ["nowhere.sim.yml"]),
        (["odd [1].sim.yml"], ["odd [1].sim.yml"]),
    ],
)
def test_a_pattern_stands_for_scenarios(patterns: list[str], expected: list[str]) -> None:
    assert names(*patterns) == expected


@pytest.mark.usefixtures("tree")
def test_a_pattern_that_matches_nothing_is_told_apart() -> None:
    assert discover(["no*.sim.yml", "a.sim.yml"]) == {"no*.sim.yml": [], "a.sim.yml": [Path("a.sim.yml")]}


def test_links_that_lead_in_circles_are_not_followed(tree: Path) -> None:
    for name in ("p", "q", "deep/r"):
        (tree / name).symlink_to(tree)
    assert names("**/*.sim.yml") == ["a.sim.yml", "b.sim.yml", "deep/er/c.sim.yml", "odd [1].sim.yml"]
    assert sorted(names(".")) == names("**/*.sim.yml")


def test_both_endings_are_scenarios_and_hidden_files_are_found_by_patterns_that_say_so(tree: Path) -> None:
    (tree / ".hidden.sim.yml").touch()
    (tree / "long.sim.yaml").touch()
    assert "long.sim.yaml" in names(".")
    assert names("*.sim.yml") == ["a.sim.yml", "b.sim.yml", "odd [1].sim.yml"]
    assert names(".*.sim.yml") == [".hidden.sim.yml"]
    assert names(".hidden/*.sim.yml") == [".hidden/d.sim.yml"]


def test_a_glob_may_be_absolute_or_begin_above(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert names(f"{tree}/*/er/*.sim.yml") == [f"{tree}/deep/er/c.sim.yml"]
    monkeypatch.chdir(tree / "deep")
    assert names("../?.sim.yml") == ["../a.sim.yml", "../b.sim.yml"]
    assert names("**.sim.yml") == []


@pytest.mark.parametrize(
    ("path", "name"),
    [
        (PurePosixPath("a/b.sim.yml"), "a/b.sim.yml"),
        (PureWindowsPath(r"a\b.sim.yml"), "a/b.sim.yml"),
        (PureWindowsPath(r"D:\a\b.sim.yml"), "D:/a/b.sim.yml"),
        (PurePosixPath(r"a\b.sim.yml"), r"a\b.sim.yml"),
    ],
)
def test_reports_call_a_file_the_same_on_every_system(path: PurePath, name: str) -> None:
    assert file_name(path) == name


@pytest.mark.parametrize("is_repository", [False, True])
def test_a_link_out_of_the_workspace_is_not_entered(
    is_repository: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, other = tmp_path / "here", tmp_path / "other"
    (here / "inner").mkdir(parents=True)
    (here / "inner/a.sim.yml").touch()
    (other / "deep").mkdir(parents=True)
    (other / "deep/b.sim.yml").touch()
    if is_repository:
        (here / ".git").mkdir()
        (other / ".git").mkdir()
    (here / "zz").symlink_to(other)
    (here / "in").symlink_to("inner")
    monkeypatch.chdir(here)
    # The link stands for itself, and is refused like a link to a file.
    assert names("z*", "in") == ["zz", "in/a.sim.yml"]
    assert names("zz/deep", f"{here}/zz") == ["zz/deep", f"{here}/zz"]
    assert [str(path) for path in unique(discover(["z*"], outside=True))] == ["zz/deep/b.sim.yml"]
    monkeypatch.chdir(tmp_path)
    assert names("other") == ["other/deep/b.sim.yml"]


def test_files_that_look_like_scenarios_are_counted(tmp_path: Path) -> None:
    scenario = "name: a\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\n"
    texts = {
        "a.sim.yml": scenario,
        "deep/other.yml": scenario,
        "list.yaml": "robot: {model: turtlebot3_burger}\nscenarios:\n  - expect: [upright]\n",
        "unused.base.yml": scenario,
        "common.yml": scenario,
        "b.sim.yml": "extends: common.yml  # keys of all\nname: b\n",
        "compose.yml": "services:\n  robot: {image: a}\n",
        ".hidden/c.yml": scenario,
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "folder.yml").mkdir()
    (tmp_path / "link.yml").symlink_to("a.sim.yml")
    found = misnamed([str(tmp_path), str(tmp_path / "deep/other.yml")])
    assert [str(path.relative_to(tmp_path)) for path in found] == ["list.yaml", "deep/other.yml"]


def test_a_similar_name_has_one_of_the_suffixes(tmp_path: Path) -> None:
    for name in ("Yard.world", "yard.txt"):
        (tmp_path / name).touch()
    assert similar_name(tmp_path / "yard.wrld", (".world", ".sdf")) == "; did you mean 'Yard.world'?"
    assert similar_name(tmp_path / "yard.tx", (".world", ".sdf")) == ""
