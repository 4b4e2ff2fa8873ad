"""Changes that threads ask for, and that the loop makes."""

from __future__ import annotations

import threading
from dataclasses import replace

from sim_action.core.geometry import Pose
from sim_action.ros.ros1.node.changes import Alter, Changes
from sim_action.ros.ros1.node.population import Population, SpawnedRobot
from sim_action.world import World

EMPTY = Population(World())


def spawned(name: str) -> SpawnedRobot:
    return SpawnedRobot(name, "<robot/>", Pose())


def refusing(_: Population) -> Population:
    raise ValueError("not here")


class Asking(threading.Thread):
    """A service's thread, which waits for its answer."""

    def __init__(self, changes: Changes, alter: Alter, *, restarts: bool = False) -> None:
        super().__init__()
        self._asked = changes, alter, restarts
        self.answer: str | None = "none yet"
        self.start()

    def run(self) -> None:
        changes, alter, restarts = self._asked
        self.answer = changes.ask(alter, restarts=restarts)


def wait_for(changes: Changes) -> None:
    while not changes.are_waiting():
        threading.Event().wait(0.001)


def test_who_asks_waits_until_the_change_is_made() -> None:
    changes = Changes()
    assert not changes.are_waiting()
    asking = Asking(changes, lambda population: replace(population, robot=spawned("rover")))
    wait_for(changes)
    assert asking.is_alive()

    population, restarts = changes.make(EMPTY)
    asking.join()

    assert population.names == ("ground_plane", "rover")
    assert (asking.answer, restarts, changes.are_waiting()) == (None, False, False)


def test_what_is_refused_changes_nothing_and_the_rest_is_made() -> None:
    changes = Changes()
    first = Asking(changes, refusing, restarts=True)
    wait_for(changes)
    population, restarts = changes.make(EMPTY)
    first.join()

    assert (population, restarts, first.answer) == (EMPTY, False, "not here")


def test_sim_time_begins_anew_if_a_change_says_so() -> None:
    changes = Changes()
    asking = Asking(changes, Population.at_home, restarts=True)
    wait_for(changes)

    assert changes.make(EMPTY)[1]
    asking.join()
