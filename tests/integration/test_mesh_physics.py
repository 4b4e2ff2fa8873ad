"""How bodies whose shape is a mesh behave in PyBullet, beside its own shapes and beside what is right."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.geometry import Vector3
from tests.integration.mesh_trials import ENGINES_MARGIN, found, reach, rewritten, written
from tests.mesh_files import L_FACES, L_POINTS, ascii_stl, dae, obj, stl

pytestmark = pytest.mark.pybullet


@pytest.mark.parametrize("scale", [(2, 1, 0.5), (-1, 1, 1), (-1, -2, -0.1)])
def test_a_scale_acts_as_it_does_in_the_engine(scale: Vector3, tmp_path: Path) -> None:
    path = written(tmp_path, "L.stl", stl(L_POINTS, L_FACES))
    alone, helped = found(["look_at", str(path), "", " ".join(map(str, scale))], ["look_at", rewritten(path, scale)])
    assert [part - ENGINES_MARGIN for part in reach(alone)] == pytest.approx(reach(helped), abs=1e-5)


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
