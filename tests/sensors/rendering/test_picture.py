"""What is drawn: the nearest, in its colour, within the bounds of the camera."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.sensors.rendering import GROUND, SKY
from sim_action.sensors.rendering.picture import Placed, draw
from sim_action.sensors.rendering.pinhole import Pinhole
from sim_action.sensors.rendering.solids import Ellipsoid, Polyhedron

EYE = Pose((0, 0, 1))
PINHOLE = Pinhole(width=64, height=48, field_of_view=math.radians(60), near=0.1, far=8.0)
RED = (1.0, 0.0, 0.0)
GREEN = (0.0, 1.0, 0.0)


def ball(x: float, colour: tuple[float, float, float] = RED, radius: float = 0.3, y: float = 0.0) -> Placed:
    return Placed(Ellipsoid((radius,) * 3), Pose((x, y, 1)), colour)


def test_an_empty_world_is_ground_and_sky() -> None:
    picture = draw(PINHOLE, EYE, [])
    sky = np.array([round(255 * part) for part in SKY])
    assert (picture.rgb[:24] == sky).all()
    assert np.isinf(picture.depth[:24]).all()
    below = 1 / -PINHOLE.up[24:, 0]
    seen = below <= PINHOLE.far
    assert picture.depth[24:][seen] == pytest.approx(np.repeat(below[seen, None], 64, axis=1), rel=1e-6)
    assert np.isinf(picture.depth[24:][~seen]).all()
    assert len(np.unique(picture.rgb[24:][seen].reshape(-1, 3), axis=0)) == len(GROUND)


def test_from_below_the_ground_it_is_not_there() -> None:
    assert np.isinf(draw(PINHOLE, Pose((0, 0, -1)), []).depth).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_what_is_nearer_hides_what_is_behind(order: tuple[int, int]) -> None:
    both = ball(2.0), ball(5.0, GREEN, radius=1.5)
    picture = draw(PINHOLE, EYE, [both[number] for number in order])
    red, green, _ = np.moveaxis(picture.rgb, 2, 0)
    assert red[24, 32] > 0 == green[24, 32]
    assert picture.depth[24, 32] == pytest.approx(1.7, abs=1e-3)
    assert green[24, 16] > 0 == red[24, 16]


def test_light_falls_from_above() -> None:
    red = draw(PINHOLE, EYE, [ball(2.0, radius=0.5)]).rgb[..., 0]
    assert red[16, 32] > 1.2 * red[32, 32] > 0


@pytest.mark.parametrize("turn", [0.0, 1.0, 3.0])
def test_light_does_not_turn_with_what_it_falls_on(turn: float) -> None:
    still = draw(PINHOLE, EYE, [ball(2.0)])
    turned = Placed(Ellipsoid((0.3,) * 3), Pose((2, 0, 1), quaternion_from_rpy(turn, turn, turn)), RED)
    picture = draw(PINHOLE, EYE, [turned])
    assert np.abs(picture.rgb.astype(int) - still.rgb).max() <= 1


def test_what_is_around_the_camera_or_beyond_its_bounds_is_not_seen() -> None:
    nothing = draw(PINHOLE, EYE, []).rgb
    around = Placed(Polyhedron.box((0.5, 0.5, 0.5)), EYE, RED)
    for unseen in (around, ball(0.35), ball(8.5), ball(-2.0), ball(2.0, y=4.0)):
        assert np.array_equal(draw(PINHOLE, EYE, [unseen]).rgb, nothing)


def test_a_camera_that_is_nowhere_sees_the_sky() -> None:
    nowhere = Pose((math.nan,) * 3, (math.nan,) * 4)
    for picture in (draw(PINHOLE, nowhere, [ball(2.0)]), draw(PINHOLE, EYE, [Placed(ball(2.0).solid, nowhere, RED)])):
        assert np.isinf(picture.depth[:24]).all()


def test_pictures_cannot_be_written_to() -> None:
    picture = draw(PINHOLE, EYE, [])
    for array in (picture.rgb, picture.depth):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
