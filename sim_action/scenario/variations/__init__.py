"""From one scenario to many: `variations:` says which of its keys take which values.

Lists are multiplied with each other; what is drawn at random is drawn jointly, a sample of all such keys at a time, and
that list of samples is one more factor.
"""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType
from typing import Any, Final, cast

from pydantic import JsonValue

from sim_action.core.errors import InvalidScenario, Location, Problem
from sim_action.core.messages import shown
from sim_action.core.yaml_document import Document, KeyPath
from sim_action.scenario.extends import without
from sim_action.scenario.source import Source, Varied
from sim_action.scenario.variations.keys import NoSuchKey, placed, resolved
from sim_action.scenario.variations.naming import is_nameable, labels, texts
from sim_action.scenario.variations.values import ValueList, ValuesError, value_list

MOST_RUNS: Final = 10_000
"""Of all scenarios of a file together."""

MOST_KEYS: Final = 20

# Of values, what they share counted for each, as each is checked on its own.
_MOST_WRITTEN_OUT: Final = 5_000_000

# What is the same in all variations, and why, where that needs saying.
_FIXED: Final = MappingProxyType(
    {
        "name": "",
        "version": "",
        "tags": "",
        "backend": "; --backend all runs a scenario on every engine",
        "extends": ": files are merged before keys vary; write a file for each that it is to extend",
        "scenarios": ": they are told apart before keys vary; each may have variations of its own",
        "variations": ": there are none of variations; put all keys that vary beside each other",
    }
)


@dataclass(frozen=True, slots=True)
class _Key:
    """A key that varies: as it was written, where it leads, what it takes, and how names call both."""

    written: str
    path: KeyPath
    values: ValueList
    label: str
    texts: tuple[str, ...]


def expanded(source: Source, seed: int | None, most: int = MOST_RUNS) -> tuple[Source, ...]:
    """A source for each variation, in the order of their values; the scenario itself, if it has none.

    Args:
        source: of the scenario.
        seed: of what is drawn; None: the scenario's own.
        most: how many there may be.

    Raises InvalidScenario.
    """
    data = source.document.data
    if not isinstance(data, dict) or "variations" not in data:
        return (source,)
    base = without(source.document, "variations")
    keys = _keys(source.document, base, _seed(base) if seed is None else seed)
    # Indices into the values of each key; those that are drawn have one index together.
    drawn = [key for key in keys if key.values.drawn]
    factors = [key for key in keys if key not in drawn[1:]]
    runs = math.prod(len(key.values.values) for key in factors)
    if runs > most:
        message = f"{runs:,} runs; a file may have {MOST_RUNS:,}"
        raise InvalidScenario([source.document.problem(("variations",), message)])
    if runs * (size := base.size) > _MOST_WRITTEN_OUT:
        message = f"{runs:,} runs of {size:,} values each, more than {_MOST_WRITTEN_OUT:,}; put what is long in a file"
        raise InvalidScenario([source.document.problem(("variations",), message)])
    rows = product(*(range(len(key.values.values)) for key in factors))
    # What the scenario shares with all of its variations is there once.
    base = replace(base, marks=dict(base.marks))
    return tuple(_varied(source, base, keys, dict(_indices(factors, drawn, row))) for row in rows)


def _indices(factors: Sequence[_Key], drawn: Sequence[_Key], row: Sequence[int]) -> Iterator[tuple[str, int]]:
    for key, index in zip(factors, row, strict=True):
        for other in drawn if key in drawn else (key,):
            yield other.written, index


def _varied(source: Source, base: Document, keys: Sequence[_Key], indices: Mapping[str, int]) -> Source:
    data = base.data
    marks: dict[KeyPath, Location] = {}
    for key in keys:
        value = key.values.values[indices[key.written]]
        data, made = placed(data, key.path, value)
        own: KeyPath = ("variations", key.written)
        place = source.document.location(own if key.values.drawn else (*own, indices[key.written]))
        marks |= dict.fromkeys(made, place)
    draws = ((source.document.location(("variations", key.written)), key.values.draw) for key in keys)
    values = ",".join(f"{key.label}={key.texts[indices[key.written]]}" for key in keys)
    return replace(
        source,
        document=Document(base.file, data, ChainMap(marks, cast(dict[KeyPath, Location], base.marks))),
        name=f"{source.name}[{values}]",
        group=source.name,
        variation=tuple(Varied(key.written, _json(key.values.values[indices[key.written]])) for key in keys),
        draws=tuple((place, draw) for place, draw in draws if draw),
    )


def _json(value: Any) -> JsonValue:
    """A value of a document as results have it."""
    if isinstance(value, dict):
        return {key: _json(inner) for key, inner in value.items()}
    if isinstance(value, tuple):
        return [_json(inner) for inner in value]
    scalar: JsonValue = value
    return scalar


def _seed(base: Document) -> int:
    """What is no seed is told when the scenario is checked."""
    seed = base.data.get("seed", 0) if isinstance(base.data, dict) else 0
    return seed if isinstance(seed, int) and seed >= 0 else 0


def _keys(document: Document, base: Document, seed: int) -> list[_Key]:
    """Raises InvalidScenario."""
    assert isinstance(document.data, dict)
    stated = document.data["variations"]
    if not isinstance(stated, dict) or not 0 < len(stated) <= MOST_KEYS:
        message = f"expected a map of 1 to {MOST_KEYS} keys to their values, found {shown(stated)}"
        raise InvalidScenario([document.problem(("variations",), message)])
    problems: list[Problem] = []
    found: dict[str, tuple[KeyPath, ValueList]] = {}
    for written, values in stated.items():
        try:
            path = resolved(base.data, written)
            _refuse_unfit(path, written)
            found[written] = path, value_list(written, values, seed)
        except NoSuchKey as error:
            problems.append(document.problem(("variations", written), str(error)))
        except ValuesError as error:
            problems.append(document.problem(("variations", written, *error.path), str(error)))
    problems = problems or [document.problem(("variations", *path), text) for path, text in _clashes(found)]
    if problems:
        raise InvalidScenario(problems)
    called = labels(list(found))
    return [_Key(key, path, values, called[key], texts(values)) for key, (path, values) in found.items()]


def _refuse_unfit(path: KeyPath, written: str) -> None:
    if not is_nameable(written):
        raise NoSuchKey("runs are named after it: it is plain text of at most 200 characters, without any of [],=*?")
    if (instead := _FIXED.get(str(path[0]))) is not None:
        raise NoSuchKey(f"'{path[0]}' is the same in all variations{instead}")


def _clashes(found: Mapping[str, tuple[KeyPath, ValueList]]) -> Iterator[tuple[KeyPath, str]]:
    """Keys of which one is inside another, and samples that are not equally many."""
    for key, (path, _) in found.items():
        for other, (outer, _) in found.items():
            if key != other and path[: len(outer)] == outer:
                yield (key,), f"is inside '{other}', which varies, too"
    drawn = [(key, len(values.values)) for key, (_, values) in found.items() if values.drawn]
    for key, samples in drawn[1:]:
        if samples != drawn[0][1]:
            yield (key,), f"samples are drawn jointly: '{drawn[0][0]}' has {drawn[0][1]}, this one {samples}"
