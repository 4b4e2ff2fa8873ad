"""Contacts of the present are a sequence like any other."""

from __future__ import annotations

import copy
import pickle

from sim_action.observation import Contact, PresentContacts

TOUCHES = tuple(Contact(0.1, "link", body, (0.0, 0.0, 0.0), 1.0) for body in ("ground", "wall"))


def test_they_are_a_sequence() -> None:
    present = PresentContacts(lambda: iter(TOUCHES))
    assert present == TOUCHES
    assert present == PresentContacts(lambda: TOUCHES)
    assert present != TOUCHES[:1]
    assert (len(present), present[1], present[:1], TOUCHES[0] in present) == (2, TOUCHES[1], TOUCHES[:1], True)
    assert [*reversed(present)] == [*reversed(TOUCHES)]
    assert repr(present) == repr(TOUCHES)
    assert hash(present) == hash(TOUCHES)


def test_none_of_them_is_false() -> None:
    assert not PresentContacts(tuple)


def test_a_copy_has_what_they_were() -> None:
    present = PresentContacts(lambda: iter(TOUCHES))
    for copied in (copy.copy(present), copy.deepcopy(present), pickle.loads(pickle.dumps(present))):
        assert type(copied) is tuple
        assert copied == TOUCHES
