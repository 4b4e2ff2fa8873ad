from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.core import process
from sim_action.core.process import program_on_path

MAKING = """
import gc
{before}
told = gc.get_stats()[0]["collections"]
made = [[] for _ in range(100_000)]
print(gc.get_stats()[0]["collections"] - told)
"""


@pytest.mark.process
@pytest.mark.parametrize(
    ("before", "is_looking"),
    [("", True), ("from sim_action.core.process import collect_garbage_rarely\ncollect_garbage_rarely()", False)],
)
def test_what_is_made_is_not_looked_through(before: str, is_looking: bool) -> None:
    code = MAKING.format(before=before)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (int(ran.stdout) > 0) == is_looking


ROOT = Path(__file__).parents[2]


def program(folder: Path, name: str = "git") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text("#!/bin/sh\n")
    path.chmod(0o755)
    return path


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, a repository with a `git` at its root and in a folder."""
    root = tmp_path / "workspace"
    program(root)
    program(root / "bin")
    monkeypatch.chdir(root)
    monkeypatch.delenv("GITHUB_WORKSPACE", raising=False)
    return root


def test_the_first_program_on_path_counts(workspace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    second, third = program(tmp_path / "second"), program(tmp_path / "third")
    (tmp_path / "first/git").mkdir(parents=True)
    program(tmp_path / "zeroth").chmod(0o644)
    folders = [tmp_path / name for name in ("missing", "zeroth", "first", "second", "third")]
    monkeypatch.setenv("PATH", os.pathsep.join(map(str, folders)))
    assert program_on_path("git", workspace) == second
    second.unlink()
    assert program_on_path("git", workspace) == third
    assert program_on_path("other", workspace) is None
    monkeypatch.delenv("PATH", raising=False)
    assert program_on_path("git", workspace) is None


@pytest.mark.parametrize(
    "entry", ["", ".", "bin", "./bin", "{root}", "{root}/bin", "{link}", "{link}/bin", "{root}/../workspace"]
)
@pytest.mark.parametrize("boundary", ["argument", "GITHUB_WORKSPACE"])
def test_a_program_of_the_workspace_is_never_found(
    entry: str, boundary: str, workspace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "link").symlink_to(workspace)
    own = program(tmp_path / "own")
    path = os.pathsep.join((entry.format(root=workspace, link=tmp_path / "link"), str(own.parent)))
    monkeypatch.setenv("PATH", path)
    if boundary == "GITHUB_WORKSPACE":
        monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path / "link"))
    assert program_on_path("git", *([workspace] if boundary == "argument" else [])) == own


def test_a_program_of_the_folder_is_not_found(workspace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(workspace))
    assert program_on_path("git", tmp_path / "other") is None
    # Folders below it may be those of the system: the current folder may be /.
    monkeypatch.setenv("PATH", str(workspace / "bin"))
    assert program_on_path("git", tmp_path / "other") == workspace / "bin/git"


def test_on_windows_a_program_has_its_suffix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program(tmp_path, "git")
    program(tmp_path, "git.bat")
    monkeypatch.setenv("PATH", f'"{tmp_path}"')
    monkeypatch.setattr(process, "_PROGRAM_SUFFIX", ".exe")
    assert program_on_path("git", tmp_path / "workspace") is None
    named = program(tmp_path, "git.exe")
    assert program_on_path("git", tmp_path / "workspace") == named


def called(node: ast.AST) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


BY_NAME = frozenset({"which", "system", "popen", "execvp", "execvpe", "execlp", "execlpe", "spawnvp", "posix_spawnp"})
"""Functions that look for a program on PATH, on Windows also in the current folder."""


def test_every_program_that_is_started_by_its_name_is_looked_up() -> None:
    found = set()
    for folder in ("sim_action", "action"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            for node in ast.walk(ast.parse(text)) if any(f"{name}(" in text for name in BY_NAME) else ():
                if isinstance(node, ast.Call) and called(node.func) in BY_NAME:
                    found.add((path.relative_to(ROOT).as_posix(), called(node.func)))
    # All start code of the repository: the program of a `process`, and launch files of ROS.
    assert found == {
        ("sim_action/commands/external_program.py", "which"),
        ("sim_action/ros/ros2/launch/declared_parts.py", "which"),
        ("sim_action/runner/isolation/command_supervisor.py", "execvp"),
    }
