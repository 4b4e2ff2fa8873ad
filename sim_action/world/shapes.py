"""The shapes that a body may have."""

from __future__ import annotations

from sim_action.quantities import FrozenModel, PositiveMetres


class Cylinder(FrozenModel):
    """An upright cylinder."""

    radius: PositiveMetres
    height: PositiveMetres


class Sphere(FrozenModel):
    """A ball."""

    radius: PositiveMetres
