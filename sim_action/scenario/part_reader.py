"""Read the parts whose class depends on a key: drive, commands, sensors, expectations; and exchange robots by `ego`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import count
from typing import TYPE_CHECKING, Any, Final, TypeGuard, TypeVar

from pydantic import BaseModel, ValidationError

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.commands import COMMANDS, CommandSource
from sim_action.core.errors import Problem
from sim_action.core.field_types import BARE_ANGLE_RULE, spec_errors
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, field, replace
from sim_action.core.registry import PackageProblem, Table
from sim_action.core.wording import did_you_mean, shown
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document, KeyPath, ProblemList, SpecProblems, placed
from sim_action.drives import DRIVES, Drive
from sim_action.robot.built_in import STANDARD_SENSORS
from sim_action.scenario.model import Expectation, ExpectationOptions
from sim_action.sensors import SENSORS, MountedSensor, Mounting
from sim_action.world.claims import allowed_rules

if TYPE_CHECKING:
    from sim_action.assertions.combined import Combined
    from sim_action.scenario.events import Condition, Event


Model = TypeVar("Model", bound=BaseModel)
Options = TypeVar("Options", bound=BaseModel)
Entry = TypeVar("Entry")
Reader = Callable[[type[Model], Any, KeyPath], Model | None]
"""A function that makes a spec of a class from plain values and notes problems."""

# Each source and assertion may name a file that takes a second to read. Nested assertions count too.
_MAX_SOURCES: Final = 50
_MAX_SENSORS: Final = 100
_MAX_ASSERTIONS: Final = 1_000
_MAX_FILES: Final = 50


def _standard_sensors(robot: Any) -> Iterable[Any]:
    """Return the entries of the sensors that a robot is sold with, if it asks for them."""
    is_asked = isinstance(robot, dict) and robot.get("sensors") == "standard"
    return STANDARD_SENSORS.get(str(robot["model"]), ()) if is_asked and "model" in robot else ()


def actors_of(data: Mapping[str, Any]) -> Any:
    """Return what stands below `world.actors`; None without it."""
    world = data.get("world")
    return world.get("actors") if isinstance(world, dict) else None


@dataclass(slots=True)
class OwnPaths:
    """The key paths of the commands and sensors of a robot that were read."""

    commands: list[KeyPath] = field(default_factory=list)
    sensors: list[KeyPath] = field(default_factory=list)


class PartReader:
    """Reads the parts of one document and collects their problems.

    `command_paths, sensor_paths, expect_paths`: the key paths of the parts that were read; `actor_paths`: the paths of
    the other robots, in their order.
    """

    def __init__(
        self,
        document: Document,
        workspace: Workspace,
        permissions: Permissions,
        problems: ProblemList,
        allowed: AbstractSet[str] = frozenset(),
        *,
        refused: AbstractSet[KeyPath] = frozenset(),
    ) -> None:
        """Start a reader.

        Args:
            document: the parts.
            workspace: in which their files are found.
            permissions: of the caller.
            problems: receives the problems.
            allowed: rules of the audit of claims that the scenario allows.
            refused: paths of command sources whose problems are known.
        """
        self.command_paths: list[KeyPath] = []
        self.sensor_paths: list[KeyPath] = []
        self.expect_paths: list[KeyPath] = []
        self.actor_paths: list[OwnPaths] = []
        self._document = document
        self._workspace = workspace
        self._permissions = permissions
        self._problems = problems
        self._assertions = 0
        self._files = 0
        self._refused = refused
        self._context = {} if "bare-angle" in allowed else {BARE_ANGLE_RULE: "bare-angle"}

    def with_families(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return the document's data with drive, commands, sensors and expectations as objects."""
        parts = dict(data)
        if "commands" in data:
            parts["commands"], self.command_paths = self._commands(data["commands"], ("commands",))
        sensors = data.get("sensors", ())
        standard = tuple(_standard_sensors(data.get("robot")))
        if isinstance(sensors, tuple) and (standard or "sensors" in data):
            entries = _numbered(("sensors",), sensors)
            entries += [(("robot", "sensors"), entry) for entry in standard]
            parts["sensors"], self.sensor_paths = self._sensors(entries)
        if isinstance(actors := actors_of(data), tuple):
            several = tuple(self._actor(entry, ("world", "actors", index)) for index, entry in enumerate(actors))
            parts["world"] = {**data["world"], "actors": several}
        if isinstance(data.get("expect"), tuple):
            parts["expect"] = self._expectations(data["expect"])
        if isinstance(data.get("events"), tuple):
            parts["events"] = self._events(data["events"])
        robot = data.get("robot")
        if isinstance(robot, dict) and "drive" in robot:
            parts["robot"] = {**robot, "drive": self._drive(robot["drive"], ("robot", "drive"))}
        return parts

    def _actor(self, data: Any, path: KeyPath) -> Any:
        """Return the entry of another robot with its drive, commands and sensors as objects."""
        if not isinstance(data, dict):
            return data
        parts = dict(data)
        own = OwnPaths()
        if "commands" in data:
            parts["commands"], own.commands = self._commands(data["commands"], (*path, "commands"))
        sensors = data.get("sensors", ())
        if sensors == "standard":
            sensors = tuple(_standard_sensors(data)) or None
            if sensors is None:
                robots = ", ".join(STANDARD_SENSORS)
                self._problems.note((*path, "sensors"), f"standard sensors are known of {robots}; list them")
        if isinstance(sensors, tuple):
            parts["sensors"], own.sensors = self._sensors(_numbered((*path, "sensors"), sensors))
        if "drive" in data:
            parts["drive"] = self._drive(data["drive"], (*path, "drive"))
        self.actor_paths.append(own)
        return parts

    def _commands(self, data: Any, path: KeyPath) -> tuple[tuple[CommandSource, ...], list[KeyPath]]:
        entries = self._few(path, _numbered(path, data), _MAX_SOURCES, "sources") if isinstance(data, tuple) else ()
        sources = [(at, self._command(entry, at)) for at, entry in entries or [(path, data)]]
        read = [(at, source) for at, source in sources if source is not None]
        return tuple(source for _, source in read), [at for at, _ in read]

    def _few(self, path: KeyPath, entries: Sequence[Entry], most: int, what: str) -> Sequence[Entry]:
        """Return the entries below a key; only the first ones if there are too many."""
        if len(entries) <= most:
            return entries
        self._problems.note(path, f"{len(entries):,} {what}; at most {most:,} are read")
        return entries[:1]

    def _command(self, data: Any, path: KeyPath) -> CommandSource | None:
        if path in self._refused:
            return None
        choice = self._kind(COMMANDS, data, path, beside=CommandSource)
        if choice is None:
            return None
        key, kind = choice
        source = self.validated(kind, data, path)
        if source is None:
            return None
        if source.runs_user_code and self._permissions.scripts_refused:
            # None of its files is opened.
            self._problems.note((*path, key), self._permissions.scripts_refused)
            return source
        source = source.completed(self._workspace)
        self._problems.note_all(path, source.problems(self._workspace))
        return source

    def _expectations(self, data: tuple[Any, ...]) -> tuple[Expectation, ...]:
        few = self._few(("expect",), data, _MAX_ASSERTIONS, "expectations")
        expectations = [
            (("expect", index), self._expectation(entry, ("expect", index))) for index, entry in enumerate(few)
        ]
        self.expect_paths = [path for path, expectation in expectations if expectation is not None]
        return _with_unique_names(tuple(expectation for _, expectation in expectations if expectation is not None))

    def _events(self, data: tuple[Any, ...]) -> tuple[Event, ...]:
        from sim_action.scenario.events import MAX_EVENTS  # few scenarios have events

        few = self._few(("events",), data, MAX_EVENTS, "events")
        events = [self._event(entry, ("events", index)) for index, entry in enumerate(few)]
        return tuple(event for event in events if event is not None)

    def _event(self, data: Any, path: KeyPath) -> Event | None:
        from sim_action.scenario.events import Event, EventKeys  # few scenarios have events

        keys = self.validated(EventKeys, data, path)
        if keys is None or (when := self._condition(keys.when, (*path, "when"))) is None:
            return None
        location = self._document.location((*path, "when"))
        return Event(keys.name or when.title, when, keys.do, location, every=keys.every)

    def _condition(self, data: Any, path: KeyPath) -> Condition | None:
        from sim_action.scenario.events import Condition, ConditionOptions  # few scenarios have events

        own = [key for key in ("at", "event") if isinstance(data, dict) and key in data]
        conditions = {"at", "event", *ASSERTIONS.all_names()}
        if isinstance(data, dict) and conditions.isdisjoint(data):
            self._problems.note(
                path, f"has no condition: '{next(iter(data), '')}'{did_you_mean(next(iter(data), ''), conditions)}"
            )
            return None
        if not own:
            pair = self._with_options(ASSERTIONS, ConditionOptions, data, path, self._assertion)
            return None if pair is None else Condition(pair[0], span=pair[1].span or 0.0, since=pair[1].since or "")
        options = self.validated(ConditionOptions, data, path)
        if options is None:
            return None
        if len(own) > 1 or options.since is not None:
            self._problems.note(path, "a condition is an assertion, 'at' or 'event'; 'since' is for assertions")
        return Condition(at=options.at or 0.0, event=options.event or "", span=options.span or 0.0)

    def _sensors(self, entries: Sequence[tuple[KeyPath, Any]]) -> tuple[tuple[MountedSensor, ...], list[KeyPath]]:
        few = self._few(entries[0][0][:-1], entries, _MAX_SENSORS, "sensors") if entries else ()
        sensors = [(path, self._sensor(entry, path)) for path, entry in few]
        read = [(path, sensor) for path, sensor in sensors if sensor is not None]
        return tuple(sensor for _, sensor in read), [path for path, _ in read]

    def _sensor(self, data: Any, path: KeyPath) -> MountedSensor | None:
        pair = self._with_options(SENSORS, Mounting, data, path, self.validated)
        if pair is None:
            return None
        sensor, on = pair
        name = on.name or sensor.key
        return MountedSensor(sensor, name, on.link, on.pose.pose, on.rate, on.trace, transmission=on)

    def _with_options(
        self, table: Table[type[Model]], beside: type[Options], data: Any, path: KeyPath, read: Reader[Model]
    ) -> tuple[Model, Options] | None:
        """Return a spec and the options next to its key. A bare key is enough if the spec needs no value."""
        data = {data: None} if isinstance(data, str) else data
        choice = self._kind(table, data, path, beside=beside)
        if choice is None:
            return None
        key, kind = choice
        spec = read(kind, {} if data[key] is None else data[key], (*path, key))
        options = self.validated(beside, {name: value for name, value in data.items() if name != key}, path)
        return None if spec is None or options is None else (spec, options)

    def _expectation(self, data: Any, path: KeyPath) -> Expectation | None:
        context = self._context
        if isinstance(data, dict) and "bare-angle" in allowed_rules(data):
            self._context = {}
        pair = self._with_options(ASSERTIONS, ExpectationOptions, data, path, self._assertion)
        self._context = context
        if pair is None:
            return None
        assertion, options = pair
        span = options.span
        if span is not None and assertion.hold_time is not None:
            if assertion.states_span:
                self._problems.note((*path, "for"), f"'{assertion.key}' has 'for' already; remove one of the two")
            assertion = assertion.lasting(span)
            span = None
        if span is not None and (reason := _why_not_for(assertion)) is not None:
            self._problems.note((*path, "for"), reason)
        if options.since is not None and options.after:
            self._problems.note((*path, "since"), "gives the time from which it is checked; remove 'after'")
        if options.before is not None and options.before <= options.after:
            self._problems.note((*path, "before"), f"must be later than 'after' ({options.after:g} s)")
        return Expectation(
            assertion=assertion,
            location=self._document.location((*path, assertion.key)),
            name=options.name or assertion.title,
            after=options.after,
            before=float("inf") if options.before is None else options.before,
            severity=options.severity,
            span=span,
            allow=options.allow,
            since=options.since or "",
        )

    def _assertion(self, kind: type[Assertion], data: Any, path: KeyPath) -> Assertion | None:
        """Return the assertion below its key, with its nested assertions."""
        self._assertions += 1
        if self._assertions > _MAX_ASSERTIONS:
            few = f"more than {_MAX_ASSERTIONS:,} assertions including nested ones; split the scenario"
            self._problems.note(("expect",), few)
            return None
        if _is_combined(kind):
            try:
                entries = kind.entries(data)
            except ValueError as error:
                self._problems.note(path, str(error))
                return None
            parts = [self._part(kind, entry, (*path, *place)) for place, entry in entries]
            valid_parts = tuple(part for part in parts if part is not None)
            return kind.made_of(valid_parts) if len(valid_parts) == len(parts) else None
        spec = self.validated(kind, data, path)
        if spec is not None:
            self._problems.note_all(path, self._file_problems(spec))
            if spec.runs_user_code and self._permissions.scripts_refused:
                self._problems.note(path, self._permissions.scripts_refused)
        return spec

    def _file_problems(self, spec: Assertion) -> SpecProblems:
        self._files += spec.reads_file
        if self._files <= _MAX_FILES:
            yield from spec.file_problems(self._workspace)
        else:
            few = f"more than {_MAX_FILES} assertions with a file of their own; split the scenario"
            self._problems.note(("expect",), few)

    def _part(self, whole: type[Combined], data: Any, path: KeyPath) -> Assertion | None:
        """Return a nested assertion, which has no options of its own."""
        data = {data: None} if isinstance(data, str) else data
        for option in [key for key in data if key in _keys_of(ExpectationOptions)] if isinstance(data, dict) else []:
            self._problems.note(
                (*path, option), f"'{option}' belongs to the outermost assertion, not into '{whole.key}'"
            )
            return None
        choice = self._kind(ASSERTIONS, data, path)
        if choice is None:
            return None
        key, kind = choice
        return self._assertion(kind, {} if data[key] is None else data[key], (*path, key))

    def _drive(self, data: Any, path: KeyPath) -> Drive | None:
        choice = self._kind(DRIVES, data, path)
        return None if choice is None else self.validated(choice[1], data[choice[0]], (*path, choice[0]))

    def _kind(
        self, table: Table[type[Model]], data: Any, path: KeyPath, beside: type[BaseModel] | None = None
    ) -> tuple[str, type[Model]] | None:
        """Return the one key of `data` in the table, and its class; fields of a second class may stand next to it."""
        key = self._family_key(table, data, path, beside)
        if key is None:
            return None
        if key not in table and (refused := self._permissions.imports_refused or self._permissions.scripts_refused):
            self._problems.note((*path, key), f"{table.installed()[key]} is not imported: {refused}")
            return None
        try:
            return key, table.load(key)
        except PackageProblem as error:
            self._problems.note((*path, key), str(error))
            return None

    def _family_key(self, table: Table[Any], data: Any, path: KeyPath, beside: type[BaseModel] | None) -> str | None:
        """Return the one key of `data` that the table knows."""
        if not isinstance(data, dict):
            names = ", ".join(table.all_names())
            self._problems.note(path, f"expected a map with one {table.kind} ({names}), found {shown(data)}")
            return None
        keys = [key for key in data if key in table]
        if len(keys) == 1 and len(data) == 1:
            return str(keys[0])
        if beside and len(keys) > 1:
            # A source may have a key with the name of another source.
            owners = [key for key in keys if _keys_of(table.load(key)).issuperset(keys)]
            keys = owners if len(owners) == 1 else keys
        others = [key for key in data if key not in table and key not in (_keys_of(beside) if beside else ())]
        # Installed packages are searched for a name that nothing else explains.
        keys += [key for key in others if key in table.installed()]
        if len(keys) == 1 and (beside or len(data) == 1):
            return str(keys[0])
        if len(keys) > 1:
            self._note_two(path, *keys[:2])
        elif others:
            hint = did_you_mean(others[0], table.all_names())
            self._problems.note((*path, others[0]), f"unknown {table.kind} '{others[0]}'{hint}")
        else:
            self._problems.note(path, f"names no {table.kind}; give one of {', '.join(table.all_names())}")
        return None

    def _note_two(self, path: KeyPath, *keys: str) -> None:
        """Note that two keys exclude each other. In a file that extends another, one of them may be inherited."""
        first, second = sorted(keys, key=lambda key: self._document.location((*path, key)).file == self._document.file)
        base = self._document.location((*path, first)).file
        if base == self._document.location((*path, second)).file:
            self._problems.note((*path, second), f"'{first}' and '{second}' in one entry; begin each with '- '")
        else:
            message = f"'{first}' of {base} stands beside it; take that out with '{first}: null'"
            self._problems.note((*path, second), message)

    def validated(self, model: type[Model], data: Any, path: KeyPath) -> Model | None:
        """Return the spec of a part of the document; None if it has a problem, which is noted."""
        try:
            return model.model_validate(data, context=self._context)
        except ValidationError as error:
            for location, message in spec_errors(model, data, error):
                # A refused part is missing from the whole. That is not a second problem.
                if not self._problems.has_below((*path, *location)):
                    self._problems.note((*path, *location), message)
            return None


