"""List the assertions, commands, drives, sensors and models that a scenario can name, with their fields and units."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, get_args, get_origin

import click
from pydantic import BaseModel, JsonValue
from pydantic.fields import FieldInfo

from sim_action.app.package_parts import package_parts
from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.commands import COMMANDS
from sim_action.core import units
from sim_action.core.field_types import Quantity, Without, bounds_text
from sim_action.core.records import dataclass
from sim_action.core.registry import PackageProblem, Table
from sim_action.drives import DRIVES
from sim_action.robot.built_in import BUILT_IN
from sim_action.scenario.model import Expectation
from sim_action.sensors import SENSORS, MountedSensor

_PARTS: Final[Mapping[Any, str]] = MappingProxyType(
    {Assertion: "assertion", Expectation: "expectation", MountedSensor: "sensor"}
)


@dataclass(frozen=True, slots=True)
class FieldEntry:
    """One key: what it takes, in words; its default as people would write it, "required" if it has none."""

    name: str
    takes: str
    default: str
    description: str


@dataclass(frozen=True, slots=True)
class Entry:
    """One thing that a scenario can name."""

    name: str
    summary: str
    fields: tuple[FieldEntry, ...] = ()


def assertions() -> tuple[Entry, ...]:
    """Return the assertions for `expect:`."""
    return tuple(_entry(name, ASSERTIONS.load(name)) for name in ASSERTIONS)


def commands() -> tuple[Entry, ...]:
    """Return the command sources for `commands:`."""
    return tuple(_entry(name, COMMANDS.load(name)) for name in COMMANDS)


def drives() -> tuple[Entry, ...]:
    """Return the drives for `robot.drive:`."""
    return tuple(_entry(name, DRIVES.load(name)) for name in DRIVES)


def sensors() -> tuple[Entry, ...]:
    """Return the sensors for `sensors:`."""
    return tuple(_entry(name, SENSORS.load(name)) for name in SENSORS)


def of_packages(table: Table[Any]) -> tuple[Entry, ...]:
    """Return what installed packages add to a table; a part that cannot be used has the reason as its summary."""
    return tuple(
        Entry(part.name, str(found))
        if isinstance(found, PackageProblem)
        else Entry(part.name, f"{summary(found)} (of {part.package})", fields(found))
        for part, found in package_parts(table)
    )


def models() -> tuple[Entry, ...]:
    """The robots that need no path."""
    return tuple(Entry(name, summary) for name, summary in BUILT_IN.items())


def _entry(name: str, model: type[BaseModel]) -> Entry:
    return Entry(name, summary(model), fields(model))


def summary(model: type[BaseModel]) -> str:
    """The docstring's first paragraph, on one line."""
    return " ".join((inspect.getdoc(model) or "").split("\n\n")[0].split())


def fields(model: type[BaseModel]) -> tuple[FieldEntry, ...]:
    """The keys of a model, those that are required first, and those that many models share last."""
    last = getattr(model, "last_keys", ())
    entries = [
        FieldEntry(
            field.alias or name, _takes(field.annotation, field.metadata), _default(field), field.description or ""
        )
        for name, field in model.model_fields.items()
    ]
    return tuple(sorted(entries, key=lambda entry: (entry.default != "required", entry.name in last)))


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
        return _keys(annotation, metadata)
    plain: dict[Any, str] = {str: "text", bool: "true or false", int: "whole number", float: "number", Any: "anything"}
    return plain.get(Any if annotation == JsonValue else annotation, str(annotation))


def _keys(model: type[BaseModel], metadata: Iterable[Any]) -> str:
    refused = {name for item in metadata if isinstance(item, Without) for name in item.names}
    return f"{{{', '.join(entry.name for entry in fields(model) if entry.name not in refused)}}}"


def _kind(dimensions: tuple[units.Dimension, ...]) -> str:
    symbols = [dimension.si for dimension in dimensions if dimension.si]
    if len(dimensions) > 1:
        return f"number ({', '.join(symbols)}, rad or m by joint type)"
    return f"{dimensions[0].name} ({symbols[0]})" if symbols else "number"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if isinstance(value, float):
        quantity = next((item for item in field.metadata if isinstance(item, Quantity)), None)
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
    for field in entry.fields:
        default = f"  [{field.default}]" if field.default else ""
        description = f"  {field.description}" if field.description else ""
        yield f"    {field.name}: {field.takes}{default}{description}"
