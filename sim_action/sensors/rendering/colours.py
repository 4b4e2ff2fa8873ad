"""The colours of what states none; apart from what draws them, as a replay names colours and draws nothing."""

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
