"""The audit of a formula (`stl`): constant parts, bare angles, and premises that never hold."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import permutations
from typing import Final

from sim_action.assertions import CREEP_M, CREEP_M_S
from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic.formula import Formula, Interval, signals, signals_of, signed_parts
from sim_action.assertions.temporal_logic.formula_signals import BASE_SIGNALS, SENSOR_SIGNALS
from sim_action.assertions.temporal_logic.intervals import (
    ANYTHING,
    Constant,
    Possible,
    Range,
    by_name,
    can_be,
    constants,
)
from sim_action.assertions.temporal_logic.parser import place
from sim_action.core import units
from sim_action.core.records import dataclass, replace
from sim_action.robot.model.robot_model import WORLD, RobotModel, rigid_bodies
from sim_action.sensors import sensor_named
from sim_action.state.readings import DISTANCES, ReadingColumn
from sim_action.state.trace import Trace
from sim_action.world import GROUND, Physics
from sim_action.world.claims import IN_RANGE, ClaimFinding, Findings, JudgedRun, Setting
from sim_action.world.robot_reach import ROUNDING_M, joint_range, joint_range_in, range_of
from sim_action.world.scene import Scene

_AXES: Final = "xyz"
_FELT_N: Final = 1e-3  # N: a contact sensor that reads less felt nothing
# m: in a formula, an infinite range is 1e9 m.
_IN_RANGE_M: Final = 1e8
_OPPOSITE: Final[dict[stl.Relation, stl.Relation]] = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_ANGLE: Final = re.compile(r"([0-9][0-9.e+-]*) (rad/s|rad)\b")


@dataclass(frozen=True, slots=True)
class Beside:
    """A number without a unit that is compared with signals."""

    number: float
    signals: tuple[stl.Signal, ...]
    at: int


def bare_numbers(formula: Formula) -> Iterator[Beside]:
    """Yield each number without a unit that is one side of a comparison, with the signals of the other side."""
    for comparison in stl.comparisons(formula):
        for side, other in ((comparison.left, comparison.right), (comparison.right, comparison.left)):
            number = side.term if isinstance(side, stl.Negative) else side
            if isinstance(number, stl.Number) and not number.unit:
                yield Beside(number.value, tuple(signals(other)), side.at)


@dataclass(frozen=True, slots=True)
class Premise:
    """The premise of an implication, and the times in s after the first step at which it is judged."""

    formula: Formula
    interval: Interval
    sensor: str = ""

    @property
    def text(self) -> str:
        """The formula with angles in degrees; for a sensor that must see something, its name and IN_RANGE."""
        if self.sensor:
            return f"{self.sensor}{IN_RANGE}"
        return _ANGLE.sub(lambda match: units.display(float(match[1]), match[2]), str(self.formula))


def premises(formula: Formula) -> tuple[Premise, ...]:
    """Return the premises that make a formula true if they never hold, also of `or` and `not (a and b)` in `always`.

    `always (a or b)` says nothing about b if a always holds by itself: its premises are `not a` and `not b`. A distance
    of a sensor is compared only if something is in range, and its force only if it felt one.
    """
    seen = (
        Premise(stl.Comparison(signal, "<", stl.Number(_IN_RANGE_M)), Interval(), signal.names[0])
        for signal in signals_of(formula)
        if signal.source == "sensor" and signal.name in DISTANCES and "max" not in signal.names
    )
    felt = (
        Premise(stl.Comparison(signal, ">", stl.Number(_FELT_N)), Interval())
        for signal in signals_of(formula)
        if signal.source == "sensor" and signal.name == "force"
    )
    return (*seen, *felt, *_premises(formula, Interval(0.0, 0.0), contrary=False, throughout=False))


def _premises(formula: Formula, when: Interval, *, contrary: bool, throughout: bool) -> Iterator[Premise]:
    inner = signed_parts(formula, contrary)
    if isinstance(formula, stl.Implies) and not contrary:
        yield Premise(formula.premise, when)
    elif throughout and isinstance(formula, stl.And if contrary else stl.Or) and _relates_quantities(formula):
        alternatives = [part if flip else _negated(part) for part, flip in inner]
        deadlines = [premise for premise in alternatives if {signal.name for signal in signals_of(premise)} == {"time"}]
        yield from (Premise(premise, when) for premise in deadlines or alternatives)
    for index, (part, flip) in enumerate(inner):
        lasts = throughout
        if isinstance(formula, stl.Always | stl.Eventually | stl.Until):
            lasts = isinstance(formula, stl.Always) != contrary or (isinstance(formula, stl.Until) and index == 0)
        yield from _premises(part, _judged(formula, index, when), contrary=flip, throughout=lasts)


def _relates_quantities(formula: Formula) -> bool:
    """Return False for a region: alternatives that are all about one signal, or one place."""
    quantities = {("place" if signal.name in _AXES else str(signal), signal.names) for signal in signals_of(formula)}
    return len(quantities) > 1


def _negated(formula: Formula) -> Formula:
    match formula:
        case stl.Comparison():
            return replace(formula, relation=_OPPOSITE[formula.relation])
        case stl.Not():
            return formula.formula
        case _:
            return stl.Not(formula)


def _judged(formula: Formula, index: int, when: Interval) -> Interval:
    """Return the times at which a direct subformula is judged; `when`: the times of the formula."""
    match formula:
        case stl.Until() if index == 0:
            return _later(when, Interval(0.0, formula.interval.end))
        case stl.Always() | stl.Eventually() | stl.Until():
            return _later(when, formula.interval)
        case _:
            return when


def _later(when: Interval, interval: Interval) -> Interval:
    return Interval(when.start + interval.start, when.end + interval.end)


def audit_formula(text: str, formula: Formula, setting: Setting) -> Findings:
    """Yield the findings that are visible without the robot model: bare angles, and results that no run changes."""
    bare = [(bare_number, unit) for bare_number in bare_numbers(formula) if (unit := _angle_unit(bare_number.signals))]
    problems = ((bare_number.at, units.beyond_a_turn(bare_number.number, unit)) for bare_number, unit in bare)
    wrong = [(at, problem) for at, problem in problems if problem is not None]
    for at, problem in wrong:
        yield ClaimFinding("bare-angle", (), f"{problem}; {place(text, at)}")
    if wrong:
        return
    parts = list(constants(formula, _possible_in(setting, math.inf)))
    yield from (_always(text, constant) for constant in parts)
    if not parts:
        parts = [Constant(part, True) for part in _on_time_alone(formula)]
        yield from (_of_clock(text, constant) for constant in parts)
    # A part on the time, such as a late deadline next to other limits, may be true in all of a run.
    if not parts and not can_be(formula, _possible_in(setting, setting.time_limit), true=False):
        yield _always(text, Constant(formula, True))


def audit_formula_of_robot(text: str, formula: Formula, scene: Scene) -> Findings:
    """Yield comparisons of values that never change, and parts that no position of joints and links changes."""
    if bare := list(_bare_joint_angles(formula, scene.model)):
        yield from bare
        return
    reported = {constant.part for constant in constants(formula, _possible_anywhere(scene.physics))}
    places = _Places(scene)
    for comparison in stl.comparisons(formula):
        compared = tuple(signals(comparison.left)) + tuple(signals(comparison.right))
        if comparison not in reported and compared and all(map(places.is_constant, compared)):
            reported.add(comparison)
            names = [f"'{name}'" for name in dict.fromkeys(map(str, compared))]
            never = "never change" if len(names) > 1 else "never changes"
            message = f"a comparison checks nothing: {' and '.join(names)} {never} in this scenario"
            use = "name links or objects that move relative to each other"
            yield ClaimFinding("fixed-base", (), f"{message}; {use}; {place(text, comparison.at)}")
    for constant in constants(formula, partial(possible_in_scene, scene)):
        if reported.isdisjoint(stl.everything(constant.part)):
            yield _always(text, constant)


def constant_result(formula: Formula, scene: Scene) -> bool | None:
    """Return the result of a formula if it is the same in every run of a robot, else None."""
    results = [true for true in (True, False) if can_be(formula, partial(possible_in_scene, scene), true=true)]
    return results[0] if len(results) == 1 else None


def is_about_motion(formula: Formula) -> bool:
    """Return True if all signals are about motion on the ground, or about distances from objects."""
    still = {"speed", "turn_rate", "travel", "x", "y", "clearance", "distance"}
    return all(signal.name in still and not signal.joint for signal in signals_of(formula))


def asks_for_rest(formula: Formula, scene: Scene) -> bool:
    """Return True if a formula on the motion of the base can be false for a robot that only creeps."""
    creeping = {"speed": (0.0, CREEP_M_S), "turn_rate": (0.0, CREEP_M_S), "travel": (0.0, CREEP_M)}
    for axis, start in (("x", scene.placement.x), ("y", scene.placement.y)):
        creeping[axis] = (start - CREEP_M, start + CREEP_M)
    if not {(signal.source, signal.name) for signal in signals_of(formula)} <= {("robot", name) for name in creeping}:
        return False
    return can_be(formula, by_name(creeping), true=False)


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


def audit_distances(formula: Formula, run: JudgedRun) -> Findings:
    """Yield a formula that is true wherever the base drives, and its joints turn, in the time limit."""
    far, start = run.far, run.scene.placement
    near = {"travel": (0.0, far), "speed": (0.0, run.top_speed)}
    near |= {axis: (begin - far, begin + far) for axis, begin in (("x", start.x), ("y", start.y))}

    def possible(signal: stl.Signal) -> Range:
        if signal.joint:
            return joint_range_in(run, signal.joint, signal.name)
        return near.get(signal.name, ANYTHING) if signal.source == "robot" else possible_in_scene(run.scene, signal)

    if not can_be(formula, possible, true=False):
        yield run.never_so_far("give smaller limits, or more time")


def _bare_joint_angles(formula: Formula, model: RobotModel) -> Findings:
    for number in bare_numbers(formula):
        joints = [model.joints_by_name.get(signal.joint) for signal in number.signals if signal.name == "position"]
        limited = any(joint is not None and joint.is_limited_angle for joint in joints)
        if limited and (problem := units.beyond_a_turn(number.number)) is not None:
            yield ClaimFinding("bare-angle", (), problem)


def _possible_anywhere(physics: Physics) -> Possible:
    return by_name(
        {
            "tilt": (0.0, math.pi),
            "roll": (-math.pi, math.pi),
            "pitch": (-math.pi / 2, math.pi / 2),
            "yaw": (-math.pi, math.pi),
            "speed": (0.0, physics.max_speed),
            "turn_rate": (0.0, physics.max_turn_rate),
            "travel": (0.0, physics.max_distance),
            "distance": (0.0, math.inf),
            "force": (0.0, math.inf),
            "time": (0.0, math.inf),
        }
    )


def _possible_in(setting: Setting, end: float) -> Possible:
    """Return the possible values of signals in a scenario until `end` in s, as far as its file states them."""
    anywhere = _possible_anywhere(setting.physics)

    def possible(signal: stl.Signal) -> Range:
        low, high = anywhere(signal)
        return low, end if (signal.source, signal.name) == ("robot", "time") else high

    return possible


def _always(text: str, constant: Constant) -> ClaimFinding:
    always = "always true ('>' and '>=' are the same)" if constant.is_true else "always false"
    message = f"'{constant.part}' is {always}, so it checks nothing; change its limit"
    return ClaimFinding("unreachable-limit", (), f"{message}; {place(text, constant.at)}")


def _on_time_alone(formula: Formula) -> Iterator[Formula]:
    """Yield the outermost parts that wait for a time and for no other signal: the run goes on until it has come."""
    outermost = list[Formula]()
    for part in stl.everything(formula):
        waits = isinstance(part, stl.Eventually) or (isinstance(part, stl.Not) and isinstance(part.formula, stl.Always))
        on_time = {(signal.source, signal.name) for signal in signals_of(part)} == {("robot", "time")}
        if waits and on_time and not any(part in stl.everything(outer) for outer in outermost):
            outermost.append(part)
    yield from outermost


def _of_clock(text: str, constant: Constant) -> ClaimFinding:
    message = f"'{constant.part}' waits for a time alone, which comes whatever the robot does"
    return ClaimFinding("unreachable-limit", (), f"{message}; compare another signal; {place(text, constant.at)}")


def _angle_unit(compared: Iterable[stl.Signal]) -> str:
    """Return "rad" or "rad/s" if all signals are angles, or angular speeds, not of joints; else an empty text."""
    quantities = SENSOR_SIGNALS | {name: ReadingColumn(kind) for name, kind in BASE_SIGNALS.items()}
    kinds = {quantities[signal.name].dimension if signal.name in quantities else None for signal in compared}
    (kind, *others) = kinds or {None}
    return kind.si if kind in (units.ANGLE, units.ANGULAR_SPEED) and not others else ""


class _Places:
    """The rigid bodies of a scene: names with one rigid body never move relative to each other."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._holders = rigid_bodies(scene.model)
        self._fixed = {GROUND, *(body.name for body in scene.world.objects if body.mass is None and not body.path)}

    def is_constant(self, signal: stl.Signal) -> bool:
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

    def _never_nears(self, signal: stl.Signal) -> bool:
        """Return True if neither the links nor the objects of a clearance or a force move."""
        *links, body = signal.names or (None,)
        model, bodies = self._scene.model, self._scene.world.names
        meant = links or [link.name for link in model.links if link.collisions or model.mjcf]
        return {self._rigid(str(name)) for name in (*meant, *(bodies if body is None else [body]))} == {WORLD}

    def _rigid(self, name: str) -> str:
        if name in self._scene.bolted_links or name in self._fixed:
            return WORLD
        return self._holders.get(name, name)


