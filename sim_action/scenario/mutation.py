"""The mutation of a run: an injected fault that shows which expectations notice it."""

from __future__ import annotations

from typing import Literal

from sim_action.core.records import dataclass

SensorFault = Literal["frozen", "stale", "biased", "drifting"]


@dataclass(frozen=True, slots=True)
class Mutation:
    """A fault of the system under test; the world, and what expectations measure, stay as they are.

    A run with a mutation goes on after an expectation has failed, so that each expectation is judged. Without a fault,
    that is its only effect.
    """

    silent: bool = False  # True if no command takes effect
    speed: float = 1.0  # factor of all commanded speeds, efforts and forces, and of the way of joints from their start
    # the part of commanded twists and wrenches that has the other sign; or empty
    reversed: Literal["", "linear", "angular"] = ""
    mirrored: bool = False  # True if left and right are swapped in commands
    crossed_wheels: bool = False  # True if left and right are swapped behind the drive
    dead_joint: str = ""  # name of a joint whose motor is off; or empty
    reversed_joint: str = ""  # name of a joint whose motor turns the other way; or empty
    sensor: str = ""  # name of a sensor that has the fault `reading`; or empty
    reading: SensorFault = "frozen"
    mass: float = 1.0  # factor of the masses of all links of the robot
    # True if the run goes on for a while after its goals are met, see `Verdict.extreme`; no fault
    looks_ahead: bool = False
