"""Which scenarios are meant: by patterns of their names, and by tags."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from fnmatch import fnmatchcase

from sim_action.core.errors import Location, UsageError
from sim_action.core.messages import counted, did_you_mean, escaped_line
from sim_action.engines import BACKENDS
from sim_action.scenario.source import Refused, Source

Scenarios = tuple[Source | Refused, ...]
"""What is written in one file."""


@dataclass(frozen=True, slots=True)
class Selection:
    """What the command line asks for; what is left empty leaves nothing out.

    Attributes:
        only, exclude: patterns of names, in which `*` and `?` stand for anything, and brackets for themselves; what is
            the very name of something means that alone. The name of a scenario means all of its variations.
        tags, exclude_tags: of which a scenario has at least one, and none.
    """

    only: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    exclude_tags: tuple[str, ...] = ()

    def takes(self, scenario: Source | Refused, names: AbstractSet[str]) -> bool:
        """Whether a scenario is meant, of all that have these names; what cannot be read may have any tag."""
        if self.only and not any(_is_called(scenario, pattern, names) for pattern in self.only):
            return False
        if any(_is_called(scenario, pattern, names) for pattern in self.exclude):
            return False
        if isinstance(scenario, Refused):
            return True
        has = set(scenario.tags)
        return not has & set(self.exclude_tags) and (not self.tags or bool(has & set(self.tags)))


def selected(files: Sequence[Scenarios], selection: Selection) -> list[Scenarios]:
    """Of each file what is meant. Raises UsageError if that is nothing at all."""
    names = {name for scenarios in files for scenario in scenarios for name in _names(scenario)}
    chosen = [tuple(scenario for scenario in scenarios if selection.takes(scenario, names)) for scenarios in files]
    if files and not any(chosen):
        raise UsageError("\n".join(escaped_line(line) for line in _nothing(files, selection)))
    return chosen


def listing(scenarios: Iterable[Source | Refused]) -> Iterator[str]:
    """A line for each that can be read: name, place and tags, with tabs between."""
    for scenario in scenarios:
        if isinstance(scenario, Source):
            place = Location(scenario.document.file, scenario.line or 1)
            yield "\t".join((scenario.name, str(place), ",".join(scenario.tags))).rstrip("\t")


def _names(scenario: Source | Refused) -> Iterator[str]:
    """All that a scenario may be called by: its own name, that of what it varies, and those of its runs on engines."""
    yield scenario.name
    if isinstance(scenario, Source) and scenario.group:
        yield scenario.group
    for engine in BACKENDS:
        yield f"{scenario.name} [{engine}]"


def _is_called(scenario: Source | Refused, pattern: str, names: AbstractSet[str]) -> bool:
    if pattern in names:
        return pattern in _names(scenario)
    return any(fnmatchcase(name, pattern.replace("[", "[[]")) for name in _names(scenario))


def _nothing(files: Sequence[Scenarios], selection: Selection) -> Iterator[str]:
    """Why nothing is meant."""
    every = [scenario for scenarios in files for scenario in scenarios]
    varied = {each.name: each.group for each in every if isinstance(each, Source) and each.group}
    names = {each.name for each in every} - set(varied) | set(varied.values())
    tags = {tag for scenario in every if isinstance(scenario, Source) for tag in scenario.tags}
    called = {name for each in every for name in _names(each)}
    unknown = [pattern for pattern in selection.only if not any(_is_called(each, pattern, called) for each in every)]
    for pattern in unknown:
        near = did_you_mean(pattern, varied if "[" in pattern and varied else names)
        yield f"--only: no scenario is called '{pattern}'{near}"
    for tag in selection.tags:
        if tag not in tags:
            yield f"--tag: no scenario has the tag '{tag}'{did_you_mean(tag, tags)}"
    yield f"of {counted(len(every), 'scenario')}, none is selected"
    for scenario in every:
        if isinstance(scenario, Refused) and not selection.takes(scenario, called):
            yield str(scenario.problems[0])
