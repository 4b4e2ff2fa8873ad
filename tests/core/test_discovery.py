from __future__ import annotations

from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath

import pytest

from sim_action.core.discovery import discover, file_name, misnamed, unique


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


def test_both_endings_of_yaml_are_scenarios(tree: Path) -> None:
    (tree / "long.sim.yaml").touch()
    assert "long.sim.yaml" in names(".")


def test_hidden_files_are_found_by_patterns_that_say_so(tree: Path) -> None:
    (tree / ".hidden.sim.yml").touch()
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
