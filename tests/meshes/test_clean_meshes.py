"""Meshes rewritten for the engine: their points, and that whatever is read is rewritten or refused."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Vector3
from sim_action.meshes import MeshError, clean_mesh, read_mesh
from sim_action.meshes.collision_hulls import MAX_HULL_POINTS
from tests import mesh_files
from tests.fuzz.damage import damaged
from tests.soak import examples

Points = np.ndarray[tuple[int, int], np.dtype[np.float64]]


def hulls(text: bytes) -> list[Points]:
    """The points that the faces of each object name, as an engine reads them."""
    points: list[list[float]] = []
    rows: list[list[int]] = []
    for line in text.decode("ascii").splitlines():
        keyword, *words = line.split()
        assert keyword in ("#", "o", "v", "f")
        if keyword == "o":
            rows.append([])
        elif keyword == "v":
            points.append([float(word) for word in words])
        elif keyword == "f":
            assert len(words) == 3
            rows[-1] += [int(word) - 1 for word in words]
    assert sorted({row for hull in rows for row in hull}) == list(range(len(points)))
    return [np.array(points)[sorted(set(hull))] for hull in rows]


def cleaned(folder: Path, name: str, data: bytes, scale: Vector3 = (1, 1, 1), margin: float = 0.0) -> list[Points]:
    path = folder / name
    path.write_bytes(data)
    return hulls(clean_mesh(path, folder / "clean", scale, margin).text)


@pytest.mark.parametrize("name", mesh_files.GOOD)
def test_what_is_written_is_the_corners_of_the_box(name: str, tmp_path: Path) -> None:
    (hull,) = cleaned(tmp_path, name, mesh_files.GOOD[name])
    assert np.allclose(sorted(hull.tolist()), sorted(mesh_files.CORNERS), atol=1e-7)


def test_each_body_is_an_object_of_its_own(tmp_path: Path) -> None:
    for name, data in {"two.obj": mesh_files.two_objects(), "two.dae": mesh_files.two_instances()}.items():
        found = sorted(sorted(hull.tolist()) for hull in cleaned(tmp_path, name, data))
        assert np.allclose(found, [sorted(mesh_files.CORNERS), sorted(mesh_files.moved(mesh_files.CORNERS, 1))])


@pytest.mark.parametrize("scale", [(2, 3, 4), (-1, 1, 1), (-0.001, 0.002, -0.003)])
def test_the_scale_is_in_the_points(scale: Vector3, tmp_path: Path) -> None:
    (hull,) = cleaned(tmp_path, "L.obj", mesh_files.obj(mesh_files.L_POINTS, mesh_files.L_FACES), scale)
    expected = sorted([scale[0] * x, scale[1] * y, scale[2] * z] for x, y, z in mesh_files.L_POINTS)
    assert np.allclose(sorted(hull.tolist()), expected, atol=1e-9)


@pytest.mark.parametrize("scale", [(0, 1, 1), (1, math.nan, 1), (1, 1, math.inf), (1, 1, 1e30)])
def test_a_scale_that_leaves_no_body_is_refused(scale: Vector3, tmp_path: Path) -> None:
    with pytest.raises(MeshError, match=r"has the scale|extends beyond") as raised:
        cleaned(tmp_path, "box.stl", mesh_files.stl(), scale)
    assert raised.value.rule == "bad-shape"
    assert [path.name for path in tmp_path.rglob("*")] == ["box.stl"]


def test_a_box_is_drawn_in_by_the_margin(tmp_path: Path) -> None:
    (hull,) = cleaned(tmp_path, "box.stl", mesh_files.stl(), (0.1, 0.1, 0.1), margin=0.001)
    assert np.allclose(np.abs(hull), (0.009, 0.019, 0.029), atol=1e-8)


def test_what_is_thinner_than_the_margin_keeps_a_thickness(tmp_path: Path) -> None:
    (hull,) = cleaned(tmp_path, "box.stl", mesh_files.stl(), (0.001, 1, 1), margin=0.001)
    assert np.allclose(np.abs(hull), (0.00001, 0.199, 0.299), atol=1e-7)


DIRECTIONS = np.random.default_rng(7).normal(size=(2000, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("scale", "points", "faces"),
    [
        ((1, 1, 1), *mesh_files.ball(rings=100, spokes=200)),
        ((1, 1, 20), *mesh_files.ball(rings=100, spokes=200)),
        ((1, 1, 1), *mesh_files.wheel(0.1, 0.02, 900)),
    ],
    ids=["ball", "needle", "wheel"],
)
def test_a_fine_mesh_is_given_with_fewer_points(
    scale: Vector3, points: list[mesh_files.Point], faces: list[mesh_files.Face], tmp_path: Path
) -> None:
    data = mesh_files.obj([(x * scale[0], y * scale[1], z * scale[2]) for x, y, z in points], faces)
    (hull,) = cleaned(tmp_path, "fine.obj", data)
    every = np.array(points) * scale
    assert len(every) > MAX_HULL_POINTS >= len(hull)
    assert len(hull) > 300
    assert np.allclose(hull.min(axis=0), every.min(axis=0), atol=1e-8)
    lost = (every @ DIRECTIONS.T).max(axis=0) - (hull @ DIRECTIONS.T).max(axis=0)
    assert (lost <= 0.003 * np.linalg.norm(np.ptp(every, axis=0) * DIRECTIONS, axis=1)).all()
    assert lost.min() > -1e-8


def test_a_content_is_rewritten_once_wherever_it_is(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(mesh_files.stl())
    (tmp_path / "b.STL").write_bytes(mesh_files.stl())
    first = clean_mesh(tmp_path / "a.stl", tmp_path / "clean")
    (entry,) = (tmp_path / "clean").iterdir()
    before = entry.stat()
    again = clean_mesh(tmp_path / "b.STL", tmp_path / "clean")
    assert again == first
    assert again.facts == read_mesh(tmp_path / "a.stl")
    assert list((tmp_path / "clean").iterdir()) == [entry]
    assert entry.stat().st_mtime_ns == before.st_mtime_ns


def test_what_differs_is_rewritten_apart(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(mesh_files.stl())
    (tmp_path / "b.stl").write_bytes(mesh_files.stl(points=mesh_files.moved(mesh_files.CORNERS, 1)))
    folder = tmp_path / "clean"
    texts = [
        clean_mesh(tmp_path / "a.stl", folder).text,
        clean_mesh(tmp_path / "b.stl", folder).text,
        clean_mesh(tmp_path / "a.stl", folder, (2, 1, 1)).text,
        clean_mesh(tmp_path / "a.stl", folder, margin=0.001).text,
    ]
    assert len(set(texts)) == len(list(folder.iterdir())) == 4


@pytest.mark.parametrize("left", [b"", b"# facts: {", b"# facts: {}\n", b"\xff", b"# facts: [1]\n"])
def test_what_a_killed_process_left_is_written_again(left: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(mesh_files.stl())
    first = clean_mesh(tmp_path / "a.stl", tmp_path / "clean")
    (entry,) = (tmp_path / "clean").iterdir()
    whole = entry.read_bytes()
    entry.write_bytes(left)
    assert clean_mesh(tmp_path / "a.stl", tmp_path / "clean") == first
    assert entry.read_bytes() == whole


def test_no_name_of_a_stranger_is_in_what_is_written(tmp_path: Path) -> None:
    data = b"mtllib /etc/passwd\no ../../evil\nusemtl x\n" + mesh_files.obj()
    (tmp_path / "a.obj").write_bytes(data)
    written = clean_mesh(tmp_path / "a.obj", tmp_path / "clean").text.decode()
    comment, *statements = written.splitlines()
    assert json.loads(comment.removeprefix("# facts: "))["format"] == "obj"
    assert statements[0] == "o hull_0"
    assert {line[0] for line in statements[1:]} == {"v", "f"}
    # The engine reads lines in pieces of 1,024 characters.
    assert max(map(len, written.splitlines())) < 1000


@examples(300)
@given(
    st.sampled_from(sorted(mesh_files.GOOD)),
    st.sampled_from(["", "a.stl", "a.obj", "a.dae"]),
    st.integers(0, 2**32 - 1),
)
def test_no_file_raises_anything_else(
    tmp_path_factory: pytest.TempPathFactory, good: str, renamed: str, seed: int
) -> None:
    folder = tmp_path_factory.getbasetemp() / "fuzzed"
    folder.mkdir(exist_ok=True)
    name, data = (
        renamed or good,
        mesh_files.GOOD[good] if seed % 4 == 0 else damaged(mesh_files.GOOD[good], random.Random(seed)),
    )
    try:
        found = cleaned(folder, name, data)
        facts = read_mesh(folder / name)
    except MeshError as error:
        assert (error.rule in RULES, str(error).isprintable()) == (True, True)  # noqa: PT017 - or none is raised
    else:
        assert facts.triangles > 0
        assert len(found) == facts.hulls
        assert all(np.isfinite(hull).all() and len(hull) >= 3 for hull in found)


RULES = {"broken-mesh", "empty-mesh", "mesh-index", "unknown-mesh-format", "too-large-mesh", "bad-shape"}
