"""Which joints of a robot an assertion is of."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.core.wording import FirstFew
from sim_action.robot.model.joint_selection import choice_problems, chosen, name_problem, reading_of, unit_problem
from sim_action.robot.model.robot_model import Reading
from tests.traces import WHEELS, burger, trace

LEFT, RIGHT = WHEELS


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        ((), WHEELS),
        (("*",), WHEELS),
        ((RIGHT, LEFT), WHEELS),
        (("*_right_*",), (RIGHT,)),
        ((LEFT, "*_left_joint"), (LEFT,)),
        (("scan_joint",), ()),
    ],
)
def test_names_and_patterns_mean_moving_joints_once(names: tuple[str, ...], joints: tuple[str, ...]) -> None:
    assert tuple(joint.name for joint in chosen(burger(), names)) == joints


def test_a_name_is_a_name_though_it_looks_like_a_pattern() -> None:
    model = burger()
    odd = tuple(dataclasses.replace(joint, name=f"[{joint.name}]") for joint in model.joints)
    assert name_problem(dataclasses.replace(model, joints=odd), f"[{LEFT}]", FirstFew()) is None


def test_a_name_that_nothing_has_and_a_model_without_a_moving_joint_are_problems() -> None:
    ((path, message),) = choice_problems(burger(), (LEFT, "wheel_rigth_joint"))
    assert path == ("joints", 1)
    assert message.startswith("the model has no moving joint 'wheel_rigth_joint'; did you mean 'wheel_right_joint'?")
    # Of many, the first few get a hint.
    messages = [message for _, message in choice_problems(burger(), ("wheel",) * 50)]
    assert [("(allowed: " in message) for message in messages] == [True] * 10 + [False] * 40
    rigid = dataclasses.replace(burger(), joints=())
    assert list(choice_problems(rigid, ())) == [((), "the model has no moving joint")]


def test_a_unit_must_be_that_of_the_joint() -> None:
    wheel = burger().joints_by_name[LEFT]
    assert unit_problem(wheel, "effort", "1 N m") is None
    assert unit_problem(wheel, "effort", 1.0) is None
    trouble = unit_problem(wheel, "effort", "1 N")
    assert trouble is not None
    assert trouble.startswith(f"joint '{LEFT}' turns: 'N' is not a unit of torque")


@pytest.mark.parametrize(("reading", "value"), [("position", 1.0), ("velocity", 2.0), ("effort", 3.0)])
def test_each_reading_is_its_column(reading: Reading, value: float) -> None:
    seen = trace([1.0], position=[1.0], velocity=[2.0], effort=[3.0])
    found = {name: reading_of(burger().joints_by_name[name], reading)(seen).tolist() for name in (LEFT, RIGHT)}
    assert found == {LEFT: [value], RIGHT: [0.0]}
