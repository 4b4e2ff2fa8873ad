"""The use case `matrix`: split scenarios into shards for the matrix of a GitHub job."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from statistics import fmean
from typing import Final

from sim_action.core.discovery import compared_name, file_name
from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.results.results_json import Results, balanced
from sim_action.scenario.selection import numbered

MAX_BYTES: Final = (128 << 10) - len("INPUT_SCENARIO=\0")
"""The action passes the scenarios of a shard in this variable; Linux limits its length."""

# GitHub accepts 1 MB as the output of a job and counts 2 bytes per character.
_MAX_CHARACTERS: Final = 500_000

# No job of GitHub lasts as long: a larger duration in a file is ignored.
_MAX_DURATION_S: Final = 1e6

Unit = tuple[str, int | None]
"""A scenario or variation: its normalised file name and its number in the file."""


@dataclass(frozen=True, slots=True)
class FileOfScenarios:
    """A file and the numbers of its selected scenarios; `alone`: the bare file name selects exactly these."""

    path: Path
    numbers: Sequence[int]
    alone: bool = True

    def named(self, numbers: Sequence[int]) -> str:
        """Return the name that makes a shard run these scenarios of the file."""
        name = self.path.as_posix()
        return name if self.alone and len(numbers) == len(self.numbers) else numbered(name, numbers)


def matrix_text(files: Sequence[FileOfScenarios], empty: Sequence[str], count: int, known: Mapping[Unit, float]) -> str:
    """Return one line of ASCII JSON for `strategy.matrix` with at most `count` shards.

    Patterns without a scenario go to the first shard, whose run reports them. Raises UsageError for names that cannot
    be in a list with one name per line, and for lists that are too long for a runner or GitHub.
    """
    _refuse_unlistable([*(file.path.as_posix() for file in files), *empty])
    scenarios = [(place, number) for place, file in enumerate(files) for number in file.numbers]
    dealt = balanced(scenarios, _durations(files, known), count)
    shards = [list(_names(files, shard)) for shard in dealt]
    shards[:1] = [[*shard, *empty] for shard in shards[:1]]
    entries = [
        {"index": index, "shards": len(shards), "scenario": "\n".join(shard)}
        for index, shard in enumerate(shards, start=1)
    ]
    text = json.dumps({"include": entries}, separators=(",", ":"))
    _refuse_too_long(shards, text)
    return text


def known_durations(results: Results) -> dict[Unit, float]:
    """Return the wall time in s of each scenario in an earlier run, on all engines together."""
    taken: dict[Unit, float] = {}
    for outcome in results.outcomes:
        if 0 < outcome.wall_time < _MAX_DURATION_S:
            unit = compared_name(outcome.file), outcome.number
            taken[unit] = taken.get(unit, 0.0) + outcome.wall_time
    return taken


def _names(files: Sequence[FileOfScenarios], shard: Sequence[tuple[int, int]]) -> Iterator[str]:
    for place, several in groupby(shard, key=itemgetter(0)):
        yield files[place].named([number for _, number in several])


def _durations(files: Sequence[FileOfScenarios], known: Mapping[Unit, float]) -> list[float]:
    found = [_known(file, known) for file in files]
    mean = _mean((duration for durations in found for duration in durations), 1.0)
    return [duration or _mean(durations, mean) for durations in found for duration in durations]


def _known(file: FileOfScenarios, known: Mapping[Unit, float]) -> list[float | None]:
    name = compared_name(file_name(file.path))
    return [known.get((name, number)) for number in file.numbers]


def _mean(durations: Iterable[float | None], otherwise: float) -> float:
    return fmean([duration for duration in durations if duration] or [otherwise])


def _refuse_unlistable(names: Sequence[str]) -> None:
    refused = [escaped_line(repr(name)) for name in _unlistable(names)]
    if refused:
        wrong = "a matrix cannot contain a name with a line break, with white space at an end or with invalid UTF-8"
        raise UsageError(f"{wrong}: {', '.join(refused)}; rename the file, or use --shard I/N, which has no such limit")


def _refuse_too_long(shards: Sequence[Sequence[str]], text: str) -> None:
    other = "use a matrix of folders or of `shard: I/N`, which needs no names"
    for index, shard in enumerate(shards, start=1):
        size = len("\n".join(shard).encode())
        if size > MAX_BYTES:
            names = f"shard {index} of {len(shards)} would be {len(shard)} names of {size / 1000:.1f} kB"
            limit = "a variable of a runner holds 128 KiB at most"
            raise UsageError(f"{names}, but {limit}; use more shards, or {other}")
    if len(text) > _MAX_CHARACTERS:
        limit = f"GitHub accepts {_MAX_CHARACTERS / 1000:g} kB"
        raise UsageError(f"the matrix would be {len(text) / 1000:.1f} kB long, but {limit}; {other}")


def _unlistable(names: Sequence[str]) -> Iterator[str]:
    for name in names:
        utf8 = name.encode(errors="replace").decode() == name
        if not utf8 or name != name.strip() or len(name.splitlines()) != 1:
            yield name
