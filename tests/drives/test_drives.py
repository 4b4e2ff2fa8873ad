"""The table of drives, and the first that fits."""

from __future__ import annotations

from sim_action.core.geometry import Pose
from sim_action.drives import DRIVES, recognise
from sim_action.robot.model.robot_model import Joint, Link, RobotModel


def test_a_model_without_wheels_has_no_drive() -> None:
    links = (Link("base", 1.0), Link("tip", 1.0))
    joints = (Joint("elbow", "revolute", "base", "tip", Pose(), (0.0, 0.0, 1.0)),)
    assert recognise(RobotModel("arm", "", links, joints, "")) is None


def test_the_keys_of_the_table_are_those_of_the_classes() -> None:
    assert {name: DRIVES.load(name).key for name in DRIVES} == {name: name for name in DRIVES}
