"""The use case `prove`: run scenarios, run their mutants, and report which expectations notice a mutant."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Final, get_args

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, replace
from sim_action.core.version import __version__
from sim_action.core.wording import counted, escaped_line, note
from sim_action.reports import ReportOptions, ReportRequest, workspace_of
from sim_action.reports.html.proof_page import ShownScenario, write_proof_page
from sim_action.reports.progress import ProgressListener
from sim_action.reports.proof import print_proof, write_proof_annotations, write_proof_outputs, write_proof_summary
from sim_action.reports.writing import open_reports
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.journal import RunEnded
from sim_action.results.outcome import Outcome
from sim_action.results.output_folder import JUNIT_FILE, is_proof, refuse_foreign_file, remove_regular, writing
from sim_action.results.proof import MutantStatus, Proof
from sim_action.results.results_json import write_json
from sim_action.runner.child_outcome import interrupted
from sim_action.runner.mutation import judgement, planning
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.mutation.suggestions import MOST_RUNS, MOST_TRIALS, Candidates, Search, candidates
from sim_action.runner.process_pool import Pool, PoolOptions
from sim_action.runner.run_plan import PlanRequest, Runs, plan_runs
from sim_action.scenario.loading import Libraries
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused

_MINUTE_S: Final = 60
# The folders of the runs without a mutant, and of those with one.
_ORIGINALS: Final = "originals"
_MUTANTS: Final = "mutants"
_WIDTH: Final = max(map(len, get_args(MutantStatus)))  # the width of the results of mutants in the progress


PROOF_FOLDER: Final = "proof"  # the folder of the report below the output folder, so that the results of `run` stay


@dataclass(frozen=True, slots=True)
class ProveRequest:
    """The options of `prove`."""

    plan: PlanRequest
    reports: ReportRequest  # which reports are written, and the folder for them
    jobs: int
    only: tuple[str, ...] = ()  # names of the mutants to run, see `planning.refuse_unknown`; empty: all of them
    budget: float | None = None  # the wall time in s that mutants may take, as estimated before they start; None: any
    json: Path | None = None  # the file for the proof; None: none
    strict: bool = False  # an expectation that has noticed nothing fails the call

    @property
    def is_quiet(self) -> bool:
        """True if no progress is printed."""
        return self.reports.verbosity == "quiet"

    @property
    def has_report(self) -> bool:
        """True if `report.html` is written."""
        return "report" not in self.reports.silenced


def prove_scenarios(request: ProveRequest, interruption: Interruption) -> ExitCode:
    """Prove all scenarios, write the findings, even if interrupted, and return the exit code. Raise UsageError."""
    planning.refuse_unknown(request.only)
    if request.json is not None:
        if not request.json.parent.is_dir():
            place = f"there is no folder {request.json.parent}"
            raise UsageError(escaped_line(f"--json {request.json} cannot be written: {place}"))
        refuse_foreign_file("--json", request.json, is_proof, "is no proof")
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder:
        call = _Call(request, Path(folder), interruption)
        with _opened(request.reports) as options:
            proof = call.proof()
            if proof is None:
                note("interrupted: no scenario is proven")
                return ExitCode.of_command(is_interrupted=True)
            _write(proof, call.shown, request, options, Path(folder))
    # A closed output does not change the result.
    with suppress(BrokenPipeError):
        print_proof(proof, os.environ)
        if "annotations" not in request.reports.silenced:
            write_proof_annotations(proof, options, strict=request.strict)
    return proof.exit_code(strict=request.strict)


@contextmanager
def _opened(request: ReportRequest) -> Iterator[ReportOptions]:
    """Yield the options of the reports; the folder is made and locked if there is a report. Raise UsageError."""
    if "report" in request.silenced:
        yield ReportOptions(
            folder=request.folder,
            junit=request.folder / JUNIT_FILE,
            junit_strict=False,
            environment=os.environ,
            workspace=workspace_of(os.environ, Path.cwd()),
            verbosity=request.verbosity,
            silenced=request.silenced,
        )
        return
    with open_reports(request) as options:
        # A call that is killed must not leave the report of another one.
        with suppress(OSError):
            remove_regular(options.folder / REPORT_FILE)
        yield options


def _write(
    proof: Proof, shown: Sequence[ShownScenario], request: ProveRequest, options: ReportOptions, replays: Path
) -> None:
    """Write the proof, the page and files of GitHub; replays are in `replays`. Raise UsageError."""
    if request.json is not None:
        with writing(f"--json {request.json}"):
            write_json(proof, request.json)
    if request.has_report:
        with writing(str(options.folder / REPORT_FILE)):
            write_proof_page(proof, shown, options, replays)
    with writing("the job summary or the outputs"):
        write_proof_outputs(proof, options)
        if "summary" not in options.silenced:
            write_proof_summary(proof, options)


class _Call:
    """One call: `folder` holds the files of its runs. Raise UsageError.

    `shown`: the scenarios of the proof with their runs.
    """

    def __init__(self, request: ProveRequest, folder: Path, interruption: Interruption) -> None:
        self._request, self._folder, self._interruption = request, folder, interruption
        self._started = time.monotonic()
        self._runs = 0
        self._run_plan = plan_runs(request.plan)
        self.shown: list[ShownScenario] = []

    def proof(self) -> Proof | None:
        """Run everything, and return the proof; None if an interruption came before the first mutant had ended."""
        firsts = list(planning.first_runs(self._run_plan.plans))
        loaded = [first for first in firsts if not isinstance(first, Refused)]
        outcomes = iter(self._outcomes(loaded, _ORIGINALS))
        several = [Outcome.of_refused(first) if isinstance(first, Refused) else next(outcomes) for first in firsts]
        entries = [
            Original.of(first, outcome, self._folder / _ORIGINALS) or ShownScenario(judgement.not_mutated(outcome))
            for first, outcome in zip(firsts, several, strict=True)
        ]
        entries += (ShownScenario(judgement.not_mutated(outcome)) for outcome in self._run_plan.of_nothing)
        proven_ones = iter(self._proven([entry for entry in entries if isinstance(entry, Original)]))
        self.shown = [next(proven_ones) if isinstance(entry, Original) else entry for entry in entries]
        scenarios = tuple(scenario.scenario for scenario in self.shown)
        interrupted = self._interruption.happened
        if interrupted and not any(scenario.mutants for scenario in scenarios):
            return None
        return Proof(
            sim_action=__version__,
            runs=self._runs,
            wall_time=max(0.0, time.monotonic() - self._started),
            interrupted=interrupted,
            scenarios=scenarios,
        )

    def _proven(self, originals: Sequence[Original]) -> list[ShownScenario]:
        """Return the scenarios that passed, after the runs of their mutants."""
        request = self._request
        plans = planning.planned(originals, request.only)
        if not self._interruption.happened:
            planning.refuse_unmatched(plans, request.only)
        if request.budget is not None:
            plans = planning.within(plans, request.budget, request.jobs)
        self._announce(plans)
        first = self._judged([(plan.original, plan.chosen) for plan in plans])
        unfinished = [len(plan.chosen) - len(several) for plan, several in zip(plans, first, strict=True)]
        results = self._with_suggestions(plans, self._with_strengths(plans, first))
        return [self._shown(*triple) for triple in zip(plans, results, unfinished, strict=True)]

    def _judged(
        self, groups: Sequence[tuple[Original, Sequence[Mutant]]], name: str = _MUTANTS
    ) -> list[list[judgement.JudgedMutant]]:
        """Run the mutants of each original, and return all that have ended; `name`: the name of their folder."""
        pairs = [(original, mutant) for original, mutants in groups for mutant in mutants]
        outcomes = iter(
            self._outcomes(
                [mutant.loaded for _, mutant in pairs],
                name,
                lambda ended: f"{judgement.status_of(pairs[ended.place][0], ended.outcome):<{_WIDTH}}",
            )
        )
        return [
            [
                replace(judgement.judged(original, mutant, outcome, self._folder / name), outcome=_below(outcome, name))
                for mutant, outcome in zip(mutants, outcomes, strict=False)
                if outcome.exit_code is not ExitCode.INTERRUPTED
            ]
            for original, mutants in groups
        ]

    def _with_strengths(
        self, plans: Sequence[planning.PlannedMutants], results: Sequence[Sequence[judgement.JudgedMutant]]
    ) -> list[list[judgement.JudgedMutant]]:
        """Return the mutants after the runs of their other strengths; a budget has no time for these."""
        judged_ones = [list(several) for several in results]
        if self._request.budget is not None:
            return judged_ones
        originals = [plan.original for plan in plans]
        for turn in count():
            waiting = [judgement.next_strengths(*pair) for pair in zip(originals, judged_ones, strict=True)]
            if not any(waiting) or self._interruption.happened:
                return judged_ones
            runs = self._judged(list(zip(originals, waiting, strict=True)), f"{_MUTANTS}-{turn}")
            judged_ones = [judgement.with_strengths(*pair) for pair in zip(judged_ones, runs, strict=True)]
        raise AssertionError

    def _shown(
        self, plan: planning.PlannedMutants, judged_ones: Sequence[judgement.JudgedMutant], unfinished: int
    ) -> ShownScenario:
        """Return a scenario with its findings, the run without a mutant, and the runs of its survivors."""
        return ShownScenario(
            judgement.proven(plan.original, judged_ones, plan.left_out, unfinished),
            _below(plan.original.outcome, _ORIGINALS),
            [judged.outcome for judged in judged_ones if _survived(judged)],
        )

    def _with_suggestions(
        self, plans: Sequence[planning.PlannedMutants], results: Sequence[Sequence[judgement.JudgedMutant]]
    ) -> list[list[judgement.JudgedMutant]]:
        """Return the mutants, each survivor with an expectation that would have noticed it, if one is found."""
        libraries = Libraries()
        survived = [[_survived(judged) for judged in several] for several in results]
        offers = [
            candidates(plan.original, self._request.plan.permissions, libraries, _changed_joints(several))
            if any(alive)
            else None
            for plan, several, alive in zip(plans, results, survived, strict=True)
        ]
        outcomes = iter(self._outcomes([*_with_candidates(offers, results, survived)], "candidates", _tried))
        searches: list[list[Search | None]] = []
        for offer, several, alive in zip(offers, results, survived, strict=True):
            original = None if offer is None else next(outcomes)
            searches.append(
                [
                    Search(offer, judged.mutant.loaded, offer.noticing(original, next(outcomes)))
                    if is_alive and offer is not None and original is not None
                    else None
                    for judged, is_alive in zip(several, alive, strict=True)
                ]
            )
        self._decide([search for several in searches for search in several if search is not None])
        return [
            [
                judged if search is None else judgement.with_suggestion(judged, search.suggestion)
                for judged, search in zip(several, plan_searches, strict=True)
            ]
            for several, plan_searches in zip(results, searches, strict=True)
        ]

    def _decide(self, searches: Sequence[Search]) -> None:
        """Run each survivor with one candidate after the other, until one is found."""
        for turn in range(MOST_TRIALS):
            left = [search for search in searches if search.places]
            outcomes = self._outcomes([run for search in left for run in search.pair], f"suggestions-{turn}", _tried)
            for search, original, mutant in zip(left, outcomes[::2], outcomes[1::2], strict=True):
                search.decide(original, mutant)

    def _outcomes(
        self, scenarios: Sequence[LoadedScenario], name: str, word_of: Callable[[RunEnded], str] | None = None
    ) -> list[Outcome]:
        """Run scenarios with a folder of their own, and return an outcome each; `word_of`: see `ProgressListener`."""
        if not scenarios:
            return []
        if self._interruption.happened:
            return [interrupted(scenario) for scenario in scenarios]
        folder = self._folder / name
        folder.mkdir()
        self._runs += len(scenarios)
        request = self._request
        listener = ProgressListener(len(scenarios), request.reports.verbosity, word_of=word_of)
        replays = request.has_report and name.startswith((_ORIGINALS, _MUTANTS))
        options = PoolOptions(request.jobs)
        outcomes = Pool(Runs(scenarios, folder, replays=replays), listener, self._interruption, options).outcomes()
        listener.close()
        return outcomes

    def _announce(self, plans: Sequence[planning.PlannedMutants]) -> None:
        """Print the cost of the mutants before they start."""
        runs, left = sum(len(plan.chosen) for plan in plans), sum(plan.left_out for plan in plans)
        seconds = planning.cost(plans, self._request.jobs)
        took = f"{seconds / _MINUTE_S:.0f} min" if seconds > 2 * _MINUTE_S else f"{seconds:.0f} s"
        over = f"; {counted(left, 'mutant')} left out" if left else ""
        if not self._request.is_quiet:
            more = f"; then up to {MOST_RUNS} runs for each mutant that survives, to try expectations" if runs else ""
            note(f"{counted(runs, 'mutant')} of {counted(len(plans), 'scenario')}, about {took} in all{over}{more}")
            sys.stderr.flush()


def _tried(_: RunEnded) -> str:
    return "tried"


def _changed_joints(judged_ones: Sequence[judgement.JudgedMutant]) -> frozenset[str]:
    return frozenset(judged.result.change.joint for judged in judged_ones if judged.result.change is not None)


def _survived(judged: judgement.JudgedMutant) -> bool:
    return judged.result.status == "survived" and judged.result.change is not None


def _with_candidates(
    offers: Sequence[Candidates | None],
    results: Sequence[Sequence[judgement.JudgedMutant]],
    survived: Sequence[Sequence[bool]],
) -> Iterator[LoadedScenario]:
    """Yield each scenario with its candidates, followed by its survivors with the same ones."""
    for offer, several, alive in zip(offers, results, survived, strict=True):
        if offer is not None:
            yield offer.loaded
            yield from (
                offer.added_to(judged.mutant.loaded) for judged, lives in zip(several, alive, strict=True) if lives
            )


def _below(outcome: Outcome, folder: str) -> Outcome:
    return outcome.model_copy(update={"replay": outcome.replay and f"{folder}/{outcome.replay}"})
