"""Contacts are read when somebody looks, or has not let go of them when the engine goes on."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.engines.observers import LazyContacts
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
    engine, lazy = Engine(), LazyContacts()
    lazy.present(engine.contacts)
    lazy.settle()
    assert engine.read == 0


def test_contacts_are_read_once_however_often_they_are_looked_at() -> None:
    engine, lazy = Engine(), LazyContacts()
    found = lazy.present(engine.contacts)
    assert [len(found), found[0].time, next(iter(found)).link] == [1, 0.0, "link"]
    lazy.settle()
    assert engine.read == 1


def test_contacts_that_are_held_are_read_before_the_engine_goes_on() -> None:
    engine, lazy = Engine(), LazyContacts()
    held = lazy.present(engine.contacts)
    lazy.settle()
    engine.moment = 1.0
    assert [contact.time for contact in held] == [0.0]


def test_a_second_look_at_the_same_moment_leaves_the_first_what_it_is() -> None:
    engine, lazy = Engine(), LazyContacts()
    first, second = lazy.present(engine.contacts), lazy.present(engine.contacts)
    lazy.settle()
    engine.moment = 1.0
    assert first == second
    assert first[0].time == 0.0
