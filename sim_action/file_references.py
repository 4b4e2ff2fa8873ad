"""The keys of a scenario that name files, for files that are read on behalf of a scenario in another folder."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

from sim_action.models import BUILT_IN
from sim_action.yaml_document import Document

_ANY: Final = "*"
_DEEP: Final = "**"

FILE_KEYS: Final[tuple[tuple[str, ...], ...]] = (
    ("robot", "model"),
    ("robot", "packages", _ANY),
    ("world", "objects", _ANY, _ANY, "file"),
    ("world", "objects", _ANY, _ANY, "image"),
    ("commands", "script"),
    ("commands", _ANY, "script"),
    ("commands", "replay"),
    ("commands", _ANY, "replay"),
    ("expect", _DEEP, "assertion"),
    ("expect", _DEEP, "follow_path", "file"),
    ("expect", _DEEP, "assertion", "class"),
)
"""Each way to a file name, `*` for every key or entry, `**` for any number of them. New keys of files belong here."""

WORD_KEYS: Final[tuple[tuple[str, ...], ...]] = (("commands", "process", _ANY), ("commands", _ANY, "process", _ANY))
"""Each way to what may be the name of a file, and is one if there is such a file."""


def seen_from(folder: Path, document: Document, own: Path) -> Document:
    """The document as it would be written in `folder`, of one that lies in the folder `own`."""
    if folder == own:
        return document

    def moved(name: str) -> str:
        return Path(os.path.relpath(own / name, folder)).as_posix()

    def relocated(data: object) -> object:
        for pattern in FILE_KEYS:
            data = _changed(data, pattern, lambda name: moved(name) if _is_relative_file(name, own) else name)
        for pattern in WORD_KEYS:
            data = _changed(data, pattern[:-1], _words)
            data = _changed(data, pattern, lambda word: moved(word) if _is_there(word, own) else word)
        return data

    return replace(document, data=_with_variations(relocated(document.data), relocated))


def _with_variations(data: object, relocated: Callable[[object], object]) -> object:
    """The data with the values of its variations changed as they would be where their keys lead."""
    if not isinstance(data, dict) or not isinstance(stated := data.get("variations"), dict):
        return data
    varied = {key: _varied(key.split("."), values, relocated) for key, values in stated.items()}
    return {**data, "variations": varied}


def _varied(steps: list[str], values: object, relocated: Callable[[object], object]) -> object:
    return tuple(_led_to(steps, value, relocated) for value in values) if isinstance(values, tuple) else values


def _led_to(steps: list[str], value: object, relocated: Callable[[object], object]) -> object:
    """A value as it is changed at the end of a way."""
    whole = value
    for step in reversed(steps):
        whole = {step: whole}
    whole = relocated(whole)
    for step in steps:
        assert isinstance(whole, dict)
        whole = whole[step]
    return whole


def _is_relative_file(name: str, folder: Path) -> bool:
    """Else it is an address, the name of a robot that is built in, or a misspelt one."""
    if "://" in name or Path(name).is_absolute() or not name.isprintable():
        return False
    return "/" in name or "." in name or (name not in BUILT_IN and _is_there(name, folder))


def _words(text: str) -> object:
    """As the command takes text apart."""
    try:
        return tuple(shlex.split(text))
    except ValueError:
        return text


def _is_there(name: str, folder: Path) -> bool:
    try:
        return not Path(name).is_absolute() and (folder / name).exists()
    except (OSError, ValueError):  # too long, or a NUL in it
        return False


def _changed(data: object, pattern: tuple[str, ...], change: Callable[[str], object]) -> object:
    """The data with every text changed that a pattern leads to."""
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
