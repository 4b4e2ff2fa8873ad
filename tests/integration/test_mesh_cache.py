"""Cached meshes never change a verdict, whatever became of their files."""

from __future__ import annotations

import gzip
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_action.cli.main import call
from sim_action.engines import installed
from sim_action.results.results_json import Results
from tests.mesh_files import CORNERS, obj, stl

SCENARIO = """\
name: a ball falls onto a box
robot: {model: r.urdf, base: fixed, pose: {z: 0}}
world: {objects: [{name: ball, sphere: {radius: 0.05}, mass: 1, pose: {z: 1.2}}]}
physics: {settle: 0 s}
backend: BACKEND
expect: [no_collision]
time_limit: 1 s
"""
URDF = """\
<robot name="a"><link name="b">
  <inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><mesh filename="m.stl"/></geometry></visual>
  <collision><geometry><mesh filename="m.stl"/></geometry></collision>
</link></robot>
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "s.sim.yml").write_text(SCENARIO.replace("BACKEND", installed()[0]))
    (tmp_path / "r.urdf").write_text(URDF)
    (tmp_path / "m.stl").write_bytes(stl())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def verdict(folder: Path) -> tuple[str, str]:
    """The verdict of a run, and the replay of it."""
    assert call(["run", "s.sim.yml", "-q"]) == 1
    (outcome,) = Results.read(folder / "sim-results" / "results.json").outcomes
    (expected,) = outcome.expectations
    assert outcome.replay is not None
    return f"{outcome.status}: {expected.verdict}", gzip.decompress(
        (folder / "sim-results" / outcome.replay).read_bytes()
    ).decode()


def entries(folder: Path) -> list[Path]:
    return sorted((folder / "cache" / "sim-action" / "meshes").iterdir())


def flipped(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[-20] ^= 1
    path.write_bytes(data)


def turned_into_a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


DAMAGES: dict[str, Callable[[Path], object]] = {
    "halved": lambda path: os.truncate(path, path.stat().st_size // 2),
    "flipped": flipped,
    "emptied": lambda path: path.write_bytes(b""),
    "a folder": turned_into_a_folder,
    # As it is without a checksum: a box that no ball meets.
    "of another mesh": lambda path: path.write_bytes(obj([(x + 9, y, z) for x, y, z in CORNERS])),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_entry_changes_no_verdict(damage: str, folder: Path) -> None:
    first = verdict(folder)
    before = {path: path.read_bytes() for path in entries(folder)}
    assert {path.suffix for path in before} == {".obj", ".npz"}
    for path in before:
        DAMAGES[damage](path)
    assert verdict(folder) == first
    if damage != "a folder":
        assert {path: path.read_bytes() for path in entries(folder) if path.suffix == ".obj"}.items() <= before.items()
    assert verdict(folder) == first


@pytest.mark.parametrize("place", ["/proc/nothing", "/dev/full", "/dev/null/a"])
def test_a_cache_that_cannot_be_used_changes_no_verdict(
    place: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = verdict(folder)
    monkeypatch.setenv("XDG_CACHE_HOME", place)
    assert verdict(folder) == first
