"""Groups of outcomes: a scenario together with all of its variations, as reports show it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.records import dataclass
from sim_action.reports.formatting import moment, quantity
from sim_action.results.outcome import WORST_FIRST, DisplayStatus, ExpectationOutcome, Outcome
from sim_action.scenario.claim_audit import AuditWarning

# The relative margin of a failure without a margin.
_NO_MARGIN: Final = -1.0


@dataclass(frozen=True, slots=True)
class ScenarioGroup:
    """The outcomes of one scenario in call order: one for each variation, or exactly one.

    Attributes:
        gate: the outcome of the gate that judges them; None: each one counts, or another call judges the gate.
    """

    name: str
    varies: bool
    outcomes: tuple[Outcome, ...]
    gate: Outcome | None = None

    @property
    def worst(self) -> Outcome:
        """The worst outcome by status; among equals, the one with the smallest relative margin."""
        return min(self.outcomes, key=lambda outcome: (WORST_FIRST.index(outcome.display_status), *_nearness(outcome)))

    @property
    def worst_text(self) -> str:
        """The worst variation and its margin, such as "[yaw=0.4], margin 0.02 m (travel at least 1.5 m)"."""
        expected = _nearest(self.worst)
        if expected is None:
            return self.values(self.worst)
        verdict = expected.verdict
        if expected.status == "not_exercised":
            return f"{self.values(self.worst)}, not exercised ({expected.name})"
        known = f"margin {quantity(verdict.margin, verdict.unit)}" if verdict.margin is not None else ""
        text = f"at {moment(verdict.time)}" if verdict.status == "passed" and verdict.goal else known
        return f"{self.values(self.worst)}, {text} ({expected.name})" if text else self.values(self.worst)

    @property
    def status(self) -> DisplayStatus:
        """The status of the gate, or of the worst outcome."""
        return self.worst.display_status if self.gate is None else self.gate.display_status

    @property
    def location(self) -> Location | None:
        """The place of the scenario in its file."""
        return self.outcomes[0].location

    @property
    def engines(self) -> str:
        """The engines that ran its outcomes, such as "pybullet 3.2.7"; empty if none was selected."""
        return ", ".join(dict.fromkeys(outcome.engine for outcome in self.outcomes if outcome.engine))

    @property
    def passed(self) -> str:
        """The number of passed outcomes, such as "7 of 9 passed"."""
        statuses = [outcome.status for outcome in self.outcomes]
        left = f", {statuses.count('skipped')} not run" if "skipped" in statuses else ""
        return f"{statuses.count('passed')} of {len(statuses)} passed{left}"

    @property
    def warnings(self) -> tuple[tuple[AuditWarning, int], ...]:
        """The warnings of the audit in file order: the first one of each rule and place, and its number of runs."""
        found: dict[tuple[str, Location], list[AuditWarning]] = {}
        for outcome in self.outcomes:
            for warning in outcome.warnings:
                found.setdefault((warning.rule, warning.location), []).append(warning)
        ordered = sorted(found.values(), key=lambda same: (same[0].location.line or 0, same[0].location.column or 0))
        return tuple((same[0], len(same)) for same in ordered)

    def warning_text(self, warning: AuditWarning, runs: int) -> str:
        """Return a warning as text, with the number of variations if it is not of all."""
        share = f" (in {runs} of {len(self.outcomes)} variations)" if runs < len(self.outcomes) else ""
        return f"{warning}{share}"

    def values(self, outcome: Outcome) -> str:
        """Return the values that identify a variation, such as "[friction=0.4]"; empty without variations."""
        return outcome.name.removeprefix(self.name) if self.varies else ""

    def worst_first(self) -> list[Outcome]:
        """Return the outcomes, the worst first, otherwise in call order."""
        return sorted(self.outcomes, key=lambda outcome: WORST_FIRST.index(outcome.display_status))


def grouped_scenarios(outcomes: Iterable[Outcome]) -> list[ScenarioGroup]:
    """Group outcomes: the variations of a scenario belong together, and so do the runs of a gate."""
    found: list[ScenarioGroup] = []
    for (_, name), several in groupby(outcomes, lambda outcome: (outcome.file, outcome.gate or outcome.group)):
        if name is None:
            found += [ScenarioGroup(outcome.name, False, (outcome,)) for outcome in several]
            continue
        together = tuple(several)
        gate = next((outcome for outcome in together if outcome.statistics is not None), None)
        runs = tuple(outcome for outcome in together if outcome.statistics is None)
        found.append(ScenarioGroup(name, True, runs, gate))
    return found


def worst_first(found: Iterable[ScenarioGroup]) -> list[ScenarioGroup]:
    """Sort groups, the worst first, otherwise in call order."""
    return sorted(found, key=lambda group: WORST_FIRST.index(group.status))


def _nearness(outcome: Outcome) -> tuple[float, float]:
    """Return a sort key; smaller is worse, and among reached goals the later one is worse."""
    expected = _nearest(outcome)
    return (0.0, 0.0) if expected is None else _closeness(expected)


def _nearest(outcome: Outcome) -> ExpectationOutcome | None:
    """Return the expectation with the smallest relative margin; None if nothing was measured.

    Failed expectations come first, then those that were never judged.

    Among expectations that hold, invariants come before goals, because a goal is always reached exactly at its limit.
    """
    failed = [expected for expected in outcome.expectations if expected.failed]
    unjudged = [expected for expected in outcome.causes if not expected.failed]
    measured = [expected for expected in outcome.expectations if expected.verdict.margin is not None]
    held = [expected for expected in measured if expected.verdict.status == "passed"]
    throughout = [expected for expected in held if not expected.verdict.goal]
    return min(failed or unjudged or throughout or held, key=_closeness, default=None)


def _closeness(expected: ExpectationOutcome) -> tuple[float, float]:
    verdict = expected.verdict
    late = verdict.time if verdict.status == "passed" and verdict.goal and verdict.time is not None else 0.0
    return -late, relative_margin(expected)


def relative_margin(expected: ExpectationOutcome) -> float:
    """Return the margin divided by the limit (the margin itself for a limit of zero); negative if it failed.

    The value is 0 for an undecided expectation (cut off), since its margin is unknown.
    """
    margin, limit = expected.verdict.margin, expected.verdict.limit
    if expected.verdict.cut_off:
        return 0.0
    if margin is None:
        return _NO_MARGIN
    return margin / abs(limit) if limit else margin
