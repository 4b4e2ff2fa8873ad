"""Search a folder for packages: package.xml, ignored folders, limits."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.robot.documents import package_search
from sim_action.robot.documents.package_search import folders_below, package_name
from sim_action.robot.documents.packages import PackageError
from tests.ros_workspace import RosWorkspace, ros_package, written


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("<package>\n  <name>\n rover </name></package>", "rover"),
        ("<package><author><name>someone</name></author><name>rover</name></package>", "rover"),
        ('<?xml version="1.0" encoding="ISO-8859-1"?><package><name>rover</name></package>', "rover"),
        ("<package><author><name>someone</name></author></package>", "folder"),
        ("<package><name></name></package>", "folder"),
        ("<package><name>rover</name>", "folder"),
        ("", "folder"),
        ('<!DOCTYPE p [<!ENTITY n "rover">]><package><name>&n;</name></package>', "folder"),
        ('<?xml version="1.0" encoding="nonsense"?><package><name>rover</name></package>', "folder"),
        (f"<package><name>rover</name>{' ' * 2_000_000}</package>", "folder"),
    ],
)
def test_a_package_xml_that_says_no_name_leaves_the_folders(text: str, name: str, tmp_path: Path) -> None:
    written(tmp_path / "folder/package.xml", text)
    assert package_name(tmp_path / "folder") == name


def test_a_pipe_in_place_of_package_xml_holds_nobody_up(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "folder/package.xml")
    assert package_name(tmp_path / "folder") == "folder"


def test_too_many_folders_are_said_to_be_too_many(ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(package_search, "_MAX_FOLDERS", 4)
    assert not folders_below(ros.root, inside_packages=True).complete
    with pytest.raises(PackageError, match=r"only some of its folders: there are too many"):
        ros.packages().find("rover_arm", ros.rover)


def test_what_is_too_deep_is_not_looked_into(tmp_path: Path) -> None:
    deep = tmp_path.joinpath(*"abcdefghijklmnopq")
    ros_package(deep.parent)
    found = folders_below(tmp_path, inside_packages=True)
    assert found.complete
    assert "p" in found.packages
    ros_package(deep)
    found = folders_below(tmp_path, inside_packages=True)
    assert not found.complete
    assert "q" not in found.packages
