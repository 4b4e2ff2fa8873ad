"""Efforts on joints: when they act, how they add up, and what they leave behind."""

from __future__ import annotations

from sim_action.core.geometry import Twist
from sim_action.ros.ros1.node.efforts import Efforts
from sim_action.state.command import Answer, JointTargets, commands_of

NONE: frozenset[str] = frozenset()


def efforts_in(answer: Answer) -> dict[str, float]:
    found: dict[str, float] = {}
    for command in commands_of(answer):
        if isinstance(command, JointTargets):
            found.update(command.effort)
    return found


def test_they_act_for_their_time_and_the_joint_is_let_go_once() -> None:
    efforts = Efforts()
    efforts.apply("a", 2.0, 1.0, 0.5)

    times = [0.99, 1.0, 1.49, 1.5, 1.6]
    assert [efforts_in(efforts.added_to(None, time, NONE)) for time in times] == [
        {},
        {"a": 2.0},
        {"a": 2.0},
        {"a": 0.0},
        {},
    ]


def test_those_of_one_joint_add_up_and_last_until_they_are_cleared() -> None:
    efforts = Efforts()
    efforts.apply("a", 2.0, 0.0, -1.0)
    efforts.apply("a", 3.0, 0.0, 1.0)
    efforts.apply("b", 1.0, 0.0, -1.0)

    assert efforts_in(efforts.added_to(None, 0.5, NONE)) == {"a": 5.0, "b": 1.0}
    assert efforts_in(efforts.added_to(None, 1e6, NONE)) == {"a": 2.0, "b": 1.0}
    efforts.clear("a")
    assert efforts_in(efforts.added_to(None, 1e6, NONE)) == {"a": 0.0, "b": 1.0}
    efforts.clear_all()
    assert efforts.added_to(Twist(), 1e6, NONE) == Twist()


def test_they_come_after_what_moves_the_joint_otherwise() -> None:
    efforts = Efforts()
    efforts.apply("a", 2.0, 0.0, 1.0)

    held = JointTargets(position={"a": 1.0})
    *_, last = commands_of(efforts.added_to(held, 0.5, NONE))
    assert last == JointTargets(effort={"a": 2.0})
    # What holds it holds it again.
    *_, last = commands_of(efforts.added_to(held, 1.0, NONE))
    assert last in (held, JointTargets())


def test_wheels_that_a_twist_turns_are_the_drives() -> None:
    efforts = Efforts()
    efforts.apply("wheel", 2.0, 0.0, -1.0)

    assert efforts_in(efforts.added_to(None, 0.0, frozenset({"wheel"}))) == {"wheel": 2.0}
    assert efforts_in(efforts.added_to(Twist(), 0.1, frozenset({"wheel"}))) == {}
