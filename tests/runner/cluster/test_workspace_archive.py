from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.runner.cluster import workspace_archive as module
from sim_action.runner.cluster.workspace_archive import Archive, archive_of, unpack


@pytest.fixture
def root(tmp_path: Path) -> Path:
    root = tmp_path / "project"
    for name in ("a.sim.yml", "robots/box.urdf", "out/results.json", "__pycache__/a.pyc", ".git_not/x"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(name)
    return root


def copy(archive: Archive, folder: Path) -> set[str]:
    unpack(archive, folder)
    there = archive.copied.moved(archive.copied.root, folder)
    return {path.relative_to(there).as_posix() for path in there.rglob("*") if not path.is_dir()}


def test_without_git_all_files_but_results_are_copied(root: Path, tmp_path: Path) -> None:
    archive = archive_of(root, root, excluded=[root / "out"])
    assert copy(archive, tmp_path / "copies") == {"a.sim.yml", "robots/box.urdf", ".git_not/x"}


@pytest.mark.process
def test_with_git_ignored_files_are_copied_only_if_a_scenario_names_them(root: Path, tmp_path: Path) -> None:
    subprocess.run(["git", "init", "-q", str(root)], check=True)
    (root / ".gitignore").write_text("*.urdf\nout\n.git_not\n__pycache__\n")
    expected = {"a.sim.yml", ".gitignore"}
    assert copy(archive_of(root, root), tmp_path / "one") == expected
    named = [root / "robots/box.urdf", tmp_path / "elsewhere", root / ".git/config", root / "missing"]
    assert copy(archive_of(root, root, named), tmp_path / "other") == {*expected, "robots/box.urdf"}


def test_links_and_permissions_are_kept(root: Path, tmp_path: Path) -> None:
    (root / "run.sh").touch(mode=0o755)
    (root / "near.urdf").symlink_to("robots/box.urdf")
    (root / "far.urdf").symlink_to(root / "robots/box.urdf")
    (root / "models").symlink_to(root / "robots")
    archive = archive_of(root, root)
    copy(archive, tmp_path / "copies")
    there = archive.copied.moved(root, tmp_path / "copies")
    (root / "robots/box.urdf").unlink()
    assert [(there / name).read_text() for name in ("near.urdf", "far.urdf", "models/box.urdf")] == [
        "robots/box.urdf"
    ] * 3
    assert (there / "run.sh").stat().st_mode & 0o777 == 0o755


def test_a_digest_is_of_files_and_a_second_copy_changes_nothing(root: Path, tmp_path: Path) -> None:
    first = archive_of(root, root).copied.digest
    assert archive_of(root, root).copied.digest == first
    (root / "a.sim.yml").write_text("changed")
    assert archive_of(root, root).copied.digest != first
    archive = archive_of(root, root)
    copy(archive, tmp_path / "copies")
    copy(archive, tmp_path / "copies")
    assert [path.name for path in (tmp_path / "copies").iterdir()] == [archive.copied.digest]


def test_files_below_the_current_folder_keep_their_names_from_there(root: Path, tmp_path: Path) -> None:
    copied = archive_of(root, tmp_path).copied
    there = copied.moved(root / "a.sim.yml", tmp_path / "copies")
    assert there == tmp_path / "copies" / copied.digest / "project/a.sim.yml"
    assert copied.holds(root / "a.sim.yml")
    assert not copied.holds(tmp_path / "other/a.sim.yml")


def test_limits_of_a_workspace(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A workspace that is too large is refused with its largest part.
    monkeypatch.setattr(module, "MAX_BYTES", 1 << 20)
    (root / "robots/mesh.stl").write_bytes(b"0" * (2 << 20))
    with pytest.raises(UsageError, match=r"is larger than 1 MiB.*\(robots: 2 MiB\); let \.gitignore name"):
        archive_of(root, root)


def test_a_workspace_with_too_many_files_is_refused(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MAX_FILES", 3)
    with pytest.raises(UsageError, match="more than 3 files; make it a git repository"):
        archive_of(root, root)
