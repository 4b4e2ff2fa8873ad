"""A scenario as reports show it: one outcome, or those of all of its variations together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from sim_action.core.errors import Location
from sim_action.reports.formatting import DisplayStatus, display_status, moment, quantity
from sim_action.results.outcome import ExpectationOutcome, Outcome

WORST_FIRST: Final[tuple[DisplayStatus, ...]] = ("error", "flaky", "failed", "warned", "skipped", "passed")

# Where nothing says by how much something failed.
_WHOLE: Final = -1.0


@dataclass(frozen=True, slots=True)
class ScenarioGroup:
    """The outcomes of one scenario, in the order of the call; several only of one that varies."""

    name: str
    varies: bool
    outcomes: tuple[Outcome, ...]

    @property
    def worst(self) -> Outcome:
        """Without a verdict before failed before the rest; of equals, what missed its limit by most or came nearest."""
        return min(self.outcomes, key=lambda outcome: (WORST_FIRST.index(display_status(outcome)), *_nearness(outcome)))

    @property
    def worst_text(self) -> str:
        """Which variation was the worst and by what, such as "[yaw=0.4], margin 0.02 m (travel at least 1.5 m)"."""
        expected = _nearest(self.worst)
        if expected is None:
            return self.values(self.worst)
        verdict = expected.verdict
        known = f"margin {quantity(verdict.margin, verdict.unit)}" if verdict.margin is not None else ""
        told = f"at {moment(verdict.time)}" if verdict.passed and verdict.goal else known
        return f"{self.values(self.worst)}, {told} ({expected.name})" if told else self.values(self.worst)

    @property
    def status(self) -> DisplayStatus:
        """How it is to be looked at."""
        return display_status(self.worst)

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
        return sorted(self.outcomes, key=lambda outcome: WORST_FIRST.index(display_status(outcome)))


def grouped_scenarios(outcomes: Iterable[Outcome]) -> list[ScenarioGroup]:
    """All outcomes, variations of a scenario together."""
    found: list[ScenarioGroup] = []
    for (_, name), several in groupby(outcomes, lambda outcome: (outcome.file, outcome.group)):
        if name is None:
            found += [ScenarioGroup(outcome.name, False, (outcome,)) for outcome in several]
        else:
            found.append(ScenarioGroup(name, True, tuple(several)))
    return found


def worst_first(found: Iterable[ScenarioGroup]) -> list[ScenarioGroup]:
    """Of equals in the order of the call."""
    return sorted(found, key=lambda group: WORST_FIRST.index(group.status))


def _nearness(outcome: Outcome) -> tuple[float, float]:
    """Less is worse; of goals that came true, the later is."""
    expected = _nearest(outcome)
    return (0.0, 0.0) if expected is None else _closeness(expected)


def _nearest(outcome: Outcome) -> ExpectationOutcome | None:
    """What missed its limit by most, or if nothing failed, what came nearest to it; None where nothing was measured.

    Of what held throughout, if there is that: a goal is met at its limit, whatever happens.
    """
    failed = [expected for expected in outcome.expectations if expected.failed]
    measured = [expected for expected in outcome.expectations if expected.verdict.margin is not None]
    held = [expected for expected in measured if expected.verdict.passed]
    throughout = [expected for expected in held if not expected.verdict.goal]
    return min(failed or throughout or held, key=_closeness, default=None)


def _closeness(expected: ExpectationOutcome) -> tuple[float, float]:
    verdict = expected.verdict
    late = verdict.time if verdict.passed and verdict.goal and verdict.time is not None else 0.0
    return -late, relative_margin(expected)


def relative_margin(expected: ExpectationOutcome) -> float:
    """Which part of its limit was left, or was missing if less than zero; a limit of zero has no parts.

    0 for what was cut off: nobody knows how near it would have come.
    """
    margin, limit = expected.verdict.margin, expected.verdict.limit
    if expected.verdict.cut_off:
        return 0.0
    if margin is None:
        return _WHOLE
    return margin / abs(limit) if limit else margin
