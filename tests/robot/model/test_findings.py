"""Findings as the lines of a report."""

from __future__ import annotations

from sim_action.core.errors import Location
from sim_action.robot.model.findings import RULES, announced, finding, grouped_notes, unannounced


def test_notes_of_one_rule_and_file_are_one_line_that_names_the_others() -> None:
    places = [("a.urdf", line) for line in range(3, 23)] + [("b.urdf", 1), ("b.urdf", 9)]
    found = [finding("missing-inertia", f"link {line}", Location(file, line)) for file, line in places]
    found.insert(1, finding("locked-joint", "joint", Location("a.urdf", 4)))
    assert grouped_notes(found) == (
        "a.urdf:3: link 3 (and 19 more like this; lines 4, 5, 6, 7, 8, 9, 10, 11, ...) [missing-inertia]",
        "a.urdf:4: joint [locked-joint]",
        "b.urdf:1: link 1 (and 1 more like this; line 9) [missing-inertia]",
    )
    # Each kind of part that is not simulated is a line.
    kinds = list(enumerate(("<gravity>", "<sensor>", "<wind>"), 1))
    found = [finding("passed-over", f"{kind} is ignored", Location("a.sdf", line)) for line, kind in kinds]
    assert grouped_notes(found) == tuple(f"a.sdf:{line}: {kind} is ignored [passed-over]" for line, kind in kinds)


def test_every_report_shows_the_parts_that_are_not_simulated_and_each_finding_is_a_note_once() -> None:
    found = [finding(rule, f"a finding of {rule}", Location("a.sdf", 1)) for rule in RULES]
    shown, others = announced(found), unannounced(found)
    assert sorted((*shown, *others)) == sorted(grouped_notes(found))
    assert "a.sdf:1: a finding of passed-over [passed-over]" in shown
    # Links of sensors and tools often have no inertial.
    assert "a.sdf:1: a finding of missing-inertia [missing-inertia]" in others
