"""The rules of the audit of claims about the comparisons of a formula (`stl`): constants, and bare angles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import permutations
from typing import TYPE_CHECKING, Final

from sim_action.assertions.temporal_logic.formula import Comparison, Formula, Signal, comparisons, signals, signals_of
from sim_action.assertions.temporal_logic.parser import place
from sim_action.assertions.temporal_logic.vacuity import (
    ANYTHING,
    Constant,
    Range,
    bare_numbers,
    by_name,
    constant_comparisons,
)
from sim_action.core import units
from sim_action.robot.model.link_pairs import rigid_bodies
from sim_action.robot.model.robot_model import WORLD, RobotModel
from sim_action.world import GROUND, Physics
from sim_action.world.claims import ClaimFinding, Findings
from sim_action.world.link_range import ROUNDING_M, range_of

if TYPE_CHECKING:
    from sim_action.state.trace import Trace
    from sim_action.world.scene import Scene

_AXES: Final = "xyz"


def audit_formula(text: str, formula: Formula, physics: Physics) -> Findings:
    """Yield the findings that are visible without the robot model: bare angles, and results that no run changes."""
    bare = [each for each in bare_numbers(formula) if _are_angles(each.signals)]
    wrong = [(each.at, problem) for each in bare if (problem := units.beyond_a_turn(each.number)) is not None]
    for at, problem in wrong:
        yield ClaimFinding("bare-angle", (), f"{problem}; {place(text, at)}")
    if wrong:
        return
    for constant in _constants(formula, physics):
        yield _always(text, constant)


def audit_formula_of_robot(text: str, formula: Formula, scene: Scene) -> Findings:
    """Yield comparisons of values that never change, and of values beyond the reach of the links."""
    yield from _bare_joint_angles(formula, scene.model)
    known = {constant.at for constant in _constants(formula, scene.physics)}
    places = _Places(scene)
    for comparison in comparisons(formula):
        compared = tuple(signals(comparison.left)) + tuple(signals(comparison.right))
        if comparison.at not in known and compared and all(map(places.is_constant, compared)):
            known.add(comparison.at)
            yield _never_changes(text, comparison, compared)
    for constant in constant_comparisons(formula, partial(_in_reach, scene)):
        if constant.at not in known:
            yield _always(text, constant)


def audit_forces(formula: Formula, trace: Trace) -> Findings:
    """Yield the first force of a formula that held although the force was always 0."""
    for signal in signals_of(formula):
        *links, body = signal.names or ("",)
        if signal.source != "pair" or signal.name != "force":
            continue
        if not any(touch.body == body and (not links or touch.link == links[0]) for touch in trace.contacts):
            who = f"link '{links[0]}'" if links else "the robot"
            message = f"{who} never pressed against {body}, so '{signal}' was always 0"
            use = f"let it touch {body}, or use no_collision if it must not"
            yield ClaimFinding("never-touched", (), f"{message}; {use}")
            return


def _bare_joint_angles(formula: Formula, model: RobotModel) -> Findings:
    for number in bare_numbers(formula):
        joints = [model.joints_by_name.get(signal.joint) for signal in number.signals if signal.name == "position"]
        limited = any(joint is not None and joint.is_limited_angle for joint in joints)
        if limited and (problem := units.beyond_a_turn(number.number)) is not None:
            yield ClaimFinding("bare-angle", (), problem)


def _constants(formula: Formula, physics: Physics) -> Iterator[Constant]:
    ranges = {
        "tilt": (0.0, math.pi),
        "roll": (-math.pi, math.pi),
        "pitch": (-math.pi / 2, math.pi / 2),
        "yaw": (-math.pi, math.pi),
        "speed": (0.0, physics.max_speed),
        "turn_rate": (0.0, physics.max_turn_rate),
        "travel": (0.0, physics.max_distance),
        "distance": (0.0, math.inf),
        "force": (0.0, math.inf),
    }
    return constant_comparisons(formula, by_name(ranges))


def _always(text: str, constant: Constant) -> ClaimFinding:
    always = "always true ('>' and '>=' are the same)" if constant.is_true else "always false"
    message = f"'{constant.comparison}' is {always}, so it checks nothing; change its limit"
    return ClaimFinding("unreachable-limit", (), f"{message}; {place(text, constant.at)}")


def _never_changes(text: str, comparison: Comparison, compared: Iterable[Signal]) -> ClaimFinding:
    names = [f"'{name}'" for name in dict.fromkeys(map(str, compared))]
    never = "never change" if len(names) > 1 else "never changes"
    message = f"a comparison checks nothing: {' and '.join(names)} {never} in this scenario"
    use = "name links or objects that move relative to each other"
    return ClaimFinding("fixed-base", (), f"{message}; {use}; {place(text, comparison.at)}")


def _are_angles(compared: Iterable[Signal]) -> bool:
    names = {signal.name for signal in compared}
    return bool(names) and names <= {"roll", "pitch", "yaw", "tilt"}


class _Places:
    """The rigid bodies of a scene: names with one rigid body never move relative to each other."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._holders = rigid_bodies(scene.model)
        self._fixed = {GROUND, *(body.name for body in scene.world.objects if body.mass is None and not body.path)}

    def is_constant(self, signal: Signal) -> bool:
        """Return True if a signal has the same value at every step."""
        match signal.source:
            case "robot":
                return self._scene.bolted and not signal.joint and signal.name != "time"
            case "frame":
                return self._rigid(signal.names[0]) == WORLD
            case "pair" if signal.name == "distance":
                return len(set(map(self._rigid, signal.names))) == 1
            case "pair":
                return self._never_nears(signal)
            case _:
                return False

    def _never_nears(self, signal: Signal) -> bool:
        """Return True if neither the links nor the objects of a clearance or a force move."""
        *links, body = signal.names or (None,)
        model, bodies = self._scene.model, [each.name for each in self._scene.world.objects]
        meant = links or [link.name for link in model.links if link.collisions or model.mjcf]
        return {self._rigid(str(name)) for name in (*meant, *(bodies if body is None else [body]))} == {WORLD}

    def _rigid(self, name: str) -> str:
        if name in self._scene.bolted_links or name in self._fixed:
            return WORLD
        return self._holders.get(name, name)


def _in_reach(scene: Scene, signal: Signal) -> Range:
    """Return the possible values of a place of a link, or of the distance between two links."""
    links = scene.model.links_by_name
    if not links.keys() >= set(signal.names) or not signal.names:
        return ANYTHING
    if signal.source == "frame" and signal.name in _AXES:
        found, axis = range_of(scene, signal.names[0], WORLD), _AXES.index(signal.name)
        if found is None or (signal.name == "z" and not found.has_height):
            return ANYTHING
        middle, away = found.centre_xyz[axis], found.radius + ROUNDING_M
        return middle - away, middle + away
    if signal.name == "distance":
        low, high = 0.0, math.inf
        for first, second in permutations(signal.names):
            if (found := range_of(scene, second, first)) is not None:
                middle, away = math.hypot(*found.centre_xyz), found.radius + ROUNDING_M
                low, high = max(low, middle - away), min(high, middle + away)
        return low, high
    return ANYTHING
