"""Events: `events: [{when: {reach: {x: 1 m, y: 0}}, do: [{start: forklift}]}]`.

The actions of events are parts of the world that wait for their time: a disturbance, an object, a path or a fault of an
event that has not happened has an infinite time. When it happens, the world gets the time, as if it had been stated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel, Name, NonNegativeSeconds, PositiveSeconds, Title
from sim_action.core.records import dataclass, replace
from sim_action.core.units import display
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import Document, KeyPath, SpecProblems
from sim_action.scenario.faults import Fault
from sim_action.state.timeline import NOT_YET, TimeMark, late_problems, waits
from sim_action.world import Body, Disturbance, Patch
from sim_action.world.body import MAX_PACE, Pace
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.assertions import Assertion
    from sim_action.scenario.model import DrivenActor, Scenario

MAX_EVENTS: Final = 100

_Flag = Annotated[Literal[True] | None, BeforeValidator(lambda value: True if value is None else value)]


class EventDisturbance(Disturbance):
    """A disturbance that an event begins: the keys of one of the world."""

    at: Annotated[NonNegativeSeconds, Field(description="time after the event at which it starts")] = 0.0


class EventFault(Fault):
    """A fault of a motor or a sensor that an event begins: the keys of one of the scenario."""

    at: Annotated[NonNegativeSeconds, Field(description="time after the event at which it begins")] = 0.0


class PathSpeed(FrozenModel):
    """The speed of an object along its path, as a multiple of the stated one."""

    object: Annotated[Name, Field(description="object with a path")]
    factor: Annotated[float, Field(gt=0, le=MAX_PACE, description="multiple of the stated speed")]


class Action(FrozenModel):
    """An action of an event, at the step after the one at which its condition became true."""

    disturb: Annotated[
        EventDisturbance | None, Field(description="a push, load or adhesion, as in world.disturbances")
    ] = None
    fault: Annotated[EventFault | None, Field(description="a motor or sensor fails, as in faults")] = None
    repair: Annotated[Name | None, Field(description="motor or sensor whose fault ends")] = None
    appear: Annotated[Name | None, Field(description="object, or named patch of the ground, that is absent before")] = (
        None
    )
    remove: Annotated[Name | None, Field(description="object that disappears")] = None
    start: Annotated[
        Name | None, Field(description="command source, or object with a path, that waits before; its times begin here")
    ] = None
    stop: Annotated[
        Name | None, Field(description="command source whose joints and base stop, or object that stops on its path")
    ] = None
    speed: Annotated[PathSpeed | None, Field(description="changes the speed of an object along its path")] = None
    end: Annotated[_Flag, Field(description="the run ends")] = None

    @model_validator(mode="before")
    @classmethod
    def _takes_a_word(cls, written: object) -> object:
        return {written: None} if isinstance(written, str) else written

    @model_validator(mode="after")
    def _is_one_action(self) -> Self:
        if len(self.model_fields_set) != 1 or self.__dict__[self.kind] is None:
            raise ValueError(f"an action has exactly one of {', '.join(type(self).model_fields)}; begin each with '- '")
        return self

    @property
    def kind(self) -> str:
        """Its key."""
        return next(iter(self.model_fields_set), "end")

    @property
    def path(self) -> tuple[str, float] | None:
        """The object whose speed along its path it may change, and the factor; None if it changes none."""
        if self.speed is not None:
            return self.speed.object, self.speed.factor
        return (self.start, 1.0) if self.start else (self.stop, 0.0) if self.stop else None

    @property
    def words(self) -> str:
        """The action in words."""
        if self.disturb is not None:
            return self.disturb.time_mark.words
        if self.fault is not None:
            return self.fault.words
        if self.speed is not None:
            return f"'{self.speed.object}' goes on at {self.speed.factor:g} times its speed"
        return "the run ends" if self.end else f"{self.kind} '{self.__dict__[self.kind]}'"


class ConditionOptions(FrozenModel):
    """The keys that the condition of an event can have besides its own."""

    at: Annotated[
        PositiveSeconds | None, Field(description="sim time at which it is true, instead of an assertion")
    ] = None
    event: Annotated[Title | None, Field(description="event after which it is true, instead of an assertion")] = None
    span: Annotated[
        PositiveSeconds | None, Field(alias="for", description="time for which it must be true without interruption")
    ] = None
    since: Annotated[Title | None, Field(description="event from which it is judged; default: from 0 s")] = None


class EventKeys(FrozenModel):
    """An event: something happens when a condition comes true, instead of at a time."""

    name: Annotated[Title | None, Field(description="default: the condition in words")] = None
    when: Annotated[Any, Field(description="its condition: an assertion, `at: TIME` or `event: NAME`")]
    do: Annotated[tuple[Action, ...], Field(min_length=1, description="its actions, in their order")]
    every: Annotated[bool, Field(description="it happens each time that the condition becomes true")] = False


@dataclass(frozen=True, slots=True)
class Condition:
    """The condition of an event: an assertion, a sim time in s, or another event."""

    assertion: Assertion | None = None
    at: float = 0.0
    event: str = ""
    span: float = 0.0  # the time in s for which it must be true
    since: str = ""  # the name of the event from which an assertion is judged; empty: from 0 s on

    @property
    def title(self) -> str:
        """The condition in words."""
        if self.event:
            return f"{display(self.span, 's')} after {self.event}" if self.span else f"after {self.event}"
        what = display(self.at, "s") if self.assertion is None else self.assertion.title
        return f"{what} for {display(self.span, 's')}" if self.span else what


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a scenario."""

    name: str
    when: Condition
    actions: tuple[Action, ...]
    location: Location  # of the condition
    every: bool = False
    # for each action the index of its disturbance, fault or command source in the scenario; None if it has none
    places: tuple[int | None, ...] = ()

    @property
    def starts(self) -> tuple[int, ...]:
        """The indices of the command sources that it starts."""
        pairs = zip(self.actions, self.places, strict=False)
        return tuple(place for action, place in pairs if action.start and place is not None)


