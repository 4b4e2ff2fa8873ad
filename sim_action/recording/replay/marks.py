"""The marks of a replay: places in the world or on a link that an expectation is about."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sim_action.core.field_types import FrozenModel
from sim_action.recording.replay.columns import Index
from sim_action.recording.replay.shapes import Length, Number, Place

Angle = Annotated[float, Field(ge=0, le=4)]
"""A difference between two headings in rad."""


class _Mark(FrozenModel):
    """A place that an expectation is about; `expectation` is its number, counted from 0, or null.

    Coordinates are in the world frame, or in that of `link`, with which the mark moves.
    """

    expectation: Index | None = None
    link: Index | None = None


class CircleMark(_Mark):
    """A circle at height `z`, in m."""

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
    """A path; points x, y, z in m.

    Attributes:
        tolerance: the distance from it that is allowed, in m.
        is_aside: True if a view need not show all of it.
    """

    kind: Literal["polyline"]
    points: Annotated[tuple[Place, ...], Field(min_length=2, max_length=10_000)]
    tolerance: Length = 0.0
    is_aside: bool = False


class ArrowMark(_Mark):
    """A position and heading on the ground plane, in m and rad about the z axis; `tolerance` in rad to both sides."""

    kind: Literal["arrow"]
    x: Number
    y: Number
    yaw: Number
    tolerance: Angle = 0.0


MarkData = Annotated[CircleMark | PolygonMark | PolylineMark | ArrowMark, Field(discriminator="kind")]

MAX_MARKS: Final = 500
