"""The colour of a mesh file, and files that hide, break or misplace it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.meshes.collada import Colour, colour_of

OBJ = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl few\nf 1 2 3\nusemtl many\nf 1 2 3\nf 1 3 2\n"
MTL = b"newmtl few\nKd 1 0 0\n\nnewmtl many\nKa 1 1 1\nKd 0 0.5 1\n"
DAE = b"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<library_effects><effect id="blue-fx"><profile_COMMON><technique><phong><diffuse><color>0 0.5 1 1</color></diffuse>
</phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="blue"><instance_effect url="#blue-fx"/></material></library_materials>
<library_geometries><geometry><mesh><triangles material="skin" count="9"/><triangles material="eyes" count="2"/></mesh>
</geometry></library_geometries>
<library_visual_scenes><visual_scene><node><instance_geometry><bind_material><technique_common>
<instance_material symbol="skin" target="#blue"/></technique_common></bind_material></instance_geometry></node>
</visual_scene></library_visual_scenes></COLLADA>"""


def obj(folder: Path, material: bytes | None, mesh: bytes = OBJ) -> Colour | None:
    if material is not None:
        (folder / "m.mtl").write_bytes(material)
    return colour_of(folder / "a.OBJ", mesh)


def test_the_material_with_the_most_faces_counts(tmp_path: Path) -> None:
    assert obj(tmp_path, MTL) == (0, 0.5, 1)
    assert colour_of(tmp_path / "a.dae", DAE) == (0, 0.5, 1)


@pytest.mark.parametrize(
    "material",
    [
        None,
        b"",
        MTL.replace(b"many", b"other"),
        MTL.replace(b"Kd 0 0.5 1", b"Kd 0 0.5"),
        MTL.replace(b"Kd 0 0.5 1", b"Kd nan 0 0"),
        MTL.replace(b"Kd 0 0.5 1", b"Kd red 0 0"),
        MTL + b"map_Kd picture.png\n",
        b"\xff\x00" * 100,
    ],
)
def test_a_material_without_a_colour_has_none(material: bytes | None, tmp_path: Path) -> None:
    assert obj(tmp_path, material) is None


def test_colours_are_at_most_white(tmp_path: Path) -> None:
    assert obj(tmp_path, MTL.replace(b"Kd 0 0.5 1", b"Kd -3 0.5 7")) == (0, 0.5, 1)


@pytest.mark.parametrize("name", [b"../m.mtl", b"/m.mtl", b"..", b".", b"a\x00b", b"\xff"])
def test_only_files_beside_the_mesh_are_opened(name: bytes, tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_bytes(MTL)
    (tmp_path / "inner").mkdir()
    assert colour_of(tmp_path / "inner" / "a.obj", OBJ.replace(b"m.mtl", name)) is None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders on Windows")
def test_links_and_pipes_are_not_opened(tmp_path: Path) -> None:
    (tmp_path / "real").write_bytes(MTL)
    (tmp_path / "m.mtl").symlink_to("real")
    assert obj(tmp_path, None) is None
    (tmp_path / "m.mtl").unlink()
    os.mkfifo(tmp_path / "m.mtl")
    assert obj(tmp_path, None) is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"#blue-fx", b"#red-fx"),
        (b'#blue"', b'#red"'),
        (b"<color>0 0.5 1 1</color>", b"<texture texture='t'/>"),
        (b"0 0.5 1 1", b"inf 0 0"),
        (b"triangles", b"lines"),
        (b'count="9"', b'count="-9"'),
    ],
)
def test_a_collada_file_without_a_colour_has_none(old: bytes, new: bytes, tmp_path: Path) -> None:
    assert colour_of(tmp_path / "a.dae", DAE.replace(old, new)) is None


def test_an_stl_file_has_no_colour(tmp_path: Path) -> None:
    assert colour_of(tmp_path / "a.stl", b"") is None
