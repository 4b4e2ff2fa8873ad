"""What code of the user's answered, held against what a command can be."""

from __future__ import annotations

from typing import cast

from sim_action.core.geometry import Twist
from sim_action.core.messages import with_article
from sim_action.robot.robot_model import RobotModel
from sim_action.state.command import Answer, Command, JointTargets, is_finite


def problem_with(answer: object, model: RobotModel) -> str | None:
    """Why an answer commands nothing that this robot can do, to be said after "returned"; None if it is right."""
    if not isinstance(answer, (tuple, list)):
        return _problem_with_one(answer, model)
    for kind in (Twist, JointTargets):
        if sum(isinstance(part, kind) for part in answer) > 1:
            return f"more than one {kind.__name__} at once; one of each kind goes together: (Twist, JointTargets)"
    problems = (_problem_with_one(part, model) for part in answer)
    return next((f"{with_article(type(answer).__name__)} with {problem}" for problem in problems if problem), None)


def as_answer(answer: object) -> Answer:
    """An answer that there is no problem with, as the loop takes it."""
    if isinstance(answer, (tuple, list)):
        return tuple(part for part in answer if part is not None)
    return cast("Answer", answer)


def _problem_with_one(answer: object, model: RobotModel) -> str | None:
    if answer is None:
        return None
    if not isinstance(answer, (Twist, JointTargets)):
        return f"{with_article(type(answer).__name__)}; it may return a Twist, JointTargets, both as a tuple, or None"
    if isinstance(answer, Twist) and not _has_three_each(answer):
        return f"{answer!r}; a Twist has two vectors of 3 numbers: Twist.planar(linear, angular) makes one"
    if problem := _problem_with_numbers(answer):
        return problem
    return None if isinstance(answer, Twist) else _problem_with_targets(answer, model)


def _problem_with_numbers(command: Command) -> str | None:
    try:
        finite = is_finite(command)
    except OverflowError:  # whole numbers have no bounds
        return f"{_text(command)}, whose values are too large"
    except Exception:  # noqa: BLE001 - values may be of classes of the user's, which raise what they like
        return f"{_text(command)}, whose values are not numbers"
    return None if finite else f"{_text(command)}, in which not every value is finite"


def _text(command: Command) -> str:
    try:
        return repr(command)
    except Exception:  # noqa: BLE001 - as above; nor is there a text of a whole number of thousands of digits
        return with_article(type(command).__name__)


def _problem_with_targets(targets: JointTargets, model: RobotModel) -> str | None:
    if targets.base is not None:
        return "a push of the base, which is for drives alone; motors move a robot"
    for name in (*targets.names(), *targets.max_effort):
        if (trouble := model.why_not_driven(str(name))) is not None:
            return f"a target that no motor can take: {trouble}"
    negative = next((name for name, effort in targets.max_effort.items() if effort < 0), None)
    return None if negative is None else f"a max_effort below 0 for joint '{negative}'; it is how much, either way"


def _has_three_each(twist: Twist) -> bool:
    try:
        return len(twist.linear_xyz) == len(twist.angular_xyz) == 3
    except TypeError:
        return False
