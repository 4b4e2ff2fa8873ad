"""A suite of 32 tests: the burger drives for 4 s at different speeds. It travels 1.5 m and does not tip over."""

import math

import pytest

RATE = 240
MIN_UP = math.cos(math.radians(10))


@pytest.mark.parametrize("speed", [(60 + number) / 100 for number in range(32)])
def test_burger_drives_upright(spawn, speed):
    burger = spawn()
    (x0, y0, _), _ = burger.pose()
    burger.target = speed
    travelled = 0.0
    for _ in range(4 * RATE):
        burger.step()
        (x, y, _), (_, qx, qy, _) = burger.pose()
        travelled = math.hypot(x - x0, y - y0)
        assert 1 - 2 * (qx * qx + qy * qy) >= MIN_UP
    assert travelled >= 1.5
