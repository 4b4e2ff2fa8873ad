"""One test: the burger drives 1.5 m."""

import math

RATE = 240


def test_burger_drives_1_5_m(spawn):
    burger = spawn()
    (x0, y0, _), _ = burger.pose()
    burger.target = 1.0
    travelled = 0.0
    for _ in range(30 * RATE):
        burger.step()
        (x, y, _), _ = burger.pose()
        travelled = math.hypot(x - x0, y - y0)
        if travelled >= 1.5:
            break
    assert travelled >= 1.5
