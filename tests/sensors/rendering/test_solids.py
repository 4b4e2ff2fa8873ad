"""Where rays enter solids: by hand, and held against points that are known to be inside or outside."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.core.geometry import Vector3
from sim_action.sensors.rendering.hulls import hull_of
from sim_action.sensors.rendering.solids import Capsule, Cylinder, Ellipsoid, Polyhedron, Solid
from tests.sensors.rendering.solid_rays import entry

BOX = Polyhedron.box((1.0, 2.0, 3.0))
CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0)])
CAN, PILL = Cylinder(1.0, 2.0), Capsule(1.0, 2.0)
EGG = Ellipsoid((1.0, 2.0, 3.0))
SOLIDS: list[tuple[Solid, Callable[[float, float, float], float]]] = [
    (BOX, lambda x, y, z: max(abs(x) - 1, abs(y) - 2, abs(z) - 3)),
    (hull_of(CORNERS), lambda x, y, z: max(abs(x) - 1, abs(y) - 2, abs(z) - 3)),
    (CAN, lambda x, y, z: max(math.hypot(x, y) - 1, abs(z) - 2)),
    (PILL, lambda x, y, z: math.hypot(x, y, max(0.0, abs(z) - 2)) - 1),
    (EGG, lambda x, y, z: math.hypot(x, y / 2, z / 3) - 1),
]
ids = ("box", "hull", "can", "pill", "egg")
part = st.floats(-1, 1).map(lambda value: round(value, 3))
vector = st.tuples(part, part, part)


@pytest.mark.parametrize(
    ("solid", "start", "way", "depth", "normal"),
    [
        (BOX, (-5, 0.5, 0.5), (2, 0, 0), 2.0, (-1, 0, 0)),
        (BOX, (0, 5, 0), (0, -1, 0), 3.0, (0, 1, 0)),
        (BOX, (0, 5, 0), (1, 0, 0), math.inf, None),
        (CAN, (-5, 0, 1.9), (1, 0, 0), 4.0, (-1, 0, 0)),
        (CAN, (-5, 0, 2.1), (1, 0, 0), math.inf, None),
        (CAN, (0.5, 0.2, 5), (0, 0, -1), 3.0, (0, 0, 1)),
        (CAN, (2, 0, 5), (0, 0, -1), math.inf, None),
        (CAN, (-9, 0, 5), (1, 0, -1), math.inf, None),
        (CAN, (-3.5, 0, 5), (1, 0, -1), 3.0, (0, 0, 1)),
        (PILL, (-5, 0, 1), (1, 0, 0), 4.0, (-1, 0, 0)),
        (PILL, (0, 0, 9), (0, 0, -1), 6.0, (0, 0, 1)),
        (PILL, (0, 0, -9), (0, 0, 1), 6.0, (0, 0, -1)),
        (EGG, (0, -9, 0), (0, 1, 0), 7.0, (0, -1, 0)),
        (EGG, (0, -9, 3.1), (0, 1, 0), math.inf, None),
        (Ellipsoid((2.0, 2.0, 2.0)), (-9, 0, 1), (1, 0, 0), 9 - math.sqrt(3), (-math.sqrt(3) / 2, 0, 0.5)),
    ],
)
def test_a_ray_enters_where_algebra_says(
    solid: Solid, start: Vector3, way: Vector3, depth: float, normal: Vector3 | None
) -> None:
    found, faces = entry(solid, start, way)
    assert found == pytest.approx(depth, abs=1e-12)
    assert normal is None or faces == pytest.approx(normal, abs=1e-12)


@pytest.mark.parametrize(("solid", "outside"), SOLIDS, ids=ids)
@given(start=vector, aim=vector)
def test_before_it_enters_a_ray_is_outside_and_then_inside(
    solid: Solid, outside: Callable[[float, float, float], float], start: Vector3, aim: Vector3
) -> None:
    (ax, ay, az), (bx, by, bz) = ((8 * x, 8 * y, 8 * z) for x, y, z in (start, aim))
    way = (bx - ax, by - ay, bz - az)
    assume(math.hypot(*way) > 0.1)
    assume(outside(ax, ay, az) > 1e-3)

    def at(depth: float) -> float:
        return outside(ax + depth * way[0], ay + depth * way[1], az + depth * way[2])

    depth, normal = entry(solid, (ax, ay, az), way)
    on_the_way = [step / 500 for step in range(1, 1001)]
    if 0 <= depth < math.inf:
        assert at(depth) == pytest.approx(0, abs=1e-6)
        assert math.hypot(*normal) == pytest.approx(1)
        assert sum(one * other for one, other in zip(normal, way, strict=True)) < 1e-6
    assert [step for step in on_the_way if at(step) < -1e-6 and not 0 <= depth <= step] == []
    assert [step for step in on_the_way if step < depth and at(step) < -1e-6] == []


@pytest.mark.parametrize("solid", [solid for solid, _ in SOLIDS], ids=ids)
def test_from_inside_nothing_is_entered_ahead(solid: Solid) -> None:
    for way in ((1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 1, 1)):
        depth, _ = entry(solid, (0.1, 0.2, 0.3), way)
        assert depth < 0


@pytest.mark.parametrize(("solid", "outside"), SOLIDS, ids=ids)
def test_its_radius_holds_it(solid: Solid, outside: Callable[[float, float, float], float]) -> None:
    beyond = solid.radius * 1.001
    turns = [(math.cos(a) * math.sin(b), math.sin(a) * math.sin(b), math.cos(b)) for a in range(9) for b in range(9)]
    assert all(outside(beyond * x, beyond * y, beyond * z) > 0 for x, y, z in turns)
