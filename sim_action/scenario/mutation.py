"""The mutation of a run: an injected fault that shows which expectations notice it."""

from __future__ import annotations

from sim_action.core.records import dataclass


@dataclass(frozen=True, slots=True)
class Mutation:
    """A fault of the system under test; the world, and what expectations measure, stay as they are.

    A run with a mutation goes on after an expectation has failed, so that each expectation is judged. Without a fault,
    that is its only effect.

    Attributes:
        silent: True if no command takes effect.
        speed: factor of all commanded speeds, efforts and forces, and of the way of joints from their start.
        mirrored: True if left and right are swapped in commands.
        dead_joint: name of a joint whose motor is off; or empty.
        frozen_sensor: name of a sensor that repeats its first reading; or empty.
        mass: factor of the masses of all links of the robot.
    """

    silent: bool = False
    speed: float = 1.0
    mirrored: bool = False
    dead_joint: str = ""
    frozen_sensor: str = ""
    mass: float = 1.0
