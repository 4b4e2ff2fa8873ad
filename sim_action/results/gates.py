"""The verdict of a gate: a pure function of its runs, so it is the same with shards, jobs and resumed calls.

A run without a verdict counts against each claim: as not passed for the lower bound of the rate, as passed for
the upper one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import takewhile
from typing import Final

from sim_action.core import statistics
from sim_action.core.records import dataclass
from sim_action.core.statistics import Decision, QuantileBounds, SequentialTest, SequentialVerdict
from sim_action.core.units import display, is_bare, with_si_unit
from sim_action.core.wording import counted
from sim_action.results.outcome import ExpectationOutcome, Failure, GateStatistics, Outcome, Status, status_of
from sim_action.scenario.sharing import share_parts
from sim_action.scenario.variations.gate import (
    MAJORITY,
    Gate,
    Passes,
    PlannedGate,
    Quantile,
    StopEarly,
    percent,
    percents_apart,
)
from sim_action.state.verdict import Verdict
from sim_action.world.claims import LOW_GATE, AuditWarning

_BLOCKING: Final = ("interrupted", "internal", "missing", "invalid")
"""The kinds of failures that leave a gate without a verdict, the worst first."""

_PERCENT: Final = 100.0

RELATIVE_FIGURES: Final = 13
"""The number of figures of a motion, see `motion_figures`, that do not depend on the place and heading of its start."""

_ROUNDING: Final = 1e-6
"""The relative difference, and the difference in SI units, up to which two runs of an engine count as equal."""


def judged_gate(planned: PlannedGate, runs: Sequence[Outcome]) -> Outcome:
    """Return the outcome of a gate; `runs`: all that are known, in the order of the samples."""
    test_decision = _decision(planned, runs)
    decision = None if test_decision is None else test_decision.verdict
    counted_runs = runs if test_decision is None or decision is None else runs[: test_decision.runs]
    done = [run for run in counted_runs if run.status != "skipped"]
    failure = _blocking(planned, runs, counted_runs)
    if failure is not None:
        return _outcome(planned, runs, done, status="error", failures=(failure,))
    if decision is None and (left := [run for run in counted_runs if run.status == "skipped"]):
        return _outcome(planned, runs, done, status="skipped", notes=left[0].notes)
    judged = [_expectation(planned, *condition) for condition in _conditions(planned, counted_runs, decision)]
    return _outcome(
        planned, runs, counted_runs, status=status_of(judged), expectations=tuple(judged), decision=decision
    )


def _decision(planned: PlannedGate, runs: Iterable[Outcome]) -> Decision | None:
    """Return the decision of a test that stops early; None: the gate has none."""
    test = sequential_test(planned)
    if test is None:
        return None
    done = takewhile(lambda run: run.status != "skipped", runs)
    return test.decision(result_of(run) for run in done)


def sequential_test(planned: PlannedGate) -> SequentialTest | None:
    """Return the test of a gate that stops early; None for other gates."""
    test = planned.gate.stop_early
    return None if test is None else SequentialTest(test.reject, test.accept, test.confidence, planned.runs)


def result_of(run: Outcome) -> bool | None:
    """Return True for a run that passed, False for one that failed, None for one without a verdict."""
    return {"passed": True, "failed": False}.get(run.status)


def _blocking(planned: PlannedGate, runs: Sequence[Outcome], looked_at: Sequence[Outcome]) -> Failure | None:
    """Return the reason why the gate has no verdict."""
    for kind in _BLOCKING:
        failures = [failure for run in looked_at for failure in run.failures if failure.kind == kind]
        if failures:
            first = failures[0]
            text = f"{counted(len(failures), 'run')} of {planned.runs}: {first.message}"
            return first.model_copy(update={"message": text, "details": ""})
    if len(runs) < planned.runs:
        lost = f"{planned.runs - len(runs)} of {planned.runs} runs have no result"
        message = f"{lost}; check the jobs that should have run them"
        return Failure(kind="missing", title="no result", message=message, location=planned.location)
    if len(runs) > planned.runs:
        message = f"{len(runs)} runs belong to a gate of {planned.runs}; merge the results of one list of scenarios"
        return Failure(kind="invalid", title="too many runs", message=message, location=planned.location)
    if (problem := _one_sample(planned.gate, looked_at) or _other_unit(planned, looked_at)) is not None:
        return Failure(kind="invalid", title="invalid gate", message=problem, location=planned.location)
    return None


def _one_sample(gate: Gate, runs: Sequence[Outcome]) -> str | None:
    """Return the problem of a claim whose runs are one run: neither the draws nor the noise had an effect on it."""
    if len(runs) < 2 or any(run.digest is None for run in runs):
        return None
    claims: list[tuple[str, str | None]] = [(claim.of, claim.expectation) for claim in gate.quantile]
    if gate.passes is not None or gate.stop_early is not None:
        claims.insert(0, ("the rate", None))
    moved_alike = _are_alike([run.motion or (run.digest,) for run in runs])
    # Another place to start has no effect on quantities of the motion alone.
    started_elsewhere = all(run.motion for run in runs) and _are_alike([run.motion[:RELATIVE_FIGURES] for run in runs])
    for name, only in claims if moved_alike or started_elsewhere else ():
        verdicts = [_verdicts(run, only) for run in runs]
        are_of_motion = all(verdict.unit not in ("", "contacts") for row in verdicts for verdict in row)
        if (moved_alike or are_of_motion) and _are_alike([list(map(_value, row)) for row in verdicts]):
            return (
                f"all {len(runs)} runs are the same run for {name}: neither what is drawn nor noise had an effect "
                "beyond rounding; draw a key that matters, or let a controller read the noisy sensor"
            )
    return None


def _verdicts(run: Outcome, only: str | None) -> list[Verdict]:
    """Return the verdict of one expectation, if it has one, or of all."""
    if only is None:
        return [expected.verdict for expected in run.expectations]
    expected = _named(only, run)
    return [] if expected is None else [expected.verdict]


def _value(verdict: Verdict) -> float | str:
    return verdict.status if verdict.measured is None else verdict.measured


def _are_alike(rows: Sequence[Sequence[float | str | None]]) -> bool:
    """Return True if all rows have equal values, numbers by less than the rounding of an engine."""
    first, *others = rows
    return all(len(row) == len(first) and all(map(_is_alike, row, first)) for row in others)


def _is_alike(value: float | str | None, other: float | str | None) -> bool:
    if isinstance(value, float) and isinstance(other, float):
        return math.isclose(value, other, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
    return value == other


def _other_unit(planned: PlannedGate, runs: Sequence[Outcome]) -> str | None:
    """Return the problem of a quantile whose limit has another unit than the measured value."""
    for claim in planned.gate.quantile:
        _, stated = with_si_unit(claim.bound)
        values, unit = _values(claim, runs)
        if stated and stated != unit and any(value is not None for value in values):
            return (
                f"{claim.of} is in {unit or 'counts'}, and the limit is {claim.bound}; write it in {unit or 'counts'}"
            )
    return None


Condition = tuple[str, Verdict]  # the name of a claim, and its verdict


def _conditions(
    planned: PlannedGate, runs: Sequence[Outcome], decision: SequentialVerdict | None
) -> Iterator[Condition]:
    gate, counts = planned.gate, _Counts.of(runs)
    if gate.passes is not None:
        yield _rate(gate.passes, counts)
    if gate.stop_early is not None:
        yield _test(gate.stop_early, counts, decision, planned.runs)
    for quantile in gate.quantile:
        yield _quantile(quantile, runs)
    if gate.passes is None and gate.stop_early is None and counts.rate < MAJORITY and not planned.may_be_low:
        limit = f"at least {percent(MAJORITY)} of the runs pass"
        message = f"{counts}; a quantile alone says nothing about failed runs: state 'passes', or allow: [{LOW_GATE}]"
        yield (limit, Verdict(False, counts.rate * _PERCENT, MAJORITY * _PERCENT, unit="%", message=message))
    if counts.without_verdict or gate.errors.at_most:
        yield _errors(gate.errors.at_most, counts)


@dataclass(frozen=True, slots=True)
class _Counts:
    runs: int
    passed: int
    failed: int
    not_exercised: int

    @classmethod
    def of(cls, runs: Sequence[Outcome]) -> _Counts:
        statuses: list[Status] = [run.status for run in runs]
        return cls(len(runs), *(statuses.count(status) for status in ("passed", "failed", "not_exercised")))

    @property
    def without_verdict(self) -> int:
        return self.runs - self.passed - self.failed

    @property
    def rate(self) -> float:
        return self.passed / self.runs if self.runs else 0.0

    def bounds(self, confidence: float) -> tuple[float, float]:
        """Return the lower and the upper bound of the rate."""
        return (
            statistics.lower_bound(self.passed, self.runs, confidence),
            statistics.upper_bound(self.passed + self.without_verdict, self.runs, confidence),
        )

    def __str__(self) -> str:
        return f"{self.passed} of {self.runs} runs passed ({percent(self.rate)})"


def _rate(claim: Passes, counts: _Counts) -> Condition:
    lower, upper = counts.bounds(claim.confidence)
    sure = f"with {percent(claim.confidence)} confidence"
    name = f"at least {percent(claim.at_least)} of the runs pass"
    if statistics.proves(counts.passed, counts.runs, claim.at_least, claim.confidence):
        least, _ = percents_apart(lower, claim.at_least)
        return name, _share(counts, claim, f"{counts}; {sure} at least {least} do", lower, passed=True)
    if statistics.refutes(counts.passed + counts.without_verdict, counts.runs, claim.at_least, claim.confidence):
        most, limit = percents_apart(upper, claim.at_least)
        return name, _share(counts, claim, f"{counts}; {sure} at most {most} do, less than {limit}", upper)
    least, most, limit = percents_apart(lower, upper, claim.at_least)
    message = f"{counts}; {sure} at least {least} and at most {most} do: too few runs to tell"
    needed = statistics.passes_needed(counts.runs, claim.at_least, claim.confidence)
    if needed is not None:
        message = f"{message}; {needed} of {counts.runs} would show {limit}"
    return name, _share(counts, claim, message, lower, inconclusive=True)


def _share(
    counts: _Counts, claim: Passes, message: str, bound: float, *, passed: bool = False, inconclusive: bool = False
) -> Verdict:
    return Verdict(
        passed,
        measured=counts.rate * _PERCENT,
        limit=claim.at_least * _PERCENT,
        margin=(bound - claim.at_least) * _PERCENT,
        unit="%",
        message=message,
        inconclusive="statistical" if inconclusive else None,
    )


def _test(test: StopEarly, counts: _Counts, decision: SequentialVerdict | None, most: int) -> Condition:
    rates = f"{percent(test.accept)} against {percent(test.reject)}"
    sure = f"with {percent(test.confidence)} confidence"
    name = f"a rate of {rates}"
    if decision is None:
        message = f"{counts}; the test neither accepts nor rejects {rates} within {counted(most, 'run')}"
        return name, Verdict(
            False, measured=counts.rate * _PERCENT, unit="%", message=message, inconclusive="statistical"
        )
    word = "accepts" if decision == "accepted" else "rejects"
    message = f"{counts}; the test {word} {rates} {sure} after {counted(counts.runs, 'run')}"
    return name, Verdict(decision == "accepted", measured=counts.rate * _PERCENT, unit="%", message=message)


def _errors(most: int, counts: _Counts) -> Condition:
    without_verdict = counts.without_verdict
    message = f"{counted(without_verdict, 'run')} of {counts.runs} without a verdict; at most {most} may have none"
    verdict = Verdict(
        without_verdict <= most,
        float(without_verdict),
        float(most),
        float(most - without_verdict),
        "runs",
        message=message,
    )
    return f"at most {counted(most, 'run')} without a verdict", verdict


def _quantile(claim: Quantile, runs: Sequence[Outcome]) -> Condition:
    limit, _ = with_si_unit(claim.bound)
    values, unit = _values(claim, runs)
    measured = [value for value in values if value is not None]
    word = "at least" if claim.at_most is None else "at most"
    stated = f"{claim.bound} {unit}".rstrip() if is_bare(claim.bound) else claim.bound
    name = f"{percent(claim.q)} quantile of {claim.of} {word} {stated}"
    bounds = statistics.quantile_bounds(measured, claim.q, claim.confidence, len(values) - len(measured))
    proving, refuting = bounds.lower, bounds.upper
    sign = 1.0
    if claim.claim == "at_most":
        proving, refuting, sign = bounds.upper, bounds.lower, -1.0
    shows = proving is not None and sign * (proving - limit) >= 0
    refutes = refuting is not None and sign * (refuting - limit) < 0
    bound = refuting if refutes else proving
    text = _quantile_text(claim, bounds, len(values), len(values) - len(measured), unit)
    return name, Verdict(
        shows,
        measured=bound,
        limit=limit,
        margin=None if bound is None else sign * (bound - limit),
        unit=unit,
        message=text if shows or refutes else f"{text}: too few runs to tell",
        inconclusive=None if shows or refutes else "statistical",
    )


def _quantile_text(claim: Quantile, bounds: QuantileBounds, runs: int, missing: int, unit: str) -> str:
    sides = (("at least", bounds.lower), ("at most", bounds.upper))
    interval = " and ".join(f"{words} {display(value, unit)}" for words, value in sides if value is not None)
    sure = f"with {percent(claim.confidence)} confidence"
    text = f"{counted(runs, 'run')}; {sure} the {percent(claim.q)} quantile is {interval or 'not bounded'}"
    return f"{text}; {counted(missing, 'run')} measured nothing, or not to the end" if missing else text


def _values(claim: Quantile, runs: Sequence[Outcome]) -> tuple[list[float | None], str]:
    """Return the value of each run, None where nothing was measured, or not to the end, and their unit."""
    values: list[float | None] = []
    unit = ""
    for run in runs:
        expected = _named(claim.expectation, run)
        verdict = expected.verdict if expected and _is_whole(claim, expected, run) else None
        value = None if verdict is None else verdict.margin if claim.of.endswith(".margin") else verdict.measured
        value = None if value is None or math.isnan(value) else value
        values.append(value)
        if verdict is not None and value is not None:
            unit = verdict.unit
    return values, unit


def _named(name: str, run: Outcome) -> ExpectationOutcome | None:
    by_name = [expected for expected in run.expectations if expected.name == name]
    matches = by_name or [expected for expected in run.expectations if expected.assertion == name]
    return matches[0] if len(matches) == 1 and not matches[0].verdict.cut_off else None


def _is_whole(claim: Quantile, expected: ExpectationOutcome, run: Outcome) -> bool:
    """Return False for a value that could have become worse, because it was not measured up to the end of the run."""
    verdict = expected.verdict
    if verdict.goal:
        return not (verdict.passed and _is_beyond(claim, expected))
    # A failure ended the run, or an invariant that only warns keeps the value with which it failed.
    is_final = verdict.passed or expected.severity == "error" or verdict.time in (None, run.sim_time)
    return run.end != "expectation failed" and is_final


def _is_beyond(claim: Quantile, goal: ExpectationOutcome) -> bool:
    """Return True for a bound on the far side of a goal, which keeps the value with which it was met."""
    if claim.of.endswith(".margin"):
        return claim.claim == "at_most"
    stated = goal.scope.stated if goal.scope else ()
    limits = {path.rpartition(".")[2] for path in stated} & {"at_least", "at_most"}
    return bool(limits) and claim.claim not in limits


def _expectation(planned: PlannedGate, name: str, verdict: Verdict) -> ExpectationOutcome:
    return ExpectationOutcome(name=name, assertion="gate", severity="error", location=planned.location, verdict=verdict)


def _outcome(
    planned: PlannedGate,
    runs: Sequence[Outcome],
    looked_at: Sequence[Outcome],
    *,
    status: Status,
    expectations: tuple[ExpectationOutcome, ...] = (),
    failures: tuple[Failure, ...] = (),
    decision: SequentialVerdict | None = None,
    notes: tuple[str, ...] = (),
) -> Outcome:
    first = runs[0]
    return Outcome(
        name=planned.name,
        file=planned.file,
        line=planned.line,
        group=planned.group,
        tags=first.tags,
        gate=planned.name,
        statistics=_statistics(planned, looked_at, decision),
        status=status,
        expectations=expectations,
        failures=failures,
        notes=notes,
        scenario_seed=first.scenario_seed,
        engine=first.engine,
        provenance=first.provenance,
    )


def _statistics(planned: PlannedGate, runs: Sequence[Outcome], decision: SequentialVerdict | None) -> GateStatistics:
    counts = _Counts.of(runs)
    gate = planned.gate
    claim = gate.passes or gate.stop_early or gate.quantile[0]
    lower, upper = (None, None) if gate.stop_early is not None or not runs else counts.bounds(claim.confidence)
    return GateStatistics(
        planned=planned.runs,
        runs=counts.runs,
        passed=counts.passed,
        failed=counts.failed,
        errors=counts.without_verdict - counts.not_exercised,
        not_exercised=counts.not_exercised,
        rate=counts.rate,
        confidence=claim.confidence,
        lower=lower,
        upper=upper,
        decision=decision,
    )


def over_variations(
    outcomes: Sequence[Outcome], gates: Iterable[PlannedGate], *, is_part: bool = False
) -> tuple[Outcome, ...]:
    """Return the outcomes of a call, each gate before its first run, and without warnings that do not hold for all.

    Outcomes of gates among `outcomes` are judged again. Runs of a gate that is not among `gates` count by themselves:
    nothing else would judge them. `is_part`: runs of a gate may be in other results; such a gate has no outcome.
    """
    planned = {(gate.file, gate.name): gate for gate in gates}
    runs = [
        run if run.gate is None or (run.file, run.gate) in planned else run.model_copy(update={"gate": None})
        for run in _audited_over_variations([outcome for outcome in outcomes if outcome.statistics is None])
    ]
    samples: dict[tuple[str, str], list[Outcome]] = {}
    for run in runs:
        if run.gate is not None:
            samples.setdefault((run.file, run.gate), []).append(run)
    judged = {
        key: judged_gate(gate, samples[key])
        for key, gate in planned.items()
        if key in samples and not (is_part and len(samples[key]) < gate.runs)
    }
    with_gates: list[Outcome] = []
    for run in runs:
        if run.gate is not None and (gate := judged.pop((run.file, run.gate), None)) is not None:
            with_gates.append(gate)
        with_gates.append(run)
    return tuple(with_gates)


def _audited_over_variations(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Return the outcomes without the warnings that count only if all variations with a verdict have them."""
    counted: dict[tuple[str, str | None], list[AuditWarning]] = {}
    for outcome in outcomes:
        if outcome.group is not None and outcome.has_verdict and outcome.end != "expectation failed":
            warnings = [warning for warning in outcome.warnings if warning.is_over_variations]
            same = counted.setdefault((outcome.file, outcome.group), warnings)
            same[:] = [warning for warning in same if warning in warnings]
    return [_audited(outcome, counted.get((outcome.file, outcome.group))) for outcome in outcomes]


def _audited(outcome: Outcome, shared: Sequence[AuditWarning] | None) -> Outcome:
    if shared is not None and any(warning.is_over_variations and warning not in shared for warning in outcome.warnings):
        kept = tuple(warning for warning in outcome.warnings if not warning.is_over_variations or warning in shared)
        outcome = share_parts(outcome.model_copy(update={"warnings": kept}), outcome)
    if outcome.strict and outcome.has_verdict and outcome.status != (status := outcome.judged_status()):
        return share_parts(outcome.model_copy(update={"status": status}), outcome)
    return outcome
