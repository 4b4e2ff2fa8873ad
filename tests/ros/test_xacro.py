"""The xacro program of the overlay, called as launch files call it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.ros.xacro import _FALLBACKS, main

FILE = """\
<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="1"/>
  <link name="$(arg mass)kg"/>{more}
</robot>
"""


def written(folder: Path, more: str = "") -> str:
    (folder / "r.urdf.xacro").write_text(FILE.format(more=more))
    return str(folder / "r.urdf.xacro")


def test_it_prints_the_urdf_with_arguments_or_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--inorder", written(tmp_path), "mass:=3", "unknown:=1", "__name:=x"]
    assert main(words) == 0
    assert '<link name="3kg"/>' in capsys.readouterr().out
    assert main(["-o", str(tmp_path / "r.urdf"), written(tmp_path)]) == 0
    assert '<link name="1kg"/>' in (tmp_path / "r.urdf").read_text()
    assert capsys.readouterr().out == ""


def test_packages_are_found_behind_links(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/package.xml").write_text("<package><name>parts</name></package>")
    (tmp_path / "parts/p.xacro").write_text('<robot><link name="part"/></robot>')
    (tmp_path / "overlay/share").mkdir(parents=True)
    (tmp_path / "overlay/share/parts").symlink_to(tmp_path / "parts")
    (tmp_path / "robot").mkdir()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "overlay"))
    assert main([written(tmp_path / "robot", '<xacro:include filename="$(find parts)/p.xacro"/>')]) == 0
    assert '<link name="part"/>' in capsys.readouterr().out


def test_an_error_has_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "<link name='${mas}'/>")
    assert main([path]) == 2
    said = capsys.readouterr().err
    assert said.startswith("xacro: ")
    assert "r.urdf.xacro:3" in said
    assert "'mas'" in said


def test_a_model_that_is_not_here_is_told_with_what_to_do(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(_FALLBACKS / "turtlebot3_description/urdf/turtlebot3_waffle.urdf.xacro")]) == 2
    assert "turtlebot3_description to the workspace" in capsys.readouterr().err


@pytest.mark.process
def test_it_imports_nothing_of_scenarios() -> None:
    # Each launch file of a robot calls it, and waits.
    code = (
        "import sys, sim_action.ros.xacro; print(sorted({'pydantic', 'numpy', 'sim_action.world'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
