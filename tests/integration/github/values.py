"""What expressions are about: their values, and how GitHub turns one kind into another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias, TypeGuard

from tests.integration.github.errors import UnsupportedFeature

Value: TypeAlias = "bool | float | str | Sequence[Value] | Mapping[str, Value] | None"


class Known(dict[str, Value]):
    """A context whose names are all known: GitHub takes another name for null, and here it is refused as a slip."""


class KnownOutputs(dict[str, str]):
    """The same, for what another's action says."""


def is_array(value: Value) -> TypeGuard[Sequence[Value]]:
    """A string is a sequence in Python, and none in an expression."""
    return isinstance(value, Sequence) and not isinstance(value, str)


def to_text(value: Value) -> str:
    """A value where text is due. Raises UnsupportedFeature for arrays and objects."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return format(value, ".15g").upper()
    if isinstance(value, str):
        return value
    raise UnsupportedFeature("an array or object where text is due")


def is_true(value: Value) -> bool:
    """Whether a condition holds: arrays and objects always do."""
    return is_array(value) or isinstance(value, Mapping) or bool(value)


def are_equal(left: Value, right: Value) -> bool:
    """As `==` has it: text without case. Raises UnsupportedFeature for what GitHub would make numbers of first."""
    match left, right:
        case str(one), str(other):
            return one.upper() == other.upper()
        case bool(), bool():
            return left == right
        # Null counts as zero there, like text that is empty or says so.
        case (None, str(text)) | (str(text), None) if "0" not in text and not text.isspace():
            return text == ""
    raise UnsupportedFeature(f"a comparison of {left!r} with {right!r}")
