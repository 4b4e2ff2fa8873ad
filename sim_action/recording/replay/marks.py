"""Places in the world that an expectation is about, as a replay draws them: goal regions, paths, poses."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from sim_action.core.field_types import FrozenModel
from sim_action.recording.replay.columns import Index
from sim_action.recording.replay.shapes import Length, Number, Place


class _Mark(FrozenModel):
    """A mark; `expectation`: the number of the one that it belongs to, counted from 0; null: of none."""

    expectation: Index | None = None


class CircleMark(_Mark):
    """On the ground plane, or as high as `z`; in m."""

    kind: Literal["circle"]
    x: Number
    y: Number
    z: Number = 0.0
    radius: Length


class PolygonMark(_Mark):
    """A closed area on the ground plane; points x, y in m."""

    kind: Literal["polygon"]
    points: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3, max_length=10_000)]


class PolylineMark(_Mark):
    """A way; points x, y, z in m."""

    kind: Literal["polyline"]
    points: Annotated[tuple[Place, ...], Field(min_length=2, max_length=10_000)]


class ArrowMark(_Mark):
    """A heading at a place on the ground plane: m, and rad about the z axis."""

    kind: Literal["arrow"]
    x: Number
    y: Number
    yaw: Number


MarkData = Annotated[CircleMark | PolygonMark | PolylineMark | ArrowMark, Field(discriminator="kind")]
