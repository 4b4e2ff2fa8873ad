"""Sobol's points: the table, and how evenly scrambled points cover the cube."""

from __future__ import annotations

import hashlib
import struct
from collections import Counter
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.scenario.variations.sobol import BITS, MAX_DIMENSIONS, points, scrambled_points

DIMENSIONS = range(MAX_DIMENSIONS)

# Of the primitive polynomials, that of the first dimension taken as 0.
DEGREES = (0, 1, 2, 3, 3, 4, 4, 5, 5, 5, 5, 5, 5, 6, 6, 6, 6, 6, 6, 7)

SCRAMBLES = st.integers(0, 2**BITS - 1)


@pytest.mark.parametrize(
    ("dimension", "first"),
    [
        (0, [0, 4, 6, 2, 3, 7, 5, 1]),
        (1, [0, 4, 2, 6, 3, 7, 1, 5]),
        (2, [0, 4, 2, 6, 5, 1, 7, 3]),
        (3, [0, 4, 2, 6, 7, 3, 5, 1]),
    ],
)
def test_the_first_points_are_those_of_joe_and_kuo(dimension: int, first: list[int]) -> None:
    assert [point / 2 ** (BITS - 3) for point in points(dimension, 8)] == first


def test_all_points_are_those_of_another_program() -> None:
    """Those of scipy 1.17.1: `qmc.Sobol(20, scramble=False, bits=32).random(256) * 2**32` as "<u4"."""
    rows = zip(*(points(dimension, 256) for dimension in DIMENSIONS), strict=True)
    written = b"".join(struct.pack("<20I", *row) for row in rows)
    assert hashlib.sha256(written).hexdigest() == "4b7cbfe2a112d4cb925243dfd974b9db5a449d4f072d0adcd34725c213b2c705"


@given(st.sampled_from(DIMENSIONS), st.integers(0, 9), SCRAMBLES)
def test_each_interval_of_a_dimension_has_one_point_at_every_power_of_2(
    dimension: int, power: int, scramble: int
) -> None:
    count = 2**power
    covered = [int(point * count) for point in scrambled_points(dimension, count, scramble)]
    assert sorted(covered) == list(range(count))


@given(st.integers(0, 8), st.integers(0, 8), SCRAMBLES, SCRAMBLES)
def test_the_first_two_dimensions_have_one_point_in_each_rectangle(wide: int, high: int, one: int, other: int) -> None:
    count = 2 ** (wide + high)
    pairs = zip(scrambled_points(0, count, one), scrambled_points(1, count, other), strict=True)
    assert len({(int(x * 2**wide), int(y * 2**high)) for x, y in pairs}) == count


@pytest.mark.parametrize(("first", "second"), list(combinations(DIMENSIONS, 2)))
def test_two_dimensions_cover_rectangles_as_their_polynomials_promise(first: int, second: int) -> None:
    """A (t, m, 2)-net: each rectangle of the area 2**(t - m) holds 2**t points."""
    t = sum(max(DEGREES[each] - 1, 0) for each in (first, second))
    m = max(t, 8)
    xs, ys = (list(scrambled_points(each, 2**m, 7919 * each + 1)) for each in (first, second))
    for wide in range(m - t + 1):
        high = m - t - wide
        cells = Counter((int(x * 2**wide), int(y * 2**high)) for x, y in zip(xs, ys, strict=True))
        assert set(cells.values()) == {2**t}
        assert len(cells) == 2 ** (m - t)


@pytest.mark.parametrize("dimensions", range(1, 11))
def test_there_is_one_point_in_each_corner_of_the_cube(dimensions: int) -> None:
    """Sobol's property A, which depends on the initial numbers of the table."""
    count = 2**dimensions
    halves = zip(*([p >> (BITS - 1) for p in points(each, count)] for each in range(dimensions)), strict=True)
    assert len(set(halves)) == count


@given(st.sampled_from(DIMENSIONS), SCRAMBLES)
def test_more_points_leave_the_first_as_they_are(dimension: int, scramble: int) -> None:
    few = list(scrambled_points(dimension, 8, scramble))
    assert list(scrambled_points(dimension, 32, scramble))[:8] == few
    assert all(0 < point < 1 for point in few)


def test_each_point_is_uniform_over_scrambles() -> None:
    """The first point of many scrambles: each of 16 intervals has its share, within 5 standard deviations."""
    seeds = [int.from_bytes(hashlib.sha256(bytes([n % 256, n // 256])).digest()[:4], "big") for n in range(4096)]
    for index in (0, 1, 5):
        found = Counter(int(list(scrambled_points(3, index + 1, seed))[-1] * 16) for seed in seeds)
        assert len(found) == 16
        assert all(abs(count - 256) < 5 * 256**0.5 for count in found.values())
