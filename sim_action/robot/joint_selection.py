"""The joints that a scenario names: exact names, or patterns such as `*_wheel_joint`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from sim_action.core import units
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import Joint, Reading, RobotModel

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray, Trace


def chosen(model: RobotModel, names: Iterable[str]) -> tuple[Joint, ...]:
    """Return the moving joints that match a name, in the order of the model; all of them if there are no names."""
    wanted = tuple(names) or ("*",)
    return tuple(joint for joint in model.moving_joints if any(matches_name(name, joint.name) for name in wanted))


def matches_name(name: str, joint: str) -> bool:
    """Return True if a name or pattern of a scenario means the joint with the name `joint`."""
    return name == joint or fnmatchcase(joint, name)


def name_problem(model: RobotModel, name: str, hinted: FirstFew) -> str | None:
    """Return the problem with a name that no moving joint matches, else None. The first few have a hint."""
    if chosen(model, (name,)):
        return None
    hint = did_you_mean(name, [joint.name for joint in model.moving_joints]) if hinted.one_more() else ""
    return f"the model has no moving joint '{name}'{hint}"


def unit_problem(joint: Joint, reading: Reading, written: float | str) -> str | None:
    """Return the problem with a quantity whose unit does not fit the joint, else None."""
    try:
        units.parse(written, joint.dimension(reading))
    except units.UnitError as error:
        motion = "slides" if joint.type == "prismatic" else "turns"
        return f"joint '{joint.name}' {motion}: {error}"
    return None


def tolerance_problems(model: RobotModel, tolerances: Mapping[str, float | str]) -> SpecProblems:
    """Yield names in a map of tolerances that no moving joint matches, and units that do not fit the joints."""
    hinted = FirstFew()
    for name, written in tolerances.items():
        if (trouble := name_problem(model, name, hinted)) is not None:
            yield (name,), trouble
        for joint in chosen(model, (name,)):
            if (misfit := unit_problem(joint, "position", written)) is not None:
                yield (name,), misfit


def choice_problems(model: RobotModel, names: tuple[str, ...]) -> SpecProblems:
    """Yield names in `joints` that no moving joint matches, and a model without moving joints."""
    hinted = FirstFew()
    for index, name in enumerate(names):
        if (trouble := name_problem(model, name, hinted)) is not None:
            yield ("joints", index), trouble
    if not names and not model.moving_joints:
        yield (), "the model has no moving joint"


def motor_problems(model: RobotModel, names: tuple[str, ...]) -> SpecProblems:
    """Yield names in `joints` that select only joints without a motor of their own, because they mimic others."""
    for index, name in enumerate(names):
        followed = [joint.mimic for joint in chosen(model, (name,))]
        if followed and (first := followed[0]) is not None and None not in followed:
            message = f"joint '{name}' mimics '{first.joint}' and has no motor of its own; name '{first.joint}'"
            yield ("joints", index), message


def as_written(quantity: float | str) -> str:
    """Return a joint quantity for a title, where it is unknown if the joint rotates or slides."""
    return quantity if isinstance(quantity, str) else f"{quantity:.4g}"


def reading_of(joint: str, reading: Reading) -> Callable[[Trace], FloatArray]:
    """Return a function from a trace to the position, velocity or effort of a joint, (T,) in SI units."""

    def signal(trace: Trace) -> FloatArray:
        columns = {
            "position": trace.joint_position,
            "velocity": trace.joint_velocity,
            "effort": trace.joint_effort,
        }
        return columns[reading][:, trace.joint_names.index(joint)]

    return signal
