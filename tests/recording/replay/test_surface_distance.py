"""How far points are from the shapes of bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.recording.replay.sightings import distance_to
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart

TURNED = Pose((1.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, math.pi / 2))
CORNERS = tuple((x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0))
TRIANGLE = SurfacePart(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]]))


@pytest.mark.parametrize(
    ("part", "point", "expected"),
    [
        (BoxPart((2.0, 4.0, 6.0)), (2.0, 0.0, 0.0), 1.0),
        (BoxPart((2.0, 4.0, 6.0)), (4.0, 6.0, 3.0), 5.0),
        (BoxPart((2.0, 4.0, 6.0)), (0.9, 0.0, 0.0), -0.1),
        (BoxPart((2.0, 4.0, 6.0), TURNED), (1.0, 2.0, 0.0), 1.0),
        (CylinderPart(0.5, 2.0), (0.0, 1.5, 0.0), 1.0),
        (CylinderPart(0.5, 2.0), (3.5, 0.0, 5.0), 5.0),
        (SpherePart(0.5, TURNED), (1.0, 0.0, 2.0), 1.5),
        (HullPart(CORNERS), (0.0, 2.5, 0.0), 1.5),
        (HullPart(CORNERS), (4.0, 5.0, 0.0), 5.0),
        (TRIANGLE, (0.2, 0.2, -0.7), 0.7),
        (TRIANGLE, (-3.0, 0.5, 4.0), 5.0),
        (TRIANGLE, (4.0, 0.0, 4.0), 5.0),
        (GridPart((2.0, 2.0), np.full((3, 3), 0.5)), (0.3, -0.4, 0.7), 0.2),
    ],
)
def test_distances(part: Part, point: tuple[float, float, float], expected: float) -> None:
    assert distance_to([part], np.array([point, point])) == pytest.approx([expected, expected])


def test_the_nearest_part_counts() -> None:
    parts = [SpherePart(0.5), SpherePart(0.5, Pose((2.0, 0.0, 0.0)))]
    assert distance_to(parts, np.array([[1.6, 0.0, 0.0], [0.0, 1.0, 0.0]])) == pytest.approx([-0.1, 0.5])
    assert len(distance_to(parts, np.empty((0, 3)))) == 0
