"""What is read from files for a world, and what is wrong with it, at the keys that are to blame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.workspace import Workspace
from sim_action.world import Body, World
from sim_action.world.parts import BoxPart, GridPart, HullPart, Part, SurfacePart
from sim_action.world.shape_files import read_surroundings
from tests.mesh_files import obj
from tests.worlds import pgm, png, write_map


def read(folder: Path, **shape: Any) -> tuple[Part, ...]:
    found = read_surroundings(World(objects=(Body.model_validate({"name": "it", **shape}),)), Workspace(folder, folder))
    assert found.problems == ()
    return tuple(found.parts["it"])


def wrong(folder: Path, **shape: Any) -> str:
    found = read_surroundings(World(objects=(Body.model_validate({"name": "it", **shape}),)), Workspace(folder, folder))
    assert not found.parts
    ((path, message),) = found.problems
    return f"{'.'.join(map(str, path))}: {message}"


def test_plain_bodies_are_not_read(tmp_path: Path) -> None:
    found = read_surroundings(World(objects=(Body(name="it", box=(1, 1, 1)),)), Workspace(tmp_path, tmp_path))
    assert (found.parts, found.problems) == ({}, ())


@pytest.mark.parametrize(("name", "write"), [("h.pgm", pgm), ("h.png", png)])
def test_an_image_is_a_grid_with_its_top_row_at_the_highest_y(name: str, write: Any, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(write(np.array([[0, 255], [51, 102], [0, 0]])))
    (grid,) = read(tmp_path, heightfield={"image": name, "size": (1, 2), "height": 2.0})
    assert isinstance(grid, GridPart)
    assert grid.heights == pytest.approx(np.array([[0, 0], [0.4, 0.8], [0, 2]]))


def test_a_mesh_is_a_hull_if_it_is_convex_or_moves_and_else_its_triangles(tmp_path: Path) -> None:
    (tmp_path / "box.obj").write_bytes(obj())
    (tmp_path / "open.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    (hull,) = read(tmp_path, mesh={"file": "box.obj", "scale": 0.5})
    assert isinstance(hull, HullPart)
    assert np.ptp(np.array(hull.points_xyz), axis=0) == pytest.approx([0.1, 0.2, 0.3])
    (surface,) = read(tmp_path, mesh={"file": "open.obj"})
    assert isinstance(surface, SurfacePart)
    assert len(surface.triangles) == 2
    (moving,) = read(tmp_path, mesh={"file": "open.obj"}, mass=1)
    assert isinstance(moving, HullPart)
    assert len(moving.points_xyz) == 4


def test_a_map_is_boxes_in_its_own_frame(tmp_path: Path) -> None:
    pixels = np.full((4, 5), 254)
    pixels[0, 1:4] = 0
    write_map(tmp_path, pixels, resolution=0.5, origin=[1, 2, 0])
    (wall,) = read(tmp_path, map={"file": "map.yaml", "height": 0.4})
    assert isinstance(wall, BoxPart)
    assert wall.size_xyz == pytest.approx((1.5, 0.5, 0.4))
    assert wall.pose.position_xyz == pytest.approx((1 + 1.25, 2 + 1.75, 0.2))


def test_a_map_may_be_negated_and_what_is_unknown_is_free(tmp_path: Path) -> None:
    pixels = np.array([[0, 205, 254], [0, 205, 254]])
    write_map(tmp_path, pixels, resolution=1)
    write_map(tmp_path, pixels, "negated", resolution=1, negate=1)
    write_map(tmp_path, pixels, "strict", resolution=1, occupied_thresh=0.15, free_thresh=0.1)
    width = {name: read(tmp_path, map={"file": f"{name}.yaml"})[0].size_xyz[0] for name in ("map", "negated", "strict")}  # type: ignore[union-attr]
    # Of white, 205 is 0.8: negated it is occupied, else free by map_server's own thresholds.
    assert width == {"map": 1, "negated": 2, "strict": 2}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"resolution": None}, "the key 'resolution' is missing"),
        ({"resolution": 0}, "must be at least 0.001"),
        ({"resolution": ".nan"}, "resolution"),
        ({"origin": [0, 0]}, "origin"),
        ({"origin": [0, 0, ".inf"]}, "origin"),
        ({"negate": 7}, "negate"),
        ({"occupied_thresh": 2}, "must be at most 1"),
        ({"occupied_thresh": 0.1, "free_thresh": 0.5}, "free_thresh: must not be above 'occupied_thresh'"),
        ({"mode": "scale"}, "'scale' is not supported; use 'trinary'"),
        ({"image": "../outside.pgm"}, "outside the workspace"),
        ({"image": "/etc/passwd"}, "outside the workspace"),
        ({"image": "none.pgm"}, "does not exist"),
        ({"image": "map.yaml"}, "neither a PGM"),
    ],
)
def test_a_map_that_cannot_be_read_is_told(keys: dict[str, Any], message: str, tmp_path: Path) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    (tmp_path / "outside.pgm").write_bytes(pgm(np.zeros((2, 2))))
    write_map(folder, np.zeros((4, 4)), **keys)
    found = wrong(folder, map={"file": "map.yaml"})
    assert found.startswith("world.objects.0.map.file: ")
    assert message in found


def test_maps_that_are_too_large_too_ragged_or_empty_are_told(tmp_path: Path) -> None:
    write_map(tmp_path, np.full((4, 4), 254), "empty")
    assert "no occupied cell" in wrong(tmp_path, map={"file": "empty.yaml"})
    write_map(tmp_path, (np.indices((100, 100)).sum(axis=0) % 2) * 254, "chess")
    assert "more than 2,000 boxes" in wrong(tmp_path, map={"file": "chess.yaml"})
    write_map(tmp_path, np.zeros((2, 2)), "bomb")
    (tmp_path / "bomb.pgm").write_bytes(b"P5 10000 10000 255\n")
    assert "10000 x 10000 pixels in its header; at most 16,000,000" in wrong(tmp_path, map={"file": "bomb.yaml"})
    (tmp_path / "text.yaml").write_bytes(b"\xff\xfe")
    assert "not UTF-8" in wrong(tmp_path, map={"file": "text.yaml"})
    (tmp_path / "list.yaml").write_text("[1, 2]")
    assert "has no keys" in wrong(tmp_path, map={"file": "list.yaml"})
    (tmp_path / "twice.yaml").write_text("image: a\nimage: b\n")
    assert "twice.yaml:2:1: the key 'image' is used twice" in wrong(tmp_path, map={"file": "twice.yaml"})
    assert "outside the workspace" in wrong(tmp_path, map={"file": "../map.yaml"})


def test_images_that_are_no_ground_are_told(tmp_path: Path) -> None:
    def found(name: str) -> str:
        return wrong(tmp_path, heightfield={"image": name, "size": (1, 1), "height": 1})

    (tmp_path / "text.pgm").write_text("hello")
    assert found("text.pgm").startswith("world.objects.0.heightfield.image: 'text.pgm' is neither a PGM")
    (tmp_path / "line.pgm").write_bytes(pgm(np.zeros((1, 9))))
    assert "at least 2 x 2" in found("line.pgm")
    (tmp_path / "large.pgm").write_bytes(pgm(np.zeros((600, 600))))
    assert "at most 250,000 samples" in found("large.pgm")
    assert "does not exist" in found("none.pgm")
    assert "outside the workspace" in found("../x.pgm")


def test_a_large_mesh_that_cannot_be_convex_is_refused_before_its_points_are_welded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A terrain of 51,200 triangles, and a ball of as many, whose surface is convex."""
    steps = np.linspace(0, np.pi, 161)
    up, round_ = np.meshgrid(steps, 2 * steps, indexing="ij")
    ball = np.stack([np.sin(up) * np.cos(round_), np.sin(up) * np.sin(round_), np.cos(up)], -1)
    terrain = np.stack([up, round_, 0.1 * np.sin(4 * up)], -1)
    for name, grid in (("ball", ball), ("terrain", terrain)):
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        corners = np.concatenate([np.stack(some, -2).reshape(-1, 9) for some in ((a, b, c), (a, c, d))])
        rows = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", 9), ("attributes", "<u2")])
        rows["corners"] = corners
        (tmp_path / f"{name}.stl").write_bytes(bytes(80) + len(rows).to_bytes(4, "little") + rows.tobytes())
    assert read(tmp_path, mesh={"file": "ball.stl"})
    assert read(tmp_path, mesh={"file": "terrain.stl"}, mass=1)
    monkeypatch.setattr("sim_action.world.shape_files.mesh_file.parsed_mesh", None)
    found = wrong(tmp_path, mesh={"file": "terrain.stl"})
    assert "'terrain.stl' is not convex and has 51,200 triangles; at most 40,000 are simulated: simplify it" in found


def test_meshes_that_cannot_be_had_are_told(tmp_path: Path) -> None:
    def found(name: str, **more: Any) -> str:
        return wrong(tmp_path, mesh={"file": name, **more}, **({"mass": 1} if name == "flat.obj" else {}))

    (tmp_path / "box.obj").write_bytes(obj())
    assert "if the file is in millimetres, use scale: 0.001" in found("box.obj", scale=1e5)
    assert "too small to simulate" in found("box.obj", scale=1e-5)
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert "has no volume" in found("flat.obj")
    (tmp_path / "bad.stl").write_text("nothing")
    assert found("bad.stl").startswith("world.objects.0.mesh.file: 'bad.stl' is not an STL file")
    (tmp_path / "model.ply").write_text("ply")
    assert "files are not supported" in found("model.ply")
    assert "outside the workspace" in found("../box.obj")
