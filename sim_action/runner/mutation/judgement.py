"""The judgement of mutants: which expectations noticed each of them, and what nothing noticed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sim_action.core.errors import Location
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import counted
from sim_action.results.artifacts import stored_file
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.proof import Finding, MutantResult, MutantStatus, PathChange, ProvenExpectation, ProvenScenario
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.mutation.path_change import path_change
from sim_action.scenario.model import LoadedScenario
from sim_action.state.trace import Trace
from sim_action.state.trace_storage import TraceError, load_trace


@dataclass(frozen=True, eq=False)
class JudgedMutant:
    """A mutant after its run.

    Attributes:
        outcome: the outcome of its run.
        result: what its run showed.
    """

    mutant: Mutant
    outcome: Outcome
    result: MutantResult


def stored(outcome: Outcome, folder: Path) -> Trace | None:
    """Return the trace of a run; None if it has none."""
    path = stored_file(folder, outcome.trace) if outcome.trace else None
    try:
        return None if path is None else load_trace(path)
    except TraceError:
        return None


def judged(original: Original, mutant: Mutant, outcome: Outcome, folder: Path) -> JudgedMutant:
    """Return a mutant with the result of its run, whose files are in `folder`."""
    result = MutantResult(name=mutant.name, words=mutant.words, status="could not run", digest=outcome.digest)
    status = status_of(original, outcome)
    update: dict[str, object] = {"status": status}
    match status:
        case "could not run":
            update |= {"reason": reason_of(outcome)}
        case "survived":
            update |= _changed(original.outcome, outcome) | {"change": _change(original, outcome, folder)}
        case "noticed" | "no effect":
            update |= _changed(original.outcome, outcome)
    return JudgedMutant(mutant, outcome, result.model_copy(update=update))


def status_of(original: Original, outcome: Outcome) -> MutantStatus:
    """Return the result of a mutant, given the outcome of its run."""
    if not outcome.has_verdict:
        return "could not run"
    changed = [
        now for before, now in _pairs(original.outcome, outcome) if notices(before, now) or _is_unexercised(before, now)
    ]
    if any(now.prevents_pass for now in changed):
        return "noticed"
    return "survived" if changed or outcome.digest != original.outcome.digest else "no effect"


def _pairs(original: Outcome, mutant: Outcome) -> Sequence[tuple[ExpectationOutcome, ExpectationOutcome]]:
    return list(zip(original.expectations, mutant.expectations, strict=True))


def notices(before: ExpectationOutcome, now: ExpectationOutcome) -> bool:
    """Return True if an expectation passed without a mutant, and fails by itself with it."""
    return before.verdict.passed and now.verdict.status == "failed" and not now.verdict.cut_off


def _is_unexercised(before: ExpectationOutcome, now: ExpectationOutcome) -> bool:
    return before.verdict.passed and now.verdict.status == "not_exercised" and not now.verdict.cut_off


def _changed(original: Outcome, mutant: Outcome) -> dict[str, object]:
    """Return the places of the expectations whose verdicts a mutant changed, as `MutantResult` has them."""
    pairs = _pairs(original, mutant)
    return {
        "noticed_by": tuple(place for place, pair in enumerate(pairs) if notices(*pair)),
        "not_exercised": tuple(place for place, pair in enumerate(pairs) if _is_unexercised(*pair)),
    }


def _change(original: Original, outcome: Outcome, folder: Path) -> PathChange | None:
    trace = stored(outcome, folder)
    model = original.loaded.model
    joints = () if model is None else model.moving_joints
    sliding = [joint.name for joint in joints if joint.type == "prismatic"]
    return None if trace is None else path_change(original.trace, trace, sliding)


def not_mutated(loaded: LoadedScenario, outcome: Outcome) -> ProvenScenario:
    """Return a scenario that did not pass, or whose run left no trace."""
    reason = "it left no trace" if outcome.status == "passed" else reason_of(outcome)
    scenario = ProvenScenario(name=outcome.name, file=outcome.file, reason=reason, location=place_of(outcome))
    return _placed(loaded, scenario, outcome)


def reason_of(outcome: Outcome) -> str:
    """Return the reason why a run did not pass."""
    if outcome.status != "error":
        return outcome.ending
    first, *others = outcome.failures
    more = f"; and {counted(len(others), 'more problem')}" if others else ""
    return f"{first.title}: {first.message}{more}"


def place_of(outcome: Outcome) -> Location | None:
    """Return the place of the reason why a run did not pass; None if there is none."""
    places = (*(each.location for each in outcome.failures), *(each.location for each in outcome.causes))
    return next((place for place in places if place is not None), outcome.location)


def proven(original: Original, mutants: Sequence[JudgedMutant], left_out: int, unfinished: int = 0) -> ProvenScenario:
    """Return a scenario with the findings on its expectations.

    `left_out`, `unfinished`: the numbers of mutants that were not to run, and that an interruption ended.
    """
    results = tuple(each.result for each in mutants)
    expectations = tuple(
        _finding(place, expected, results, original.outcome.digest, is_complete=not (left_out or unfinished))
        for place, expected in enumerate(original.outcome.expectations)
    )
    scenario = ProvenScenario(
        name=original.outcome.name,
        file=original.outcome.file,
        expectations=expectations,
        mutants=results,
        left_out=left_out,
        unfinished=unfinished,
    )
    return _placed(original.loaded, scenario, original.outcome)


def _placed(loaded: LoadedScenario, scenario: ProvenScenario, outcome: Outcome) -> ProvenScenario:
    source = loaded.source
    update = {"line": source.line, "variation": source.variation, "exit_code": int(outcome.exit_code)}
    return scenario.model_copy(update=update)


def _finding(
    place: int,
    expected: ExpectationOutcome,
    mutants: Sequence[MutantResult],
    digest: str | None,
    *,
    is_complete: bool,
) -> ProvenExpectation:
    """Return the finding on the expectation at a place; `digest`: of the run without a mutant."""
    noticed = tuple(each.name for each in mutants if place in each.noticed_by)
    # A reading that changed no motion concerns only the expectations that read it.
    others = [
        each for each in mutants if each.digest != digest and place not in (*each.noticed_by, *each.not_exercised)
    ]
    missed = tuple(each.name for each in others if each.status == "noticed")
    changed = len(noticed) + sum(each.status in ("noticed", "survived") for each in others)
    is_known = changed > 0 and is_complete and expected.verdict.passed
    finding: Finding = "notices" if noticed else "checks nothing" if is_known else "unknown"
    return ProvenExpectation(
        name=expected.name,
        assertion=expected.assertion,
        severity=expected.severity,
        location=expected.location,
        finding=finding,
        passed=expected.verdict.passed,
        noticed=noticed,
        missed=missed,
        not_exercised=tuple(each.name for each in mutants if place in each.not_exercised),
        changed=changed,
        sensitivity=_sensitivity(expected),
    )


def _sensitivity(expected: ExpectationOutcome) -> float | None:
    verdict = expected.verdict
    return None if verdict.goal or verdict.margin is None or not verdict.limit else abs(verdict.margin / verdict.limit)


def with_suggestion(judged: JudgedMutant, suggestion: str) -> JudgedMutant:
    """Return a mutant with the expectation that would have noticed it."""
    return replace(judged, result=judged.result.model_copy(update={"suggestion": suggestion}))
