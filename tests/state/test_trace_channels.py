"""What is asked for, and what several ask for together."""

from __future__ import annotations

import pickle

from sim_action.state.trace_channels import Channels, ClearanceWatch

WALL = ClearanceWatch(bodies=("wall",))
ALL = Channels(
    contacts=True,
    clearances=frozenset({WALL, ClearanceWatch()}),
    sensors=frozenset({"scan", "imu"}),
    bodies=frozenset({"ball"}),
    objects=frozenset({"crate", "ball"}),
    link_contacts=frozenset({"foot", "hand"}),
    openings=frozenset({0.0, 2.0}),
)


def test_nothing_is_asked_for_by_nobody() -> None:
    assert Channels.all_of([]) == Channels()
    assert not Channels().contacts


def test_what_any_of_them_asks_for_is_asked_for() -> None:
    several = [
        Channels(contacts=True).opening_at(2.0),
        Channels(clearances=frozenset({WALL}), sensors=frozenset({"scan"}), objects=frozenset({"crate"})),
        Channels(bodies=frozenset({"ball"}), objects=frozenset({"ball"}), link_contacts=frozenset({"foot"})),
        Channels(link_contacts=frozenset({"hand"})),
        Channels(clearances=frozenset({ClearanceWatch(), WALL}), sensors=frozenset({"imu"})).opening_at(0.0),
    ]
    assert Channels.all_of(several) == Channels.all_of(reversed(several)) == ALL


def test_it_crosses_into_the_process_of_a_scenario() -> None:
    assert pickle.loads(pickle.dumps(ALL)) == ALL