def _numbered(path: KeyPath, entries: Iterable[Any]) -> list[tuple[KeyPath, Any]]:
    return [((*path, index), entry) for index, entry in enumerate(entries)]


def _keys_of(model: type[BaseModel]) -> frozenset[str]:
    return frozenset(field.alias or name for name, field in model.model_fields.items())


def _why_not_for(assertion: Assertion) -> str | None:
    """Return the reason why an assertion cannot have `for`, else None."""
    if not assertion.has_truth:
        return (
            f"'{assertion.key}' is not true or false at a moment, so it cannot hold for a time; use at_once, or an stl "
            "formula such as eventually always[0 s, 2 s] (...)"
        )
    if not assertion.is_goal:
        return f"'for' is for goals, and '{assertion.title}' must hold all the time; use 'after' and 'before'"
    return None


def _is_combined(kind: type[Assertion]) -> TypeGuard[type[Combined]]:
    return hasattr(kind, "made_of")


def _with_unique_names(expectations: tuple[Expectation, ...]) -> tuple[Expectation, ...]:
    """Return the expectations with unique names: the second of a name becomes "name (2)"."""
    taken = {expectation.name for expectation in expectations}
    seen: set[str] = set()
    unique = []
    for expectation in expectations:
        name = expectation.name
        if name in seen:
            name = next(free for n in count(2) if (free := f"{name} ({n})") not in taken)
        seen.add(name)
        taken.add(name)
        unique.append(replace(expectation, name=name))
    return tuple(unique)


