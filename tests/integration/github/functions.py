"""The functions of expressions; those that ask for the status of a run are given by who runs it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.values import Value, are_equal, is_array, is_primitive, to_number, to_text

# From here on, numbers are written with an exponent.
_LARGE: Final = 1e15
_PLACEHOLDER: Final = re.compile(r"\{\{|\}\}|\{(\d+)\}|[{}]")


def contains(search: Value, item: Value) -> Value:
    if is_array(search):
        return any(are_equal(element, item) for element in search)
    return _both_text(search, item) and to_text(item).upper() in to_text(search).upper()


def starts_with(text: Value, start: Value) -> Value:
    return _both_text(text, start) and to_text(text).upper().startswith(to_text(start).upper())


def ends_with(text: Value, end: Value) -> Value:
    return _both_text(text, end) and to_text(text).upper().endswith(to_text(end).upper())


def format_text(template: Value, *arguments: Value) -> Value:
    def value(placeholder: re.Match[str]) -> str:
        if placeholder[0] in {"{{", "}}"}:
            return placeholder[0][0]
        if placeholder[1] is None or int(placeholder[1]) >= len(arguments):
            raise UnsupportedFeature(f"format: {placeholder[0]} in {template!r}")
        return to_text(arguments[int(placeholder[1])])

    return _PLACEHOLDER.sub(value, to_text(template))


def join(items: Value, separator: Value = ",") -> Value:
    if is_array(items):
        return to_text(separator).join(to_text(item) for item in items)
    return to_text(items)


def to_json(value: Value) -> Value:
    return json.dumps(_plain(value), indent=2, ensure_ascii=False, allow_nan=False)


def from_json(text: Value) -> Value:
    try:
        value: Value = json.loads(to_text(text))
    except json.JSONDecodeError as error:
        raise UnsupportedFeature(f"fromJSON of {text!r}: {error}") from error
    return value


@dataclass(frozen=True, slots=True)
class Function:
    """A function, and how many arguments it takes."""

    call: Callable[..., Value]
    least: int
    most: int


FUNCTIONS: Final[Mapping[str, Function]] = {
    "contains": Function(contains, 2, 2),
    "startswith": Function(starts_with, 2, 2),
    "endswith": Function(ends_with, 2, 2),
    "format": Function(format_text, 1, 255),
    "join": Function(join, 1, 2),
    "tojson": Function(to_json, 1, 1),
    "fromjson": Function(from_json, 1, 1),
}


def _both_text(one: Value, other: Value) -> bool:
    return is_primitive(one) and is_primitive(other)


def _plain(value: Value) -> Value:
    if isinstance(value, Mapping):
        return {key: _plain(member) for key, member in value.items()}
    if is_array(value):
        return [_plain(item) for item in value]
    is_whole = isinstance(value, float) and value.is_integer() and abs(value) < _LARGE
    return int(to_number(value)) if is_whole else value
