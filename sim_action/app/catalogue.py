"""List the assertions, commands, drives, sensors and models that a scenario can name, with their fields and units."""

from __future__ import annotations

import inspect
import itertools
import os
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Literal, get_args, get_origin

import click
from pydantic import BaseModel, JsonValue
from pydantic.fields import FieldInfo

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.commands import COMMANDS
from sim_action.core import units
from sim_action.core.errors import UsageError
from sim_action.core.field_types import Quantity, Without, bounds_text
from sim_action.core.permissions import scripts_refused
from sim_action.core.records import dataclass, field
from sim_action.core.registry import InstalledPart, PackageProblem, Table
from sim_action.core.version import __version__
from sim_action.core.wording import did_you_mean
from sim_action.drives import DRIVES
from sim_action.robot.built_in import BUILT_IN
from sim_action.scenario.model import Expectation, ExpectationOptions, Scenario
from sim_action.sensors import SENSORS, MountedSensor, Mounting
from sim_action.world import World


def package_parts(table: Table[Any]) -> Iterator[tuple[InstalledPart, type[BaseModel] | PackageProblem]]:
    """Yield the parts of installed packages, each with its class, or the reason why it is not imported."""
    refused = scripts_refused("auto", os.environ, (Path.cwd(),)) if table.installed() else None
    for name, part in table.installed().items():
        try:
            yield part, PackageProblem(f"{part} is not imported: {refused}") if refused else table.load(name)
        except PackageProblem as problem:
            yield part, problem


_PARTS: Final[Mapping[Any, str]] = {Assertion: "assertion", Expectation: "expectation", MountedSensor: "sensor"}


@dataclass(frozen=True, slots=True)
class FieldEntry:
    """One key: what it takes, in words; its default as people would write it, "required" if it has none."""

    name: str
    takes: str
    default: str
    description: str
    annotation: Any = field(default=None, compare=False, repr=False)  # its type


@dataclass(frozen=True, slots=True)
class Entry:
    """One thing that a scenario can name."""

    name: str
    summary: str
    fields: tuple[FieldEntry, ...] = ()


def entries(table: Table[Any]) -> tuple[Entry, ...]:
    """Return the names of a table of sim-action itself."""
    return tuple(Entry(name, summary(table.load(name)), fields(table.load(name))) for name in table)


def of_packages(table: Table[Any]) -> tuple[Entry, ...]:
    """Return what installed packages add to a table; a part that cannot be used has the reason as its summary."""
    return tuple(
        Entry(part.name, str(kind))
        if isinstance(kind, PackageProblem)
        else Entry(part.name, f"{summary(kind)} (of {part.package})", fields(kind))
        for part, kind in package_parts(table)
    )


def models() -> tuple[Entry, ...]:
    """The robots that need no path."""
    return tuple(Entry(name, summary) for name, summary in BUILT_IN.items())


def summary(model: type[BaseModel]) -> str:
    """The docstring's first paragraph, on one line."""
    return " ".join((inspect.getdoc(model) or "").split("\n\n")[0].split())


def fields(model: type[BaseModel]) -> tuple[FieldEntry, ...]:
    """Return the keys of a model: required keys first, keys that many models share last."""
    last = getattr(model, "last_keys", ())
    rows = [
        FieldEntry(
            one.alias or name,
            _takes(one.annotation, one.metadata),
            _default(one),
            one.description or "",
            one.annotation,
        )
        for name, one in model.model_fields.items()
    ]
    return tuple(sorted(rows, key=lambda entry: (entry.default != "required", entry.name in last)))


def key_rows(
    model: type[BaseModel], above: str = "", shown: set[type[BaseModel]] | None = None
) -> Iterator[FieldEntry]:
    """Yield each key and the keys below it, except the keys of assertions and of models in `shown`."""
    shown = set() if shown is None else shown
    for entry in fields(model):
        below = [
            nested
            for nested in _models_below(entry.annotation)
            if nested[0] not in shown and not _is_assertion(nested[0])
        ]
        takes = re.sub(r"\{[\w, ]*\}", "map", entry.takes) if below else entry.takes
        yield FieldEntry(f"{above}{entry.name}", takes, entry.default, entry.description)
        for inner, step, refused in below:
            shown.add(inner)
            start = f"{above}{entry.name}{step}."
            names = tuple(f"{start}{name}{end}" for name in refused for end in (" ", ".", "["))
            yield from (row for row in key_rows(inner, start, shown) if not f"{row.name} ".startswith(names))