@dataclass(frozen=True, slots=True)
class Unfolded:
    """A document whose command sources have all keys side by side."""

    document: Document  # it knows where the keys are written
    problems: tuple[Problem, ...] = ()  # of the maps
    refused: frozenset[KeyPath] = frozenset()  # the paths of the sources with problems


def unfolded(document: Document) -> Unfolded:
    """Return a document with the keys of each map of a command source next to its name."""
    data = document.data if isinstance(document.data, dict) else {}
    sources = list(_sources_of(data.get("commands"), ("commands",)))
    actors = actors_of(data)
    for index, actor in enumerate(actors if isinstance(actors, tuple) else ()):
        if isinstance(actor, dict):
            sources += _sources_of(actor.get("commands"), ("world", "actors", index, "commands"))
    for entry in sources:
        entry.unfold()
    moved = {path: place for entry in sources for path, place in entry.moved.items()}
    problems = tuple(document.problem(*problem) for entry in sources for problem in entry.problems)
    if not moved and not problems:
        return Unfolded(document)
    changed: Any = data
    for entry in sources:
        changed, _ = placed(changed, entry.path, entry.data)
    refused = frozenset(entry.path for entry in sources if entry.problems)
    return Unfolded(replace(document, data=changed, moved={**document.moved, **moved}), problems, refused)


