"""Select scenarios: by file, by number in a file, by patterns of their names, and by tags."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from fnmatch import fnmatchcase
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core.errors import Location, Problem, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import counted, did_you_mean, escaped_line
from sim_action.core.workspace import compared_name, discover, file_name, unique
from sim_action.engines import ENGINES
from sim_action.scenario.files import read_file
from sim_action.scenario.source import Refused, Source

if TYPE_CHECKING:
    from sim_action.scenario.written import Scenario as Written

_RANGE: Final = "[0-9]{1,5}(?:-[0-9]{1,5})?"
_NUMBERED: Final = re.compile(rf"(.+)::({_RANGE}(?:,{_RANGE})*)", re.DOTALL)


def ranges_text(numbers: Iterable[int], between: str = ",") -> str:
    """Return numbers in ascending order with runs joined, such as "1-15,31"."""
    # Consecutive numbers have the same distance from their index.
    runs = [
        [number for _, number in run] for _, run in groupby(enumerate(sorted(numbers)), lambda pair: pair[1] - pair[0])
    ]
    return between.join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def numbered(file: str, numbers: Iterable[int]) -> str:
    """Return the name of some scenarios of a file, such as "push.sim.yml::1-15,31"."""
    return f"{file}::{ranges_text(numbers)}"


def split(pattern: str) -> tuple[str, frozenset[int] | None]:
    """Split "FILE::NUMBERS" into file and numbers, None for all; an existing file wins. Raise UsageError."""
    match = _NUMBERED.fullmatch(pattern)
    if match is None or os.path.lexists(pattern):
        return pattern, None
    return match[1], frozenset(number for part in match[2].split(",") for number in _range(part))


def _range(text: str) -> range:
    first, _, last = text.partition("-")
    numbers = range(int(first), int(last or first) + 1)
    if not numbers:
        raise UsageError(f"a range of scenarios goes from the lower to the higher number, found '{text}'")
    return numbers


Scenarios = tuple[Source | Refused, ...]  # the scenarios of one file


@dataclass(frozen=True, slots=True)
class Selection:
    """The selection options of the command line; an empty one excludes nothing."""

    # Patterns of names, in which `*` and `?` are wildcards and brackets stand for themselves. An exact name selects
    # only that scenario. The name of a scenario selects all of its variations.
    only: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()  # a scenario must have at least one of them
    exclude_tags: tuple[str, ...] = ()  # a scenario must have none of them

    def takes(self, scenario: Source | Refused, names: AbstractSet[str]) -> bool:
        """Return True if a scenario is selected by name or tags, which an unreadable one may have; `names`: of all."""
        if self.only and not any(_is_called(scenario, pattern, names) for pattern in self.only):
            return False
        if any(_is_called(scenario, pattern, names) for pattern in self.exclude):
            return False
        if isinstance(scenario, Refused):
            return True
        has = set(scenario.tags)
        return not has & set(self.exclude_tags) and (not self.tags or bool(has & set(self.tags)))


@dataclass(frozen=True, slots=True)
class Unmatched:
    """A pattern of names, or a tag, that matches no scenario."""

    option: str  # the option of the command line that states it
    pattern: str
    message: str  # the reason, with the nearest name
    # a problem of each file that cannot be read and may have the scenario that is meant
    unreadable: tuple[Problem, ...] = ()

    def __str__(self) -> str:
        return escaped_line(f"{self.option}: {self.message}")

    @property
    def name(self) -> str:
        """The option as typed, for reports."""
        return escaped_line(f"{self.option} {self.pattern}")


@dataclass(frozen=True, slots=True)
class Selected:
    """The selected scenarios of each file, and what selects nothing."""

    scenarios: list[Scenarios]
    unmatched: tuple[Unmatched, ...] = ()


def selected(files: Sequence[Scenarios], selection: Selection, *, complete: bool = True) -> Selected:
    """Return the selected scenarios, and patterns and tags that match none of all files. Raises UsageError."""
    names = {name for scenarios in files for scenario in scenarios for name in _names(scenario)}
    chosen = [tuple(scenario for scenario in scenarios if selection.takes(scenario, names)) for scenarios in files]
    if not files or (any(chosen) and not complete):
        return Selected(chosen)
    every = [scenario for scenarios in files for scenario in scenarios]
    unmatched = list(_unknown_names("--only", selection.only, every))
    if not (any(chosen) and _has_unreadable(every)):
        unmatched += _unknown_tags("--tag", selection.tags, every)
    # The scenario that is meant may be in a file that cannot be read.
    refused = [source for source in every if isinstance(source, Refused) and not selection.takes(source, names)]
    unreadable = tuple(refusal.problems[0] for refusal in refused)
    if not any(chosen):
        nothing = f"of {counted(len(every), 'scenario')}, none is selected"
        raise UsageError("\n".join((*map(str, unmatched), nothing, *map(escaped_line, map(str, unreadable)))))
    return Selected(chosen, tuple(replace(pattern, unreadable=unreadable) for pattern in unmatched))


def unmatched_exclusions(files: Iterable[Scenarios], selection: Selection) -> Iterator[str]:
    """Yield a message for each pattern of `exclude` and each tag of `exclude_tags` that matches no scenario."""
    every = [scenario for scenarios in files for scenario in scenarios]
    yield from map(str, _unknown_names("--exclude", selection.exclude, every))
    if not _has_unreadable(every):
        yield from map(str, _unknown_tags("--exclude-tag", selection.exclude_tags, every))


def listing(scenarios: Iterable[Source | Refused]) -> Iterator[str]:
    """Yield a line for each readable scenario: name, place and tags, separated by tabs."""
    for scenario in scenarios:
        if isinstance(scenario, Source):
            place = Location(scenario.document.file, scenario.line or 1)
            yield "\t".join((scenario.name, str(place), ",".join(scenario.tags))).rstrip("\t")


def _names(scenario: Source | Refused) -> Iterator[str]:
    """Yield all names that select a scenario: its own, its group's, and one for each engine."""
    yield scenario.name
    if isinstance(scenario, Source) and scenario.group:
        yield scenario.group
    for engine in ENGINES:
        yield f"{scenario.name} [{engine}]"


