"""A ray caster for camera pictures that gives the same picture on every engine; also the default colours.

The renderers of the engines were measured and rejected. PyBullet's TinyRenderer draws a ball as a polyhedron whose
depth is off by centimetres; its rays take 60 ms for 160x120 pixels.
MuJoCo needs a GL library that CI runners lack. Here rays
are intersected with exact solids, and only in the pixels that a solid may cover.

Each solid has a frame of its own. Rays are given in that frame by their start and by directions whose component along
the view is 1, so that the parameter of a point on a ray is its depth.
"""

from __future__ import annotations

from typing import Final

Colour = tuple[float, float, float]  # red, green and blue, each 0 to 1
SKY: Final[Colour] = (0.62, 0.78, 0.94)
GROUND: Final[tuple[Colour, Colour]] = ((0.55, 0.55, 0.55), (0.47, 0.47, 0.47))
"""The alternating colours of the ground's squares; without a pattern motion would not be visible."""

ROBOT: Final[Colour] = (0.8, 0.8, 0.8)
ACTOR: Final[Colour] = (0.55, 0.65, 0.8)

PALETTE: Final[tuple[Colour, ...]] = (
    (0.2, 0.4, 0.9),
    (0.2, 0.7, 0.3),
    (0.9, 0.7, 0.1),
    (0.5, 0.3, 0.8),
    (0.2, 0.7, 0.7),
    (0.6, 0.5, 0.3),
)
"""The colours of bodies without a `color`, in turn. None of them is red."""
