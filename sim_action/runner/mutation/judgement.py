"""The judgement of mutants: which expectations noticed each of them, and what nothing noticed."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.wording import counted
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.proof import Finding, MutantResult, MutantStatus, PathChange, ProvenExpectation, ProvenScenario
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.outcome_assembly import stored_trace
from sim_action.state.trace import Trace, rotation_angles


@dataclass(frozen=True, eq=False)
class JudgedMutant:
    """A mutant after its run."""

    mutant: Mutant
    outcome: Outcome  # the outcome of its run
    result: MutantResult  # what its run showed


def judged(original: Original, mutant: Mutant, outcome: Outcome, folder: Path) -> JudgedMutant:
    """Return a mutant with the result of its run, whose files are in `folder`."""
    result = MutantResult(name=mutant.name, words=mutant.words, status="could not run", digest=outcome.digest)
    status = status_of(original, outcome)
    update: dict[str, object] = {"status": status}
    match status:
        case "could not run":
            update |= {"reason": _reason_of(outcome)}
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
    trace = stored_trace(outcome, folder)
    model = original.loaded.model
    joints = () if model is None else model.moving_joints
    sliding = [joint.name for joint in joints if joint.type == "prismatic"]
    return None if trace is None else path_change(original.trace, trace, sliding)


def not_mutated(outcome: Outcome) -> ProvenScenario:
    """Return a scenario that cannot run, that did not pass, or whose run left no trace."""
    reason = "it left no trace" if outcome.status == "passed" else _reason_of(outcome)
    return ProvenScenario(reason=reason, location=_place_of(outcome), **_of_run(outcome))


def _reason_of(outcome: Outcome) -> str:
    """Return the reason why a run did not pass."""
    if outcome.status != "error":
        return outcome.ending
    first, *others = outcome.failures
    more = f"; and {counted(len(others), 'more problem')}" if others else ""
    return f"{first.title}: {first.message}{more}"


def _place_of(outcome: Outcome) -> Location | None:
    places = (*(failure.location for failure in outcome.failures), *(expected.location for expected in outcome.causes))
    return next((place for place in places if place is not None), outcome.location)


def proven(original: Original, mutants: Sequence[JudgedMutant], left_out: int, unfinished: int = 0) -> ProvenScenario:
    """Return a scenario with findings; `left_out`, `unfinished`: mutants that were not to run, and interrupted ones."""
    results = tuple(judged_one.result for judged_one in mutants)
    expectations = tuple(
        _finding(place, expected, results, original.outcome.digest, is_complete=not (left_out or unfinished))
        for place, expected in enumerate(original.outcome.expectations)
    )
    of_run = _of_run(original.outcome)
    return ProvenScenario(
        expectations=expectations, mutants=results, left_out=left_out, unfinished=unfinished, **of_run
    )


def _of_run(outcome: Outcome) -> dict[str, Any]:
    same = {key: getattr(outcome, key) for key in ("name", "file", "line", "variation")}
    return {**same, "exit_code": int(outcome.exit_code)}


def _finding(
    place: int, expected: ExpectationOutcome, mutants: Sequence[MutantResult], digest: str | None, *, is_complete: bool
) -> ProvenExpectation:
    """Return the finding on the expectation at a place; `digest`: of the run without a mutant."""
    noticed = tuple(mutant.name for mutant in mutants if place in mutant.noticed_by)
    # A reading that changed no motion concerns only the expectations that read it.
    others = [
        mutant
        for mutant in mutants
        if mutant.digest != digest and place not in (*mutant.noticed_by, *mutant.not_exercised)
    ]
    missed = tuple(mutant.name for mutant in others if mutant.status == "noticed")
    changed = len(noticed) + sum(mutant.status in ("noticed", "survived") for mutant in others)
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
        not_exercised=tuple(mutant.name for mutant in mutants if place in mutant.not_exercised),
        changed=changed,
        sensitivity=_sensitivity(expected),
    )


def _sensitivity(expected: ExpectationOutcome) -> float | None:
    verdict = expected.verdict
    return None if verdict.goal or verdict.margin is None or not verdict.limit else abs(verdict.margin / verdict.limit)


def next_strengths(original: Original, mutants: Sequence[JudgedMutant]) -> list[Mutant]:
    """Return the next mutants: milder than those noticed, stronger than others, or while an expectation saw none."""
    noticed = {place for judged_one in mutants for place in judged_one.result.noticed_by}
    idle = any(
        expected.verdict.passed and place not in noticed for place, expected in enumerate(original.outcome.expectations)
    )
    following = list[Mutant]()
    for judged_one in mutants:
        mutant, is_noticed = judged_one.mutant, judged_one.result.status == "noticed"
        if mutant.milder and is_noticed:
            following.append(replace(mutant.milder[0], milder=mutant.milder[1:]))
        elif mutant.stronger and (idle or not is_noticed):
            following.append(replace(mutant.stronger[0], stronger=mutant.stronger[1:]))
    return following


def with_strengths(mutants: Sequence[JudgedMutant], ran: Sequence[JudgedMutant]) -> list[JudgedMutant]:
    """Return judged mutants with new strengths: a milder one replaces the noticed one, a stronger one follows."""
    by_name = {judged_one.mutant.name: judged_one for judged_one in ran}
    updated = list[JudgedMutant]()
    for judged_one in mutants:
        mutant = judged_one.mutant
        following = next((by_name.get(other.name) for other in mutant.strengths[1:]), None)
        if following is None:
            updated.append(judged_one)
        elif mutant.milder and following.result.status == "noticed":
            updated.append(following)
        else:
            done = replace(judged_one, mutant=replace(mutant, milder=(), stronger=()))
            updated += [done] if mutant.milder else [done, following]
    return updated


def with_suggestion(judged: JudgedMutant, suggestion: str) -> JudgedMutant:
    """Return a mutant with the expectation that would have noticed it."""
    return replace(judged, result=judged.result.model_copy(update={"suggestion": suggestion}))


LEAST_DISTANCE_M: Final = 0.1
LEAST_ANGLE: Final = math.radians(5)
"""The smallest changes that count: of the base in m and in rad, and of the joints of a base that stays, in rad or m."""

_DIGITS: Final = 6  # rounding must not decide which of two equal changes is reported


def path_change(original: Trace, mutant: Trace, sliding: Collection[str] = ()) -> PathChange | None:
    """Return the greatest change of the motion, if large enough; `sliding`: joints with positions in m."""
    # The rows of both traces at equal times, and then the last row of each.
    ends = min(original.time[-1], mutant.time[-1]) + TIME_EPSILON_S
    ours = np.flatnonzero(original.time <= ends)
    theirs = np.searchsorted(mutant.time, original.time[ours] + TIME_EPSILON_S, side="right") - 1
    ours, theirs = np.append(ours, len(original) - 1), np.append(np.maximum(theirs, 0), len(mutant) - 1)
    apart = mutant.base_position_xyz[theirs] - original.base_position_xyz[ours]
    distances = np.linalg.norm(apart, axis=1).round(_DIGITS)
    angles = rotation_angles(original.base_orientation_xyzw[ours], mutant.base_orientation_xyzw[theirs]).round(_DIGITS)
    row = int(np.argmax(distances))
    if distances[row] >= LEAST_DISTANCE_M:
        forward = float(original.yaw[ours[row]])
        words = f"the robot was {_where(apart[row].tolist(), forward)}{_when(mutant, theirs, row)}"
        return PathChange(text=words, distance=float(distances[row]), angle=float(angles.max()))
    row = int(np.argmax(angles))
    if angles[row] >= LEAST_ANGLE:
        words = f"the robot was turned by {units.display(float(angles[row]), 'rad')} more{_when(mutant, theirs, row)}"
        return PathChange(text=words, distance=float(distances.max()), angle=float(angles[row]))
    return _joint_change(original, mutant, ours, theirs, sliding)


def _joint_change(
    original: Trace,
    mutant: Trace,
    ours: np.ndarray[tuple[int], np.dtype[np.intp]],
    theirs: np.ndarray[tuple[int], np.dtype[np.intp]],
    sliding: Collection[str],
) -> PathChange | None:
    """Return the greatest change of a joint of a base that stays where it is; wheels of others turn anyhow."""
    travel = np.linalg.norm(np.ptp(original.base_position_xyz, axis=0))
    if not original.joint_names or travel >= LEAST_DISTANCE_M:
        return None
    changes = np.abs(mutant.joint_position[theirs] - original.joint_position[ours]).round(_DIGITS)
    row, column = (int(index) for index in np.unravel_index(int(np.argmax(changes)), changes.shape))
    change = float(changes[row, column])
    if change < LEAST_ANGLE:
        return None
    joint = original.joint_names[column]
    apart = units.display(change, "m" if joint in sliding else "rad")
    words = f"joint '{joint}' was {apart} elsewhere{_when(mutant, theirs, row)}"
    return PathChange(text=words, distance=0.0, angle=0.0, joint=joint, joint_change=change)


def _when(mutant: Trace, theirs: np.ndarray[tuple[int], np.dtype[np.intp]], row: int) -> str:
    return " at the end" if row == len(theirs) - 1 else f" at {float(mutant.time[theirs[row]]):.2f} s"


def _where(apart_xyz: list[float], forward: float) -> str:
    """Return the way between places by its greatest component, as "0.8 m further left"; `forward`: yaw in rad."""
    x, y, z = apart_xyz
    ahead = math.cos(forward) * x + math.sin(forward) * y
    left = math.cos(forward) * y - math.sin(forward) * x
    amounts = {"further ahead": ahead, "behind": -ahead, "further left": left, "further right": -left}
    amounts |= {"higher": z, "lower": -z}
    return f"{math.hypot(x, y, z):.2f} m {max(amounts, key=lambda word: amounts[word])}"
