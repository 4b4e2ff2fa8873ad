"""Many variations of one test: the burger drives for 2 s, each time in another direction."""

import math
import os
import random

import pytest

RATE = 240
MIN_UP = math.cos(math.radians(10))
VARIATIONS = int(os.environ.get("VARIATIONS", "1000"))
DRAWN = random.Random(0)


@pytest.mark.parametrize("yaw", [math.radians(DRAWN.uniform(-1, 1)) for _ in range(VARIATIONS)])
def test_burger_drives_upright(spawn, yaw):
    burger = spawn(yaw)
    (x0, y0, _), _ = burger.pose()
    burger.target = 1.0
    travelled = 0.0
    for _ in range(2 * RATE):
        burger.step()
        (x, y, _), (qx, qy, _, _) = burger.pose()
        travelled = math.hypot(x - x0, y - y0)
        assert 1 - 2 * (qx * qx + qy * qy) >= MIN_UP
    assert travelled >= 1.0
