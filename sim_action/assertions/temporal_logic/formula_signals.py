"""The signals that a formula may use: their dimensions, what they name in a scene, and the channels that they need."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final, cast

from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic.formula import Formula, Term, comparisons, signals_of
from sim_action.core import units
from sim_action.core.units import Dimension
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.joint_selection import links_with_shapes
from sim_action.robot.model.robot_model import READINGS, Reading, RobotModel
from sim_action.state.readings import READING_COLUMNS, columns_of
from sim_action.state.trace_records import Channels, ClearanceWatch
from sim_action.world.physics import GROUND
from sim_action.world.scene import Scene

BASE_SIGNALS: Final = MappingProxyType(
    {
        "time": units.TIME,
        "x": units.LENGTH,
        "y": units.LENGTH,
        "z": units.LENGTH,
        "roll": units.ANGLE,
        "pitch": units.ANGLE,
        "yaw": units.ANGLE,
        "tilt": units.ANGLE,
        "speed": units.SPEED,
        "turn_rate": units.ANGULAR_SPEED,
        "travel": units.LENGTH,
    }
)
"""Signals of the base link, named as in `Trace`. `travel` is the distance on the ground from the settled pose."""

FRAME_SIGNALS: Final = MappingProxyType(
    {name: kind for name, kind in BASE_SIGNALS.items() if name not in ("time", "travel")}
)
"""Signals of the frame of a link; an object has all of them except RATES."""

RATES: Final = ("speed", "turn_rate")  # signals of the frame of a link that objects do not have

SENSOR_SIGNALS: Final = MappingProxyType(
    {name: column for columns in READING_COLUMNS.values() for name, column in columns.items()}
)
"""The columns of the readings of all kinds of sensors; columns with the same name have the same dimension."""

PAIR_SIGNALS: Final = MappingProxyType(
    {
        "distance": (units.LENGTH, ("distance(NAME, NAME)",)),
        "clearance": (units.LENGTH, ("clearance", "clearance(OBJECT)", "clearance(LINK, OBJECT)")),
        "force": (units.FORCE, ("force(OBJECT)", "force(LINK, OBJECT)")),
    }
)
"""Signals between links and objects -> the dimension, and the ways to write them."""

NAMES: Final = (
    *BASE_SIGNALS,
    *(f"{reading}(JOINT)" for reading in READINGS),
    "LINK.z",
    "OBJECT.z",
    "SENSOR.READING",
    *(form for _, forms in PAIR_SIGNALS.values() for form in forms),
)
"""All signals, as messages list them."""

Powers = tuple[int, int, int, int]  # the exponents of m, s, rad and kg
_BASES: Final = ("m", "s", "rad", "kg")
_NONE: Final[Powers] = (0, 0, 0, 0)

_POWERS: Final[dict[str, Powers]] = {
    units.TIME.si: (0, 1, 0, 0),
    units.LENGTH.si: (1, 0, 0, 0),
    units.ANGLE.si: (0, 0, 1, 0),
    units.SPEED.si: (1, -1, 0, 0),
    units.ANGULAR_SPEED.si: (0, -1, 1, 0),
    units.ACCELERATION.si: (1, -2, 0, 0),
    units.FORCE.si: (1, -2, 0, 1),
    units.TORQUE.si: (2, -2, 0, 1),
}

_SYMBOLS: Final = {powers: symbol for symbol, powers in _POWERS.items()}


def dimension(signal: stl.Signal, model: RobotModel) -> Dimension:
    """Return the dimension of a signal; its joint must exist."""
    if signal.joint:
        return model.joints_by_name[signal.joint].dimension(cast("Reading", signal.name))
    match signal.source:
        case "sensor":
            return SENSOR_SIGNALS[signal.name].dimension
        case "pair":
            return PAIR_SIGNALS[signal.name][0]
        case _:
            return BASE_SIGNALS[signal.name]


def problem_with(signal: stl.Signal, model: RobotModel) -> str | None:
    """Return the problem with a signal whose joint does not exist or does not move, else None."""
    moving = [joint.name for joint in model.moving_joints]
    if not signal.joint or signal.joint in moving:
        return None
    return f"the model has no moving joint '{signal.joint}'{did_you_mean(signal.joint, moving)}"


class _Unlike(Exception):
    """Terms with different dimensions, which cannot be added or compared."""


def dimension_problems(formula: Formula, model: RobotModel) -> Iterator[tuple[int, str]]:
    """Yield the index in the text and a message for unknown joints and different dimensions."""
    missing = [(signal.at, problem) for signal in signals_of(formula) if (problem := problem_with(signal, model))]
    if missing:
        yield from missing
        return
    for comparison in comparisons(formula):
        try:
            _alike((comparison.left, comparison.right), model)
        except _Unlike as unlike:
            yield comparison.at, str(unlike)


def margin_unit(comparison: stl.Comparison, model: RobotModel) -> str:
    """Return the SI symbol of the margin of a comparison; empty if the unit has no symbol."""
    return _SYMBOLS.get(_alike((comparison.left, comparison.right), model) or _NONE, "")


def _alike(terms: tuple[Term, ...], model: RobotModel) -> Powers | None:
    """Return the common dimension of terms; None if all are plain numbers, which match any dimension."""
    first: tuple[Term, Powers] | None = None
    for term in terms:
        powers = _powers(term, model)
        if powers is None:
            continue
        if first is not None and _without_angle(powers) != _without_angle(first[1]):
            raise _Unlike(f"'{first[0]}' is in {_name(first[1])}, '{term}' in {_name(powers)}: they cannot be compared")
        first = first or (term, powers)
    return None if first is None else first[1]


def _powers(term: Term, model: RobotModel) -> Powers | None:
    match term:
        case stl.Number():
            return _POWERS[term.unit] if term.unit else None
        case stl.Signal():
            return _POWERS.get(dimension(term, model).si, _NONE)
        case stl.Negative() | stl.Absolute():
            return _powers(term.term, model)
        case stl.Sum():
            return _alike(term.terms, model)
        case stl.Product():
            factor_powers = [powers for factor in term.factors if (powers := _powers(factor, model)) is not None]
            return _multiplied(factor_powers) if factor_powers else None


def _multiplied(factors: list[Powers]) -> Powers:
    metres, seconds, radians, kilograms = (sum(column) for column in zip(*factors, strict=True))
    return metres, seconds, radians, kilograms


def _without_angle(powers: Powers) -> tuple[int, int, int]:
    metres, seconds, _, kilograms = powers
    return metres, seconds, kilograms


def _name(powers: Powers) -> str:
    named = [base if power == 1 else f"{base}^{power}" for base, power in zip(_BASES, powers, strict=True) if power]
    return _SYMBOLS.get(powers) or " ".join(named) or "plain numbers"


def channels_of(formula: Formula) -> Channels:
    """Return the channels that the signals of a formula need. Objects may also be names of links."""
    return Channels.all_of(map(_channels, signals_of(formula)))


def _channels(signal: stl.Signal) -> Channels:
    if signal.source == "sensor":
        return Channels(sensors=frozenset(signal.names[:1]))
    if signal.source == "frame" or signal.name == "distance":
        return Channels(objects=frozenset(signal.names))
    if signal.source == "pair":
        if signal.name == "force":
            return Channels(contacts=True, ground=signal.names[-1] == GROUND)
        return Channels(clearances=frozenset({watch_of(signal)}))
    return Channels()


def watch_of(signal: stl.Signal) -> ClearanceWatch:
    """Return the distances that a clearance reads."""
    *links, body = signal.names or (None,)
    return ClearanceWatch(tuple(link for link in links if link) or None, None if body is None else (body,), always=True)


def name_problems(formula: Formula, scene: Scene) -> Iterator[tuple[int, str]]:
    """Yield the index in the text and a message for links and objects that do not exist or do not fit."""
    for signal in signals_of(formula):
        for message in _name_problems(signal, scene):
            yield signal.at, message


def _name_problems(signal: stl.Signal, scene: Scene) -> Iterator[str]:
    if signal.source == "frame" or signal.name == "distance":
        for name in signal.names:
            bodies = (*scene.world.names, *scene.frames)
            links = scene.model.links_by_name
            if name in links and name in bodies:
                yield f"'{name}' is a link of the robot and an object; rename the object"
            elif name not in links and name not in bodies:
                yield f"there is no link or object '{name}'{did_you_mean(name, [*links, *bodies])}"
            elif name in bodies and signal.name in RATES:
                yield f"the {signal.name} of an object is not recorded; bound its place, such as {signal.names[0]}.z"
    elif signal.source == "pair":
        yield from _shape_problems(signal, scene, scene.world.names)


def _shape_problems(signal: stl.Signal, scene: Scene, bodies: Sequence[str]) -> Iterator[str]:
    links = links_with_shapes(scene.model)
    *named, body = signal.names or (None,)
    if body is None and not bodies:
        yield "the world has no objects to keep clear of; add some to world.objects"
    if body is not None and body not in (*bodies, GROUND):
        yield f"the world has no body '{body}'{did_you_mean(body, bodies)}"
    meant = named or links
    for link in meant:
        if link not in links:
            yield f"the robot has no link '{link}' with a collision shape{did_you_mean(str(link), links)}"
    travels = any(world_object.name == body and world_object.path for world_object in scene.world.objects)
    if signal.name == "force" and travels and scene.bolted_links.issuperset(str(link) for link in meant):
        yield f"engines compute no force between '{body}', which follows its path, and links that cannot move"


def sensor_problems(formula: Formula, kinds: Mapping[str, str]) -> Iterator[tuple[int, str]]:
    """Yield the index in the text and a message for sensors that do not exist, and readings that they do not have."""
    for signal in signals_of(formula):
        if signal.source != "sensor":
            continue
        name = signal.names[0]
        if name not in kinds:
            yield signal.at, f"the scenario has no sensor '{name}'{did_you_mean(name, kinds)}"
        elif signal.name not in (columns := columns_of(kinds[name])):
            hint = did_you_mean(signal.name, columns)
            yield signal.at, f"a reading of '{name}' has no column '{signal.name}'{hint}"
