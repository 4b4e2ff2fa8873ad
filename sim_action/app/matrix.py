"""The matrix of a GitHub job: which scenarios each of its runners is told to run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from statistics import fmean
from typing import Final

from sim_action.core.discovery import compared_name, file_name
from sim_action.core.errors import UsageError
from sim_action.core.messages import escaped_line
from sim_action.results.results_json import Results
from sim_action.results.shards import balanced
from sim_action.scenario.selection import numbered

MAX_BYTES: Final = (128 << 10) - len("INPUT_SCENARIO=\0")
"""The action has the scenarios of a shard in this variable, and Linux takes no longer one."""

# GitHub takes 1 MB as the output of a job, and counts 2 bytes for each character.
_MAX_CHARACTERS: Final = 500_000

# s; no job of GitHub's lasts as long, so a file that says more is not believed.
_LONGEST: Final = 1e6

Unit = tuple[str, int | None]
"""A scenario or a variation, by its file, spelled in one way, and its number in that."""


@dataclass(frozen=True, slots=True)
class FileOfScenarios:
    """A file, and the numbers of its scenarios that are meant; `alone`: whether its name alone means these."""

    path: Path
    numbers: Sequence[int]
    alone: bool = True

    def named(self, numbers: Sequence[int]) -> str:
        """How to tell a shard to run these of them."""
        name = self.path.as_posix()
        return name if self.alone and len(numbers) == len(self.numbers) else numbered(name, numbers)


def matrix_text(files: Sequence[FileOfScenarios], empty: Sequence[str], count: int, known: Mapping[Unit, float]) -> str:
    """One line of ASCII JSON for `strategy.matrix`, of at most so many shards.

    Patterns that found nothing go to the first shard, whose run reports them. Raises UsageError for names that cannot
    stand in a list that has one name in each line, and for more of them than a runner or GitHub takes.
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
    """How long each scenario took in an earlier run, in s, on all engines together; what did not run is left out."""
    taken: dict[Unit, float] = {}
    for outcome in results.outcomes:
        if 0 < outcome.wall_time < _LONGEST:
            unit = compared_name(outcome.file), outcome.number
            taken[unit] = taken.get(unit, 0.0) + outcome.wall_time
    return taken


def _names(files: Sequence[FileOfScenarios], shard: Sequence[tuple[int, int]]) -> Iterator[str]:
    """Each file of a shard, with the numbers that are the shard's; `shard`: places of files and numbers."""
    for place, several in groupby(shard, key=itemgetter(0)):
        yield files[place].named([number for _, number in several])


def _durations(files: Sequence[FileOfScenarios], known: Mapping[Unit, float]) -> list[float]:
    """Of a scenario that nobody knows, the mean of those of its file that are known, or else of all."""
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
        wrong = "a name with a line break, white space at an end or bytes that are no UTF-8 cannot stand in a matrix"
        raise UsageError(f"{wrong}: {', '.join(refused)}; rename it, or use --shard I/N, which has no such limit")


def _refuse_too_long(shards: Sequence[Sequence[str]], text: str) -> None:
    other = "a matrix of folders or of `shard: I/N`, which needs no names"
    for index, shard in enumerate(shards, start=1):
        size = len("\n".join(shard).encode())
        if size > MAX_BYTES:
            names = f"shard {index} of {len(shards)} would be {len(shard)} names of {size / 1000:.1f} kB"
            limit = "128 KiB is all that one variable of a runner holds"
            raise UsageError(f"{names}, and {limit}; make more shards, or {other}")
    if len(text) > _MAX_CHARACTERS:
        limit = f"GitHub takes {_MAX_CHARACTERS / 1000:g} kB"
        raise UsageError(f"the matrix would be {len(text) / 1000:.1f} kB long, and {limit}; make {other}")


def _unlistable(names: Sequence[str]) -> Iterator[str]:
    for name in names:
        utf8 = name.encode(errors="replace").decode() == name
        if not utf8 or name != name.strip() or len(name.splitlines()) != 1:
            yield name
