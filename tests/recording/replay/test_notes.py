"""What a replay says of meshes that are drawn in another way than the model states them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action.recording.replay.scene import scenery
from sim_action.recording.replay.surfaces import Budget
from sim_action.scenario.loading import build_scene
from tests.mesh_files import ball, stl
from tests.recording.replay.test_scene import BOX, MESH, seen
from tests.scenarios import load


def notes(folder: Path) -> tuple[str, ...]:
    return scenery(build_scene(load(folder, (folder / "s.sim.yml").read_text())), []).notes


def test_what_is_drawn_as_stated_has_no_note(tmp_path: Path) -> None:
    assert seen(tmp_path, MESH.format(material=""), BOX.format(material="")).notes == ()


def test_links_whose_meshes_cannot_be_read_are_counted_with_the_reason(tmp_path: Path) -> None:
    seen(tmp_path, MESH.format(material=""), BOX.format(material=""))
    (tmp_path / "box.stl").write_bytes(b"")
    (note,) = notes(tmp_path)
    assert note.startswith("1 of 2 links are drawn as their collision shapes: box.stl ")
    assert len(note) > len("1 of 2 links are drawn as their collision shapes: box.stl ")


def test_a_mesh_file_that_is_too_large_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_action.recording.replay.visual_meshes._MAX_BYTES", 100)
    found = seen(tmp_path, MESH.format(material=""))
    assert "box.stl has 0 MB; meshes are drawn up to 0 MB" in found.notes[0]


def test_a_body_with_a_mass_is_its_convex_hull(tmp_path: Path) -> None:
    seen(tmp_path)
    scenario = tmp_path / "s.sim.yml"
    world = "world: {objects: [{name: crate, mesh: {file: box.stl}, mass: 1, pose: {x: 9}}]}\n"
    scenario.write_text(world + scenario.read_text())
    assert notes(tmp_path) == ("Drawn as convex hulls, which is what collides: crate",)


def test_meshes_that_lose_most_of_their_triangles_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen(tmp_path, MESH.format(material=""))
    (tmp_path / "box.stl").write_bytes(stl(*ball()))
    assert notes(tmp_path) == ()
    monkeypatch.setattr("sim_action.recording.replay.scene.ROBOT_BUDGET", Budget(2_400, 100))
    (note,) = notes(tmp_path)
    assert re.fullmatch(r"Meshes are drawn with \d\d of their 1,516 triangles", note)
