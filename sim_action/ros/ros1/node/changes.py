"""What nodes ask the world to become, by services: taken between two steps, while the node that asks waits."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from sim_action.core.errors import SourceOver
from sim_action.ros.ros1.node.population import Population

Alter = Callable[[Population], Population]
"""From a population to the next. Raises ValueError with what to tell whoever has asked."""

_PATIENCE: Final = 30.0


class BeginAnew(SourceOver):
    """The world has changed: what was simulated so far is over, and goes on from where everything is."""


@dataclass
class Change:
    """One request, until it is answered.

    Attributes:
        restarts: whether sim time begins anew.
        refused: why it was not done.
    """

    alter: Alter
    restarts: bool = False
    refused: str | None = None
    done: threading.Event = field(default_factory=threading.Event)


class Changes:
    """The requests of all services; a handler of one waits in a thread of its own."""

    def __init__(self) -> None:
        self._waiting = queue.SimpleQueue[Change]()

    def ask(self, alter: Alter, *, restarts: bool = False) -> str | None:
        """Waits until a change is made; returns why it was not, if it was not."""
        change = Change(alter, restarts)
        self._waiting.put(change)
        if not change.done.wait(_PATIENCE):
            return "the simulation does not answer"
        return change.refused

    def are_waiting(self) -> bool:
        """Whether there is a change to be made."""
        return not self._waiting.empty()

    def make(self, population: Population) -> tuple[Population, bool]:
        """The population after all changes that are asked for, and whether sim time begins anew."""
        restarts = False
        while not self._waiting.empty():
            change = self._waiting.get()
            try:
                population = change.alter(population)
                restarts = restarts or change.restarts
            except ValueError as error:
                change.refused = str(error)
            change.done.set()
        return population, restarts