def _is_called(scenario: Source | Refused, pattern: str, names: AbstractSet[str]) -> bool:
    if pattern in names:
        return pattern in _names(scenario)
    return any(fnmatchcase(name, pattern.replace("[", "[[]")) for name in _names(scenario))


def _unknown_names(option: str, patterns: Sequence[str], every: Sequence[Source | Refused]) -> Iterator[Unmatched]:
    """Yield each pattern that matches the name of no scenario."""
    if not patterns:
        return
    called = {name for scenario in every for name in _names(scenario)}
    varied = {scenario.name: scenario.group for scenario in every if isinstance(scenario, Source) and scenario.group}
    names = {scenario.name for scenario in every} - set(varied) | set(varied.values())
    for pattern in dict.fromkeys(patterns):
        if not any(_is_called(scenario, pattern, called) for scenario in every):
            near = did_you_mean(pattern, varied if "[" in pattern and varied else names)
            yield Unmatched(option, pattern, f"no scenario is named '{pattern}'{near}")


def _unknown_tags(option: str, chosen_tags: Sequence[str], every: Sequence[Source | Refused]) -> Iterator[Unmatched]:
    """Yield each tag that no readable scenario has."""
    tags = {tag for scenario in every if isinstance(scenario, Source) for tag in scenario.tags}
    for tag in dict.fromkeys(chosen_tags):
        if tag not in tags:
            yield Unmatched(option, tag, f"no scenario has the tag '{tag}'{did_you_mean(tag, tags)}")


def _has_unreadable(every: Iterable[Source | Refused]) -> bool:
    return any(isinstance(scenario, Refused) for scenario in every)


def _ignore(_: str) -> None:
    """Take a message and do nothing."""


@dataclass(frozen=True, slots=True)
class Contents:
    """The selected scenarios of each file that has some, and the patterns and tags that match no scenario."""

    files: Mapping[Path, Scenarios]
    unmatched: tuple[Unmatched, ...] = ()


