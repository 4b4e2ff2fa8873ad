"""Which of a joint's numbers is used_columns."""

from __future__ import annotations

import pytest

from sim_action.commands.logs import JointColumn, Kind, row_targets, used_columns
from sim_action.state.command import JointTargets


@pytest.mark.parametrize(
    ("kinds", "place"),
    [
        (("position", "velocity", "effort"), 0),
        (("effort", "velocity", "position"), 2),
        (("effort", "velocity"), 1),
        (("effort",), 0),
    ],
)
def test_a_position_counts_before_a_velocity_and_that_before_an_effort(kinds: tuple[Kind, ...], place: int) -> None:
    assert list(used_columns(JointColumn(kind, "elbow") for kind in kinds)) == [place]


def test_each_joint_follows_what_it_has_in_the_order_of_the_file() -> None:
    columns = [JointColumn("velocity", "wheel"), JointColumn("effort", "elbow"), JointColumn("position", "elbow")]
    assert list(used_columns(columns)) == [0, 2]


def test_targets_are_grouped_by_what_they_are() -> None:
    row = [(JointColumn("velocity", "wheel"), 2.0), (JointColumn("position", "elbow"), -1.0)]
    assert row_targets([*row, (JointColumn("effort", "hand"), 3.0)]) == JointTargets(
        position={"elbow": -1.0}, velocity={"wheel": 2.0}, effort={"hand": 3.0}
    )
