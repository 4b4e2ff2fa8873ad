"""Expand a scenario into its variations.

`variations:` lists dotted keys, such as `world.objects.wall.pose.x`, and their values. A step into a list is the name
of an entry or its index from 0. A key or name that contains dots counts as a whole. Lists are multiplied with each
other. Draws are joint: each sample holds a value for every drawn key, and the list of samples is one more factor. A
variation is named `push[friction=0.4,yaw=0.031]`.

Each sample has a seed of its own, so that samples are independent. Listed values are compared on the same samples.
"""

from __future__ import annotations

import math
import re
from collections import ChainMap, Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from types import MappingProxyType
from typing import Final, cast

from sim_action.core.errors import InvalidScenario, Location, Problem
from sim_action.core.field_types import is_plain_name
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import shown
from sim_action.core.yaml_document import Document, KeyPath, NoSuchKey, placed, plain_data, resolved
from sim_action.scenario.source import MAX_KEYS, MAX_RUNS, SEED, Source, Varied
from sim_action.scenario.variations import Sobol
from sim_action.scenario.variations.gate import (
    GATE,
    SAMPLE,
    GateOfScenario,
    refuse_misspelt,
    refuse_unfit,
    runs_without_draws,
    stated_gate,
)
from sim_action.scenario.variations.values import CsvFiles, ValueList, ValuesError, value_list

_LONGEST_TEXT: Final = 40
_MIN_DIGITS: Final = 3
_MAX_DIGITS: Final = 17  # two different floats always differ in this many digits
# Characters of the name's own form or of patterns.
_NOT_IN_TEXTS: Final = re.compile(r"[][,=*?\s]|#[0-9]+$")
_NOT_IN_KEYS: Final = re.compile(r"[][,=*?]")
_LONGEST_KEY: Final = 200


def labels(keys: Sequence[str]) -> dict[str, str]:
    """Return the shortest unique ending of each key."""
    return {key: _label(key.split("."), [other.split(".") for other in keys if other != key]) for key in keys}


def texts(values: ValueList) -> tuple[str, ...]:
    """Return the text of each value in names; a long or structured value is replaced by its number in the list."""
    if values.rounded:
        # As many digits as make the numbers different.
        roundings = [_rounding(value) for value in values.values]
        for digits in range(_MIN_DIGITS, _MAX_DIGITS + 1):
            rounded = tuple(rounding(digits) for rounding in roundings)
            if len(set(rounded)) == len(rounded):
                return rounded
        return tuple(f"{text}#{number}" for number, text in enumerate(rounded, start=1))
    listed = {repr(value): value for value in values.choices or values.values}
    written = {key: _written(value) for key, value in listed.items()}
    count = Counter(written.values())
    called = {
        key: text if text is not None and count[text] == 1 else f"#{number}"
        for number, (key, text) in enumerate(written.items(), start=1)
    }
    return tuple(called[repr(value)] for value in values.values)


def _label(steps: list[str], others: list[list[str]]) -> str:
    sizes = range(1, len(steps) + 1)
    size = next((size for size in sizes if all(other[-size:] != steps[-size:] for other in others)), len(steps))
    return ".".join(steps[-size:])


def _rounding(value: float | str) -> Callable[[int], str]:
    number, _, unit = value.partition(" ") if isinstance(value, str) else (value, "", "")
    return lambda digits: f"{float(number):.{digits}g}{unit.replace(' ', '')}"


def _written(value: object) -> str | None:
    """Return the text of a value, or None if it cannot be in a name."""
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, (dict, tuple)):
        return None
    text = str(value).replace(" ", "")
    fits = text and len(text) <= _LONGEST_TEXT and is_plain_name(text)
    return text if fits and not _NOT_IN_TEXTS.search(text) else None


_MAX_WRITTEN_OUT: Final = 5_000_000  # number of values; shared values count for each variation, as each is checked

# Keys that cannot vary, and the reason if it needs one.
_FIXED: Final = MappingProxyType(
    {
        "name": "",
        "version": "",
        "tags": "",
        "backend": "; use --backend all to run a scenario on every engine",
        "extends": ": files are merged before keys vary; write one file for each base",
        "scenarios": ": scenarios are separated before keys vary; give each scenario its own variations",
        "variations": ": variations cannot be nested; list all varied keys together",
        "gate": ": a gate judges all samples",
    }
)


