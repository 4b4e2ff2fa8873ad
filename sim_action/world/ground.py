"""What everything stands on."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field

from sim_action.core.field_types import FrozenModel, Metres, NonNegativeRatio
from sim_action.core.geometry import Pose
from sim_action.world.parts import BoxPart

GROUND: Final = "ground"

Friction = Annotated[NonNegativeRatio, Field(le=100)]

Side = Annotated[Metres, Field(ge=0.01, le=1000)]


class Ground(FrozenModel):
    """The plane z = 0."""

    friction: Annotated[Friction, Field(description="multiplies with the friction of what touches it")] = 1.0


class Patch(FrozenModel):
    """An area of the ground with a friction of its own.

    It is level with the ground, which is cut around it: there is no step, and no place where both hold. To contacts it
    is the ground. Patches may touch and must not lie on each other; at most 50. The ground then ends at 10 km.
    """

    x: Annotated[Metres, Field(ge=-1000, le=1000, description="of its middle")] = 0.0
    y: Annotated[Metres, Field(ge=-1000, le=1000, description="of its middle")] = 0.0
    size: Annotated[tuple[Side, Side], Field(description="x and y")]
    friction: Annotated[Friction, Field(description="as of the ground, in its place")]

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """From where to where in x, and in y, in m."""
        (width, depth) = self.size
        return (self.x - width / 2, self.x + width / 2), (self.y - depth / 2, self.y + depth / 2)


GROUND_REACH_M: Final = 10_000.0
"""m: how far the tiles go from the origin of the world, which is as far as a robot may go by default."""

_TILE_DEPTH_M: Final = 10.0
# m: what is narrower between two patches is nothing.
_MIN_WIDTH_M: Final = 1e-6

Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Tile:
    """A piece of the ground, its upper side at z = 0."""

    part: BoxPart
    friction: float


def ground_tiles(ground: Ground, patches: Sequence[Patch]) -> tuple[Tile, ...]:
    """The patches, and what is left of the ground between and around them; nothing, if there are no patches."""
    if not patches:
        return ()
    around = [Tile(_box(across, along), ground.friction) for across, along in _rest(patches)]
    return (*(Tile(_box(*patch.bounds), patch.friction) for patch in patches), *around)


def _rest(patches: Sequence[Patch]) -> Iterator[tuple[Span, Span]]:
    """In strips from edge to edge along x, each cut where patches are; strips that are cut alike are one."""
    cuts = sorted({-GROUND_REACH_M, GROUND_REACH_M, *(edge for patch in patches for edge in patch.bounds[0])})
    begun: dict[Span, float] = {}
    end = -GROUND_REACH_M
    for low, high in itertools.pairwise(cuts):
        if high - low < _MIN_WIDTH_M:
            continue
        gaps = set(_gaps([patch.bounds[1] for patch in patches if _covers(patch.bounds[0], low, high)]))
        for gap in [gap for gap in begun if gap not in gaps]:
            yield (begun.pop(gap), low), gap
        for gap in sorted(gaps):
            begun.setdefault(gap, low)
        end = high
    for gap, start in begun.items():
        yield (start, end), gap


def _covers(span: Span, low: float, high: float) -> bool:
    return span[0] <= low + _MIN_WIDTH_M and span[1] >= high - _MIN_WIDTH_M


def _gaps(spans: Sequence[Span]) -> Iterator[Span]:
    """What spans that do not overlap leave of the whole reach."""
    at = -GROUND_REACH_M
    for start, end in sorted(spans):
        if start - at > _MIN_WIDTH_M:
            yield at, start
        at = end
    if GROUND_REACH_M - at > _MIN_WIDTH_M:
        yield at, GROUND_REACH_M


def _box(across: Span, along: Span) -> BoxPart:
    (left, right), (low, high) = across, along
    return BoxPart(
        (right - left, high - low, _TILE_DEPTH_M), Pose(((left + right) / 2, (low + high) / 2, -_TILE_DEPTH_M / 2))
    )
