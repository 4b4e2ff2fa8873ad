"""Contacts are read when somebody looks, or has not let go of them when the engine goes on."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.engines.observers import Glance
from sim_action.state.observation import Contact


class Engine:
    """Counts how often its contacts are read; a contact tells the moment at which it was."""

    def __init__(self) -> None:
        self.moment = 0.0
        self.read = 0

    def contacts(self) -> Iterator[Contact]:
        self.read += 1
        yield Contact(self.moment, "link", "wall", (0.0, 0.0, 0.0), 1.0)


def test_contacts_that_nobody_looks_at_are_not_read() -> None:
    engine, glance = Engine(), Glance()
    glance.at(engine.contacts)
    glance.settle()
    assert engine.read == 0


def test_contacts_are_read_once_however_often_they_are_looked_at() -> None:
    engine, glance = Engine(), Glance()
    found = glance.at(engine.contacts)
    assert [len(found), found[0].time, next(iter(found)).link] == [1, 0.0, "link"]
    glance.settle()
    assert engine.read == 1


def test_contacts_that_are_held_are_read_before_the_engine_goes_on() -> None:
    engine, glance = Engine(), Glance()
    held = glance.at(engine.contacts)
    glance.settle()
    engine.moment = 1.0
    assert [contact.time for contact in held] == [0.0]


def test_a_second_look_at_the_same_moment_leaves_the_first_what_it_is() -> None:
    engine, glance = Engine(), Glance()
    first, second = glance.at(engine.contacts), glance.at(engine.contacts)
    glance.settle()
    engine.moment = 1.0
    assert first == second
    assert first[0].time == 0.0
