"""Pictures of a scene, by rays of our own: the same on every engine, which only tells where things are.

What the engines offer instead was measured. PyBullet's TinyRenderer draws a ball as a polyhedron whose depth is off by
centimetres, its rays take 60 ms for 160x120 pixels, and MuJoCo renders through a GL library that runners lack. Here a
solid is met where algebra says, only the pixels that it may cover are looked at, and no engine is disturbed.

Solids are in frames of their own; rays are given in such a frame by where they start and by directions whose length
along the view is 1, so that the parameter of a point on a ray is its depth.
"""

from __future__ import annotations

from typing import Final

Colour = tuple[float, float, float]
"""Red, green and blue, each 0 to 1."""

SKY: Final[Colour] = (0.62, 0.78, 0.94)
GROUND: Final[tuple[Colour, Colour]] = ((0.55, 0.55, 0.55), (0.47, 0.47, 0.47))
"""Of the squares of the ground, by turns: what has no pattern does not look as if it moved."""

ROBOT: Final[Colour] = (0.8, 0.8, 0.8)

PALETTE: Final[tuple[Colour, ...]] = (
    (0.2, 0.4, 0.9),
    (0.2, 0.7, 0.3),
    (0.9, 0.7, 0.1),
    (0.5, 0.3, 0.8),
    (0.2, 0.7, 0.7),
    (0.6, 0.5, 0.3),
)
"""Of bodies that state no colour, by turns. Nothing is red that was not meant to be."""
