"""The ground: the plane z = 0, patches with their own friction, and the tiles that replace the plane.

A patch on top of the ground would share its load or form a step. The ground is therefore cut around patches. Measured:
a box that slides from one tile to the next stops where v^2 / (2 mu g) predicts, at any speed.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Annotated, Final

from pydantic import Field

from sim_action.core.field_types import FrozenModel, Metres, Name, NonNegativeRatio, PositiveSeconds
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass
from sim_action.world.parts import BoxPart

GROUND: Final = "ground"
Friction = Annotated[NonNegativeRatio, Field(le=100)]
Side = Annotated[Metres, Field(ge=0.01, le=1000)]


class Ground(FrozenModel):
    """The plane z = 0."""

    friction: Annotated[Friction, Field(description="multiplied with the friction of whatever touches it")] = 1.0


class Patch(FrozenModel):
    """An area of the ground with its own friction.

    It is level with the ground, which is cut around it, so there is no step. Contacts with a patch are contacts with
    the ground. Patches may touch but must not overlap; at most 50 are allowed. With patches, the ground ends at 10 km.
    """

    name: Annotated[Name | None, Field(description="for events")] = None
    x: Annotated[Metres, Field(ge=-1000, le=1000, description="centre of the patch")] = 0.0
    y: Annotated[Metres, Field(ge=-1000, le=1000, description="centre of the patch")] = 0.0
    size: Annotated[tuple[Side, Side], Field(description="size in x and y")]
    friction: Annotated[Friction, Field(description="friction in place of the ground's")]
    appears: Annotated[
        PositiveSeconds | None, Field(description="sim time from which on it has its own friction; default: always")
    ] = None

    @property
    def words(self) -> str:
        """The patch in words."""
        return f"the patch at ({self.x:g}, {self.y:g}) m with a friction of {self.friction:g}"

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The lower and upper bounds in x and in y, in m."""
        (width, depth) = self.size
        return (self.x - width / 2, self.x + width / 2), (self.y - depth / 2, self.y + depth / 2)


GROUND_REACH_M: Final = 10_000.0
"""The extent in m of the tiles from the origin of the world; a robot may not go farther by default."""

_TILE_DEPTH_M: Final = 10.0
_MIN_WIDTH_M: Final = 1e-6  # narrower gaps in m between patches are ignored
Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Tile:
    """A piece of the ground with its upper side at z = 0."""

    part: BoxPart
    friction: float


def ground_tiles(ground: Ground, patches: Sequence[Patch]) -> tuple[Tile, ...]:
    """Return the patches at the start, in order, and the remaining ground around them; empty without patches."""
    if not patches:
        return ()
    around = [Tile(_box(across, along), ground.friction) for across, along in _rest(patches)]
    frictions = (patch.friction if patch.appears is None else ground.friction for patch in patches)
    areas = (_box(*patch.bounds) for patch in patches)
    return (*(Tile(area, friction) for area, friction in zip(areas, frictions, strict=True)), *around)


def _rest(patches: Sequence[Patch]) -> Iterator[tuple[Span, Span]]:
    """Yield the remaining ground as strips along x, cut at patches; equal neighbouring strips are merged."""
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
    """Yield the gaps between spans that do not overlap."""
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
