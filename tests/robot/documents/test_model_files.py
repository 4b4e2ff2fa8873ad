"""The file of a Gazebo model."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import PackageError, Packages, find_model_file, parsed_version
from tests.ros_workspace import written


def found(folder: Path, reference: str) -> Path:
    packages = Packages(Workspace(folder, folder), environment={})
    return find_model_file(reference, folder / "robot.sdf", packages).path.relative_to(folder)


def manifest(folder: Path, inside: str) -> None:
    written(folder / "rover/model.config", f"<model>{inside}</model>")


@pytest.mark.parametrize("reference", ["model://rover", "model://rover/", "rover", "./rover", "rover/model.sdf"])
def test_a_folder_without_a_manifest_has_its_model(reference: str, tmp_path: Path) -> None:
    written(tmp_path / "rover/model.sdf", "")
    assert found(tmp_path, reference) == Path("rover/model.sdf")


def test_the_newest_version_that_is_read_counts(tmp_path: Path) -> None:
    for name in ("a", "b", "c", "d"):
        written(tmp_path / f"rover/{name}.sdf", "")
    versions = {"a": "1.5", "b": "1.10", "c": "1.9", "d": "2.0"}
    manifest(tmp_path, "".join(f'<sdf version="{version}"> {name}.sdf </sdf>' for name, version in versions.items()))
    assert found(tmp_path, "model://rover") == Path("rover/b.sdf")


def test_where_all_are_newer_the_newest_counts(tmp_path: Path) -> None:
    written(tmp_path / "rover/a.sdf", "")
    manifest(tmp_path, '<sdf version="2.0">a.sdf</sdf>')
    assert found(tmp_path, "rover") == Path("rover/a.sdf")


@pytest.mark.parametrize(
    ("inside", "reference", "rule", "words"),
    [
        ("", "rover", "missing-file", "has no <sdf> element"),
        ("<sdf>a.sdf</sdf>", "rover", "missing-file", "'rover/a.sdf' does not exist"),
        ("<sdf>../../a.sdf</sdf>", "model://rover", "outside-workspace", "is outside the workspace"),
        ("<sdf/>", "rover", "missing-file", "is a folder"),
        ("", "model://rovr", "missing-package", "did you mean 'rover'?"),
        ("", "rovr", "missing-package", "did you mean 'rover'?"),
        ("", "..", "outside-workspace", "is outside the workspace"),
        ("", "model:///rover", "bad-reference", "names no file"),
        ("", "a\0b", "missing-package", "was not found"),
        ("", "a" * 300 + ".sdf", "bad-reference", "is not a valid path"),
        ("", "package://rover", "missing-file", "has no <sdf> element"),
        ("", "package://rovr", "missing-package", "the package 'rovr'"),
    ],
)
def test_what_leads_nowhere_is_told(inside: str, reference: str, rule: str, words: str, tmp_path: Path) -> None:
    folder = tmp_path / "workspace"
    manifest(folder, inside)
    with pytest.raises(PackageError) as raised:
        found(folder, reference)
    assert (raised.value.rule, words in str(raised.value)) == (rule, True), raised.value


@pytest.mark.parametrize(("text", "version"), [("1.9", (1, 9)), (" 1.10 ", (1, 10)), ("1", (0, 0)), ("a.b", (0, 0))])
def test_versions_are_numbers(text: str, version: tuple[int, int]) -> None:
    assert parsed_version(text) == version
