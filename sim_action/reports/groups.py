"""A scenario as reports show it: one outcome, or those of all of its variations together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from sim_action.location import Location
from sim_action.outcome import ExpectationOutcome, Outcome
from sim_action.reports.wording import Mood, mood

WORST_FIRST: Final[tuple[Mood, ...]] = ("error", "failed", "warned", "skipped", "passed")

# Where nothing says by how much something failed.
_WHOLE: Final = -1.0


@dataclass(frozen=True, slots=True)
class Group:
    """The outcomes of one scenario, in the order of the call; several only of one that varies."""

    name: str
    varies: bool
    outcomes: tuple[Outcome, ...]

    @property
    def worst(self) -> Outcome:
        """Without a verdict before failed before the rest; of equals, what missed its limit by most."""
        return min(self.outcomes, key=lambda outcome: (WORST_FIRST.index(mood(outcome)), _least_margin(outcome)))

    @property
    def mood(self) -> Mood:
        """How it is to be looked at."""
        return mood(self.worst)

    @property
    def location(self) -> Location | None:
        """Where it is written."""
        return self.outcomes[0].location

    @property
    def passed(self) -> str:
        """Such as "7 of 9 passed"."""
        statuses = [outcome.status for outcome in self.outcomes]
        left = f", {statuses.count('skipped')} not run" if "skipped" in statuses else ""
        return f"{statuses.count('passed')} of {len(statuses)} passed{left}"

    def values(self, outcome: Outcome) -> str:
        """What tells one of its outcomes from the others, such as "[friction=0.4]"."""
        return outcome.name.removeprefix(self.name) if self.varies else ""

    def worst_first(self) -> list[Outcome]:
        """Its outcomes, of equals in the order of the call."""
        return sorted(self.outcomes, key=lambda outcome: WORST_FIRST.index(mood(outcome)))


def groups(outcomes: Iterable[Outcome]) -> list[Group]:
    """All outcomes, variations of a scenario together."""
    found: list[Group] = []
    for (_, name), several in groupby(outcomes, lambda outcome: (outcome.file, outcome.group)):
        if name is None:
            found += [Group(outcome.name, False, (outcome,)) for outcome in several]
        else:
            found.append(Group(name, True, tuple(several)))
    return found


def worst_first(found: Iterable[Group]) -> list[Group]:
    """Of equals in the order of the call."""
    return sorted(found, key=lambda group: WORST_FIRST.index(group.mood))


def _least_margin(outcome: Outcome) -> float:
    """Relative to its limit, of what failed; 0 if nothing did."""
    return min((relative_margin(expected) for expected in outcome.expectations if expected.failed), default=0.0)


def relative_margin(expected: ExpectationOutcome) -> float:
    """By which part of its limit something failed, less than zero; a limit of zero has no parts.

    0 for what was cut off: nobody knows how near it would have come.
    """
    margin, limit = expected.verdict.margin, expected.verdict.limit
    if expected.verdict.cut_off:
        return 0.0
    if margin is None:
        return _WHOLE
    return margin / abs(limit) if limit else margin
