"""The geometry of a pinhole camera."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.sensors.rendering.pinhole import Patch, Pinhole

WIDE = Pinhole(width=40, height=20, field_of_view=math.radians(90), near=0.1, far=10.0)
ALL: Patch = (slice(None), slice(None))


def test_the_field_of_view_is_from_edge_to_edge() -> None:
    assert WIDE.focal_length == pytest.approx(20)
    assert WIDE.left[0, [0, 19, 20, 39]] == pytest.approx([0.975, 0.025, -0.025, -0.975])
    assert WIDE.up[[0, 9, 10, 19], 0] == pytest.approx([0.475, 0.025, -0.025, -0.475])


def test_rays_are_turned_with_the_camera() -> None:
    rays = WIDE.rays(Pose((1, 2, 3), quaternion_from_rpy(0, 0, math.pi / 2)), ALL)
    x, y, z = (np.broadcast_to(way, (20, 40)) for way in rays.ways)
    assert rays.start_xyz == (1, 2, 3)
    assert y == pytest.approx(np.ones((20, 40)))
    assert (x[0, 0], z[0, 0]) == pytest.approx((-0.975, 0.475))
    assert [part[0, 0] for part in rays.points(np.full((20, 40), 2.0))] == pytest.approx([1 - 1.95, 4, 3.95])


near_or_far = st.floats(-12, 12)
# What is at most as far to a side as it is ahead is in sight.
ahead = st.tuples(st.floats(0.1, 10), st.floats(-1, 1), st.floats(-0.5, 0.5))


@given(
    middle=st.tuples(st.floats(-1, 12), near_or_far, near_or_far)
    | ahead.map(lambda at: (at[0], at[0] * at[1], at[0] * at[2])),
    radius=st.floats(0.01, 3),
    toward=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)),
)
def test_a_patch_holds_all_of_a_ball(
    middle: tuple[float, float, float], radius: float, toward: tuple[float, float, float]
) -> None:
    share = radius / max(1.0, math.hypot(*toward))
    x, y, z = (at + share * part for at, part in zip(middle, toward, strict=True))
    if not WIDE.near <= x <= WIDE.far:
        return
    column, row = (math.floor(middle - WIDE.focal_length * part / x) for middle, part in ((20, y), (10, z)))
    if not (0 <= column < 40 and 0 <= row < 20):
        return
    patch = WIDE.patch_around(middle, radius)
    assert patch is not None
    rows, columns = patch
    assert rows.start <= row < rows.stop
    assert columns.start <= column < columns.stop


@pytest.mark.parametrize(
    "middle",
    [(-1.0, 0, 0), (11.0, 0, 0), (5.0, 9.0, 0), (5.0, 0, -9.0), (math.nan,) * 3, (math.inf,) * 3, (5.0, math.inf, 0)],
)
def test_what_is_behind_too_far_or_beside_has_none(middle: tuple[float, float, float]) -> None:
    assert WIDE.patch_around(middle, 0.5) is None


def test_a_ball_far_away_has_a_small_one() -> None:
    assert WIDE.patch_around((5.0, 0, 0), 0.5) == (slice(7, 13), slice(17, 23))
