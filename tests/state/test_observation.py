"""Contacts of the present are a sequence like any other."""

from __future__ import annotations

import copy
import pickle

import pytest

from sim_action.state.observation import ByName, Contact, PresentContacts

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
    # None of them is false.
    assert not PresentContacts(tuple)
    # A copy has what they were.
    present = PresentContacts(lambda: iter(TOUCHES))
    for copied in (copy.copy(present), copy.deepcopy(present), pickle.loads(pickle.dumps(present))):
        assert type(copied) is tuple
        assert copied == TOUCHES


def test_a_name_that_there_is_not_is_told_with_those_that_there_are() -> None:
    found = ByName({"lidar": 1, "imu": 2})
    assert (found["imu"], found.get("scan"), "scan" in found, dict(found)) == (2, None, False, {"lidar": 1, "imu": 2})
    with pytest.raises(KeyError, match=r"there is no 'lidr'; did you mean 'lidar'\? \(allowed: imu, lidar\)"):
        found["lidr"]
    with pytest.raises(KeyError, match=r"there is no 'scan' \(allowed: none\)"):
        ByName[int]()["scan"]
    assert pickle.loads(pickle.dumps(found)) == found
