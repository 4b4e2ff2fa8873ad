"""Workflow commands: what a runner reads in the log of a step, and does."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from tests.integration.github.errors import UnsupportedFeature

# The runner's own reader ends lines at a lone carriage return, too.
_LINE_END: Final = re.compile(r"\r\n|\n|\r")
_ANNOTATIONS: Final = frozenset({"error", "warning", "notice"})
_HARMLESS: Final = frozenset({"debug", "group", "endgroup"})
_SWITCHED_OFF: Final = frozenset({"set-env", "add-path"})
_UNSUPPORTED: Final = frozenset({"add-mask", "add-matcher", "remove-matcher", "save-state", "echo"})
_REGISTERED: Final = _ANNOTATIONS | _HARMLESS | _SWITCHED_OFF | _UNSUPPORTED | {"set-output", "stop-commands"}
# An escaped per cent sign comes last: what it gives is not an escape.
_DATA_ESCAPES: Final = {"%0D": "\r", "%0A": "\n", "%25": "%"}
_PROPERTY_ESCAPES: Final = {"%0D": "\r", "%0A": "\n", "%3A": ":", "%2C": ",", "%25": "%"}
_LEGACY_ESCAPES: Final = {"%3B": ";", "%0D": "\r", "%0A": "\n", "%5D": "]", "%25": "%"}


@dataclass(frozen=True, slots=True)
class Annotation:
    """A workflow command that GitHub would show beside a line; text as it was before its escaping."""

    level: str
    message: str
    file: str | None
    line: int | None


@dataclass(frozen=True, slots=True)
class Commands:
    """What the log of a step tells the runner.

    Attributes:
        outputs: from set-output, which is deprecated and still obeyed.
        refused: commands that were switched off, and fail the step.
    """

    annotations: tuple[Annotation, ...]
    outputs: Mapping[str, str]
    refused: tuple[str, ...]


def parse_commands(log: str) -> Commands:
    """All commands in what one step printed. Raises UnsupportedFeature."""
    annotations, outputs, refused = [], {}, []
    for command in _obeyed(log):
        if command.name in _UNSUPPORTED:
            raise UnsupportedFeature(f"the workflow command {command.name}")
        if command.name in _ANNOTATIONS:
            annotations.append(_annotation(command))
        if command.name in _SWITCHED_OFF:
            refused.append(command.name)
        if command.name == "set-output":
            outputs[command.properties["name"]] = command.data
    return Commands(tuple(annotations), outputs, tuple(refused))


def parse_annotations(log: str) -> tuple[Annotation, ...]:
    """The annotations in what a step printed; nothing between ::stop-commands::token and ::token:: counts."""
    return parse_commands(log).annotations


def escaped(message: str) -> str:
    """A message on one line, as it is put behind `::error::`."""
    return message.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


@dataclass(frozen=True, slots=True)
class _Command:
    name: str
    properties: Mapping[str, str]
    data: str


def _obeyed(log: str) -> Iterator[_Command]:
    token = ""
    for line in _LINE_END.split(log):
        command = _parsed(line, _REGISTERED | {token})
        if command and token:
            token = "" if command.name == token else token
        elif command and command.name == "stop-commands":
            token = command.data.lower()
        elif command:
            yield command


def _parsed(line: str, registered: frozenset[str]) -> _Command | None:
    return _modern(line.lstrip(), registered) or _legacy(line, registered)


def _modern(line: str, registered: frozenset[str]) -> _Command | None:
    """`::name key=value,key=value::data`."""
    head, separator, data = line.removeprefix("::").partition("::")
    if not line.startswith("::") or not separator:
        return None
    properties = _properties(head, ",", _PROPERTY_ESCAPES)
    return _registered(_Command(_name(head), properties, _unescaped(data, _DATA_ESCAPES)), registered)


def _legacy(line: str, registered: frozenset[str]) -> _Command | None:
    """`##[name key=value;key=value]data`, which counts anywhere in a line."""
    _, opened, rest = line.partition("##[")
    head, closed, data = rest.partition("]")
    if not opened or not closed:
        return None
    properties = _properties(head, ";", _LEGACY_ESCAPES)
    return _registered(_Command(_name(head), properties, _unescaped(data, _LEGACY_ESCAPES)), registered)


def _registered(command: _Command, registered: frozenset[str]) -> _Command | None:
    return command if command.name and command.name in registered else None


def _name(head: str) -> str:
    return head.partition(" ")[0].lower()


def _properties(head: str, separator: str, escapes: Mapping[str, str]) -> dict[str, str]:
    pairs = (pair.split("=", 1) for pair in head.partition(" ")[2].strip().split(separator) if "=" in pair)
    return {key.lower(): _unescaped(value, escapes) for key, value in pairs}


def _annotation(command: _Command) -> Annotation:
    line = command.properties.get("line", "")
    return Annotation(
        level=command.name,
        message=command.data,
        file=command.properties.get("file"),
        line=int(line) if line.isdecimal() else None,
    )


def _unescaped(text: str, escapes: Mapping[str, str]) -> str:
    for escape, character in escapes.items():
        text = text.replace(escape, character)
    return text