@dataclass(frozen=True, slots=True)
class _Key:
    """A varied key: as written, its path, its values, and their texts in names."""

    written: str
    path: KeyPath
    values: ValueList
    label: str
    texts: tuple[str, ...]

    def place(self, document: Document, index: int) -> Location:
        """Return the place where a value is written."""
        below = self.values.places[index] if self.values.places else ()
        return below if isinstance(below, Location) else document.location(("variations", self.written, *below))


def expanded(source: Source, seed: int | None, most: int = MAX_RUNS) -> tuple[Source, ...]:
    """Return a source for each variation in the order of their values.

    Raises InvalidScenario. `source`: of a scenario with `variations` or a gate; `seed`: for random draws; None takes
    the scenario's own; `most`: the largest number of variations.
    """
    data = source.document.data
    assert isinstance(data, dict)
    gate = stated_gate(source.document)
    refuse_misspelt(source.document)
    base = source.document.without("variations", GATE)
    keys: list[_Key] = []
    if "variations" in data:
        runs = None if gate is None else gate.gate.runs
        keys += _numbered(_keys(source, base, source.seed_of_draws(seed) or 0, runs))
    if gate is not None and not any(key.values.drawn for key in keys):
        keys.append(_samples(source.document, gate))
    # Indices into the values of each key; drawn keys share one index.
    drawn = [key for key in keys if key.values.drawn]
    factors = [key for key in keys if key not in drawn[1:]]
    if gate is not None:
        refuse_unfit(source.document, gate, len(drawn[0].values.values))
        # The samples of one gate follow each other.
        factors.sort(key=lambda key: key.values.drawn)
    count = math.prod(len(key.values.values) for key in factors)
    if count > most:
        message = f"{count:,} runs; a file may have {MAX_RUNS:,}"
        raise InvalidScenario([source.document.problem(("variations",), message)])
    if count * (size := base.size) > _MAX_WRITTEN_OUT:
        message = (
            f"{count:,} runs of {size:,} values each, more than {_MAX_WRITTEN_OUT:,}; move long values into a file"
        )
        raise InvalidScenario([source.document.problem(("variations",), message)])
    rows = product(*(range(len(key.values.values)) for key in factors))
    # The keys that all variations share exist once.
    base = replace(base, marks=dict(base.marks))
    indices = [dict(_indices(factors, drawn, row)) for row in rows]
    shared: _Marks = {}
    sources: Iterable[Source] = (_varied(source, base, keys, positions, shared) for positions in indices)
    if drawn and not any(key.written == SEED for key in drawn):
        sample = drawn[0].written
        sources = (run.sampled(positions[sample], seed) for run, positions in zip(sources, indices, strict=True))
    if gate is not None:
        listed = [key for key in keys if not key.values.drawn]
        names = [_named(source, listed, positions) for positions in indices]
        size = len(drawn[0].values.values)
        gates = {name: gate.planned(name, source.name, source.document.file, source.line, size) for name in names}
        keys_of_values = [key for key in drawn if key.written not in (SAMPLE, SEED)]
        by_seed = all(len(set(map(repr, key.values.values))) == 1 for key in keys_of_values)
        equal = tuple(key.written for key in keys_of_values) if by_seed else ()
        sources = (
            replace(run, gate=gates[name], differs_by_seed=by_seed, equal_draws=equal)
            for run, name in zip(sources, names, strict=True)
        )
    return tuple(sources)


def _samples(document: Document, stated: GateOfScenario) -> _Key:
    numbers = ValueList(tuple(range(1, runs_without_draws(document, stated) + 1)), drawn=True)
    return _Key(SAMPLE, (), numbers, SAMPLE, texts(numbers))


def _indices(factors: Sequence[_Key], drawn: Sequence[_Key], row: Sequence[int]) -> Iterator[tuple[str, int]]:
    for key, index in zip(factors, row, strict=True):
        for other in drawn if key in drawn else (key,):
            yield other.written, index


_Marks = dict[tuple[tuple[KeyPath, Location], ...], ChainMap[KeyPath, Location]]
"""The places of the values of variations; all samples of a draw have the same place."""


