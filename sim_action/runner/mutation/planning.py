"""The plan of a proof: which scenarios are proven, which mutants of each run, and what that costs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import did_you_mean, escaped_line, shown
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.mutation.table import KINDS, TABLE
from sim_action.runner.run_plan import Plan
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused


@dataclass(frozen=True, slots=True)
class PlannedMutants:
    """The mutants of a run.

    Attributes:
        original: the run that passed.
        every: all its mutants, in the order of the table.
        chosen: the mutants to run, in the same order.
    """

    original: Original
    every: Sequence[Mutant]
    chosen: Sequence[Mutant]

    @property
    def left_out(self) -> int:
        """The number of mutants that do not run: the call named others, or they do not fit into the budget."""
        return len(self.every) - len(self.chosen)


def first_runs(plans: Iterable[Plan]) -> Iterator[LoadedScenario | Refused]:
    """Yield one run of each scenario: its first variation, on the first of its engines."""
    seen = set[tuple[object, str]]()
    for plan in plans:
        if isinstance(plan, Refused):
            yield plan
            continue
        source = plan[0].source
        if source.group is not None:
            if (key := (source.path, source.group)) in seen:
                continue
            seen.add(key)
        # Its motion is not compared with that of another engine.
        yield replace(plan[0], compared=False)


def refuse_unknown(names: Iterable[str]) -> None:
    """Raise UsageError for a name that no mutant can have; a name is a kind, or a kind and a subject."""
    for name in names:
        kind = name.partition(":")[0]
        if kind not in KINDS:
            raise UsageError(f"--only: there is no mutant {shown(name)}{did_you_mean(kind, KINDS)}")


def refuse_unmatched(plans: Sequence[PlannedMutants], names: Iterable[str]) -> None:
    """Raise UsageError for a name of a single mutant that no run has; without any run, nothing is known."""
    every = {mutant.name for plan in plans for mutant in plan.every}
    for name in names:
        kind, colon, _ = name.partition(":")
        if plans and colon and name not in every:
            hint = did_you_mean(name, (each for each in every if each.partition(":")[0] == kind))
            raise UsageError(escaped_line(f"--only: no scenario that passes has the mutant {shown(name)}{hint}"))


def planned(originals: Iterable[Original], only: Collection[str] = ()) -> list[PlannedMutants]:
    """Return the mutants of each run, all of them if `only` is empty; see `refuse_unknown`."""
    return [_planned(original, only) for original in originals]


def _planned(original: Original, only: Collection[str]) -> PlannedMutants:
    every = [mutant for row in TABLE for mutant in row.mutants(original)]
    chosen = [mutant for mutant in every if not only or mutant.kind in only or mutant.name in only]
    return PlannedMutants(original, every, chosen)


def cost(plans: Iterable[PlannedMutants], jobs: int) -> float:
    """Return the estimated wall time in s of all mutants, from the originals: a mutant may run up to its time limit."""
    return sum(each.original.outcome.wall_time * len(each.chosen) for each in plans) / jobs


def within(plans: Sequence[PlannedMutants], seconds: float, jobs: int) -> list[PlannedMutants]:
    """Return the plans with the most telling mutants that take at most a wall time in s.

    The first mutant of each kind comes before the second one of any kind, and scenarios take turns.
    """
    left = seconds * jobs
    chosen: list[set[str]] = [set() for _ in plans]
    for _, place, mutant in sorted(_ranked(plans), key=lambda each: each[:2]):
        needed = plans[place].original.outcome.wall_time
        if needed <= left:
            left -= needed
            chosen[place].add(mutant.name)
    return [
        replace(each, chosen=[mutant for mutant in each.chosen if mutant.name in names])
        for each, names in zip(plans, chosen, strict=True)
    ]


def _ranked(plans: Sequence[PlannedMutants]) -> Iterator[tuple[tuple[int, int], int, Mutant]]:
    """Yield each mutant after its rank and the index of its plan."""
    for place, each in enumerate(plans):
        before = Counter[str]()
        for mutant in each.chosen:
            yield (before[mutant.kind], KINDS.index(mutant.kind)), place, mutant
            before[mutant.kind] += 1
