"""Findings as the lines of a report."""

from __future__ import annotations

from sim_action.core.errors import Location
from sim_action.robot.audit.rules import finding, grouped_notes


def test_notes_of_one_rule_and_file_are_one_line_that_names_the_others() -> None:
    places = [("a.urdf", line) for line in range(3, 23)] + [("b.urdf", 1), ("b.urdf", 9)]
    found = [finding("missing-inertia", f"link {line}", Location(file, line)) for file, line in places]
    found.insert(1, finding("locked-joint", "joint", Location("a.urdf", 4)))
    assert grouped_notes(found) == (
        "a.urdf:3: link 3 (and 19 more like this; lines 4, 5, 6, 7, 8, 9, 10, 11, ...) [missing-inertia]",
        "a.urdf:4: joint [locked-joint]",
        "b.urdf:1: link 1 (and 1 more like this; line 9) [missing-inertia]",
    )