def possible_in_scene(scene: Scene, signal: stl.Signal) -> Range:
    """Return the possible values of a signal: of a joint, or of the places of links, and of the base."""
    if signal.joint:
        return joint_range(scene, signal.joint, signal.name)
    at, links = scene.placement, scene.model.links_by_name
    if signal.source == "robot" and signal.name in _AXES:
        begin, far = (at.x, at.y, 0.0)[_AXES.index(signal.name)], scene.physics.max_distance
        return begin - far, begin + far
    if signal.source == "frame" and signal.name in _AXES and signal.names[0] in links:
        reach = range_of(scene, signal.names[0], WORLD)
        axis = _AXES.index(signal.name)
        if reach is not None and (signal.name != "z" or reach.has_height):
            middle, away = reach.centre_xyz[axis], reach.radius + ROUNDING_M
            return middle - away, middle + away
    if signal.name == "distance" and links.keys() >= set(signal.names):
        low, high = 0.0, math.inf
        for first, second in permutations(signal.names):
            if (reach := range_of(scene, second, first)) is not None:
                middle, away = math.hypot(*reach.centre_xyz), reach.radius + ROUNDING_M
                low, high = max(low, middle - away), min(high, middle + away)
        return low, high
    if signal.source == "sensor":
        name, *which = signal.names
        sensor = sensor_named(scene, name)
        return sensor.limits(signal.name, which[0] if which else None) if sensor else ANYTHING
    return _possible_anywhere(scene.physics)(signal)