def _sources_of(commands: Any, path: KeyPath) -> Iterator[_Entry]:
    entries = _numbered(path, commands) if isinstance(commands, tuple) else [(path, commands)]
    return (_Entry(at, entry) for at, entry in entries)


@dataclass(slots=True)
class _Entry:
    """One command source."""

    path: KeyPath
    data: Any
    moved: dict[KeyPath, KeyPath] = field(default_factory=dict)  # paths of its keys -> their paths in the file
    problems: list[tuple[KeyPath, str]] = field(default_factory=list)

    def unfold(self) -> None:
        """Move the keys of a map next to the name of the source."""
        for name in [key for key, value in self._items() if isinstance(value, dict) and key in COMMANDS]:
            kind = COMMANDS.load(name)
            if kind.map_key is not None:
                inner = self.data[name]
                beside = {key: value for key, value in self._items() if key != name}
                allowed = {kind.map_key, *(field.alias or key for key, field in kind.model_fields.items())} - {name}
                self.problems += self._problems(name, kind.map_key, allowed)
                place = (*self.path, name)
                self.moved |= {(*self.path, name if key == kind.map_key else key): (*place, key) for key in inner}
                self.data = {**beside, **{name if key == kind.map_key else key: value for key, value in inner.items()}}

    def _problems(self, name: str, own: str, allowed: set[str]) -> Iterator[tuple[KeyPath, str]]:
        inner = self.data[name]
        for key in inner:
            if key not in allowed:
                yield (*self.path, name, key), f"unknown key{did_you_mean(key, allowed)}"
            elif key in self.data:
                yield (*self.path, name, key), f"'{key}' is also given next to '{name}'; remove one of the two"
        if own not in inner and allowed.issuperset(inner):  # else it is misspelt
            yield (*self.path, name), f"the key '{own}' is missing"

    def _items(self) -> Iterator[tuple[str, Any]]:
        yield from self.data.items() if isinstance(self.data, dict) else ()


