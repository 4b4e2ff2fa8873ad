"""Masses that <compiler> of an MJCF file changes: the reader and the engine have the same ones."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.integration.engines import running
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
