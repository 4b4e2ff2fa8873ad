"""What is simulated: the robot, the ground, the objects, the physics rate. No engine in sight.

The fields are the keys of a scenario file; the docstrings and descriptions are what `sim-action schema` prints.
"""

from __future__ import annotations

from typing import Final

from sim_action.quantities import FrozenModel
from sim_action.world.body import Body
from sim_action.world.ground import GROUND, Ground
from sim_action.world.physics import FASTEST, Physics
from sim_action.world.placement import Placement
from sim_action.world.robot import Robot
from sim_action.world.shapes import Cylinder, Sphere

__all__ = [
    "FASTEST",
    "GRAVITY",
    "GROUND",
    "Body",
    "Cylinder",
    "Ground",
    "Physics",
    "Placement",
    "Robot",
    "Sphere",
    "World",
]

GRAVITY: Final = 9.80665
"""m/s^2, standard gravity (CGPM 1901)."""


class World(FrozenModel):
    """What surrounds the robot."""

    ground: Ground = Ground()
    objects: tuple[Body, ...] = ()
