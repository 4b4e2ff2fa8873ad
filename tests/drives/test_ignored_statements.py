"""Statements of a model that its drive does not use."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.core.errors import Location
from sim_action.drives import recognise
from sim_action.drives.ignored_statements import ignored_statements
from sim_action.robot.model.robot_model import CommandedJoint, Plugin, RobotModel
from tests.drives.carts import FOUR, cart
from tests.drives.test_plugins import DIFF_CONTROLLER, PLACE, SIDES, TWO

DIFF = Plugin("gz-sim-diff-drive-system", (("left_joint", "a"), ("right_joint", "b")), "", PLACE)


def notes(model: RobotModel) -> list[str]:
    drive = recognise(model)
    assert drive is not None
    return list(ignored_statements(model, drive.source(model), drive.open(model, 100).joints))


@pytest.mark.parametrize(
    ("name", "parameters", "ignored"),
    [
        (DIFF.name, (("max_linear_velocity", "0.2"),), "max_linear_velocity 0.2"),
        (
            DIFF.name,
            (("max_velocity", "0.2"), ("max_angular_velocity", "1")),
            "max_velocity 0.2, max_angular_velocity 1",
        ),
        (DIFF.name, (("max_velocity", "0"), ("max_acceleration", "1")), None),
        (DIFF_CONTROLLER, (("linear.x.max_velocity", "0.2"),), "linear.x.max_velocity 0.2"),
        (DIFF_CONTROLLER, (("linear.x.max_velocity", ".nan"),), None),
        (DIFF_CONTROLLER, (("linear.x.max_velocity", "1"), ("linear.x.has_velocity_limits", "False")), None),
    ],
)
def test_speed_limits_are_named(name: str, parameters: tuple[tuple[str, str], ...], ignored: str | None) -> None:
    sides = SIDES if name == DIFF_CONTROLLER else DIFF.parameters
    found = notes(dataclasses.replace(TWO, plugins=(Plugin(name, (*sides, *parameters), "base", PLACE),)))
    assert [note.split(" of ")[0] for note in found] == ([] if ignored is None else [ignored])


def test_other_plugins_and_unread_files_are_named() -> None:
    second = dataclasses.replace(DIFF, location=Location("control.yaml", 9))
    control = Plugin("gz_ros2_control-system", (), "", PLACE, ("'nope.yaml' does not exist",))
    found = notes(dataclasses.replace(TWO, plugins=(DIFF, second, control)))
    assert [note.split(", ")[0] for note in found] == [
        "plugin gz-sim-diff-drive-system at control.yaml:9 is ignored",
        "the controllers of plugin gz_ros2_control-system at control.yaml:3 are not known: 'nope.yaml' does not exist",
    ]


def test_wheels_with_motors_that_the_drive_does_not_turn_are_named() -> None:
    commanded = tuple(CommandedJoint(name, frozenset({"velocity"}), "transmission", PLACE) for name in "abcd")
    sides = (("left_joint", "a"), ("right_joint", "c"))
    model = dataclasses.replace(cart(*FOUR), plugins=(Plugin(DIFF.name, sides, "", PLACE),), commanded=commanded)
    assert [note.split(",")[0] for note in notes(model)] == ["the model states motors of 'b'"]
