"""`sim-action matrix`."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any, Final

import click

from sim_action.cli.options import PATHS, Bounded, discovered, selection_flags, text_option
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, note
from sim_action.core.workspace import compared_name, file_name
from sim_action.results.results_json import Results, balanced
from sim_action.scenario.selection import numbered

if TYPE_CHECKING:
    from sim_action.scenario.selection import Suite


@click.command()
@PATHS
@selection_flags
@click.option(
    "--shards",
    type=Bounded(click.IntRange(min=1, max=256)),
    metavar="N",
    required=True,
    help="Number of shards, 1 to 256. If there are fewer scenarios, there are fewer shards.",
)
@text_option(
    "--durations",
    metavar="FILE",
    text="The results.json of an earlier run: shards get about the same total duration. Without it, all scenarios "
    "count the same.",
)
def matrix(paths: Sequence[str], shards: int, durations: str | None, **flags: Any) -> ExitCode:
    """Split scenarios into shards of similar duration, which parallel jobs run.

    The shards are printed as JSON, for the matrix of a GitHub job.

    PATHS are scenario files, globs, or folders. A folder stands for every *.sim.yml and *.sim.yaml in it and below. The
    default is the current folder.

    Exit code: 0 scenarios found; 2 a scenario file or the command line is invalid; 3 internal error of sim-action; 5 no
    scenario found.
    """
    suite = discovered(paths, flags)
    if not suite.files:
        return ExitCode.of_command(has_scenarios=False)
    durations_by_unit: dict[Unit, float] = {}
    try:
        if durations and os.path.lexists(durations):
            durations_by_unit = known_durations(Results.read(Path(durations)))
        elif durations:
            note(
                f"there are no earlier results at {durations}, as in the first run; all scenarios count as equally long"
            )
    except UsageError as error:
        note(f"{error}; all scenarios count as equally long")
    click.echo(matrix_text(_files(suite), suite.empty, shards, durations_by_unit))
    return ExitCode.PASSED


def _files(suite: Suite) -> list[FileOfScenarios]:
    """Return the files of which at least one scenario is selected. Raises UsageError.

    With several patterns or tags, a shard need not have a scenario for each. Numbers make its run accept that.
    """
    contents = suite.read(Permissions())
    if contents.unmatched:
        # A shard gets numbers and cannot report it.
        problems = [str(problem) for unmatched in contents.unmatched[:1] for problem in unmatched.unreadable]
        raise UsageError("\n".join((*map(str, contents.unmatched), *map(escaped_line, problems))))
    read = contents.files.items()
    numbers = {
        path: [scenario.number for scenario in scenarios if suite.numbered(scenario)] for path, scenarios in read
    }
    several = max(len(suite.selection.only), len(suite.selection.tags)) > 1
    return [
        FileOfScenarios(path, some, not several and file_name(path) not in suite.numbers)
        for path, some in numbers.items()
        if some
    ]


MAX_BYTES: Final = (128 << 10) - len("INPUT_SCENARIO=\0")
"""The action passes the scenarios of a shard in this variable; Linux limits its length."""

_MAX_CHARACTERS: Final = 500_000  # GitHub accepts 1 MB as the output of a job and counts 2 bytes per character
_MAX_DURATION_S: Final = 1e6  # no job of GitHub lasts as long: a larger duration in a file is ignored
Unit = tuple[str, int | None]  # a scenario or variation: its normalised file name and its number in the file


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


def matrix_text(
    files: Sequence[FileOfScenarios], empty: Sequence[str], count: int, durations_by_unit: Mapping[Unit, float]
) -> str:
    """Return one line of ASCII JSON for `strategy.matrix` with at most `count` shards.

    Patterns without a scenario go to the first shard, whose run reports them. Raises UsageError for names that cannot
    be in a list with one name per line, and for lists that are too long for a runner or GitHub.
    """
    _refuse_unlistable([*(file.path.as_posix() for file in files), *empty])
    scenarios = [(place, number) for place, file in enumerate(files) for number in file.numbers]
    dealt = balanced(scenarios, _durations(files, durations_by_unit), count)
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


def _durations(files: Sequence[FileOfScenarios], durations_by_unit: Mapping[Unit, float]) -> list[float]:
    durations_by_file = [_durations_of(file, durations_by_unit) for file in files]
    mean = _mean((duration for durations in durations_by_file for duration in durations), 1.0)
    return [duration or _mean(durations, mean) for durations in durations_by_file for duration in durations]


def _durations_of(file: FileOfScenarios, durations_by_unit: Mapping[Unit, float]) -> list[float | None]:
    name = compared_name(file_name(file.path))
    return [durations_by_unit.get((name, number)) for number in file.numbers]


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
