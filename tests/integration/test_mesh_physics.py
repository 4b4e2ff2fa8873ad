"""How bodies whose shape is a mesh behave in PyBullet, beside its own shapes and beside what is right."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.geometry import Vector3
from sim_action.meshes import MeshError, clean_mesh
from tests.integration.mesh_trials import ENGINES_MARGIN, found, reach, rewritten, written
from tests.mesh_files import (
    CORNERS,
    L_FACES,
    L_POINTS,
    ascii_stl,
    ball,
    dae,
    obj,
    stl,
    two_instances,
    two_objects,
    wheel,
)

pytestmark = pytest.mark.pybullet


@pytest.mark.parametrize("scale", [(2, 1, 0.5), (-1, 1, 1), (-1, -2, -0.1)])
def test_a_scale_acts_as_it_does_in_the_engine(scale: Vector3, tmp_path: Path) -> None:
    path = written(tmp_path, "L.stl", stl(L_POINTS, L_FACES))
    alone, helped = found(["look_at", str(path), "", " ".join(map(str, scale))], ["look_at", rewritten(path, scale)])
    assert [part - ENGINES_MARGIN for part in reach(alone)] == pytest.approx(reach(helped), abs=1e-5)


def test_a_scale_of_nothing_is_a_speck_to_the_engine_and_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "box.stl", stl())
    (alone,) = found(["look_at", str(path), "", "0 0 0"])
    assert reach(alone) == pytest.approx([ENGINES_MARGIN] * 6)
    with pytest.raises(MeshError, match="expected three finite numbers other than 0"):
        rewritten(path, (0, 0, 0))


@pytest.mark.parametrize("name", ["L.obj", "L.stl"])
def test_what_is_hollow_is_filled(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, name, (obj if name.endswith("obj") else stl)(L_POINTS, L_FACES))
    alone, helped = found(["look_at", str(path)], ["look_at", rewritten(path)])
    assert (alone["hits"]["0.4 0.4"], helped["hits"]["0.4 0.4"]) == (True, True)
    assert clean_mesh(path, tmp_path / "clean").facts.shape == "concave"


def test_a_concave_mesh_that_is_no_hull_falls_through_the_ground(tmp_path: Path) -> None:
    path = written(tmp_path, "L.obj", obj(L_POINTS, L_FACES))
    hull, concave = found(["look_at", str(path)], ["look_at", str(path), 'concave="yes"'])
    assert hull["rests_at"] == pytest.approx(ENGINES_MARGIN, abs=1e-4)
    assert concave["hits"]["0.4 0.4"] is False
    assert concave["rests_at"] < -1


def test_bodies_of_a_file_are_hulls_of_their_own_as_in_the_engine_but_for_dae(tmp_path: Path) -> None:
    two, dae_of_two = written(tmp_path, "two.obj", two_objects()), written(tmp_path, "two.dae", two_instances())
    paths = [str(two), str(dae_of_two), rewritten(two), rewritten(dae_of_two)]
    assert [answer["hits"]["0.5 0"] for answer in found(*(["look_at", path] for path in paths))] == [
        False,
        True,
        False,
        False,
    ]


def test_a_box_stands_at_its_height_and_weighs_what_is_stated(tmp_path: Path) -> None:
    files = {"a.stl": stl(), "a.obj": obj(), "a.dae": dae(), "b.stl": ascii_stl()}
    shapes = [rewritten(written(tmp_path, name, data)) for name, data in files.items()]
    for helped in found(*(["look_at", shape] for shape in shapes)):
        assert helped["rests_at"] == pytest.approx(0.3, abs=5e-5)
        assert helped["mass"] == 2


def test_a_box_that_is_not_drawn_in_stands_on_the_engines_margin(tmp_path: Path) -> None:
    path = written(tmp_path, "box.stl", stl())
    (helped,) = found(["look_at", rewritten(path, margin=0)])
    assert helped["rests_at"] == pytest.approx(0.3 + ENGINES_MARGIN, abs=5e-5)


def test_a_box_slides_as_the_engines_own_box_does(tmp_path: Path) -> None:
    low = [(z, y, x) for x, y, z in CORNERS]  # on its broad side
    path = written(tmp_path, "box.stl", stl(low))
    own, mesh = found(["slide", '<box size="0.6 0.4 0.2"/>'], ["slide", f'<mesh filename="{rewritten(path)}"/>'])
    assert own["slid"] > 0.15
    assert mesh["slid"] == pytest.approx(own["slid"], rel=0.03)
    assert mesh["z"] == pytest.approx(0.1, abs=1e-4)
    assert (abs(mesh["aside"]) < 0.02, mesh["tilt"] < 1e-3) == (True, True)


def test_a_wheel_rolls_as_far_as_its_radius_says(tmp_path: Path) -> None:
    path = written(tmp_path, "wheel.obj", obj(*wheel(0.033, 0.018)))
    shapes = [rewritten(path), rewritten(path, margin=0)]
    own, mesh, thick = found(
        ["roll", '<cylinder radius="0.033" length="0.018"/>'],
        *(["roll", f'<mesh filename="{shape}"/>'] for shape in shapes),
    )
    assert mesh["radius"] == pytest.approx(own["radius"], rel=0.005)
    assert thick["radius"] > 1.02 * own["radius"]


def test_a_fine_ball_loads_as_the_ball_it_is(tmp_path: Path) -> None:
    path = written(tmp_path, "ball.obj", obj(*ball(rings=150, spokes=300)))
    (helped,) = found(["look_at", rewritten(path)])
    assert reach(helped) == pytest.approx([0.1] * 6, abs=1e-4)
    assert helped["rests_at"] == pytest.approx(0.1, abs=1e-3)
