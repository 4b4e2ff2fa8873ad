"""What a step tells the runner: workflow commands in its log, and entries of GITHUB_OUTPUT and GITHUB_ENV."""

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
_UNSUPPORTED: Final = frozenset(
    {"add-mask", "add-matcher", "remove-matcher", "save-state", "echo", "set-output", "set-env", "add-path"}
)
_REGISTERED: Final = _ANNOTATIONS | _HARMLESS | _UNSUPPORTED | {"stop-commands"}
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


def parse_annotations(log: str) -> tuple[Annotation, ...]:
    """The annotations in what one step printed. Raises UnsupportedFeature for commands that do more.

    Nothing between ::stop-commands::token and ::token:: counts.
    """
    commands = list(_obeyed(log))
    if unsupported := [command.name for command in commands if command.name in _UNSUPPORTED]:
        raise UnsupportedFeature(f"the workflow command {unsupported[0]}")
    return tuple(_annotation(command) for command in commands if command.name in _ANNOTATIONS)


def parse_outputs(text: str) -> dict[str, str]:
    """What a GITHUB_OUTPUT or GITHUB_ENV file says: `name=value` lines and heredocs. Raises ValueError."""
    outputs = {}
    lines = iter(text.removesuffix("\n").split("\n"))
    for line in lines:
        if line:
            name, value = _entry(line, lines)
            outputs[name] = value
    return outputs


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


def _entry(line: str, lines: Iterator[str]) -> tuple[str, str]:
    name, equals, value = line.partition("=")
    key, heredoc, delimiter = line.partition("<<")
    # Whichever sign comes first says what it is.
    if heredoc and len(key) < len(name) and key and delimiter:
        return key, "\n".join(_until(delimiter, lines))
    if equals and name and len(name) < len(key):
        return name, value
    raise ValueError(f"neither name=value nor name<<delimiter: {line!r}")


def _until(delimiter: str, lines: Iterator[str]) -> Iterator[str]:
    for line in lines:
        if line == delimiter:
            return
        yield line
    raise ValueError(f"no closing {delimiter!r}")
