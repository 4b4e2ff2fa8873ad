"""What is wrong with points that joints are to move through: with themselves, and for a robot."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Final

from sim_action.commands.joint_path import Blend
from sim_action.commands.joint_points import JointPoint, Knot, in_si, knots
from sim_action.core import units
from sim_action.core.messages import FirstFew
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.joint_limits import beyond_limits, too_fast, too_strong
from sim_action.robot.robot_model import Joint
from sim_action.world.scene import Scene

_LIMITS: Final = MappingProxyType({"position": beyond_limits, "velocity": too_fast, "effort": too_strong})
_WITH_ARTICLE: Final = MappingProxyType({"position": "a position", "velocity": "a velocity", "effort": "an effort"})
# In s, of sim time: scenarios may last no longer.
_LONGEST: Final = 86_400
# Times that are advised are rounded up to it, in s.
_ADVISED: Final = 0.01


def order_problems(points: Sequence[JointPoint]) -> SpecProblems:
    """Points that are not later than the one before."""
    for index, (before, point) in enumerate(pairwise(points), start=1):
        if point.at <= before.at:
            yield ("joints", index, "at"), f"must be later than the point before it, at {before.at:g} s"


def two_kinds_problems(points: Sequence[JointPoint]) -> SpecProblems:
    """Joints that are given targets of two kinds, each once."""
    first: dict[str, Knot] = {}
    told = set[str]()
    for knot in knots(points):
        earlier = first.setdefault(knot.joint, knot)
        if knot.reading != earlier.reading and knot.joint not in told:
            told.add(knot.joint)
            message = f"joint '{knot.joint}' is given {_WITH_ARTICLE[earlier.reading]} as well, at {earlier.time:g} s"
            yield knot.path, f"{message}; a joint is moved by position, by velocity or by effort"


def misfits(points: Sequence[JointPoint], blend: Blend, scene: Scene) -> SpecProblems:
    """Joints that are not there or have no motor, units that are not theirs, what they cannot do."""
    by_joint: dict[str, list[Knot]] = {}
    for knot in knots(points):
        by_joint.setdefault(knot.joint, []).append(knot)
    unknown = FirstFew()
    for name, told in by_joint.items():
        if (trouble := scene.model.why_not_driven(name)) is None:
            yield from _joint_problems(scene.model.joints_by_name[name], told, blend, scene)
        elif unknown.one_more():
            yield told[0].path, trouble


def _joint_problems(joint: Joint, told: Sequence[Knot], blend: Blend, scene: Scene) -> SpecProblems:
    """Values that are not the joint's; where there are none, ways that take longer than they may."""
    goals: list[float] = []
    for knot in told:
        try:
            goals.append(in_si(scene, knot))
        except units.UnitError as error:
            yield knot.path, str(error)
        else:
            if (problem := _LIMITS[knot.reading](joint, goals[-1])) is not None:
                yield knot.path, problem
                goals.pop()
    try:
        beginning = scene.joint_positions[joint.name]
    except units.UnitError:
        return  # which is told of the robot
    if len(goals) == len(told) and blend.peak is not None and all(knot.reading == "position" for knot in told):
        yield from _way_problems(joint, beginning, zip(told, goals, strict=True), blend.peak)


def _way_problems(joint: Joint, value: float, wanted: Iterable[tuple[Knot, float]], peak: float) -> SpecProblems:
    """Ways between positions that would be too fast; the first begins at `value`, at 0 s."""
    time = 0.0
    for knot, goal in wanted:
        way = peak * abs(goal - value)
        # No time is left where the points are not in order, which is told, or where the first is a step at 0 s.
        found = too_fast(joint, way / (knot.time - time)) if knot.time > time else None
        if found is not None and joint.max_velocity is not None:
            yield knot.path, f"too little time from {time:g} s to here: {found}; {_advice(way / joint.max_velocity)}"
        time, value = knot.time, goal


def _advice(least: float) -> str:
    """How much time a way takes; a model may say of a joint that it hardly moves."""
    return f"it takes {math.ceil(least / _ADVISED) * _ADVISED:.4g} s" if least <= _LONGEST else "it takes days"
