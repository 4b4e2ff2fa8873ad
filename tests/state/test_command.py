"""Commands: joint targets that add up, and what a motor cannot be given."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sim_action.core.geometry import Twist
from sim_action.state.command import BasePush, Command, JointTargets, LinkWrench, is_finite
from sim_action.state.joint_motion import JointMotion


def test_the_names_of_targets_are_those_of_all_groups() -> None:
    targets = JointTargets(position={"a": 1}, velocity={"b": 2}, effort={"c": 3}, max_effort={"d": 4})
    assert list(targets.names()) == ["a", "b", "c"]
    # A joint with a position and its speed is named once, and replaced as one.
    moving = JointTargets(position={"a": 1}, velocity={"a": 2, "b": 3})
    assert list(moving.names()) == ["a", "b"]
    assert moving.updated_by(JointTargets(position={"a": 4})) == JointTargets(position={"a": 4}, velocity={"b": 3})


def test_a_later_target_replaces_an_earlier_one_of_any_group() -> None:
    earlier = JointTargets(position={"a": 1}, velocity={"b": 2}, max_effort={"a": 5, "b": 6})
    later = JointTargets(effort={"a": 3}, max_effort={"c": 7})
    assert earlier.updated_by(later) == JointTargets(velocity={"b": 2}, effort={"a": 3}, max_effort={"b": 6, "c": 7})


def test_joints_that_are_not_named_keep_their_target() -> None:
    earlier = JointTargets(position={"a": 1})
    assert earlier.updated_by(JointTargets()) == earlier
    assert JointTargets().updated_by(earlier) == earlier
    # Updating leaves both as they were.
    later = JointTargets(position={"a": 2})
    assert earlier.updated_by(later).position == {"a": 2}
    assert (earlier.position, later.position) == ({"a": 1}, {"a": 2})


def test_a_push_of_the_base_stays_until_another() -> None:
    one, other = (BasePush((speed, 0.0), 0.0, (0.0, 0.0, 0.0), 1.0, 1.0) for speed in (1.0, 2.0))
    pushed = JointTargets(base=one)
    assert pushed.updated_by(JointTargets(effort={"a": 3})) == JointTargets(effort={"a": 3}, base=one)
    assert pushed.updated_by(JointTargets(base=other)).base == other
    assert JointTargets(effort={"a": 3}).updated_by(pushed).base == one


def test_wrenches_stay_until_others_replace_all_of_them() -> None:
    one, other = (LinkWrench(name, (1.0, 0.0, 0.0)) for name in ("a", "b"))
    pressed = JointTargets(wrenches=(one,))
    assert pressed.updated_by(JointTargets(effort={"a": 3})) == JointTargets(effort={"a": 3}, wrenches=(one,))
    assert pressed.updated_by(JointTargets(wrenches=(other,))).wrenches == (other,)
    assert pressed.updated_by(JointTargets(wrenches=())).wrenches == ()
    assert JointTargets(effort={"a": 3}).updated_by(pressed).wrenches == (one,)


@pytest.mark.parametrize(
    ("command", "finite"),
    [
        (Twist.planar(1, 2), True),
        (Twist.planar(math.nan), False),
        (Twist((0, 0, 0), (0, math.inf, 0)), False),
        (JointTargets(), True),
        (LinkWrench("a", (1.0, 0.0, 0.0)), True),
        (LinkWrench("a", (math.nan, 0.0, 0.0)), False),
        (LinkWrench("a", torque_xyz=(0.0, math.inf, 0.0)), False),
        (LinkWrench("a", point_xyz=(0.0, 0.0, math.nan)), False),
        (JointTargets(position={"a": 1.0}), True),
        (JointTargets(effort={"a": math.nan}), False),
        (JointTargets(position={"a": 1.0}, max_effort={"a": math.inf}), False),
    ],
)
def test_a_command_is_finite_if_all_its_numbers_are(command: Command, finite: bool) -> None:
    assert is_finite(command) is finite


@pytest.mark.parametrize("wrong", [True, np.bool_(False), "0.5", None])
def test_a_truth_value_and_a_text_are_no_numbers(wrong: Any) -> None:
    for command in (Twist((0.0, wrong, 0.0)), LinkWrench("a", (wrong, 0, 0)), JointTargets(effort={"a": wrong})):
        with pytest.raises(TypeError):
            is_finite(command)
    with pytest.raises(TypeError):
        Twist.planar(lateral=wrong)
    for times, positions in (((0, wrong), (1, 2)), ((0, 1), (1, wrong))):
        with pytest.raises(TypeError):
            JointMotion.through(["a"], times, [[position] for position in positions])


def test_numbers_of_numpy_are_numbers() -> None:
    half: Any = np.float32(0.5)
    assert is_finite(Twist((half, half, 0)))
    assert Twist.planar(half) == Twist.planar(0.5)
    curve = JointMotion.through(["a"], np.array([0, 1]), [[half], [1]]).curves[0]
    assert curve.at(1.0)[0] == 1.0