_STEPS: Final[Mapping[object, str]] = {tuple: "[]", dict: ".NAME"}
"""A container -> the step from it to an entry, as lists of keys show it."""


def _models_below(
    annotation: Any, step: str = "", refused: frozenset[str] = frozenset()
) -> Iterator[tuple[type[BaseModel], str, frozenset[str]]]:
    """Yield the models in a type, each with the step to it and the keys that it does not take there."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, step, refused
    step = step or _STEPS.get(get_origin(annotation), "")
    for item in getattr(annotation, "__metadata__", ()):
        refused |= item.names if isinstance(item, Without) else frozenset()
    for part in get_args(annotation):
        yield from _models_below(part, step, refused)


def _is_assertion(model: type[BaseModel]) -> bool:
    return any(issubclass(model, ASSERTIONS.load(name)) for name in ASSERTIONS)


def _takes(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    bounds = bounds_text(annotation, metadata)
    return f"{_kind_of(annotation, metadata)}{bounds and f', {bounds}'}"


def _kind_of(annotation: Any, metadata: Iterable[Any]) -> str:  # noqa: PLR0911 - one line a kind of annotation
    for item in metadata:
        if isinstance(item, Quantity):
            return _kind(item.dimensions)
    parts = [part for part in get_args(annotation) if part not in (type(None), ...)]
    if hasattr(annotation, "__metadata__"):
        return _kind_of(parts[0], annotation.__metadata__)
    if get_origin(annotation) is Literal:
        return " or ".join(str(part) for part in parts)
    if get_origin(annotation) is tuple:
        several = get_args(annotation)[-1] is ...
        return f"list of {_takes(parts[0])}" if several else f"[{', '.join(_takes(part) for part in parts)}]"
    if get_origin(annotation) in (dict, Mapping):
        return f"map of name to {_takes(parts[1])}"
    if parts:
        return " or ".join(_takes(part) for part in parts)
    if (name := _PARTS.get(annotation)) is not None:
        return name
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        refused = {name for item in metadata if isinstance(item, Without) for name in item.names}
        return f"{{{', '.join(entry.name for entry in fields(annotation) if entry.name not in refused)}}}"
    plain: dict[Any, str] = {str: "text", bool: "true or false", int: "whole number", float: "number", Any: "anything"}
    return plain.get(Any if annotation == JsonValue else annotation, str(annotation))


def _kind(dimensions: tuple[units.Dimension, ...]) -> str:
    symbols = [dimension.si for dimension in dimensions if dimension.si]
    if len(dimensions) > 1:
        return f"number ({', '.join(symbols)}, rad or m by joint type)"
    return f"{dimensions[0].name} ({symbols[0]})" if symbols else "number"


def _default(info: FieldInfo) -> str:
    if info.is_required():
        return "required"
    value = info.get_default(call_default_factory=True)
    if isinstance(value, float):
        quantity = next((item for item in info.metadata if isinstance(item, Quantity)), None)
        return units.display(value, quantity.dimensions[0].si if quantity else "")
    if isinstance(value, bool):
        return str(value).lower()
    return "" if value in (None, (), {}) or isinstance(value, BaseModel) else str(value)


def listing(entries: Iterable[Entry]) -> str:
    """Each entry with its fields below it."""
    return "\n".join(line for entry in entries for line in _lines(entry))


def _lines(entry: Entry) -> Iterator[str]:
    yield click.style(entry.name, bold=True)
    yield f"  {entry.summary}"
    for key in entry.fields:
        default = f"  [{key.default}]" if key.default else ""
        description = f"  {key.description}" if key.description else ""
        yield f"    {key.name}: {key.takes}{default}{description}"


_MAX_GUIDE_KEYS: Final = 16  # a part with more keys has only its required ones in the guide

_LEFT_TO_EXPLAIN: Final = (
    *("world.actors[].", "world.objects[].pace[].", "world.objects[].surface_velocity.", "events"),
    *("agreement", "allow", "commands", "environment", "expect", "extends", "memory_limit", "name", "output_limit"),
    *("robot.allow", "robot.args", "robot.keyframe", "robot.packages", "robot.srdf", "scenarios", "sensors", "tags"),
    *("trace", "unexercised", "version", "wall_limit", "gate.stop_early", "gate.quantile", "gate.errors"),
    *("confidence", "ego", "engines", "inconclusive", "physics.max_", "physics.speculative"),
    *("world.file", "world.robot", "world.objects[].inertia"),
    *("world.objects[].shapes", "world.objects[].mesh.", "world.objects[].map.", "world.objects[].heightfield."),
    *("world.objects[].center", "world.objects[].color", "world.objects[].ramp.", "world.objects[].stairs."),
)
"""Beginnings of keys of a scenario that are not in the guide."""

_SHORTER: Final = re.compile(
    r", (?:-?[\d.,e-]+ to|at most|at least|less than) [\d.,]+(?: [A-Za-z^/23]+)?|(?<=[a-z]) \([^,()]*\)"
)
"""Bounds and units in what a key takes."""


def guide() -> str:
    """Return the compact reference for programs that write scenarios: rules, examples, and parts with their keys."""
    text = Path(__file__).with_name("guide.md").read_text(encoding="utf-8").replace("VERSION", __version__)
    seen: set[FieldEntry] = set()
    rows = (row for row in key_rows(Scenario) if not row.name.startswith(_LEFT_TO_EXPLAIN))
    lines = [text, *_guide_rows(rows, seen)]
    for table in (ASSERTIONS, COMMANDS, SENSORS):
        kind = _KINDS[table.kind]
        lines.append(f"\n## {table.kind.capitalize()}s, below `{kind.place}`\n")
        lines += ["Beside each:", *_guide_rows(fields(kind.beside), seen)] if kind.beside else []
        for name in table:
            model = table.load(name)
            listed = list(key_rows(model))
            few = [row for row in listed if row.default == "required" or len(listed) <= _MAX_GUIDE_KEYS]
            lines += [f"\n**{name}**: {summary(model)}", *_guide_rows(few, seen)]
            lines += [f"More: `sim-action explain {name}`."] * (len(few) < len(listed))
    return "\n".join(lines)


def _guide_rows(rows: Iterable[FieldEntry], seen: set[FieldEntry]) -> Iterator[str]:
    """Yield one line for adjacent keys that take the same values; keys in `seen` have only their names."""
    for is_known, group in itertools.groupby(dict.fromkeys(rows), seen.__contains__):
        if is_known:
            yield f"{', '.join(row.name for row in group)} as above"
            continue
        for (takes, default, meaning), same in itertools.groupby(
            group, lambda row: (row.takes, row.default, row.description)
        ):
            alike = list(same)
            seen.update(alike)
            stated = {"": "", "required": " (required)"}.get(default, f" = {default}")
            shown = f"{', '.join(row.name for row in alike)}: {_SHORTER.sub('', takes)}{stated}"
            yield f"{shown}; {meaning}" if meaning else shown


_TABLES: Final[tuple[Table[Any], ...]] = (ASSERTIONS, COMMANDS, DRIVES, SENSORS)


@dataclass(frozen=True, slots=True)
class _Kind:
    """The place of the names of a table in a file."""

    place: str  # the key above them
    # the model of the keys that may stand next to such a name; None: there are none
    beside: type[BaseModel] | None = None


_KINDS: Final = {
    "assertion": _Kind("expect", ExpectationOptions),
    "command": _Kind("commands"),
    "drive": _Kind("robot.drive"),
    "sensor": _Kind("sensors", Mounting),
}

_KEYS: Final[Mapping[str, type[BaseModel]]] = {"scenario": Scenario, "world": World}
"""Other names -> the model whose keys are explained, together and each alone."""

_INDENT: Final = "  "
_LIST_ITEM: Final = re.compile(r"\n(?=- )")


def names() -> list[str]:
    """Return all names that can be explained."""
    return list(dict.fromkeys([*(name for table in _TABLES for name in table.all_names()), *_KEYS, *_single_keys()]))


def _single_keys() -> Iterator[str]:
    for model in _KEYS.values():
        yield from (entry.name for entry in fields(model))


def explanation(name: str, width: int) -> str:
    """Return the explanation of a name in lines of at most `width` columns. Raise UsageError for an unknown name."""
    tables = [table for table in _TABLES if name in table]
    texts = ["\n".join(_of_model(name, _KEYS[name], width))] if name in _KEYS else list(_of_keys(name, width))
    if not tables and not texts:
        tables = [table for table in _TABLES if name in table.installed()]
    if not tables and not texts:
        hint = did_you_mean(name, names())
        raise UsageError(f"no part of a scenario is called '{name}'{hint}; 'sim-action explain' lists all names")
    return "\n\n".join([*("\n".join(_of_table(table, name, width)) for table in tables), *texts])


def overview() -> str:
    """Return all names, by their kind."""
    lines = [f"{table.kind}s: {', '.join(table.all_names())}" for table in _TABLES]
    return "\n".join([*lines, f"keys: {', '.join(dict.fromkeys([*_KEYS, *_single_keys()]))}"])


def _of_table(table: Table[Any], name: str, width: int) -> Iterator[str]:
    kind, (model, origin) = _KINDS[table.kind], _loaded(table, name)
    yield f"{click.style(name, bold=True)}: {table.kind}{origin}, below {kind.place}"
    yield from _text(model, width)
    yield from _key_lines("keys", fields(model), width)
    if kind.beside is not None:
        yield from _key_lines(f"keys beside '{name}'", fields(kind.beside), width)


def _loaded(table: Table[Any], name: str) -> tuple[type[BaseModel], str]:
    """Return the class of a name, and the package that it is of as text. Raise UsageError if there is no class."""
    if name in table:
        return table.load(name), ""
    part, kind = next(entry for entry in package_parts(table) if entry[0].name == name)
    if isinstance(kind, PackageProblem):
        raise UsageError(str(kind))
    return kind, f" of {part.package}"


def _of_model(name: str, model: type[BaseModel], width: int) -> Iterator[str]:
    yield f"{click.style(name, bold=True)}: keys"
    yield from _text(model, width)
    yield from _key_lines("keys", fields(model), width)


def _of_keys(name: str, width: int) -> Iterator[str]:
    """Yield a text for each place where a single key has this name."""
    for place, model in _KEYS.items():
        for entry in fields(model):
            if entry.name == name:
                yield "\n".join(_of_key(place, entry, width))


def _of_key(place: str, entry: FieldEntry, width: int) -> Iterator[str]:
    where = "a scenario" if place == "scenario" else place
    yield f"{click.style(entry.name, bold=True)}: key of {where}"
    yield from _key_lines("key", (entry,), width)
    for model, *_ in _models_below(entry.annotation):
        yield from _text(model, width)
        yield from _key_lines(f"keys below '{entry.name}'", fields(model), width)


def _text(model: type[BaseModel], width: int) -> Iterator[str]:
    """Yield the docstring, paragraph by paragraph; an example keeps its lines."""
    for paragraph in (inspect.getdoc(model) or "").split("\n\n"):
        yield ""
        if paragraph.startswith(" "):
            yield from textwrap.indent(paragraph, _INDENT).splitlines()
            continue
        for item in _LIST_ITEM.split(paragraph):
            later = _INDENT * 2 if item.startswith("- ") else _INDENT
            yield from _wrapped(" ".join(item.split()), width, _INDENT, later)


def _key_lines(title: str, entries: tuple[FieldEntry, ...], width: int) -> Iterator[str]:
    if not entries:
        return
    yield f"\n{_INDENT}{click.style(title, bold=True)}"
    for entry in entries:
        default = f" [{entry.default}]" if entry.default else ""
        yield from _wrapped(f"{entry.name}: {entry.takes}{default}", width, _INDENT * 2, _INDENT * 4)
        if entry.description:
            yield from _wrapped(entry.description, width, _INDENT * 4)


def _wrapped(text: str, width: int, indent: str, later: str | None = None) -> list[str]:
    return textwrap.wrap(
        text,
        max(width, 2 * len(indent)),
        initial_indent=indent,
        subsequent_indent=indent if later is None else later,
        break_long_words=False,
        break_on_hyphens=False,
    )
