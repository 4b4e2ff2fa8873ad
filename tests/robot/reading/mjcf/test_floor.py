"""The look of a floor: what its plane or its material states, within limits."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.robot.model.robot_model import FloorLook
from tests.robot.reading.mjcf.test_mjcf_reader import read

TEXTURE = '<texture name="t" type="2d" builtin="{kind}" rgb1=".2 .4 .6" rgb2="0 0.5 1" width="8" height="8"/>'
MATERIAL = '<material name="m" texture="t" texrepeat="5 5" {more}/>'
BODY = '<body name="b" pos="0 0 1"><freejoint/><geom size=".1"/></body>'


def look(
    folder: Path, floor: str = "", more: str = "", kind: str = "checker", texture: str = TEXTURE
) -> FloorLook | None:
    asset = f"<asset>{texture.format(kind=kind)}{MATERIAL.format(more=more)}</asset>"
    size = "" if "size" in floor else 'size="2 2 .1"'
    plane = f'<geom name="floor" type="plane" {size} {floor}/>'
    found = read(folder, f"<mujoco>{asset}<worldbody>{plane}{BODY}</worldbody></mujoco>")
    assert found.mjcf is not None
    return found.mjcf.floor_look


def test_the_squares_of_a_texture_are_those_of_the_floor(tmp_path: Path) -> None:
    assert look(tmp_path, 'material="m"') == FloorLook((0.2, 0.4, 0.6), (0, 0.5, 1), 0.4)


@pytest.mark.parametrize(
    ("floor", "more", "square"),
    [
        ('material="m"', 'texuniform="true"', 0.1),
        ('material="m" size="0 0 1"', "", 0.1),
        ('material="m" size="0.001 1 1"', "", 0.01),
        ('material="m" size="100000 1 1"', "", 1000),
    ],
)
def test_squares_have_the_size_in_which_mujoco_draws_them(floor: str, more: str, square: float, tmp_path: Path) -> None:
    found = look(tmp_path, floor, more)
    assert found is not None
    assert found.square == pytest.approx(square)


def test_a_material_tints_its_texture_and_the_plane_replaces_that(tmp_path: Path) -> None:
    tinted = look(tmp_path, 'material="m"', 'rgba="1 0.5 0 1"')
    assert tinted == FloorLook((0.2, 0.2, 0), (0, 0.25, 0), 0.4)
    assert look(tmp_path, 'material="m" rgba="0 0 1 1"', 'rgba="1 0.5 0 1"') == FloorLook((0, 0, 0.6), (0, 0, 1), 0.4)


def test_a_floor_of_one_colour_has_no_squares(tmp_path: Path) -> None:
    assert look(tmp_path, 'rgba=".3 .2 .1 1"') == FloorLook((0.3, 0.2, 0.1))
    assert look(tmp_path, 'material="m"', kind="flat") == FloorLook((0.2, 0.4, 0.6))


@pytest.mark.parametrize("floor", ["", 'material="m"'])
def test_a_floor_that_says_nothing_has_no_look(floor: str, tmp_path: Path) -> None:
    assert look(tmp_path, floor, kind="none") is None


@pytest.mark.parametrize("numbers", ["", "1 2", "nan 0 0", "red green blue", "1e400 0 0"])
def test_colours_that_are_none_are_those_of_mujoco(numbers: str, tmp_path: Path) -> None:
    texture = TEXTURE.replace(".2 .4 .6", numbers)
    assert look(tmp_path, 'material="m"', texture=texture) == FloorLook((0.8, 0.8, 0.8), (0, 0.5, 1), 0.4)


def test_colours_beyond_white_are_white(tmp_path: Path) -> None:
    texture = TEXTURE.replace(".2 .4 .6", "7 -3 0.5")
    assert look(tmp_path, 'material="m"', texture=texture) == FloorLook((1, 0, 0.5), (0, 0.5, 1), 0.4)
