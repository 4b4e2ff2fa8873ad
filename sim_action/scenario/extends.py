"""The file names in a base of another folder, rewritten as seen from the folder of the document that extends it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, get_args, get_origin

from pydantic import BaseModel

from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.core.field_types import NamesFile
from sim_action.core.records import replace
from sim_action.core.yaml_document import Document
from sim_action.drives import DRIVES
from sim_action.robot.built_in import BUILT_IN
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.variations import Choice, CsvColumn
from sim_action.sensors import SENSORS
from sim_action.world import World

_ACTORS: Final = "world", "actors"
_ANY: Final = "*"
_DEEP: Final = "**"
Pattern = tuple[str, ...]  # a way to a file name: `*` for every key or entry, `**` for any number of them


@cache
def file_keys(*, if_there: bool = False) -> tuple[Pattern, ...]:
    """Return the patterns of all keys that the specs annotate as NamesFile."""
    patterns = [
        *_ways(Robot, if_there, ("robot",)),
        *_ways(World, if_there, ("world",)),
        *_ways_of_robot(if_there, (), ("robot",)),
        *_ways_of_robot(if_there, (*_ACTORS, _ANY), (*_ACTORS, _ANY)),
    ]
    for key in ASSERTIONS:
        spec = ASSERTIONS.load(key)
        ways = list(_ways(spec, if_there, ("expect", _DEEP, key)))
        # Its value may be given directly instead of its keys.
        patterns += [*(way[:-1] for way in ways if way[-1] == spec.bare_value), *ways]
    return tuple(dict.fromkeys(patterns))


def _ways_of_robot(if_there: bool, above: Pattern, robot: Pattern) -> Iterator[Pattern]:
    """Yield the patterns of the drive, the sensors and the commands of a robot; `above`: of the latter two."""
    for key in DRIVES:
        yield from _ways(DRIVES.load(key), if_there, (*robot, "drive", key))
    for key in SENSORS:
        yield from _ways(SENSORS.load(key), if_there, (*above, "sensors", _ANY, key))
    for key in COMMANDS:
        yield from _ways_of_source(key, if_there, (*above, "commands"))
        yield from _ways_of_source(key, if_there, (*above, "commands", _ANY))


def _ways_of_source(key: str, if_there: bool, to: Pattern) -> Iterator[Pattern]:
    """Yield the patterns of a command source, whose keys may also be written in a map below its own key."""
    kind = COMMANDS.load(key)
    for own, *rest in _ways(kind, if_there, ()):
        yield (*to, own, *rest)
        if kind.map_key is not None:
            yield (*to, key, kind.map_key if own == key else own, *rest)


def _ways(model: type[BaseModel], if_there: bool, to: Pattern) -> Iterator[Pattern]:
    for name, field in model.model_fields.items():
        yield from _ways_in(field.annotation, field.metadata, if_there, (*to, field.alias or name))


def _ways_in(annotation: Any, metadata: Iterable[Any], if_there: bool, to: Pattern) -> Iterator[Pattern]:
    """Yield the patterns in a type. Annotations of a list or a map hold for its entries."""
    all_metadata = [*metadata, *getattr(annotation, "__metadata__", ())]
    if annotation is str and NamesFile(if_there) in all_metadata:
        yield to
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield from _ways(annotation, if_there, to)
    origin = get_origin(annotation)
    parts = get_args(annotation)
    if origin is Annotated:
        parts = parts[:1]
    elif origin is dict:
        parts = parts[1:]
    inside = (*to, _ANY) if origin in (tuple, dict) else to
    for part in parts:
        yield from _ways_in(part, all_metadata, if_there, inside)


def seen_from(folder: Path, document: Document, own: Path) -> Document:
    """Return a document of the folder `own` with its file names as seen from another one, `folder`."""

    def moved(name: str) -> str:
        return Path(os.path.relpath(own / name, folder)).as_posix()

    def moved_file(name: str) -> str:
        return moved(name) if _is_relative_file(name, own) else name

    def relocated(data: object) -> object:
        for pattern in file_keys():
            data = _changed(data, pattern, moved_file)
        for pattern in file_keys(if_there=True):
            data = _changed(data, pattern[:-1], _words)
            data = _changed(data, pattern, lambda word: moved(word) if _is_there(word, own) else word)
        return data

    return replace(document, data=_with_variations(relocated(document.data), relocated, moved_file))


def _with_variations(data: object, relocated: Callable[[object], object], moved: Callable[[str], str]) -> object:
    """Return the data with the file names in its variations rewritten."""
    if not isinstance(data, dict) or not isinstance(stated := data.get("variations"), dict):
        return data
    varied = {key: _varied(key.split("."), values, relocated, moved) for key, values in stated.items()}
    return {**data, "variations": varied}


def _varied(
    steps: list[str], values: object, relocated: Callable[[object], object], moved: Callable[[str], str]
) -> object:
    if isinstance(values, tuple):
        return tuple(_led_to(steps, value, relocated) for value in values)
    if not isinstance(values, dict):
        return values
    changed = {key: _varied(steps, values[key], relocated, moved) for key in (Choice.key,) if key in values}
    if isinstance(file := values.get(CsvColumn.key), str):
        changed[CsvColumn.key] = moved(file)
    return {**values, **changed}


def _led_to(steps: list[str], value: object, relocated: Callable[[object], object]) -> object:
    """Return a value rewritten at the end of a key path."""
    whole = value
    for step in reversed(steps):
        whole = {step: whole}
    whole = relocated(whole)
    for step in steps:
        assert isinstance(whole, dict)
        whole = whole[step]
    return whole


def _is_relative_file(name: str, folder: Path) -> bool:
    if "://" in name or Path(name).is_absolute() or not name.isprintable():
        return False
    return "/" in name or "." in name or (name not in BUILT_IN and _is_there(name, folder))


def _words(text: str) -> object:
    """Split a text into words as a command line is split."""
    try:
        import shlex  # only where it is asked for

        return tuple(shlex.split(text))
    except ValueError:
        return text


def _is_there(name: str, folder: Path) -> bool:
    try:
        return not Path(name).is_absolute() and (folder / name).exists()
    except (OSError, ValueError):  # too long, or a NUL in it
        return False


def _changed(data: object, pattern: tuple[str, ...], change: Callable[[str], object]) -> object:
    """Return the data with every text changed that a pattern matches."""
    if not pattern:
        return change(data) if isinstance(data, str) else data
    step, *rest = pattern
    if step == _DEEP:
        data = _changed(data, tuple(rest), change)
        step, rest = _ANY, [_DEEP, *rest]
    if isinstance(data, dict):
        return {
            key: _changed(value, tuple(rest), change) if step in (_ANY, key) else value for key, value in data.items()
        }
    if isinstance(data, tuple) and step == _ANY:
        return tuple(_changed(value, tuple(rest), change) for value in data)
    return data
