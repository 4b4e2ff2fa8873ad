"""The audit of a formula (`stl`): constant comparisons, bare angles, and premises that never hold."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import permutations, product
from typing import TYPE_CHECKING, Final

from sim_action.assertions.temporal_logic.formula import (
    Absolute,
    Always,
    Comparison,
    Eventually,
    Formula,
    Implies,
    Interval,
    Negative,
    Number,
    Product,
    Signal,
    Sum,
    Term,
    Until,
    comparisons,
    signals,
    signals_of,
    signed_parts,
)
from sim_action.assertions.temporal_logic.parser import place
from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.robot.model.link_pairs import rigid_bodies
from sim_action.robot.model.robot_model import WORLD, RobotModel
from sim_action.world import GROUND, Physics
from sim_action.world.claims import ClaimFinding, Findings
from sim_action.world.link_range import ROUNDING_M, range_of

if TYPE_CHECKING:
    from sim_action.state.trace import Trace
    from sim_action.world.scene import Scene

_AXES: Final = "xyz"
_ANGLE: Final = re.compile(r"([0-9][0-9.e+-]*) (rad/s|rad)\b")

Range = tuple[float, float]
"""The least and the greatest possible value of a term."""

ANYTHING: Final[Range] = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Constant:
    """A comparison that has the same result in every run, and its index in the text."""

    comparison: Comparison
    is_true: bool

    @property
    def at(self) -> int:
        """The index in the text at which the comparison begins."""
        return self.comparison.at


def by_name(ranges: Mapping[str, Range]) -> Callable[[Signal], Range]:
    """Return the possible values of a signal; `ranges`: name of a signal of the base -> possible values."""

    def possible(signal: Signal) -> Range:
        if signal.joint:
            return ANYTHING
        low, high = ranges.get(signal.name, ANYTHING)
        # Only the base has the limits of a run.
        return low, math.inf if signal.source == "frame" and signal.name in ("speed", "turn_rate") else high

    return possible


def constant_comparisons(formula: Formula, possible: Callable[[Signal], Range]) -> Iterator[Constant]:
    """Yield the comparisons that are always true or always false; `possible` returns the values of a signal."""
    for comparison in comparisons(formula):
        smaller, greater = comparison.left, comparison.right
        if comparison.relation in (">", ">="):
            smaller, greater = greater, smaller
        (low, high), (other_low, other_high) = _range(smaller, possible), _range(greater, possible)
        if high <= other_low:
            yield Constant(comparison, True)
        elif low > other_high:
            yield Constant(comparison, False)


def _range(term: Term, possible: Callable[[Signal], Range]) -> Range:
    match term:
        case Number():
            return term.value, term.value
        case Signal():
            return possible(term)
        case Negative():
            low, high = _range(term.term, possible)
            return -high, -low
        case Absolute():
            low, high = _range(term.term, possible)
            return max(0.0, low, -high), max(-low, high)
        case Sum():
            each = [_range(part, possible) for part in term.terms]
            return sum(low for low, _ in each), sum(high for _, high in each)
        case Product():
            low, high = 1.0, 1.0
            for factor in term.factors:
                ends = [_times(a, b) for a, b in product((low, high), _range(factor, possible))]
                low, high = min(ends), max(ends)
            return low, high


def _times(first: float, second: float) -> float:
    return first * second if first and second else 0.0


@dataclass(frozen=True, slots=True)
class Beside:
    """A number without a unit that is compared with signals."""

    number: float
    signals: tuple[Signal, ...]
    at: int


def bare_numbers(formula: Formula) -> Iterator[Beside]:
    """Yield each number without a unit that is one side of a comparison, with the signals of the other side."""
    for comparison in comparisons(formula):
        for side, other in ((comparison.left, comparison.right), (comparison.right, comparison.left)):
            number = side.term if isinstance(side, Negative) else side
            if isinstance(number, Number) and not number.unit:
                yield Beside(number.value, tuple(signals(other)), side.at)


@dataclass(frozen=True, slots=True)
class Premise:
    """The premise of an implication, and the times in s after the first step at which it is judged."""

    formula: Formula
    interval: Interval

    @property
    def text(self) -> str:
        """The formula with angles in degrees."""
        return _ANGLE.sub(lambda match: units.display(float(match[1]), match[2]), str(self.formula))


def premises(formula: Formula) -> tuple[Premise, ...]:
    """Return the premises that make a formula true if they never hold."""
    return tuple(_premises(formula, Interval(0.0, 0.0), contrary=False))


def _premises(formula: Formula, when: Interval, *, contrary: bool) -> Iterator[Premise]:
    if isinstance(formula, Implies) and not contrary:
        yield Premise(formula.premise, when)
    for index, (part, flip) in enumerate(signed_parts(formula, contrary)):
        yield from _premises(part, _judged(formula, index, when), contrary=flip)


def _judged(formula: Formula, index: int, when: Interval) -> Interval:
    """Return the times at which a direct subformula is judged; `when`: those of the formula."""
    match formula:
        case Until() if index == 0:
            return _later(when, Interval(0.0, formula.interval.end))
        case Always() | Eventually() | Until():
            return _later(when, formula.interval)
        case _:
            return when


def _later(when: Interval, interval: Interval) -> Interval:
    return Interval(when.start + interval.start, when.end + interval.end)


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
