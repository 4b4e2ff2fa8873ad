"""The ground cut around patches."""

from __future__ import annotations

from itertools import combinations

from hypothesis import given
from hypothesis import strategies as st

from sim_action.world.physics import GROUND_REACH_M, Ground, Patch, Tile, ground_tiles


def bounds(tile: Tile) -> tuple[float, float, float, float]:
    x, y, _ = tile.part.pose.position_xyz
    width, depth, _ = tile.part.size_xyz
    return x - width / 2, x + width / 2, y - depth / 2, y + depth / 2


def test_ground_without_patches_stays_a_plane() -> None:
    assert ground_tiles(Ground(), ()) == ()


def test_a_patch_leaves_four_tiles_around_it_that_end_at_the_height_of_the_ground() -> None:
    tiles = ground_tiles(Ground(friction=0.7), [Patch(x=1, y=2, size=(2, 4), friction=0.1)])
    assert [tile.friction for tile in tiles] == [0.1, *[0.7] * 4]
    assert bounds(tiles[0]) == (0, 2, 0, 4)
    assert {tile.part.pose.position_xyz[2] + tile.part.size_xyz[2] / 2 for tile in tiles} == {0.0}


@st.composite
def patches(draw: st.DrawFn) -> list[Patch]:
    """In cells of a grid, so that none lies on another; many touch."""
    cells = draw(st.sets(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=8))
    sizes = st.sampled_from([0.3, 0.7, 1.0])
    return [Patch(x=x, y=y, size=(draw(sizes), draw(sizes)), friction=0.1) for x, y in sorted(cells)]


@given(patches())
def test_tiles_cover_the_ground_once(found: list[Patch]) -> None:
    tiles = [bounds(tile) for tile in ground_tiles(Ground(), found)]
    area = sum((right - left) * (high - low) for left, right, low, high in tiles)
    assert abs(area - 4 * GROUND_REACH_M**2) < 1e-2
    for one, other in combinations(tiles, 2):
        apart = one[1] <= other[0] + 1e-6 or other[1] <= one[0] + 1e-6
        assert apart or one[3] <= other[2] + 1e-6 or other[3] <= one[2] + 1e-6
