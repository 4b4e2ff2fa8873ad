"""How a variation is called: `push[friction=0.4,yaw=0.031]`, short, readable, and no two alike."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Final

from sim_action.core.field_types import is_plain_name
from sim_action.scenario.variations.values import ValueList

_LONGEST_TEXT: Final = 40
_FEWEST_DIGITS: Final = 3
# No two floats look the same with as many.
_MOST_DIGITS: Final = 17
# What would be taken for a part of the name's own form, or of a pattern.
_NOT_IN_TEXTS: Final = re.compile(r"[][,=*?\s]")
_NOT_IN_KEYS: Final = re.compile(r"[][,=*?]")
_LONGEST_KEY: Final = 200


def is_nameable(text: str) -> bool:
    """Whether a key or a unit can stand in a name, as part of it."""
    return is_plain_name(text) and len(text) <= _LONGEST_KEY and not _NOT_IN_KEYS.search(text)


def labels(keys: Sequence[str]) -> dict[str, str]:
    """Each key by as few of its last steps as tell it from the others."""
    return {key: _label(key.split("."), [other.split(".") for other in keys if other != key]) for key in keys}


def texts(values: ValueList) -> tuple[str, ...]:
    """Each value as names have it; what is long, or no scalar, by its number in the list."""
    if values.drawn:
        return _told_apart([_rounding(value) for value in values.values])
    written = [_written(value) for value in values.values]
    return tuple(
        text if text is not None and written.count(text) == 1 else f"#{number}"
        for number, text in enumerate(written, start=1)
    )


def _label(steps: list[str], others: list[list[str]]) -> str:
    sizes = range(1, len(steps) + 1)
    size = next((size for size in sizes if all(other[-size:] != steps[-size:] for other in others)), len(steps))
    return ".".join(steps[-size:])


def _told_apart(roundings: Sequence[Callable[[int], str]]) -> tuple[str, ...]:
    """All with as many digits as tell every one from the others."""
    for digits in range(_FEWEST_DIGITS, _MOST_DIGITS + 1):
        found = tuple(rounding(digits) for rounding in roundings)
        if len(set(found)) == len(found):
            return found
    return tuple(f"{text}#{number}" for number, text in enumerate(found, start=1))


def _rounding(value: float | str) -> Callable[[int], str]:
    number, _, unit = value.partition(" ") if isinstance(value, str) else (value, "", "")
    return lambda digits: f"{float(number):.{digits}g}{unit.replace(' ', '')}"


def _written(value: object) -> str | None:
    """None: no text that can stand in a name."""
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, (dict, tuple)):
        return None
    text = str(value).replace(" ", "")
    fits = text and len(text) <= _LONGEST_TEXT and is_plain_name(text)
    return text if fits and not _NOT_IN_TEXTS.search(text) else None
