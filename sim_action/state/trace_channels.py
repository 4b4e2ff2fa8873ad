"""What is computed of a run only if somebody asks for it: contacts, clearance, readings of sensors.

An assertion declares its channels; a run computes those of all its assertions together, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import reduce
from operator import or_
from typing import Self


@dataclass(frozen=True, slots=True)
class ClearanceWatch:
    """The least distance between any of these links and any of these bodies.

    Attributes:
        links: of the robot; None: all.
        bodies: of the world; None: all but the ground.
        within: m; what is farther away is not told.
        always: whether it is told at every step; else only at those where it is less than ever before.
    """

    links: tuple[str, ...] | None = None
    bodies: tuple[str, ...] | None = None
    within: float = math.inf
    always: bool = False


@dataclass(frozen=True, slots=True)
class Channels:
    """What is asked for; `|` joins two of them.

    Attributes:
        contacts: whether `Trace.contacts` are.
        clearances: which of `Trace.clearances` are.
        sensors: names of those that are read, and stand in `Trace.sensors` for monitors.
        bodies: names of those whose `Trace.bodies` are.
        openings: sim times in s from which somebody looks: "ever before" begins anew at each.
    """

    contacts: bool = False
    clearances: frozenset[ClearanceWatch] = frozenset()
    sensors: frozenset[str] = frozenset()
    bodies: frozenset[str] = frozenset()
    openings: frozenset[float] = frozenset()

    @classmethod
    def all_of(cls, several: Iterable[Self]) -> Self:
        """What any of them asks for."""
        return reduce(or_, several, cls())

    def __or__(self, other: Self) -> Self:
        return replace(
            self,
            contacts=self.contacts or other.contacts,
            clearances=self.clearances | other.clearances,
            sensors=self.sensors | other.sensors,
            bodies=self.bodies | other.bodies,
            openings=self.openings | other.openings,
        )

    def opening_at(self, time: float) -> Self:
        """The same, looked at from a sim time on."""
        return replace(self, openings=self.openings | {time})
