"""What expressions are about: their values, and how GitHub turns one kind into another."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Final, TypeAlias, TypeGuard

from tests.integration.github.errors import UnsupportedFeature

Value: TypeAlias = "bool | float | str | Sequence[Value] | Mapping[str, Value] | None"

_DECIMAL: Final = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_BASES: Final = {"0x": 16, "0o": 8}


class Known(dict[str, Value]):
    """A context whose names are all known: GitHub takes another name for null, and here it is refused as a slip."""


def is_array(value: Value) -> TypeGuard[Sequence[Value]]:
    """A string is a sequence in Python, and none in an expression."""
    return isinstance(value, Sequence) and not isinstance(value, str)


def is_primitive(value: Value) -> bool:
    """Neither an array nor an object."""
    return value is None or isinstance(value, bool | int | float | str)


def to_text(value: Value) -> str:
    """A value where text is due. Raises UnsupportedFeature for arrays and objects."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return _number_text(value)
    if isinstance(value, str):
        return value
    raise UnsupportedFeature("an array or object where text is due; toJSON makes text of it")


def to_number(value: Value) -> float:
    """A value where a number is due; NaN if there is none."""
    if value is None:
        return 0.0
    if isinstance(value, str):
        return _parsed(value.strip())
    return float(value) if isinstance(value, bool | int | float) else math.nan


def is_true(value: Value) -> bool:
    """Whether a condition holds: arrays and objects always do."""
    if isinstance(value, float) and math.isnan(value):
        return False
    return not is_primitive(value) or bool(value)


def are_equal(left: Value, right: Value) -> bool:
    """As `==` has it: text without case, other kinds by number, collections by identity."""
    if isinstance(left, str) and isinstance(right, str):
        return left.upper() == right.upper()
    if not is_primitive(left) or not is_primitive(right):
        return left is right
    return to_number(left) == to_number(right)


def is_less(left: Value, right: Value) -> bool:
    """As `<` has it; nothing is less than a collection."""
    if isinstance(left, str) and isinstance(right, str):
        return left.upper() < right.upper()
    return to_number(left) < to_number(right)


def _number_text(number: float) -> str:
    if math.isinf(number):
        return "Infinity" if number > 0 else "-Infinity"
    return "NaN" if math.isnan(number) else format(number, ".15g").upper()


def _parsed(text: str) -> float:
    if not text:
        return 0.0
    if _DECIMAL.fullmatch(text):
        return float(text)
    if text in {"Infinity", "+Infinity", "-Infinity"}:
        return float(text)
    try:
        return float(int(text[2:], _BASES[text[:2]]))
    except (KeyError, ValueError):
        return math.nan
