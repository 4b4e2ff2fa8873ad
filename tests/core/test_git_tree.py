from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sim_action.core import git_tree as module
from sim_action.core.git_tree import FileDigests, GitError, GitListing, GitTree

pytestmark = pytest.mark.process
LATER_NS = 3_600_000_000_000


def git(folder: Path, *words: str) -> None:
    identity = ("-c", "user.name=a", "-c", "user.email=a@example.com", "-c", "protocol.file.allow=always")
    subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True)


def repository(folder: Path) -> Path:
    """A repository with a file in a folder, a program, a link, and a rule for ignored files."""
    (folder / "sim").mkdir(parents=True)
    (folder / "sim/a.yml").write_text("a: 1\n")
    (folder / "run.py").write_text("print(1)\n")
    (folder / "link").symlink_to("run.py")
    (folder / ".gitignore").write_text("*.log\n")
    git(folder, "init", "-q")
    git(folder, "add", ".")
    git(folder, "commit", "-qm", "a")
    return folder


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return repository(tmp_path / "repository")


def tree(root: Path, *excluded: Path) -> GitTree:
    return GitListing(root).tree(FileDigests(time.time_ns() + LATER_NS), excluded)


def test_all_files_that_are_not_ignored_count(root: Path) -> None:
    (root / "new.txt").write_text("1")
    (root / "a.log").write_text("1")
    assert set(tree(root).contents) == {"sim/a.yml", "run.py", "link", ".gitignore", "new.txt"}
    assert tree(root).holds(root / "sim/a.yml")
    assert not tree(root).holds(root / "a.log")
    assert not tree(root).holds(root.parent)


def edit(root: Path) -> None:
    (root / "sim/a.yml").write_text("a: 2\n")


def change(root: Path, how: str) -> None:
    file, program = root / "sim/a.yml", root / "run.py"
    match how:
        case "edited" | "hidden from git":
            edit(root)
        case "same size and time":
            status = file.stat()
            file.write_text("a: 3\n")
            os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
        case "removed":
            program.unlink()
        case "renamed":
            program.rename(root / "walk.py")
        case "may run":
            program.chmod(0o755)
        case "another link":
            (root / "link").unlink()
            (root / "link").symlink_to("sim")
        case "untracked":
            (root / "new.txt").write_text("")
        case "now a folder":
            program.unlink()
            program.mkdir()
        case "a repository":
            repository(root / "inner")


CHANGES = ("edited", "same size and time", "removed", "renamed", "may run", "another link", "untracked", "now a folder")


@pytest.mark.parametrize("how", [*CHANGES, "hidden from git", "a repository"])
def test_a_change_changes_the_digest(root: Path, how: str) -> None:
    before = tree(root).digest
    if how == "hidden from git":
        git(root, "update-index", "--assume-unchanged", "sim/a.yml")
    change(root, how)
    assert tree(root).digest != before


def test_other_changes_do_not(root: Path) -> None:
    before = tree(root).digest
    # It is written again, and has another time.
    (root / "sim/a.yml").write_text((root / "sim/a.yml").read_text())
    os.utime(root / "sim/a.yml", (1, 1))
    git(root, "update-index", "--refresh")
    assert tree(root).digest == before
    (root / "a.log").write_text("1")  # ignored
    assert tree(root).digest == before
    (root / "sim/__pycache__").mkdir()
    (root / "sim/__pycache__/a.pyc").write_text("1")
    assert tree(root).digest == before
    git(root, "commit", "-q", "--allow-empty", "-m", "b")
    assert tree(root).digest == before


def test_a_second_clone_has_the_same_digest(root: Path, tmp_path: Path) -> None:
    git(tmp_path, "clone", "-q", str(root), "clone")
    assert tree(tmp_path / "clone").digest == tree(root).digest


def test_outputs_do_not_count_but_tracked_files_in_their_folder_do(root: Path) -> None:
    before = tree(root).digest
    (root / "out").mkdir()
    (root / "out/results.json").write_text("1")
    (root / "outer.txt").write_text("1")
    (root / "junit.xml").write_text("1")
    found = tree(root, root / "out", root / "junit.xml", root.parent / "elsewhere")
    assert "outer.txt" in found.contents
    (root / "outer.txt").unlink()
    assert tree(root, root / "out", root / "junit.xml").digest == before
    before = tree(root, root / "sim").digest
    edit(root)
    assert tree(root, root / "sim").digest != before


@pytest.mark.parametrize("is_submodule", [True, False])
def test_repositories_in_a_repository_count(root: Path, tmp_path: Path, *, is_submodule: bool) -> None:
    if is_submodule:
        git(root, "submodule", "add", "-q", str(repository(tmp_path / "other")), "inner")
        git(root, "commit", "-qm", "submodule")
    else:
        repository(root / "inner")
    before = tree(root)
    assert before.holds(root / "inner/sim/a.yml")
    (root / "inner/out").mkdir()
    (root / "inner/out/a").write_text("")
    assert tree(root, root / "inner/out").digest == before.digest
    edit(root / "inner")
    assert tree(root, root / "inner/out").digest != before.digest


