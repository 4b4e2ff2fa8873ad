"""The change of the motion that nothing noticed, in words."""

from __future__ import annotations

import math

import pytest

from sim_action.runner.mutation.path_change import path_change
from sim_action.state.trace import Trace
from tests.runner.mutation.runs import straight
from tests.traces import trace

TIME = [0.0, 1.0, 2.0]


def moved(**columns: list[float]) -> Trace:
    return trace(TIME, **columns)  # type: ignore[arg-type] # columns only


AHEAD = moved(x=[0, 1, 2])


@pytest.mark.parametrize(
    ("mutant", "told"),
    [
        (moved(x=[0, 1, 2], y=[0, 0.8, 0.2]), "the robot was 0.80 m further left at 1.00 s"),
        (moved(x=[0, 1, 2], y=[0, -0.8, 0.2]), "the robot was 0.80 m further right at 1.00 s"),
        (moved(x=[0, 1.5, 2]), "the robot was 0.50 m further ahead at 1.00 s"),
        (moved(x=[0, 1, 1.5]), "the robot was 0.50 m behind at 2.00 s"),
        (moved(x=[0, 1, 2], z=[0, 0.3, 0]), "the robot was 0.30 m higher at 1.00 s"),
        (moved(x=[0, 0.92, 2], y=[0, 0.09, 0]), "the robot was 0.12 m further left at 1.00 s"),
        (moved(x=[0, 1, 2], yaw=[0, 0, 0.2]), "the robot was turned by 11.46 deg more at 2.00 s"),
    ],
)
def test_the_greatest_change_is_told(mutant: Trace, told: str) -> None:
    change = path_change(AHEAD, mutant)
    assert change is not None
    assert change.text == told


def test_directions_are_those_of_the_robot() -> None:
    north = moved(y=[0, 1, 2], yaw=[math.pi / 2] * 3)
    change = path_change(north, moved(y=[0, 1, 2], x=[0, 0, -0.4], yaw=[math.pi / 2] * 3))
    assert change is not None
    assert "0.40 m further left" in change.text


def test_small_changes_do_not_count() -> None:
    assert path_change(AHEAD, AHEAD) is None
    assert path_change(AHEAD, moved(x=[0, 1.09, 2], yaw=[0, 0.08, 0])) is None


def test_a_longer_run_counts_where_it_ends() -> None:
    change = path_change(AHEAD, trace([*TIME, 3.0], x=[0, 1, 2, 3]))
    assert change is not None
    assert change.text == "the robot was 1.00 m further ahead at the end"


def test_the_joints_of_a_robot_that_stays_count() -> None:
    still, bent = moved(position=[0, 0, 0]), moved(position=[0, 0.5, 0])
    change = path_change(still, bent)
    assert change is not None
    assert (change.joint, change.joint_change) == ("wheel_left_joint", 0.5)
    assert change.text == "joint 'wheel_left_joint' was 28.65 deg elsewhere at 1.00 s"
    slid = path_change(still, bent, ["wheel_left_joint"])
    assert slid is not None
    assert slid.text == "joint 'wheel_left_joint' was 0.5 m elsewhere at 1.00 s"
    assert path_change(still, moved(position=[0, 0.05, 0])) is None
    assert path_change(straight(), straight()) is None
