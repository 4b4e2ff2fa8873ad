"""Groups of outcomes: a scenario together with all of its variations, or the runs of a gate, as reports show it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import groupby
from typing import Final

from sim_action.core.errors import ExitCode, Location
from sim_action.core.records import dataclass
from sim_action.core.wording import counted
from sim_action.reports.display import STATUS_DISPLAYS, RowStatus
from sim_action.reports.formatting import moment, quantity
from sim_action.results.outcome import WORST_FIRST, DisplayStatus, ExpectationOutcome, Outcome
from sim_action.scenario.variations.gate import PlannedGate, percent
from sim_action.world.claims import AuditWarning

_NO_MARGIN: Final = -1.0  # the relative margin of a failure without a margin


@dataclass(frozen=True)
class ScenarioGroup:
    """The outcomes of one scenario in call order: one for each variation, or exactly one."""

    name: str
    varies: bool
    outcomes: tuple[Outcome, ...]
    # the outcome of the gate that judges them; None: each one counts, or another call judges the gate
    gate: Outcome | None = None
    planned: PlannedGate | None = None  # the gate as it is stated, if it is known

    @property
    def is_part(self) -> bool:
        """Return True for runs of a gate that another call judges: `merge`, because the other runs are elsewhere."""
        return self.gate is None and self.planned is not None

    @property
    def is_gate(self) -> bool:
        """Return True for a gate, also if another call judges it: its runs do not count by themselves."""
        return self.gate is not None or self.is_part

    @property
    def could_not_run(self) -> tuple[Outcome, ...]:
        """The runs that fail the call in spite of their gate: invalid or interrupted ones, and internal errors."""
        return tuple(outcome for outcome in self.outcomes if outcome.exit_code > ExitCode.FAILED)

    @property
    def row_status(self) -> RowStatus:
        """The status; "information" for runs that another call judges."""
        return "information" if self.is_part and not self.could_not_run else self.status

    @property
    def gate_text(self) -> str:
        """The runs of a gate, such as "gate of 61 runs"; for a part also the command that judges it."""
        if self.gate is None or self.gate.statistics is None:
            whole = "a gate" if self.planned is None else f"the {counted(self.planned.runs, 'run')} of the gate"
            several = len(self.outcomes) != 1
            passed = sum(outcome.status == "passed" for outcome in self.outcomes)
            presence = f"{len(self.outcomes)} of {whole} {'are' if several else 'is'} in this part, {passed} passed"
            return f"{presence}; sim-action merge judges {'them' if several else 'it'}"
        counts = self.gate.statistics
        if counts.runs < counts.planned:
            return f"gate, {counts.runs} of {counted(counts.planned, 'run')}"
        return f"gate of {counted(counts.planned, 'run')}"

    @property
    def rate_text(self) -> str:
        """The rate of a gate, such as "58 of 61 runs passed (95.08 %)"; empty without one."""
        counts = None if self.gate is None else self.gate.statistics
        return "" if counts is None else f"{counts.passed} of {counts.runs} runs passed ({percent(counts.rate)})"

    @property
    def ending(self) -> str:
        """The reasons for the status of a gate; for a part, the reason why a run cannot run, or the judging command."""
        if self.gate is None:
            reasons = [f"{failure.title}: {failure.message}" for run in self.could_not_run for failure in run.failures]
            return reasons[0] if reasons else self.gate_text
        reasons = [f"{failure.title}: {failure.message}" for failure in self.gate.failures]
        reasons += [expected.verdict.message for expected in self.gate.causes or self.gate.expectations]
        return "; ".join(reasons or self.gate.notes) or STATUS_DISPLAYS[self.gate.status].word

    @property
    def not_passed(self) -> tuple[Outcome, ...]:
        """The runs that did not pass, the worst first, without interrupted ones, and those beyond an early decision."""
        counts = None if self.gate is None else self.gate.statistics
        judged = self.outcomes if counts is None or counts.decision is None else self.outcomes[: counts.runs]
        bad = [outcome for outcome in judged if outcome.status not in ("passed", "skipped")]
        return tuple(sorted((run for run in bad if run.exit_code is not ExitCode.INTERRUPTED), key=_badness))

    @property
    def not_passed_text(self) -> str:
        """The number of runs that did not pass, such as "3 runs did not pass: 2 failed, 1 error"."""
        statuses = [outcome.status for outcome in self.not_passed]
        kinds = dict.fromkeys(sorted(statuses, key=lambda status: (status == "error", statuses.index(status))))
        breakdown = ", ".join(STATUS_DISPLAYS[kind].counted(statuses.count(kind)) for kind in kinds)
        if len(kinds) == 1 and "failed" in kinds:
            return f"{counted(len(statuses), 'run')} failed"
        return f"{counted(len(statuses), 'run')} did not pass: {breakdown}" if statuses else ""

    @property
    def warned(self) -> tuple[tuple[ExpectationOutcome, str], ...]:
        """The expectations that did not hold but may: the worst of each, and the number of runs with the worst one."""
        runs_by_expectation: dict[tuple[str, Location], list[tuple[ExpectationOutcome, Outcome]]] = {}
        for outcome in self.outcomes:
            for expected in outcome.expectations:
                if expected.warned:
                    runs_by_expectation.setdefault((expected.name, expected.location), []).append((expected, outcome))
        worst = (
            (*min(same, key=lambda pair: relative_margin(pair[0])), len(same)) for same in runs_by_expectation.values()
        )
        return tuple(
            (expected, f"not in {runs} of {len(self.outcomes)} runs; the worst, {self.values(run)}: {expected.message}")
            for expected, run, runs in worst
        )

    @cached_property
    def worst(self) -> Outcome:
        """The worst outcome by status; among equals, the one with the smallest relative margin."""
        return self.outcomes[0] if len(self.outcomes) == 1 else min(self.outcomes, key=_badness)

    @property
    def worst_text(self) -> str:
        """The worst variation and its margin, such as "[yaw=0.4], margin 0.02 m (travel at least 1.5 m)"."""
        expected = nearest_expectation(self.worst)
        if expected is None:
            return self.values(self.worst)
        verdict = expected.verdict
        if expected.status == "not_exercised":
            return f"{self.values(self.worst)}, not exercised ({expected.name})"
        margin_text = f"margin {quantity(verdict.margin, verdict.unit)}" if verdict.margin is not None else ""
        text = f"at {moment(verdict.time)}" if verdict.status == "passed" and verdict.goal else margin_text
        return f"{self.values(self.worst)}, {text} ({expected.name})" if text else self.values(self.worst)

    @property
    def status(self) -> DisplayStatus:
        """The status of the gate, or of the worst outcome; a run that another call judges does not count by itself."""
        if self.is_part:
            return "error" if self.could_not_run else "skipped"
        return self.worst.display_status if self.gate is None else self.gate.display_status

    @property
    def location(self) -> Location | None:
        """The place of the scenario in its file."""
        return (self.gate or self.outcomes[0]).location

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
    def variations_text(self) -> str:
        """The number of passed variations and the worst one, such as "7 of 9 passed; worst: [yaw=0.4], ..."."""
        return self.passed + (f"; worst: {self.worst_text}" if self.status != "skipped" else "")

    @property
    def warnings(self) -> tuple[tuple[AuditWarning, int], ...]:
        """The warnings of the audit in file order: the first one of each rule and place, and its number of runs."""
        warnings_by_place: dict[tuple[str, Location], list[AuditWarning]] = {}
        for outcome in self.outcomes:
            for warning in outcome.warnings:
                warnings_by_place.setdefault((warning.rule, warning.location), []).append(warning)
        ordered = sorted(
            warnings_by_place.values(), key=lambda same: (same[0].location.line or 0, same[0].location.column or 0)
        )
        return tuple((same[0], len(same)) for same in ordered)

    def warning_text(self, warning: AuditWarning, runs: int) -> str:
        """Return a warning as text, with the number of variations if it is not of all, or of the runs of a gate."""
        if self.is_gate:
            return f"{warning} (in {runs} of {counted(len(self.outcomes), 'run')})"
        share = f" (in {runs} of {len(self.outcomes)} variations)" if runs < len(self.outcomes) else ""
        return f"{warning}{share}"

    def values(self, outcome: Outcome) -> str:
        """Return the values that identify a variation, such as "[friction=0.4]"; empty without variations."""
        return outcome.name.removeprefix(outcome.group or self.name) if self.varies else ""

    def worst_first(self) -> list[Outcome]:
        """Return the outcomes by status, worst first, relative margin and order; runs that no gate needed last."""
        return sorted(
            self.outcomes, key=lambda outcome: (outcome.is_sample and outcome.status == "skipped", _badness(outcome))
        )


def grouped_scenarios(outcomes: Iterable[Outcome], gates: Iterable[PlannedGate] = ()) -> list[ScenarioGroup]:
    """Group outcomes: variations of a scenario, runs of a gate; of `gates` without an outcome as in a part."""
    planned = {(gate.file, gate.name): gate for gate in gates}
    groups: list[ScenarioGroup] = []
    for (file, name), several in groupby(_with_gates(outcomes), _group_of):
        if name is None:
            groups += [ScenarioGroup(outcome.name, False, (outcome,)) for outcome in several]
            continue
        together = tuple(several)
        gate = next((outcome for outcome in together if outcome.statistics is not None), None)
        runs = tuple(outcome for outcome in together if outcome.statistics is None)
        stated = planned.get((file, name)) if gate is not None or runs[0].is_sample else None
        groups.append(ScenarioGroup(name, True, runs, gate, stated))
    return groups


def _group_of(outcome: Outcome) -> tuple[str, str | None]:
    return outcome.file, outcome.gate or outcome.group


def _with_gates(outcomes: Iterable[Outcome]) -> Iterator[Outcome]:
    """Yield the outcomes, all outcomes of a gate together: on several engines, the runs of their gates alternate."""
    ordered = tuple(outcomes)
    of_gates: dict[tuple[str, str | None], list[Outcome]] = {}
    for outcome in ordered:
        if outcome.gate is not None:
            of_gates.setdefault(_group_of(outcome), []).append(outcome)
    for outcome in ordered:
        if outcome.gate is None:
            yield outcome
        else:
            yield from of_gates.pop(_group_of(outcome), ())


def worst_first(groups: Iterable[ScenarioGroup]) -> list[ScenarioGroup]:
    """Sort groups, the worst first, otherwise in call order."""
    return sorted(groups, key=lambda group: WORST_FIRST.index(group.status))


def _badness(outcome: Outcome) -> tuple[float, float, float]:
    expected = nearest_expectation(outcome)
    return (WORST_FIRST.index(outcome.display_status), *((0.0, 0.0) if expected is None else _closeness(expected)))


def nearest_expectation(outcome: Outcome) -> ExpectationOutcome | None:
    """Return the expectation with the smallest relative margin; None if nothing was measured.

    Failed expectations come first, then expectations that were never judged.

    Among expectations that hold, invariants come before goals, because a goal is always reached exactly at its limit.
    Counts of contacts come last: a count that holds is always at its limit, too.
    """
    failed = [expected for expected in outcome.expectations if expected.failed]
    unjudged = [expected for expected in outcome.causes if not expected.failed]
    measured = [expected for expected in outcome.expectations if expected.verdict.margin is not None]
    held = [expected for expected in measured if expected.verdict.status == "passed"]
    graded = [expected for expected in held if expected.verdict.unit != "contacts"]
    throughout = [expected for expected in graded if not expected.verdict.goal]
    return min(failed or unjudged or throughout or graded or held, key=_closeness, default=None)


def _closeness(expected: ExpectationOutcome) -> tuple[float, float]:
    verdict = expected.verdict
    late = verdict.time if verdict.status == "passed" and verdict.goal and verdict.time is not None else 0.0
    return -late, relative_margin(expected)


def relative_margin(expected: ExpectationOutcome) -> float:
    """Return the margin by the limit (itself for 0), negative if it failed, 0 if undecided: it is not known."""
    margin, limit = expected.verdict.margin, expected.verdict.limit
    if expected.verdict.cut_off:
        return 0.0
    if margin is None:
        return _NO_MARGIN
    return margin / abs(limit) if limit else margin
