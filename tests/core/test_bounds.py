"""Bounds of keys in words."""

from __future__ import annotations

import math
from typing import Annotated

import pytest
from pydantic import Field

from sim_action.core.bounds import bound_text, bounds_text, unit_of
from sim_action.core.quantities import (
    FrozenModel,
    JointPosition,
    Metres,
    PositiveHertz,
    PositiveMetres,
    PositiveRadians,
    PositiveSeconds,
    Ratio,
)


class Spec(FrozenModel):
    plain: float
    positive: PositiveMetres
    pixels: Annotated[int, Field(ge=1, le=1920)]
    angle: Annotated[PositiveRadians, Field(le=math.radians(170))]
    optional: Annotated[PositiveRadians | None, Field(lt=math.pi / 2)] = None
    nested: Annotated[PositiveSeconds, Field(le=86_400)] | None = None
    rate: Annotated[PositiveHertz, Field(ge=1, le=100_000)]
    far: Annotated[Metres, Field(ge=-1e6, le=1e6)]
    near: Annotated[Metres, Field(ge=0.001)]
    error: Annotated[Ratio, Field(gt=-1)]
    many: tuple[PositiveMetres, ...]
    joint: JointPosition
    shares: Annotated[tuple[Ratio, ...], Field(min_length=2)]


@pytest.mark.parametrize(
    ("name", "bounds", "unit"),
    [
        ("plain", "", ""),
        ("positive", "", "m"),
        ("pixels", "1 to 1920", ""),
        ("angle", "at most 170 deg", "rad"),
        ("optional", "less than 90 deg", "rad"),
        ("nested", "at most 86,400 s", "s"),
        ("rate", "1 to 100,000 Hz", "Hz"),
        ("far", "-1,000,000 to 1,000,000 m", "m"),
        ("near", "at least 0.001 m", "m"),
        ("error", "more than -1", ""),
        ("many", "", "m"),
        ("joint", "", ""),
        ("shares", "", ""),
    ],
)
def test_bounds_of_a_key(name: str, bounds: str, unit: str) -> None:
    field = Spec.model_fields[name]
    assert bounds_text(field.annotation, field.metadata) == bounds
    assert unit_of(field.annotation, field.metadata) == unit


def test_a_bound_has_all_its_digits() -> None:
    assert bound_text(1_000_000_000, "") == "1,000,000,000"
    assert bound_text(2**63 - 1, "") == "9,223,372,036,854,775,807"
    assert bound_text(0.0, "m") == "0"
    assert [bound_text(size, "B") for size in (512 * 2**20, 2**40, 1000)] == ["512 MiB", "1024 GiB", "1000 B"]
    assert bound_text(math.pi, "rad/s") == "180 deg/s"
