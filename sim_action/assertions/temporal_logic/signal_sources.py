"""The links, objects and sensors that the signals of a formula name, and the channels of a trace that they need."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from sim_action.assertions.temporal_logic.dimensions import RATES
from sim_action.assertions.temporal_logic.formula import Formula, Signal, signals_of
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.joint_selection import links_with_shapes
from sim_action.state.readings import columns_of
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.world.ground import GROUND
from sim_action.world.scene import Scene


def channels_of(formula: Formula) -> Channels:
    """Return the channels that the signals of a formula need. Objects may also be names of links."""
    return Channels.all_of(map(_channels, signals_of(formula)))


def _channels(signal: Signal) -> Channels:
    if signal.source == "sensor":
        return Channels(sensors=frozenset(signal.names[:1]))
    if signal.source == "frame" or signal.name == "distance":
        return Channels(objects=frozenset(signal.names))
    if signal.source == "pair":
        return Channels(contacts=True) if signal.name == "force" else Channels(clearances=frozenset({watch_of(signal)}))
    return Channels()


def watch_of(signal: Signal) -> ClearanceWatch:
    """Return the distances that a clearance reads."""
    *links, body = signal.names or (None,)
    return ClearanceWatch(tuple(link for link in links if link) or None, None if body is None else (body,), always=True)


def name_problems(formula: Formula, scene: Scene) -> Iterator[tuple[int, str]]:
    """Yield the index in the text and a message for links and objects that do not exist or do not fit."""
    for signal in signals_of(formula):
        for message in _name_problems(signal, scene):
            yield signal.at, message


def _name_problems(signal: Signal, scene: Scene) -> Iterator[str]:
    bodies = [body.name for body in scene.world.objects]
    if signal.source == "frame" or signal.name == "distance":
        for name in signal.names:
            yield from _frame_problems(name, signal, scene, bodies)
    elif signal.source == "pair":
        yield from _shape_problems(signal, scene, bodies)


def _frame_problems(name: str, signal: Signal, scene: Scene, bodies: list[str]) -> Iterator[str]:
    links = scene.model.links_by_name
    if name in links and name in bodies:
        yield f"'{name}' is a link of the robot and an object; rename the object"
    elif name not in links and name not in bodies:
        yield f"there is no link or object '{name}'{did_you_mean(name, [*links, *bodies])}"
    elif name in bodies and signal.name in RATES:
        yield f"the {signal.name} of an object is not recorded; bound its place, such as {signal.names[0]}.z"


def _shape_problems(signal: Signal, scene: Scene, bodies: list[str]) -> Iterator[str]:
    links = links_with_shapes(scene.model)
    *named, body = signal.names or (None,)
    if body is None and not bodies:
        yield "the world has no objects to keep clear of; add some to world.objects"
    if body == GROUND and signal.name == "force":
        yield "contacts with the ground are not recorded; name an object"
    elif body is not None and body not in (*bodies, GROUND):
        yield f"the world has no body '{body}'{did_you_mean(body, bodies)}"
    meant = named or links
    for link in meant:
        if link not in links:
            yield f"the robot has no link '{link}' with a collision shape{did_you_mean(str(link), links)}"
    travels = any(each.name == body and each.path for each in scene.world.objects)
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
