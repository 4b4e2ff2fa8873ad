"""Check the answers of the user's controllers: types, numbers and joints."""

from __future__ import annotations

from typing import cast

from sim_action.core.geometry import Twist
from sim_action.core.wording import with_article
from sim_action.robot.robot_model import RobotModel
from sim_action.state.command import Answer, Command, JointTargets, is_finite


def answer_problem(answer: object, model: RobotModel) -> str | None:
    """Return the problem of an answer, as the end of a sentence "... returned ..."; None if the answer is valid."""
    if not isinstance(answer, (tuple, list)):
        return _problem_with_one(answer, model)
    for kind in (Twist, JointTargets):
        if sum(isinstance(part, kind) for part in answer) > 1:
            return f"more than one {kind.__name__} in a tuple; it may have one of each kind: (Twist, JointTargets)"
    problems = (_problem_with_one(part, model) for part in answer)
    return next((f"{with_article(type(answer).__name__)} with {problem}" for problem in problems if problem), None)


def as_answer(answer: object) -> Answer:
    """Return a valid answer in the form that the simulation loop expects."""
    if isinstance(answer, (tuple, list)):
        return tuple(part for part in answer if part is not None)
    return cast("Answer", answer)


def _problem_with_one(answer: object, model: RobotModel) -> str | None:
    if answer is None:
        return None
    if not isinstance(answer, (Twist, JointTargets)):
        return f"{with_article(type(answer).__name__)}; allowed are a Twist, JointTargets, a tuple of both, or None"
    if isinstance(answer, Twist) and not _has_three_each(answer):
        return f"{answer!r}; a Twist needs two vectors of 3 numbers; Twist.planar(linear, angular) creates one"
    if problem := _problem_with_numbers(answer):
        return problem
    return None if isinstance(answer, Twist) else _problem_with_targets(answer, model)


def _problem_with_numbers(command: Command) -> str | None:
    try:
        finite = is_finite(command)
    except OverflowError:  # an int may be too large for a float
        return f"{_text(command)}, whose values are too large"
    except Exception:  # noqa: BLE001 - values may be objects of the user, which can raise anything
        return f"{_text(command)}, whose values are not numbers"
    return None if finite else f"{_text(command)}, which has a value that is not finite"


def _text(command: Command) -> str:
    try:
        return repr(command)
    except Exception:  # noqa: BLE001 - as above; and Python refuses to print very long integers
        return with_article(type(command).__name__)


def _problem_with_targets(targets: JointTargets, model: RobotModel) -> str | None:
    if targets.base is not None:
        return "a push of the base, which only drives may command; use joint targets"
    for name in (*targets.names(), *targets.max_effort):
        if (trouble := model.why_not_driven(str(name))) is not None:
            return f"a target for a joint that cannot be driven: {trouble}"
    negative = next((name for name, effort in targets.max_effort.items() if effort < 0), None)
    return (
        None
        if negative is None
        else f"a negative max_effort for joint '{negative}'; it is a magnitude, so it must be 0 or more"
    )


def _has_three_each(twist: Twist) -> bool:
    try:
        return len(twist.linear_xyz) == len(twist.angular_xyz) == 3
    except TypeError:
        return False
