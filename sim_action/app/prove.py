"""The use case `prove`: run scenarios, run their mutants, and tell which expectations notice anything."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action import __version__
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass
from sim_action.core.wording import counted, escaped_line, note, system_reason
from sim_action.reports.progress import ProgressListener
from sim_action.reports.proof import print_proof
from sim_action.results.outcome import Outcome
from sim_action.results.proof import Proof, ProvenScenario
from sim_action.results.written_files import is_foreign, is_proof
from sim_action.runner.mutation.judgement import JudgedMutant, judged, not_mutated, proven, stored, with_suggestion
from sim_action.runner.mutation.mutant import Original
from sim_action.runner.mutation.planning import PlannedMutants, cost, first_runs, planned, refuse_unknown, within
from sim_action.runner.mutation.suggestions import Candidates, candidates
from sim_action.runner.process_pool import execute
from sim_action.runner.run_plan import PlanRequest, plan_runs
from sim_action.scenario.loading import Libraries
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused

_MINUTE_S: Final = 60


@dataclass(frozen=True, slots=True)
class ProveRequest:
    """The options of `prove`.

    Attributes:
        only: names of the mutants to run, see `planning.refuse_unknown`; empty: all of them.
        budget: the wall time in s that mutants may take, as estimated before they start; None: any.
        json: the file for the proof; None: none.
        strict: an expectation that checks nothing fails the call.
        quiet: print no progress.
    """

    plan: PlanRequest
    jobs: int
    only: tuple[str, ...] = ()
    budget: float | None = None
    json: Path | None = None
    strict: bool = False
    quiet: bool = False


def prove_scenarios(request: ProveRequest, interruption: Interruption) -> ExitCode:
    """Prove all scenarios, print the findings and return the exit code. Raise UsageError."""
    refuse_unknown(request.only)
    if request.json is not None:
        _refuse_foreign(request.json)
    proof = proof_of(request, interruption)
    if proof is None:
        note("interrupted: no scenario is proven")
        return ExitCode.INTERRUPTED
    if request.json is not None:
        try:
            proof.write(request.json)
        except OSError as error:
            raise UsageError(escaped_line(f"--json {request.json} cannot be written: {system_reason(error)}")) from None
    # A closed output does not change the result.
    with suppress(BrokenPipeError):
        print_proof(proof, os.environ)
    return proof.exit_code(strict=request.strict)


def proof_of(request: ProveRequest, interruption: Interruption) -> Proof | None:
    """Return the proof of all scenarios; None if the call was interrupted. Raise UsageError."""
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder:
        call = _Call(request, Path(folder), interruption)
        scenarios = call.scenarios()
        if interruption.happened:
            return None
        took = max(0.0, time.monotonic() - started)
        return Proof(sim_action=__version__, runs=call.runs, wall_time=took, scenarios=tuple(scenarios))


class _Call:
    """One call: `folder` holds the traces of its runs.

    Attributes:
        runs: the number of runs so far.
    """

    def __init__(self, request: ProveRequest, folder: Path, interruption: Interruption) -> None:
        self._request, self._folder, self._interruption = request, folder, interruption
        self.runs = 0

    def scenarios(self) -> list[ProvenScenario]:
        """Run everything, and return the scenarios in their order."""
        found = plan_runs(self._request.plan)
        firsts = list(first_runs(found.plans))
        loaded = [each for each in firsts if not isinstance(each, Refused)]
        outcomes = iter(self._outcomes(loaded, "originals"))
        told: list[ProvenScenario | Original] = []
        for each in firsts:
            if isinstance(each, Refused):
                told.append(_of_refused(Outcome.of_refused(each)))
            else:
                told.append(self._original(each, next(outcomes)))
        told += map(_of_refused, [*map(Outcome.of_nothing, found.empty), *map(Outcome.of_unmatched, found.unmatched)])
        proven_ones = iter(self._proven([each for each in told if isinstance(each, Original)]))
        return [next(proven_ones) if isinstance(each, Original) else each for each in told]

    def _original(self, loaded: LoadedScenario, outcome: Outcome) -> ProvenScenario | Original:
        """Return a run that passed, or the reason why it is not mutated."""
        trace = stored(outcome, self._folder / "originals") if outcome.status == "passed" else None
        return not_mutated(loaded, outcome) if trace is None else Original(loaded, outcome, trace)

    def _proven(self, originals: Sequence[Original]) -> list[ProvenScenario]:
        """Return the scenarios that passed, after the runs of their mutants."""
        request = self._request
        plans = planned(originals, request.only)
        if request.budget is not None:
            plans = within(plans, request.budget, request.jobs)
        self._announce(plans)
        mutants = [mutant.loaded for plan in plans for mutant in plan.chosen]
        outcomes = iter(self._outcomes(mutants, "mutants"))
        results = [
            [judged(plan.original, mutant, next(outcomes), self._folder / "mutants") for mutant in plan.chosen]
            for plan in plans
        ]
        results = self._with_suggestions(plans, results)
        return [proven(plan.original, several, plan.left_out) for plan, several in zip(plans, results, strict=True)]

    def _with_suggestions(
        self, plans: Sequence[PlannedMutants], results: Sequence[Sequence[JudgedMutant]]
    ) -> list[list[JudgedMutant]]:
        """Return the mutants, each survivor with an expectation that would have noticed it, if one is found."""
        libraries = Libraries()
        survived = [[_survived(each) for each in several] for several in results]
        offers = [
            candidates(plan.original, self._request.plan.permissions, libraries) if any(several) else None
            for plan, several in zip(plans, survived, strict=True)
        ]
        wanted = [*_with_candidates(offers, results, survived)]
        outcomes = iter(self._outcomes(wanted, "suggestions"))
        told = []
        for offer, several, alive in zip(offers, results, survived, strict=True):
            if offer is None:
                told.append(list(several))
                continue
            original = next(outcomes)
            told.append(
                [
                    with_suggestion(each, offer.best(original, next(outcomes))) if is_alive else each
                    for each, is_alive in zip(several, alive, strict=True)
                ]
            )
        return told

    def _outcomes(self, scenarios: Sequence[LoadedScenario], name: str) -> list[Outcome]:
        """Run scenarios with a folder of their own, and return an outcome each."""
        if not scenarios:
            return []
        folder = self._folder / name
        folder.mkdir()
        self.runs += len(scenarios)
        listener = ProgressListener(len(scenarios), "quiet" if self._request.quiet else "normal")
        outcomes = execute(scenarios, folder, self._request.jobs, listener, self._interruption)
        listener.close()
        return outcomes

    def _announce(self, plans: Sequence[PlannedMutants]) -> None:
        """Print the cost of the mutants before they start."""
        runs, left = sum(len(plan.chosen) for plan in plans), sum(plan.left_out for plan in plans)
        seconds = cost(plans, self._request.jobs)
        took = f"{seconds / _MINUTE_S:.0f} min" if seconds > 2 * _MINUTE_S else f"{seconds:.0f} s"
        over = f"; {left:,} more are over the budget" if left else ""
        if not self._request.quiet:
            note(f"{counted(runs, 'mutant')} of {counted(len(plans), 'scenario')}, about {took} in all{over}")
            sys.stderr.flush()


def _survived(each: JudgedMutant) -> bool:
    return each.result.status == "survived" and each.result.change is not None


def _with_candidates(
    offers: Sequence[Candidates | None],
    results: Sequence[Sequence[JudgedMutant]],
    survived: Sequence[Sequence[bool]],
) -> Iterator[LoadedScenario]:
    """Yield each scenario with its candidates, followed by its survivors with the same ones."""
    for offer, several, alive in zip(offers, results, survived, strict=True):
        if offer is not None:
            yield offer.loaded
            yield from (offer.added_to(each.mutant.loaded) for each, lives in zip(several, alive, strict=True) if lives)


def _of_refused(outcome: Outcome) -> ProvenScenario:
    """Return a scenario that cannot run."""
    return ProvenScenario(
        name=outcome.name,
        file=outcome.file,
        line=outcome.line,
        variation=outcome.variation,
        reason=outcome.ending,
        exit_code=int(outcome.exit_code),
    )


def _refuse_foreign(path: Path) -> None:
    """Raise UsageError if the file exists and `prove` did not write it, or if its folder does not exist."""
    if not path.parent.is_dir():
        raise UsageError(escaped_line(f"--json {path} cannot be written: there is no folder {path.parent}"))
    try:
        foreign = is_foreign(path, is_proof)
    except (OSError, ValueError) as error:
        raise UsageError(escaped_line(f"--json {path} cannot be written: {system_reason(error)}")) from None
    if foreign:
        raise UsageError(escaped_line(f"--json {path} exists and is no proof; name another file, or remove it"))
