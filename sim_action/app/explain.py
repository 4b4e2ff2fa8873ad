"""Explain a name that a scenario can use: the text and the keys of its reference page, for a terminal."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final, get_args

import click
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sim_action.app.catalogue import FieldEntry, fields
from sim_action.app.package_parts import package_parts
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass
from sim_action.core.registry import PackageProblem, Table
from sim_action.core.wording import did_you_mean
from sim_action.drives import DRIVES
from sim_action.scenario.model import ExpectationOptions, Scenario
from sim_action.sensors import SENSORS, Mounting
from sim_action.world import World

_TABLES: Final[tuple[Table[Any], ...]] = (ASSERTIONS, COMMANDS, DRIVES, SENSORS)


@dataclass(frozen=True, slots=True)
class _Kind:
    """The place of the names of a table in a file.

    Attributes:
        place: the key above them.
        beside: the model of the keys that may stand next to such a name; None: there are none.
    """

    place: str
    beside: type[BaseModel] | None = None


_KINDS: Final = MappingProxyType(
    {
        "assertion": _Kind("expect", ExpectationOptions),
        "command": _Kind("commands"),
        "drive": _Kind("robot.drive"),
        "sensor": _Kind("sensors", Mounting),
    }
)

_KEYS: Final[Mapping[str, type[BaseModel]]] = MappingProxyType({"scenario": Scenario, "world": World})
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
    found = [table for table in _TABLES if name in table]
    texts = ["\n".join(_of_model(name, _KEYS[name], width))] if name in _KEYS else list(_of_keys(name, width))
    if not found and not texts:
        found = [table for table in _TABLES if name in table.installed()]
    if not found and not texts:
        hint = did_you_mean(name, names())
        raise UsageError(f"no part of a scenario is called '{name}'{hint}; 'sim-action explain' lists all names")
    return "\n\n".join([*("\n".join(_of_table(table, name, width)) for table in found), *texts])


def overview() -> str:
    """Return all names, by their kind."""
    lines = [f"{table.kind}s: {', '.join(table.all_names())}" for table in _TABLES]
    return "\n".join([*lines, f"keys: {', '.join(dict.fromkeys([*_KEYS, *_single_keys()]))}"])


def _of_table(table: Table[Any], name: str, width: int) -> Iterator[str]:
    kind, (model, origin) = _KINDS[table.kind], _loaded(table, name)
    yield f"{click.style(name, bold=True)}: {table.kind}{origin}, below {kind.place}"
    yield from _text(model, width)
    yield from _keys("keys", fields(model), width)
    if kind.beside is not None:
        yield from _keys(f"keys beside '{name}'", fields(kind.beside), width)


def _loaded(table: Table[Any], name: str) -> tuple[type[BaseModel], str]:
    """Return the class of a name, and the package that it is of as text. Raise UsageError if there is no class."""
    if name in table:
        return table.load(name), ""
    part, found = next(each for each in package_parts(table) if each[0].name == name)
    if isinstance(found, PackageProblem):
        raise UsageError(str(found))
    return found, f" of {part.package}"


def _of_model(name: str, model: type[BaseModel], width: int) -> Iterator[str]:
    yield f"{click.style(name, bold=True)}: keys"
    yield from _text(model, width)
    yield from _keys("keys", fields(model), width)


def _of_keys(name: str, width: int) -> Iterator[str]:
    """Yield a text for each place where a single key has this name."""
    for place, model in _KEYS.items():
        for entry, field in zip(fields(model), _by_entry(model), strict=True):
            if entry.name == name:
                yield "\n".join(_of_key(place, entry, field, width))


def _by_entry(model: type[BaseModel]) -> Iterator[FieldInfo]:
    named = {field.alias or name: field for name, field in model.model_fields.items()}
    yield from (named[entry.name] for entry in fields(model))


def _of_key(place: str, entry: FieldEntry, field: FieldInfo, width: int) -> Iterator[str]:
    where = "a scenario" if place == "scenario" else place
    yield f"{click.style(entry.name, bold=True)}: key of {where}"
    yield from _keys("key", (entry,), width)
    for model in _models_in(field.annotation):
        yield from _text(model, width)
        yield from _keys(f"keys below '{entry.name}'", fields(model), width)


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models of keys in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


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


def _keys(title: str, entries: tuple[FieldEntry, ...], width: int) -> Iterator[str]:
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