@dataclass(frozen=True, slots=True)
class Suite:
    """The scenario files of a call and the selection among their scenarios."""

    files: Sequence[Path]  # in order
    empty: Sequence[str] = ()  # paths without a scenario
    written: Sequence[Written] = ()  # scenarios of a program, which come after the files
    # file name -> selected numbers, for files of which only some scenarios are selected
    numbers: Mapping[str, frozenset[int]] = field(default_factory=dict)
    selection: Selection = field(default_factory=Selection)  # by names and tags
    # the place in pyproject.toml that names the files; None: the command line names them
    named_at: Location | None = None
    # False if the list lacks files of the call, in which scenarios may be that the selection names
    complete: bool = True
    warn: Callable[[str], None] = _ignore  # takes a message for each exclusion that matches no scenario

    def read(self, permissions: Permissions, seed: int | None = None) -> Contents:
        """Return the selected scenarios of all files, varied by `seed`, or by their own. Raises UsageError."""
        every = [self._scenarios(path, permissions, seed) for path in self.files]
        every += [scenario.sources(permissions, seed) for scenario in self.written]
        # A shard of `matrix` gets some scenarios of the list, which `matrix` has checked.
        complete = self.complete and not self.numbers
        chosen = selected(every, self.selection, complete=complete)
        for message in unmatched_exclusions(every, self.selection) if complete else ():
            self.warn(message)
        files: dict[Path, Scenarios] = {}
        for path, scenarios in zip(
            (*self.files, *(scenario.path for scenario in self.written)), chosen.scenarios, strict=True
        ):
            if scenarios:
                files[path] = (*files.get(path, ()), *scenarios)
        return Contents(files, chosen.unmatched)

    def numbered(self, scenario: Source | Refused) -> bool:
        """Return True if the number of a scenario is selected."""
        file = scenario.file if isinstance(scenario, Refused) else scenario.document.file
        return file not in self.numbers or scenario.number in self.numbers[file]

    def scenarios(self, permissions: Permissions) -> list[Source | Refused]:
        """Return all selected scenarios. Raises UsageError."""
        return self.numbered_in(self.read(permissions))

    def numbered_in(self, contents: Contents) -> list[Source | Refused]:
        """Return the scenarios whose numbers are selected."""
        return [scenario for several in contents.files.values() for scenario in several if self.numbered(scenario)]

    def _scenarios(self, path: Path, permissions: Permissions, seed: int | None) -> Scenarios:
        scenarios = read_file(path, permissions, seed, self.named_at)
        name = file_name(path)
        beyond = [number for number in self.numbers.get(name, ()) if not 1 <= number <= len(scenarios)]
        if beyond:
            raise UsageError(
                escaped_line(f"{numbered(name, beyond)}: the file has {len(scenarios)} scenarios, counted from 1")
            )
        return scenarios


def find_suite(
    paths: Sequence[str],
    selection: Selection = Selection(),  # noqa: B008 - immutable
    *,
    outside: bool = False,
    named_at: Location | None = None,
    warn: Callable[[str], None] = _ignore,
) -> Suite:
    """Return the scenarios of files, also with numbers (`push.sim.yml::1-15`), globs and folders; see `Suite`."""
    named = [split(path) for path in paths]
    files_by_pattern = discover((file for file, _ in named), outside=outside)
    # Two spellings of one path give one outcome.
    empty: dict[str, str] = {}
    for pattern in (pattern for pattern, matches in files_by_pattern.items() if not matches):
        empty.setdefault(compared_name(pattern), pattern)
    files = unique(files_by_pattern)
    numbers = _numbers(files, ((files_by_pattern[file], some) for file, some in named))
    return Suite(files, tuple(empty.values()), (), numbers, selection, named_at, warn=warn)


def _numbers(
    files: Sequence[Path], named: Iterable[tuple[Sequence[Path], frozenset[int] | None]]
) -> dict[str, frozenset[int]]:
    """Return the chosen scenario numbers of each file that was only named with numbers."""
    some: dict[str, frozenset[int]] = {}
    whole = set[str]()
    for path, numbers in ((path, numbers) for paths, numbers in named for path in paths):
        name = compared_name(str(path))
        if numbers is None:
            whole.add(name)
        else:
            some[name] = some.get(name, frozenset()) | numbers
    by_name = {compared_name(str(path)): file_name(path) for path in files} if some else {}
    return {by_name[name]: numbers for name, numbers in some.items() if name not in whole}
