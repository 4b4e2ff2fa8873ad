"""What bodies are made of."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import IDENTITY, Pose, quaternion_from_rpy, rotate
from sim_action.world import parts

ANGLES = st.floats(-3, 3)
CORNERS = tuple((x, y, z) for x in (-1.0, 1.0) for y in (-0.5, 0.5) for z in (-0.25, 0.25))


@given(ANGLES, ANGLES, ANGLES)
def test_a_box_is_as_low_as_its_lowest_corner(roll: float, pitch: float, yaw: float) -> None:
    turned = quaternion_from_rpy(roll, pitch, yaw)
    expected = min(rotate(turned, corner)[2] for corner in CORNERS)
    surface = parts.grid_surface(parts.GridPart((2, 1), np.zeros((2, 2))))
    assert parts.lowest([parts.BoxPart((2, 1, 0.5))], turned) == pytest.approx(expected)
    assert parts.lowest([parts.HullPart(CORNERS)], turned) == pytest.approx(expected)
    flat = min(rotate(turned, (x, y, 0.0))[2] for x, y, _ in CORNERS)
    assert parts.lowest([surface], turned) == pytest.approx(flat)


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        (parts.SpherePart(0.3), -0.3),
        (parts.CylinderPart(0.3, 2.0), -0.3),
        (parts.BoxPart((1, 1, 1), Pose((0, 0, 5))), -0.5),
        (parts.BoxPart((1, 1, 1), Pose((5, 0, 0))), -5.5),
    ],
)
def test_a_quarter_turn_about_y_puts_x_down(part: parts.Part, expected: float) -> None:
    assert parts.lowest([part], quaternion_from_rpy(0, math.pi / 2, 0)) == pytest.approx(expected)
    assert parts.lowest([part, parts.SpherePart(9)], IDENTITY) == -9


def test_a_grid_has_its_rows_along_y_and_its_columns_along_x() -> None:
    points = parts.grid_points(parts.GridPart((2, 4), np.array([[1, 2, 3], [4, 5, 6]])))
    assert points.tolist() == [[-1, -2, 1], [0, -2, 2], [1, -2, 3], [-1, 2, 4], [0, 2, 5], [1, 2, 6]]


@given(st.floats(-1, 1), st.floats(-2, 2))
def test_the_height_of_a_grid_is_that_of_the_triangle_there(x: float, y: float) -> None:
    grid = parts.GridPart((2, 4), np.array([[1.0, 2, 0], [4, 0, 6], [3, 3, 1]]))
    surface = parts.grid_surface(grid)
    found = parts.height_at(grid, x, y)
    assert found is not None
    heights = []
    for a, b, c in surface.points_xyz[surface.triangles]:
        u, v = np.linalg.solve(np.column_stack((b - a, c - a))[:2], np.array([x, y]) - a[:2])
        if min(u, v, 1 - u - v) >= -1e-9:
            heights.append((a + u * (b - a) + v * (c - a))[2])
    assert found == pytest.approx(heights[0], abs=1e-6)
    assert parts.height_at(grid, 1.1, 0) is None