@dataclass(frozen=True, slots=True)
class Happening:
    """An event that happened, by its index, at a sim time in s."""

    event: int
    time: float


def source_names(robot: Scenario | DrivenActor) -> tuple[str, ...]:
    """Return the names of the command sources of a robot: one without a name has its key."""
    return tuple(source.name or source.key for source in robot.commands)


def names_of_actors(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the other robots that are commanded, and of each of their sources: `robot2/drive`."""
    actors = [actor for actor in scenario.world.actors if actor.commands]
    sources = (f"{actor.name}/{name}" for actor in actors for name in source_names(actor))
    return (*(actor.name for actor in actors), *sources)


def events_of(scenario: Scenario, actor: DrivenActor) -> tuple[Event, ...]:
    """Return the events, in the same order, with what they start and stop of another robot."""
    return tuple(_event_of(event, actor) for event in scenario.events)


def _event_of(event: Event, actor: DrivenActor) -> Event:
    pairs = [
        (action, index)
        for action in event.actions
        for index, name in enumerate(source_names(actor))
        if (action.start or action.stop) in (actor.name, f"{actor.name}/{name}")
    ]
    return replace(event, actions=tuple(one for one, _ in pairs), places=tuple(place for _, place in pairs))


def with_events(scenario: Scenario) -> Scenario:
    """Return a scenario whose parts wait for its events."""
    world, names = scenario.world, source_names(scenario)
    disturbances, faults = [*world.disturbances], [*scenario.faults]
    events = []
    for event in scenario.events:
        places: list[int | None] = []
        for action in event.actions:
            source = action.start or action.stop
            place = names.index(source) if source in names else None
            if action.disturb is not None:
                place = len(disturbances)
                disturbances.append(action.disturb.model_copy(update={"at": NOT_YET}))
            if action.fault is not None:
                place = len(faults)
                faults.append(action.fault.model_copy(update={"at": NOT_YET}))
            places.append(place)
        events.append(replace(event, places=tuple(places)))
    actions = [action for event in scenario.events for action in event.actions]
    come, gone = {action.appear for action in actions}, {action.remove for action in actions}
    objects = (_waiting_body(body, actions, come, gone) for body in world.objects)
    patches = (_appearing(patch, NOT_YET) if patch.name in come - {None} else patch for patch in world.patches)
    expect = tuple(
        replace(expectation, after=NOT_YET) if expectation.since else expectation for expectation in scenario.expect
    )
    return _changed(scenario, disturbances, objects, patches, faults, events=tuple(events), expect=expect)


def _appearing(patch: Patch, time: float) -> Patch:
    return patch.model_copy(update={"appears": time})


def _changed(
    scenario: Scenario,
    disturbances: Iterable[Disturbance],
    objects: Iterable[Body],
    patches: Iterable[Patch],
    faults: Iterable[Fault],
    **others: object,
) -> Scenario:
    parts = {"disturbances": tuple(disturbances), "objects": tuple(objects), "patches": tuple(patches)}
    world = scenario.world.model_copy(update=parts)
    return scenario.model_copy(update={"world": world, "faults": tuple(faults), **others})


def _waiting_body(body: Body, actions: Sequence[Action], come: set[str | None], gone: set[str | None]) -> Body:
    paces = [pace for action in actions if (pace := action.path) is not None and pace[0] == body.name]
    update: dict[str, object] = {}
    if body.path and paces:
        first = (Pace(at=0.0, speed=0.0),) if any(action.start == body.name for action in actions) else ()
        update["pace"] = (*body.pace, *first, *(_pace(NOT_YET, factor) for _, factor in paces))
    # A stated time is a problem that is reported.
    if body.name in come and body.appears is None:
        update["appears"] = NOT_YET
    if body.name in gone and body.disappears is None:
        update["disappears"] = NOT_YET
    return body.model_copy(update=update) if update else body


def _pace(at: float, speed: float) -> Pace:
    return Pace.model_construct(at=at, speed=speed)


def after(scenario: Scenario, happenings: Sequence[Happening]) -> Scenario:
    """Return a scenario that states the times of the happenings, in the order of time."""
    for happening in happenings:
        scenario = _after(scenario, scenario.events[happening.event], happening.time)
    return scenario


def _after(scenario: Scenario, event: Event, time: float) -> Scenario:
    world = scenario.world
    disturbances = [*world.disturbances]
    faults = [*scenario.faults]
    objects = list(world.objects)
    patches = list(world.patches)
    for action, place in zip(event.actions, event.places, strict=True):
        # A mutant may lack the part.
        if action.disturb is not None and place is not None and place < len(disturbances):
            disturbances[place] = action.disturb.model_copy(update={"at": time + action.disturb.at})
        if action.fault is not None and place is not None and place < len(faults):
            faults[place] = action.fault.model_copy(update={"at": time + action.fault.at})
        faults = [_repaired(fault, time) if action.repair == fault.target else fault for fault in faults]
        objects = [_body_after(body, action, time) for body in objects]
        patches = [
            _appearing(patch, time) if action.appear and patch.name == action.appear else patch for patch in patches
        ]
    expect = tuple(
        replace(expected, after=time) if expected.since == event.name and waits(expected.after) else expected
        for expected in scenario.expect
    )
    return _changed(scenario, disturbances, objects, patches, faults, expect=expect)


def _repaired(fault: Fault, time: float) -> Fault:
    return fault.model_copy(update={"duration": time - fault.at}) if fault.at <= time < fault.end else fault


def without_absent(scenario: Scenario) -> Scenario:
    """Return a scenario without the bodies, patches, disturbances and faults that wait for an event."""
    world = scenario.world
    bodies = (_without_waiting(body) for body in world.objects if not waits(body.appears))
    patches = (patch for patch in world.patches if not waits(patch.appears))
    disturbances = (disturbance for disturbance in world.disturbances if not waits(disturbance.at))
    faults = (fault for fault in scenario.faults if not waits(fault.at))
    return _changed(scenario, disturbances, bodies, patches, faults)


def _without_waiting(body: Body) -> Body:
    gone = None if waits(body.disappears) else body.disappears
    pace = tuple(change for change in body.pace if not waits(change.at))
    return body.model_copy(update={"disappears": gone, "pace": pace})


def _body_after(body: Body, action: Action, time: float) -> Body:
    if action.appear == body.name:
        return body.model_copy(update={"appears": time})
    if action.remove == body.name:
        return body.model_copy(update={"disappears": time})
    if body.path and (pace := action.path) is not None and pace[0] == body.name:
        earlier = [change for change in body.pace if change.at < time]
        later = [change for change in body.pace if waits(change.at)]
        return body.model_copy(update={"pace": (*earlier, _pace(time, pace[1]), *later)})
    return body


def time_marks(scenario: Scenario, happenings: Sequence[Happening]) -> Iterator[TimeMark]:
    """Yield the marks of happenings, with the actions that the world does not mark itself."""
    for happening in happenings:
        event = scenario.events[happening.event]
        # The world marks what its objects do.
        marked = {"", *(body.name for body in scenario.world.objects)}
        done = [one.words for one in event.actions if one.end or (one.start or one.stop or "") not in marked]
        what = f"event '{event.name}' happened"
        yield TimeMark(happening.time, happening.time, f"{what}: {', '.join(done)}" if done else what)


def event_places(document: Document) -> Document:
    """Return a document that knows where the disturbances and faults of events are written."""
    data = document.data
    events = data.get("events") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(events, tuple):
        return document
    world = data.get("world")
    stated = {"disturb": world.get("disturbances") if isinstance(world, dict) else None, "fault": data.get("faults")}
    wholes: dict[str, KeyPath] = {"disturb": ("world", "disturbances"), "fault": ("faults",)}
    counts = {key: len(value) if isinstance(value, tuple) else 0 for key, value in stated.items()}
    moved: dict[KeyPath, KeyPath] = {}
    for index, event in enumerate(events):
        actions = event.get("do") if isinstance(event, dict) else None
        for number, action in enumerate(actions if isinstance(actions, tuple) else ()):
            for key in (key for key in wholes if isinstance(action, dict) and key in action):
                moved[(*wholes[key], counts[key])] = ("events", index, "do", number, key)
                counts[key] += 1
    return replace(document, moved={**document.moved, **moved}) if moved else document


def event_problems(scenario: Scenario) -> SpecProblems:
    """Yield names that clash or mean nothing, circles of events, and conditions that no moment can decide."""
    events = {event.name: event for event in scenario.events}
    for index, event in enumerate(scenario.events):
        path: KeyPath = ("events", index)
        if events[event.name] is not event:
            yield (*path, "name"), f"a second event named '{event.name}'; give each a 'name' of its own"
        for below, message in _condition_problems(event.when, events, scenario.time_limit):
            yield (*path, "when", *below), message
        if event.every and event.when.at:
            yield (*path, "every"), f"{event.when.at:g} s comes once; remove 'every', or write one event for each time"
        for number, action in enumerate(event.actions):
            for below, message in _action_problems(action, scenario):
                yield (*path, "do", number, *below), message
    yield from _circles(events)
    yield from _too_often(scenario)
    for index, expected in enumerate(scenario.expect):
        if expected.since and expected.since not in events:
            hint = did_you_mean(expected.since, events)
            yield ("expect", index, "since"), f"there is no event '{expected.since}'{hint}"


def _condition_problems(when: Condition, events: Mapping[str, Event], limit: float) -> SpecProblems:
    for key, name in (("event", when.event), ("since", when.since)):
        if name and name not in events:
            yield (key,), f"there is no event '{name}'{did_you_mean(name, events)}"
    yield from late_problems(("at",), when.at, limit)
    if when.assertion is not None and (problem := when.assertion.moment_problem):
        yield (when.assertion.key,), problem


def _action_problems(action: Action, scenario: Scenario) -> SpecProblems:
    """Yield unknown names, and what the named part cannot do."""
    bodies = {body.name: body for body in scenario.world.objects}
    patches = {patch.name for patch in scenario.world.patches if patch.name}
    failing = {fault.target for fault in scenario.faults}
    for key, name, allowed, kind in (
        ("appear", action.appear, {*bodies, *patches}, "object and no patch"),
        ("remove", action.remove, {*bodies}, "object"),
        ("repair", action.repair, failing, "fault of a motor or sensor"),
    ):
        if name is not None and name not in allowed:
            yield (key,), f"there is no {kind} '{name}'{did_you_mean(name, allowed)}"
    body = bodies.get(action.appear or action.remove or "")
    stated = None if body is None else body.appears if action.appear else body.disappears
    if stated is not None and not waits(stated):
        yield (action.kind,), f"'{action.appear or action.remove}' states {stated:g} s for that; remove one of the two"
    body = body if action.appear else None
    if body is not None and body.path:
        why = "an object on a 'path' exists from the start"
        yield ("appear",), f"{why}; let its path begin with the event: start: {action.appear}"
    elif body is not None and body.surface_velocity is not None:
        yield ("appear",), f"'{action.appear}' has a 'surface_velocity', which is of an object that is always there"
    if action.path is not None:
        others = () if action.speed else (*source_names(scenario), *names_of_actors(scenario))
        actors = {actor.name for actor in scenario.world.actors}
        yield from _path_problems(action, action.path[0], bodies, others, actors)


def _path_problems(
    action: Action, name: str, bodies: Mapping[str, Body], sources: Sequence[str], actors: set[str]
) -> SpecProblems:
    """Yield a name that is not one of a command source or an object with a path, or is several."""
    key = (action.kind, "object") if action.speed is not None else (action.kind,)
    on_paths = [body.name for body in bodies.values() if body.path]
    if sources.count(name) > 1 or (name in sources and name in bodies):
        what = "an object, too" if name in bodies else "another command source, or robot, too"
        yield key, f"'{name}' is the name of {what}; give the command source a 'name' of its own"
    elif name in bodies and name not in on_paths:
        yield key, f"object '{name}' has no 'path', so it does not move along one; add a 'path', or use disturb"
    elif name not in sources and action.speed is None and name in actors:
        yield key, f"robot '{name}' has no 'commands', so there is nothing to {action.kind}; add 'commands' to it"
    elif name not in sources and name not in bodies:
        kinds = "object with a path" if action.speed is not None else "command source, robot or object with a path"
        yield key, f"there is no {kinds} named '{name}'{did_you_mean(name, (*sources, *on_paths))}"


def _circles(events: Mapping[str, Event]) -> SpecProblems:
    """Yield the events that wait for each other, each circle once."""
    reported: set[str] = set()
    for index, event in enumerate(events.values()):
        chain = [event.name]
        while (name := _before(events[chain[-1]])) in events and name not in chain:
            chain.append(name)
        if name == event.name and name not in reported:
            reported.update(chain)
            ring = " -> ".join([*chain[:1], *reversed(chain)])
            why = f"these events wait for each other, so none of them can happen: {ring}"
            yield ("events", index, "when"), f"{why}; let one of them begin with something else"


def _before(event: Event) -> str:
    return event.when.event or event.when.since


def _too_often(scenario: Scenario) -> SpecProblems:
    """Yield objects that would come or go several times, or that an event needs after an earlier one removed them."""
    events = {event.name: event for event in scenario.events}
    seen: dict[tuple[str, str], str] = {}
    removed = {action.remove: event.name for event in scenario.events for action in event.actions if action.remove}
    for index, event in enumerate(scenario.events):
        earlier = []
        name = _before(event)
        while name in events and name not in earlier:
            earlier.append(name)
            name = _before(events[name])
        for number, action in enumerate(event.actions):
            path: KeyPath = ("events", index, "do", number, action.kind)
            for kind, what in (("appear", action.appear), ("remove", action.remove)):
                if what is not None and (event.every or (kind, what) in seen):
                    often = "each time" if event.every else f"with event '{seen[kind, what]}', too"
                    yield path, f"'{what}' would {kind} {often}; it can do so once: add another object"
                elif what is not None:
                    seen[kind, what] = event.name
            used = action.disturb.body if action.disturb is not None else action.path and action.path[0]
            if used and removed.get(used) in earlier:
                yield path, f"event '{removed[used]}', which comes before, removes '{used}'; take it out there, or here"


def condition_problems(scenario: Scenario, scene: Scene) -> SpecProblems:
    """Yield what does not fit the scene or the sensors in the conditions of events."""
    kinds = {mounted.name: mounted.sensor.key for mounted in scenario.sensors}
    for index, event in enumerate(scenario.events):
        if (assertion := event.when.assertion) is not None:
            for below, message in (*assertion.problems(scene), *assertion.sensor_problems(kinds)):
                yield ("events", index, "when", assertion.key, *below), message
