"""Masses that <compiler> of an MJCF file changes: the reader and the engine have the same ones."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.integration.engines import advance, running
from tests.integration.test_native_robots import scene

mujoco: Any = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")

ROBOT = """<mujoco model="r"><compiler {}/><worldbody><body name="base" pos="0 0 .1"><freejoint/>
  <geom type="box" size=".2 .2 .1" mass="5"/><geom type="sphere" pos=".5 0 0" size=".1" density="200" group="2"/>
  <body name="arm" pos="0 0 .3"><joint name="j" axis="0 1 0"/>
    <inertial pos="0 0 .1" mass="2" fullinertia=".2 .1 .25 .01 0 0"/>
    <geom type="capsule" fromto="0 0 0 .3 0 .1" size=".03"/></body>
  <body name="tip" pos="0 0 .6"><joint name="k" axis="0 1 0"/>
    <inertial pos="0 0 0" mass=".001" diaginertia="1 .1 .1"/></body>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    "compiler",
    [
        'balanceinertia="true"',
        'settotalmass="20" balanceinertia="true"',
        'boundmass="0.5" balanceinertia="true"',
        'boundinertia="0.5" balanceinertia="true"',
        'inertiafromgeom="true" boundmass="0.1" boundinertia="0.1" balanceinertia="true"',
        'inertiagrouprange="1 3" balanceinertia="true"',
    ],
)
def test_a_compiler_that_changes_masses_gives_one_model_to_the_reader_and_the_engine(
    compiler: str, tmp_path: Path
) -> None:
    robot = scene(tmp_path, ROBOT.format(compiler))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain = mujoco.MjModel.from_xml_string(ROBOT.format(compiler))
    assert [link.mass for link in robot.model.links] == pytest.approx(plain.body_mass[1:])
    with running("mujoco", robot) as engine:
        model = engine._compiled.model  # type: ignore[attr-defined]
        assert model.body_mass[1:] == pytest.approx(plain.body_mass[1:])
        assert np.allclose(model.body_inertia[1:], plain.body_inertia[1:])
        assert np.allclose(model.body_ipos[1:], plain.body_ipos[1:])


CUBE = ((0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4))
LAST = ((1, 5, 7), (1, 7, 3))


def cube(faces: tuple[tuple[int, ...], ...], attributes: str = "") -> str:
    """Return a robot with a mesh of a cube of 0.2 m: 8 kg."""
    vertices = " ".join(f"{x} {y} {z}" for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1))
    triangles = " ".join(str(corner) for face in faces for corner in face)
    return f"""<mujoco><asset><mesh name="m" vertex="{vertices}" face="{triangles}" {attributes}/></asset><worldbody>
      <body name="b"><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("faces", "attributes", "is_odd"),
    [
        (CUBE + LAST, "", False),
        (CUBE + LAST[:1], "", True),
        (CUBE + LAST + tuple(face[::-1] for face in CUBE + LAST), "", True),
        (CUBE + LAST[:1], 'inertia="convex"', False),
    ],
)
def test_a_mesh_that_is_not_closed_is_named_with_the_mass_of_its_hull(
    faces: tuple[tuple[int, ...], ...], attributes: str, is_odd: bool, tmp_path: Path
) -> None:
    robot = scene(tmp_path, cube(faces, attributes))
    found = [str(finding.message) for finding in robot.model.findings if finding.rule == "open-mesh"]
    assert len(found) == is_odd
    assert not is_odd or "8 kg with its convex hull" in found[0]


def test_belts_stand_still_until_the_scenario_begins(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="base" pos="0 0 .1"><freejoint/>
      <geom name="belt" type="box" size=".3 .2 .1" mass="5" surfacevel="-0.5 0 0"/></body></worldbody></mujoco>"""
    robot = scene(tmp_path, text)
    assert [finding.rule for finding in robot.model.findings] == ["moving-surface"]
    with running("mujoco", robot) as engine:
        before = advance(engine, -240, 240)
        after = advance(engine, 0, 480)
    assert abs(before.base_position_xyz[-1, 0]) < 1e-3
    assert after.base_position_xyz[-1, 0] == pytest.approx(1.0, abs=0.05)
