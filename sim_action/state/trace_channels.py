"""The channels of a trace that are computed on request only: contacts, clearances, sensor readings, bodies, objects.

An assertion declares its channels. A run computes the channels of all its assertions, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import fields
from functools import reduce
from operator import or_
from typing import Self

from sim_action.core.records import dataclass, replace


@dataclass(frozen=True, slots=True)
class ClearanceWatch:
    """A request for the smallest distance between some links of the robot and some bodies."""

    links: tuple[str, ...] | None = None
    bodies: tuple[str, ...] | None = None  # bodies of the world; None: all except the ground
    within: float = math.inf  # the largest reported distance in m
    always: bool = False  # True to report every step; else only steps with a new minimum


@dataclass(frozen=True, slots=True)
class Channels:
    """The requested channels; `|` joins two requests."""

    contacts: bool = False
    clearances: frozenset[ClearanceWatch] = frozenset()
    sensors: frozenset[str] = frozenset()
    bodies: frozenset[str] = frozenset()  # the names of bodies that are needed in `Trace.bodies`, 30 poses per second
    # the names of bodies that are needed in `Trace.objects`, a pose at every step
    objects: frozenset[str] = frozenset()
    # the names or patterns of links whose contacts are needed in `Trace.link_contacts`
    link_contacts: frozenset[str] = frozenset()
    # sim times in s at which an observation begins, and the minimum of a clearance is reset
    openings: frozenset[float] = frozenset()
    self_contacts: bool = False
    ground: bool = False  # True if `Trace.contacts` must have those with the ground, too

    @classmethod
    def all_of(cls, several: Iterable[Self]) -> Self:
        """Return the union of several requests."""
        return reduce(or_, several, cls())

    def __or__(self, other: Self) -> Self:
        joined = {one.name: getattr(self, one.name) | getattr(other, one.name) for one in fields(self)}
        return type(self)(**joined)

    def opening_at(self, time: float) -> Self:
        """Return the same request, observed from a sim time on."""
        return replace(self, openings=self.openings | {time})