def _varied(source: Source, base: Document, keys: Sequence[_Key], indices: Mapping[str, int], shared: _Marks) -> Source:
    data = base.data
    marks: dict[KeyPath, Location] = {}
    written = [key for key in keys if key.path]
    for key in written:
        value = key.values.values[indices[key.written]]
        data, made = placed(data, key.path, value)
        marks |= dict.fromkeys(made, key.place(source.document, indices[key.written]))
    chained = ChainMap(marks, cast(dict[KeyPath, Location], base.marks))
    draws = ((key.place(source.document, indices[key.written]), key.values.advice) for key in written)
    return replace(
        source,
        document=Document(base.file, data, shared.setdefault(tuple(marks.items()), chained), base.moved),
        name=_named(source, keys, indices),
        group=source.name,
        variation=tuple(Varied(key.written, plain_data(key.values.values[indices[key.written]])) for key in written),
        draws=tuple((place, advice) for place, advice in draws if advice),
    )


def _named(source: Source, keys: Sequence[_Key], indices: Mapping[str, int]) -> str:
    values = ",".join(f"{key.label}={key.texts[indices[key.written]]}" for key in keys)
    return f"{source.name}[{values}]" if values else source.name


def _keys(source: Source, base: Document, seed: int, runs: int | None) -> list[_Key]:
    """Return the varied keys. Raises InvalidScenario."""
    document = source.document
    assert isinstance(document.data, dict)
    stated = document.data["variations"]
    if not isinstance(stated, dict) or not 0 < len(stated) <= MAX_KEYS:
        message = f"expected a map of 1 to {MAX_KEYS} keys to their values, found {shown(stated)}"
        raise InvalidScenario([document.problem(("variations",), message)])
    problems: list[Problem] = []
    varied_keys: dict[str, tuple[KeyPath, ValueList]] = {}
    files = CsvFiles(source.workspace, document.file)
    even = [written for written, values in stated.items() if isinstance(values, dict) and Sobol.key in values]
    for written, values in stated.items():
        dimension = even.index(written) if written in even else 0
        try:
            path = resolved(base.data, written)
            _refuse_unfit(path, written)
            listed = value_list(written, values, seed, runs=runs, dimension=dimension, files=files)
            varied_keys[written] = path, listed
        except NoSuchKey as error:
            problems.append(document.problem(("variations", written), str(error)))
        except ValuesError as error:
            problem = document.problem(("variations", written, *error.path), str(error))
            problems.append(problem if error.place is None else replace(problem, location=error.place))
    problems = problems or [document.problem(("variations", *path), text) for path, text in _clashes(varied_keys)]
    if problems:
        raise InvalidScenario(problems)
    called = labels(list(varied_keys))
    return [_Key(key, path, values, called[key], texts(values)) for key, (path, values) in varied_keys.items()]


def _numbered(keys: list[_Key]) -> list[_Key]:
    """Return the keys with the number of a sample in its text if another sample is equal in all drawn keys."""
    drawn = [key for key in keys if key.values.drawn]
    rows = list(zip(*(key.texts for key in drawn), strict=True)) if drawn else []
    count = Counter(rows)
    if len(count) == len(rows):
        return keys
    first = drawn[0]
    numbers = enumerate(zip(first.texts, rows, strict=True), start=1)
    distinct_texts = tuple(f"{text}#{number}" if count[row] > 1 else text for number, (text, row) in numbers)
    return [replace(key, texts=distinct_texts) if key is first else key for key in keys]


def _refuse_unfit(path: KeyPath, written: str) -> None:
    if not (is_plain_name(written) and len(written) <= _LONGEST_KEY and not _NOT_IN_KEYS.search(written)):
        raise NoSuchKey(
            "the names of the runs contain it: use plain text of at most 200 characters without any of [],=*?"
        )
    if (instead := _FIXED.get(str(path[0]))) is not None:
        raise NoSuchKey(f"'{path[0]}' is the same in all variations{instead}")


def _clashes(varied_keys: Mapping[str, tuple[KeyPath, ValueList]]) -> Iterator[tuple[KeyPath, str]]:
    """Yield keys that are inside other varied keys, and draws with different numbers of samples."""
    for key, (path, _) in varied_keys.items():
        for other, (outer, _) in varied_keys.items():
            if key != other and path[: len(outer)] == outer:
                yield (key,), f"is inside '{other}', which also varies"
    drawn = [(key, len(values.values)) for key, (_, values) in varied_keys.items() if values.drawn]
    for key, samples in drawn[1:]:
        if samples != drawn[0][1]:
            yield (key,), f"samples are drawn together: '{drawn[0][0]}' has {drawn[0][1]}, this one {samples}"