_EGO: Final = "ego"
_BESIDE: Final = ("commands", "sensors")  # the keys that stand next to `robot` in a scenario, and inside an actor


def with_roles(document: Document) -> tuple[Document, tuple[Problem, ...]]:
    """Return a document in which the robot that `ego` names is under test, with the problems of that key.

    The former robot takes its place and its name. So two files share a world with the roles turned round: the second
    one `extends` the first, and expects from its own robot.
    """
    data = document.data
    if not isinstance(data, dict) or _EGO not in data:
        return document, ()
    actors, name = actors_of(data), data[_EGO]
    actor_names = [
        actor["name"] for actor in actors or () if isinstance(actor, dict) and isinstance(actor.get("name"), str)
    ]
    if not isinstance(name, str) or not isinstance(former := data.get("robot"), dict):
        return document, ()  # the reader of keys reports it
    if name not in actor_names:
        hint = did_you_mean(name, actor_names) if actor_names else "; the world has no 'actors'"
        return document, (document.problem((_EGO,), f"there is no robot '{name}' in world.actors{hint}"),)
    index = next(number for number, actor in enumerate(actors) if isinstance(actor, dict) and actor.get("name") == name)
    chosen, at = actors[index], ("world", "actors", index)
    beside = {key: data[key] for key in _BESIDE if key in data}
    if isinstance(former.get("sensors"), str):
        # Standard sensors; others stand next to the robot.
        beside.setdefault("sensors", former["sensors"])
    new_actor = {"name": name, **{key: value for key, value in former.items() if key != "sensors"}, **beside}
    robot = {key: value for key, value in chosen.items() if key not in ("name", *_BESIDE)}
    if isinstance(chosen.get("sensors"), str):
        robot["sensors"] = chosen["sensors"]
    turned = {key: value for key, value in data.items() if key not in _BESIDE}
    turned |= {key: chosen[key] for key in _BESIDE if key in chosen and key not in robot}
    world = {**data["world"], "actors": (*actors[:index], new_actor, *actors[index + 1 :])}
    moved: dict[KeyPath, KeyPath] = {("robot",): at, at: ("robot",), (*at, "name"): (_EGO,)}
    for key in _BESIDE:
        moved |= {(key,): (*at, key), (*at, key): (key,)}
    turned |= {"robot": robot, "world": world}
    return replace(document, data=turned, moved={**document.moved, **moved}), ()
