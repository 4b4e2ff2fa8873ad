"""The joints that a scenario names: exact names, patterns such as `*_wheel_joint`, or groups of an SRDF.

Links with collision shapes are named in the same way, without groups.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Final

from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.robot_model import STOP_SLACK, Joint, Reading, RobotModel

if TYPE_CHECKING:
    from sim_action.state.trace import Trace

_WILDCARD: Final = re.compile(r"[*?\[]")


def groups_of(model: RobotModel) -> Mapping[str, tuple[str, ...]]:
    """Return group name -> its joints, as the SRDF states them; empty without one."""
    return {} if model.srdf is None else model.srdf.groups


def chosen(model: RobotModel, names: Iterable[str]) -> tuple[Joint, ...]:
    """Return the moving joints that match a name, in the order of the model; all of them if there are no names."""
    patterns = tuple(names) or ("*",)
    return tuple(joint for joint in model.moving_joints if any(_means(model, name, joint.name) for name in patterns))


def matches_name(name: str, part_name: str) -> bool:
    """Return True if a name or pattern of a scenario means the joint or link with the name `part_name`."""
    return name == part_name or fnmatchcase(part_name, name)


def links_with_shapes(model: RobotModel) -> list[str]:
    """Return the links that can touch something. Only the engine knows the shapes of an MJCF model."""
    return [link.name for link in model.links if link.collisions or model.mjcf]


def links_named(model: RobotModel, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the links with collision shapes that match a name or a pattern, in the order of the model."""
    return tuple(link for link in links_with_shapes(model) if any(matches_name(name, link) for name in names))


def link_name_problems(model: RobotModel, key: str, names: tuple[str, ...]) -> SpecProblems:
    """Yield the names and patterns of `key` that no link with a collision shape matches."""
    hinted = FirstFew()
    for index, name in enumerate(names):
        if not links_named(model, (name,)):
            hint = did_you_mean(name, links_with_shapes(model)) if hinted.one_more() else ""
            yield (key, index), f"the robot has no link '{name}' with a collision shape{hint}"


def _means(model: RobotModel, name: str, joint: str) -> bool:
    if name in groups_of(model) and name not in model.joints_by_name:
        return joint in groups_of(model)[name]
    return matches_name(name, joint)


def selects(model: RobotModel, name: str) -> bool:
    """Return True for a pattern or a group, and False for the name of one joint, known or not."""
    if name in model.joints_by_name or name in model.balls:
        return False
    return name in groups_of(model) or _WILDCARD.search(name) is not None


def joints_set_by(model: RobotModel, names: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Return name -> the joints that it sets; the name of a joint wins over patterns and groups."""
    own = {name for name in names if not selects(model, name)}
    return {
        name: (name,) if name in own else tuple(joint for joint in _led(model, name) if joint not in own)
        for name in names
    }


def _led(model: RobotModel, name: str) -> tuple[str, ...]:
    return tuple(joint.name for joint in model.motor_joints if joint.mimic is None and _means(model, name, joint.name))


def setting_problems(model: RobotModel, values: Mapping[str, float | str], hinted: FirstFew) -> SpecProblems:
    """Yield patterns and groups in a map that set no joint, and pairs that give one joint different values."""
    several = [name for name in values if selects(model, name)]
    for name in several:
        if not _led(model, name):
            yield (name,), _sets_nothing(model, name, hinted)
    first = dict[str, str]()
    reported = set[tuple[str, str]]()
    for other, joints in joints_set_by(model, values).items():
        for joint in joints:
            one = first.setdefault(joint, other)
            if values[one] != values[other] and (one, other) not in reported:
                reported.add((one, other))
                theirs = f"'{other}' to {as_written(values[other])}"
                conflict = f"'{one}' sets joint '{joint}' to {as_written(values[one])}, {theirs}"
                yield from (
                    ((name,), f"{conflict}; name the joint itself, or change a pattern") for name in (one, other)
                )


def _sets_nothing(model: RobotModel, name: str, hinted: FirstFew) -> str:
    meant = chosen(model, (name,))
    if meant and (trouble := model.why_not_driven(meant[0].name)) is not None:
        return f"'{name}' names no joint with a motor of its own: {trouble}"
    if name in groups_of(model):
        return f"the group '{name}' of the SRDF has no moving joint"
    return f"no moving joint matches '{name}'{_hint(model, name, hinted)}"


def _hint(model: RobotModel, name: str, hinted: FirstFew) -> str:
    joints = (joint.name for joint in model.moving_joints)
    return did_you_mean(name, dict.fromkeys((*joints, *groups_of(model)))) if hinted.one_more() else ""


def name_problem(model: RobotModel, name: str, hinted: FirstFew) -> str | None:
    """Return the problem with a name that no moving joint matches, else None. The first few have a hint."""
    if chosen(model, (name,)):
        return None
    return f"the model has no moving joint '{name}'{_hint(model, name, hinted)}"


def unit_problem(joint: Joint, reading: Reading, written: float | str) -> str | None:
    """Return the problem with a quantity whose unit does not fit the joint, else None."""
    try:
        units.parse(written, joint.dimension(reading))
    except units.UnitError as error:
        motion = "slides" if joint.type == "prismatic" else "turns"
        return f"joint '{joint.name}' {motion}: {error}"
    return None


def bare_angle(model: RobotModel, names: Iterable[str], written: object) -> str | None:
    """Return the problem of a bare angle of joints that cannot make a full turn; other joints may turn many times."""
    limited = any(joint.is_limited_angle for joint in chosen(model, names))
    return units.beyond_a_turn(written) if limited else None


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


def reading_of(joint: Joint, reading: Reading) -> Callable[[Trace], FloatArray]:
    """Return a function from a trace to the position, velocity or effort of a joint, (T,) in SI units.

    A position at a stop is the limit of the joint: engines hold a joint a little before or behind it.
    """
    stops = [limit for limit in (joint.lower, joint.upper) if limit is not None] if reading == "position" else []

    def signal(trace: Trace) -> FloatArray:
        columns = {"position": trace.joint_position, "velocity": trace.joint_velocity, "effort": trace.joint_effort}
        values = columns[reading][:, trace.joint_names.index(joint.name)]
        for stop in stops:
            values = np.where(np.abs(values - stop) <= STOP_SLACK, stop, values)
        return values

    return signal
