"""Scenarios that a program builds, or reads from files and changes.

They go the same way as files: each is a YAML document, which is checked when it is used.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path, PurePath
from typing import Any, Final

import yaml

from sim_action.assertions import Assertion
from sim_action.assertions.combined import Combined
from sim_action.core.errors import InvalidScenario, Location, UsageError
from sim_action.core.field_types import FrozenModel, is_title
from sim_action.core.permissions import Permissions
from sim_action.core.records import replace
from sim_action.core.wording import shown
from sim_action.core.yaml_document import (
    MAX_DEPTH,
    Document,
    KeyPath,
    NoSuchKey,
    is_plain_text,
    placed,
    plain_data,
    read_document,
    resolved,
)
from sim_action.drives import Drive
from sim_action.scenario.files import numbered_runs, workspace_around
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.gate import GATE
from sim_action.sensors import Sensor

_LINE_ENDS: Final = frozenset("\x85\u2028\u2029")
_UNNAMED: Final = "scenario"
_VALUE: Final = "value"
_WIDTH: Final = 1 << 20  # longer lines are folded, and a place in a folded text is hard to find


class Scenario:
    """A scenario of a program, with the keys of a scenario file.

    Values are what YAML has (text, numbers, booleans, None, lists, maps), paths, or parts such as
    `sim_action.parts.Travel`. Numbers without a unit are in SI units. `validate` and `run` check the scenario.

    `scenario.model.Scenario` is what a checked document becomes.

    Example:
        Scenario(
            name="burger drives",
            robot={"model": "turtlebot3_burger"},
            commands={"twist": [{"linear": 0.5}]},
            expect=[Travel(at_least=1.5)],
            time_limit=30,
        )
    """

    __slots__ = ("_source",)

    def __init__(self, *, folder: str | os.PathLike[str] = ".", **keys: object) -> None:
        """Build a scenario.

        Raises InvalidScenario for a value that YAML does not have. `folder`: relative paths in the scenario start here;
        `keys`: as in a scenario file.
        """
        name = keys.get("name")
        name = name if isinstance(name, str) and is_title(name) else _UNNAMED
        label = f"{name.replace('/', '-')} (Python)"
        document = read_document(label, _yaml(_plain(keys, label, ())))
        # The call that runs it knows the permissions.
        path = Path(folder) / label
        self._source = Source(path, workspace_around(path, Permissions(outside=True)), document, name)

    @classmethod
    def of(cls, source: Source) -> Scenario:
        """Return a scenario of a file."""
        scenario = cls.__new__(cls)
        scenario._source = source  # noqa: SLF001 - its own class
        return scenario

    @property
    def name(self) -> str:
        """The name in reports; a variation has its values in it."""
        return self._source.name

    @property
    def tags(self) -> tuple[str, ...]:
        """The tags."""
        return self._source.tags

    @property
    def gate(self) -> str | None:
        """The name of the gate that judges it together with others, if `load` has read it as a run of one."""
        return None if self._source.gate is None else self._source.gate.name

    @property
    def path(self) -> Path:
        """The path of its file; of a scenario without a file, its name in the folder of its relative paths."""
        return self._source.path

    @property
    def line(self) -> int | None:
        """The first line in its file; None if the file has one scenario."""
        return self._source.line

    @property
    def keys(self) -> dict[str, Any]:
        """A copy of all keys, as YAML has them, with the keys of files that it extends."""
        copy: dict[str, Any] = plain_data(self._keys)
        return copy

    def changed(self, changes: Mapping[str, object]) -> Scenario:
        """Return the scenario with other values.

        `changes`: key path, as in `variations`, such as "robot.pose.yaw" -> value. Raises InvalidScenario for a path
        that leads nowhere, UsageError for anything but a map of key paths.
        """
        if not isinstance(changes, Mapping) or not all(isinstance(written, str) for written in changes):
            raise UsageError(f"changes: expected a map of key paths to values, found {shown(changes)}")
        document = self._source.document
        for written, value in changes.items():
            try:
                path = resolved(document.data, written)
            except NoSuchKey as error:
                raise InvalidScenario([document.problem((), f"{written}: {error}")]) from None
            data, made = placed(document.data, path, _read(document.file, {_VALUE: value})[_VALUE])
            place = document.location(path)
            document = replace(document, data=data, marks={**document.marks, **dict.fromkeys(made, place)})
        name = changes.get("name", self.name)
        return self.of(replace(self._source, document=document, name=name if isinstance(name, str) else self.name))

    def to_yaml(self) -> str:
        """Return the text of a file with this scenario alone; relative paths start in the folder of `path`."""
        return _yaml({**self.keys, "name": self.name})

    def sources(self, permissions: Permissions, seed: int | None = None) -> tuple[Source | Refused, ...]:
        """Return its variations, or itself, for a call with these permissions; `seed` draws the variations."""
        try:
            own = replace(self._source, workspace=workspace_around(self.path, permissions))
            return numbered_runs([own], seed) if self._keys.keys() & {"variations", GATE} else (own,)
        except InvalidScenario as error:
            return (self._source.refused(error),)

    @property
    def _keys(self) -> dict[str, Any]:
        data = self._source.document.data
        assert isinstance(data, dict)  # checked when it was made
        return data

    def __repr__(self) -> str:
        return f"Scenario(name={self.name!r}, path={str(self.path)!r})"


def _read(label: str, keys: Mapping[str, object]) -> dict[str, Any]:
    data = read_document(label, _yaml(_plain(keys, label, ()))).data
    assert isinstance(data, dict)
    return data


def _yaml(data: object) -> str:
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=_WIDTH)


class _Dumper(yaml.SafeDumper):
    """A writer of YAML 1.2: `1e3` and `0o7` without quotes are numbers there, and texts for PyYAML."""


def _written_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    # Some parsers of YAML fold the line ends of Unicode, in quotes also.
    style = None if is_plain_text(text) and _LINE_ENDS.isdisjoint(text) else '"'
    return dumper.represent_scalar(yaml.resolver.BaseResolver.DEFAULT_SCALAR_TAG, text, style=style)


_Dumper.add_representer(str, _written_text)


def _plain(value: object, label: str, path: KeyPath) -> object:
    """Return a value as plain YAML data. Raise InvalidScenario for one that YAML does not have."""
    if len(path) > MAX_DEPTH:
        raise _refused(f"more than {MAX_DEPTH} nested maps and lists", label, path[:1])
    if hasattr(value, "tolist"):
        # Arrays, numbers and truth values of numpy, which is not imported for this.
        value = value.tolist()
    if isinstance(value, FrozenModel):
        own = _keys_of(value, label, path)
        name = _part_key(value)
        return own if name is None else {name: own}
    if isinstance(value, Mapping):
        return {_key(key, label, path): _below(key, part, label, (*path, str(key))) for key, part in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [_plain(part, label, (*path, index)) for index, part in enumerate(value)]
    return value.as_posix() if isinstance(value, PurePath) else _scalar(value, label, path)


def _part_key(value: object) -> str | None:
    return value.key if isinstance(value, Assertion | Drive | Sensor) else None


def _below(key: object, value: object, label: str, path: KeyPath) -> object:
    if isinstance(value, FrozenModel) and key == _part_key(value):
        return _keys_of(value, label, path)
    return _plain(value, label, path)


def _keys_of(part: FrozenModel, label: str, path: KeyPath) -> object:
    """Return what stands below the key of a part: the fields that were given."""
    if isinstance(part, Combined):
        parts = [_plain(nested, label, (*path, *place)) for place, nested in part.placed_parts]
        return parts if part.placed_parts[0][0] else parts[0]
    return {
        field.alias or name: _plain(getattr(part, name), label, (*path, name))
        for name, field in type(part).model_fields.items()
        if name in part.model_fields_set
    }


def _scalar(value: object, label: str, path: KeyPath) -> object:
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value)
    raise _refused(f"expected text, a number, a list, a map or a part of a scenario, found {value!r}", label, path)


def _key(key: object, label: str, path: KeyPath) -> str:
    if isinstance(key, str):
        return key
    raise _refused(f"a key is text, found {key!r}", label, path)


def _refused(message: str, label: str, path: KeyPath) -> InvalidScenario:
    return InvalidScenario([Document(label, None, {path: Location(label)}).problem(path, message)])
