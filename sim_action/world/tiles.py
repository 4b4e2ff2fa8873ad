"""The ground in pieces: where patches have a friction of their own, it is cut around them.

A patch that lies on the ground would share the load with it, or be a step. Tiles that meet at z = 0 do neither
(measured: a box that slides from one to the next stops where v^2 / (2 mu g) says, at any speed).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from sim_action.core.geometry import Pose
from sim_action.world.ground import Ground, Patch
from sim_action.world.parts import BoxPart

REACH: Final = 10_000.0
"""m: how far the tiles go from the origin of the world, which is as far as a robot may go by default."""

_DEEP: Final = 10.0
# m: what is narrower between two patches is nothing.
_SLIVER: Final = 1e-6

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
    cuts = sorted({-REACH, REACH, *(edge for patch in patches for edge in patch.bounds[0])})
    begun: dict[Span, float] = {}
    end = -REACH
    for low, high in itertools.pairwise(cuts):
        if high - low < _SLIVER:
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
    return span[0] <= low + _SLIVER and span[1] >= high - _SLIVER


def _gaps(spans: Sequence[Span]) -> Iterator[Span]:
    """What spans that do not overlap leave of the whole reach."""
    at = -REACH
    for start, end in sorted(spans):
        if start - at > _SLIVER:
            yield at, start
        at = end
    if REACH - at > _SLIVER:
        yield at, REACH


def _box(across: Span, along: Span) -> BoxPart:
    (left, right), (low, high) = across, along
    return BoxPart((right - left, high - low, _DEEP), Pose(((left + right) / 2, (low + high) / 2, -_DEEP / 2)))
