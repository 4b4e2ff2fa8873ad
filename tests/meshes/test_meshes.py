"""Mesh files: what is read of each format, the colour of each, and that equal points become one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action import meshes
from sim_action.core.geometry import Vector3
from sim_action.meshes import MeshFacts, mesh, read_mesh
from sim_action.meshes.collada import Colour, colour_of
from sim_action.meshes.collision_hulls import MAX_HULLS
from sim_action.meshes.mesh import welded
from tests import mesh_files
from tests.soak import examples

BOX = ((-0.1, -0.2, -0.3), (0.1, 0.2, 0.3))


def read(folder: Path, name: str, data: bytes) -> MeshFacts:
    path = folder / name
    path.write_bytes(data)
    return read_mesh(path)


def corners(facts: MeshFacts) -> tuple[Vector3, Vector3]:
    return facts.lower_xyz, facts.upper_xyz


@pytest.mark.parametrize("name", mesh_files.GOOD)
def test_a_box_is_the_same_box_in_every_format(name: str, tmp_path: Path) -> None:
    facts = read(tmp_path, name, mesh_files.GOOD[name])
    assert np.allclose(corners(facts), BOX, atol=1e-7)
    assert (facts.triangles, facts.vertices, facts.hulls, facts.shape) == (12, 8, 1, "convex")
    assert facts.format == name.lower()[-3:]


def test_a_file_may_hold_several_bodies(tmp_path: Path) -> None:
    solids = mesh_files.ascii_stl() + mesh_files.ascii_stl(mesh_files.moved(mesh_files.CORNERS, 1))
    files = {
        "two.obj": mesh_files.two_objects(),
        "groups.obj": mesh_files.two_objects("g right"),
        "two.dae": mesh_files.two_instances(),
        "two.stl": solids,
    }
    for name, data in files.items():
        facts = read(tmp_path, name, data)
        assert np.allclose(corners(facts), (BOX[0], (1.1, 0.2, 0.3)))
        assert (facts.triangles, facts.vertices, facts.hulls, facts.shape) == (24, 16, 2, "convex")


def test_a_material_begins_no_body(tmp_path: Path) -> None:
    facts = read(tmp_path, "two.obj", mesh_files.two_objects("usemtl red"))
    assert (facts.hulls, facts.shape) == (1, "concave")


def test_sides_drawn_apart_are_sides_of_one_body(tmp_path: Path) -> None:
    sides = b"".join(b"g side\n" + mesh_files.obj(points=(), faces=[side]) for side in mesh_files.SIDES)
    facts = read(tmp_path, "sides.obj", mesh_files.obj(faces=()) + sides)
    assert (facts.hulls, facts.shape) == (1, "convex")


def test_bodies_beyond_counting_are_one_hull(tmp_path: Path) -> None:
    def row(count: int) -> bytes:
        return b"".join(
            b"o box\n" + mesh_files.obj(mesh_files.moved(mesh_files.CORNERS, nth), corner=lambda row: str(row - 8))
            for nth in range(count)
        )

    assert read(tmp_path, "screws.obj", row(MAX_HULLS)).hulls == MAX_HULLS
    assert read(tmp_path, "screws.obj", row(MAX_HULLS + 1)).hulls == 1


@pytest.mark.parametrize(
    ("shape", "points", "faces"),
    [
        ("convex", *mesh_files.ball()),
        ("convex", *mesh_files.ball(rings=60, spokes=120)),
        ("convex", *mesh_files.wheel(0.033, 0.018)),
        (
            "convex",
            mesh_files.CORNERS,
            [face[::-1] if turned else face for turned, face in enumerate(mesh_files.SIDES)],
        ),
        ("concave", mesh_files.L_POINTS, mesh_files.L_FACES),
        ("concave", mesh_files.CORNERS, mesh_files.SIDES[1:]),  # no lid
        ("concave", mesh_files.CORNERS, mesh_files.SIDES[2:]),  # a tube
        (
            "concave",
            [*mesh_files.CORNERS, *mesh_files.moved(mesh_files.CORNERS, 1)],
            [*mesh_files.SIDES, *([row + 8 for row in side] for side in mesh_files.SIDES)],
        ),
        ("flat", mesh_files.CORNERS, mesh_files.SIDES[:1]),
        ("flat", [(x + y, y - x, 0.1 * x + 0.7 * y) for x, y, _ in mesh_files.L_POINTS], mesh_files.L_FACES[:1]),
    ],
    ids=["ball", "fine ball", "wheel", "turned sides", "L", "open box", "tube", "two boxes", "side", "tilted L"],
)
def test_the_shape_says_what_a_hull_would_add(
    shape: str, points: list[mesh_files.Point], faces: list[mesh_files.Face], tmp_path: Path
) -> None:
    assert read(tmp_path, "it.obj", mesh_files.obj(points, faces)).shape == shape
    assert read(tmp_path, "it.stl", mesh_files.stl(points, faces)).shape == shape


MATRIX = "<matrix>0 -1 0 1  1 0 0 2  0 0 1 3  0 0 0 1</matrix>"


@pytest.mark.parametrize(
    ("node", "lower", "upper"),
    [
        (MATRIX + mesh_files.SHOWN, (0.8, 1.9, 2.7), (1.2, 2.1, 3.3)),
        (MATRIX * 2 + mesh_files.SHOWN, (-1.1, 2.8, 5.7), (-0.9, 3.2, 6.3)),
        ("<translate>1 2 3</translate><scale>2 1 1</scale>" + mesh_files.SHOWN, (0.8, 1.8, 2.7), (1.2, 2.2, 3.3)),
        ("<scale>2 1 1</scale><translate>1 2 3</translate>" + mesh_files.SHOWN, (1.8, 1.8, 2.7), (2.2, 2.2, 3.3)),
        ("<rotate>0 0 9 90</rotate>" + mesh_files.SHOWN, (-0.2, -0.1, -0.3), (0.2, 0.1, 0.3)),
        ("<rotate>1 0 0 90</rotate><rotate>0 0 1 90</rotate>" + mesh_files.SHOWN, (-0.2, -0.3, -0.1), (0.2, 0.3, 0.1)),
        (f"<translate>1 0 0</translate><node>{MATRIX}{mesh_files.SHOWN}</node>", (1.8, 1.9, 2.7), (2.2, 2.1, 3.3)),
    ],
)
def test_the_scene_of_a_dae_puts_its_surfaces_in_place(
    node: str, lower: Vector3, upper: Vector3, tmp_path: Path
) -> None:
    assert np.allclose(corners(read(tmp_path, "box.dae", mesh_files.dae(node=node))), (lower, upper), atol=1e-9)
    with_unit = read(tmp_path, "box.dae", mesh_files.dae(node=node, asset='<unit name="cm" meter="0.01"/>'))
    assert np.allclose(corners(with_unit), np.array((lower, upper)) / 100, atol=1e-9)


def test_a_node_of_a_dae_may_be_used_again(tmp_path: Path) -> None:
    library = f'<library_nodes><node id="part">{mesh_files.SHOWN}</node></library_nodes><library_visual'
    again = '<instance_node url="#part"/><node><translate>1 0 0</translate><instance_node url="#part"/></node>'
    data = mesh_files.dae(node=again).replace(b"<library_visual", library.encode(), 1)
    assert read(tmp_path, "box.dae", data).hulls == 2


@pytest.mark.process
def test_numpy_is_not_imported_before_a_mesh_is_read() -> None:
    code = "import sys, sim_action.meshes; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_reader_is_named_by_what_it_reads() -> None:
    assert set(meshes.READERS) == {name.lower()[-3:] for name in mesh_files.GOOD}


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


def colour_with(folder: Path, material: bytes | None, mesh: bytes = OBJ) -> Colour | None:
    if material is not None:
        (folder / "m.mtl").write_bytes(material)
    return colour_of(folder / "a.OBJ", mesh)


def test_the_material_with_the_most_faces_counts_and_is_at_most_white(tmp_path: Path) -> None:
    assert colour_with(tmp_path, MTL) == (0, 0.5, 1)
    assert colour_with(tmp_path, MTL.replace(b"Kd 0 0.5 1", b"Kd -3 0.5 7")) == (0, 0.5, 1)
    assert colour_of(tmp_path / "a.dae", DAE) == (0, 0.5, 1)
    assert colour_of(tmp_path / "a.stl", b"") is None


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
    assert colour_with(tmp_path, material) is None


@pytest.mark.parametrize("name", [b"../m.mtl", b"/m.mtl", b"..", b".", b"a\x00b", b"\xff"])
def test_only_files_beside_the_mesh_are_opened(name: bytes, tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_bytes(MTL)
    (tmp_path / "inner").mkdir()
    assert colour_of(tmp_path / "inner" / "a.obj", OBJ.replace(b"m.mtl", name)) is None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders on Windows")
def test_links_and_pipes_are_not_opened(tmp_path: Path) -> None:
    (tmp_path / "real").write_bytes(MTL)
    (tmp_path / "m.mtl").symlink_to("real")
    assert colour_with(tmp_path, None) is None
    (tmp_path / "m.mtl").unlink()
    os.mkfifo(tmp_path / "m.mtl")
    assert colour_with(tmp_path, None) is None


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


COORDINATES = st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e-40, -1e-40, 0.5, 1e9])
ROWS = st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), max_size=40)


Array = np.ndarray[Any, np.dtype[Any]]


def expected(points: Array) -> tuple[Array, Array]:
    """The same by sorting all rows, which keeps the first of equal ones."""
    wide = points.astype(np.float64)
    order = np.lexsort(wide.T)
    is_new = [bool(nth == 0 or (wide[row] != wide[order[nth - 1]]).any()) for nth, row in enumerate(order)]
    names = np.empty(len(wide), np.int64)
    names[order] = np.cumsum(is_new) - 1
    return wide[order[is_new]], names


@examples(100)
@given(ROWS, st.sampled_from([np.float32, np.float64]))
def test_equal_points_become_one(rows: list[tuple[float, float, float]], kind: type) -> None:
    points: Array = np.array(rows, kind).reshape(-1, 3)
    found, names = welded(points)
    wanted, wanted_names = expected(points)
    assert found.tobytes() == wanted.tobytes()  # also the sign of a zero
    assert names.tolist() == wanted_names.tolist()


@pytest.mark.parametrize("rounds", [0, 1, 6])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_many_points_are_sorted_by_z_then_y_then_x(kind: type, rounds: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh, "_MAX_ROUNDS", rounds)
    monkeypatch.setattr(mesh, "_CHUNK", 1000)
    points = np.random.default_rng(5).integers(-8, 8, (10_000, 3)).astype(kind) / 4
    found, names = welded(points)
    wanted, wanted_names = expected(points)
    assert (found.tobytes(), names.tobytes()) == (wanted.tobytes(), wanted_names.tobytes())