def test_a_submodule_that_is_not_checked_out_is_missing(root: Path, tmp_path: Path) -> None:
    git(root, "submodule", "add", "-q", str(repository(tmp_path / "other")), "inner")
    git(root, "commit", "-qm", "submodule")
    git(tmp_path, "clone", "-q", str(root), "clone")
    assert not any(name.startswith("inner/") for name in tree(tmp_path / "clone").contents)
    (tmp_path / "clone/inner/a").write_text("")
    with pytest.raises(GitError, match="submodule without a repository"):
        tree(tmp_path / "clone")


def test_no_program_of_the_repository_runs(root: Path, tmp_path: Path) -> None:
    witness = tmp_path / "ran"
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\ntouch '{witness}'\ncat\n")
    program.chmod(0o755)
    (root / ".gitattributes").write_text("*.yml filter=own\n")
    (root / ".git/hooks").mkdir(exist_ok=True)
    for hook in ("post-index-change", "pre-commit", "fsmonitor-watchman", "query-watchman"):
        (root / ".git/hooks" / hook).write_text(program.read_text())
        (root / ".git/hooks" / hook).chmod(0o755)
    for key in ("filter.own.clean", "filter.own.smudge", "filter.own.process", "core.fsmonitor", "core.sshCommand"):
        git(root, "config", key, str(program))
    edit(root)
    tree(root)
    assert not witness.exists()


def test_the_index_is_not_written_and_a_folder_inside_is_refused(root: Path) -> None:
    os.utime(root / "run.py", (1, 1))
    before = (root / ".git/index").stat()
    tree(root)
    assert (root / ".git/index").stat().st_mtime_ns == before.st_mtime_ns
    with pytest.raises(GitError, match="not the root of a git repository"):
        tree(root / "sim")
    (root / "sim/.git").mkdir()
    with pytest.raises(GitError, match="cannot list"):
        tree(root / "sim")


def test_variables_of_git_lead_nowhere_else(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = repository(tmp_path / "other")
    edit(other)
    before = tree(root)
    for name, value in (("GIT_DIR", ".git"), ("GIT_INDEX_FILE", ".git/index"), ("GIT_WORK_TREE", ".")):
        monkeypatch.setenv(name, str(other / value))
    assert tree(root).digest == before.digest


def test_without_git_there_is_a_reason(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(root))
    with pytest.raises(GitError, match="git was not found on PATH, outside of the workspace"):
        tree(root)


def test_a_git_of_the_repository_is_not_started(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (root / "git").write_text(f"#!{sys.executable}\nopen('started', 'w')\n")
    (root / "git").chmod(0o755)
    monkeypatch.chdir(root)
    monkeypatch.setenv("PATH", os.pathsep.join(("", ".", str(root), os.environ["PATH"])))
    assert "git" in tree(root).contents
    assert not (root / "started").exists()


def test_a_git_that_does_not_answer_is_ended(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "git").write_text(f"#!{sys.executable}\nimport time\ntime.sleep(60)\n")
    (tmp_path / "git").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(module, "_TIMEOUT_S", 0.05)
    with pytest.raises(GitError, match=r"did not answer within 0\.05 s"):
        tree(root)


@pytest.mark.parametrize("printed", ["nonsense", "? a", "H 100644 12 0\\ta\\0nonsense"])
def test_an_unknown_list_is_refused(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, printed: str) -> None:
    (tmp_path / "git").write_text(f"#!{sys.executable}\nprint('{printed}', end='')\n")
    (tmp_path / "git").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(GitError, match="unknown form"):
        tree(root)


def test_a_file_that_changes_meanwhile_is_a_reason(root: Path) -> None:
    listing, digests = GitListing(root), FileDigests(time.time_ns())
    edit(root)
    with pytest.raises(GitError, match=r"sim/a\.yml was changed a moment ago"):
        listing.tree(digests)


def test_names_may_hold_any_byte_and_too_many_files_are_a_reason(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = tree(root).digest
    for name in (b"new\nline", b"t\tab", b"\xff", "\u00e4".encode(), b"? a"):
        Path(os.fsdecode(bytes(root) + b"/" + name)).write_text("1")
    git(root, "add", ".")
    assert len(tree(root).contents) == 9
    assert tree(root).digest != before
    monkeypatch.setattr(module, "_MAX_FILES", 3)
    with pytest.raises(GitError, match="more than 3 files"):
        tree(root)


def test_closing_ends_git(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "git").write_text(f"#!{sys.executable}\nimport time\ntime.sleep(60)\n")
    (tmp_path / "git").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    listing = GitListing(root)
    listing.close()
    with pytest.raises(GitError, match="git exited with -9"):
        listing.tree(FileDigests(0))
