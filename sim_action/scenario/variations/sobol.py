"""Sobol's sequence: points that fill a cube evenly, scrambled so that each point is uniform by itself.

The direction numbers are those of Joe and Kuo (2008), new-joe-kuo-6. The scramble of Laine and Karras (2011) is Owen's
nested scramble with a hash: each binary digit depends on the digits above it alone, so that the points keep covering
all elementary intervals.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Final

MAX_DIMENSIONS: Final = 20

BITS: Final = 32

_MASK: Final = 2**BITS - 1

# For each dimension after the first: the primitive polynomial over GF(2), without its first and last coefficient, and
# the initial direction numbers, as many as its degree.
_JOE_KUO: Final = (
    (0, (1,)),
    (1, (1, 3)),
    (1, (1, 3, 1)),
    (2, (1, 1, 1)),
    (1, (1, 1, 3, 3)),
    (4, (1, 3, 5, 13)),
    (2, (1, 1, 5, 5, 17)),
    (4, (1, 1, 5, 5, 5)),
    (7, (1, 1, 7, 11, 19)),
    (11, (1, 1, 5, 1, 1)),
    (13, (1, 1, 1, 3, 11)),
    (14, (1, 3, 5, 5, 31)),
    (1, (1, 3, 3, 9, 7, 49)),
    (13, (1, 1, 1, 15, 21, 21)),
    (16, (1, 3, 1, 13, 27, 49)),
    (19, (1, 1, 1, 15, 7, 5)),
    (22, (1, 3, 1, 15, 13, 25)),
    (25, (1, 1, 5, 5, 19, 61)),
    (1, (1, 3, 7, 11, 23, 15, 103)),
)

# The multipliers are even, so that a digit depends on the digits below it alone (here the digits are reversed).
_MULTIPLIERS: Final = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)


def scrambled_points(dimension: int, count: int, scramble: int) -> Iterator[float]:
    """Yield the first points of a dimension, from 0, between 0 and 1, without both.

    :param scramble: a random number of 32 bits.
    """
    for point in points(dimension, count):
        yield (_reversed(_permuted(_reversed(point), scramble)) + 0.5) / 2**BITS


def points(dimension: int, count: int) -> Iterator[int]:
    """Yield the first points of a dimension in units of 2**-32, in the order of the Gray code, without a scramble."""
    directions = _directions(dimension)
    point = 0
    for index in range(1, count + 1):
        yield point
        # The Gray codes of neighbours differ in the lowest bit that is set in the index of the second.
        point ^= directions[(index & -index).bit_length() - 1]


@cache
def _directions(dimension: int) -> tuple[int, ...]:
    """Return the direction numbers of a dimension, in units of 2**-32."""
    if dimension == 0:
        return tuple(1 << (BITS - 1 - place) for place in range(BITS))
    polynomial, initial = _JOE_KUO[dimension - 1]
    degree = len(initial)
    found = [number << (BITS - 1 - place) for place, number in enumerate(initial)]
    for place in range(degree, BITS):
        direction = found[place - degree] ^ (found[place - degree] >> degree)
        for step in range(1, degree):
            if polynomial >> (degree - 1 - step) & 1:
                direction ^= found[place - step]
        found.append(direction)
    return tuple(found)


def _permuted(number: int, scramble: int) -> int:
    """Return a permutation of all numbers of 32 bits, in which each bit depends on the bits below it alone."""
    number = number + scramble & _MASK
    for multiplier in _MULTIPLIERS:
        number ^= number * multiplier & _MASK
    return number


def _reversed(number: int) -> int:
    return int(f"{number:0{BITS}b}"[::-1], 2)
