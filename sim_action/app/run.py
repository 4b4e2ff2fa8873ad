"""The use case `run`: plan the scenarios, execute them, write the reports."""

from __future__ import annotations

import platform
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

from sim_action import __version__
from sim_action.core.errors import ExitCode
from sim_action.core.process import Interruption
from sim_action.reports import ReportOptions, ReportRequest, make_ready, open_reports, write_reports
from sim_action.reports.progress import ProgressListener
from sim_action.results.outcome import Outcome, audited_over_variations
from sim_action.results.results_json import Results
from sim_action.runner.child_outcome import skipped
from sim_action.runner.process_pool import execute, motion_file
from sim_action.runner.run_plan import Plan, PlanRequest, RunPlan, plan_runs
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The options of `run`; `recordings`: the formats to record each run in."""

    plan: PlanRequest
    reports: ReportRequest
    jobs: int
    fail_fast: bool
    recordings: tuple[str, ...] = ()
    repeat: int = 1


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """The results of `run`, and the exit code, which is higher if a required report cannot be written."""

    results: Results
    exit_code: ExitCode


def run_scenarios(request: RunRequest, interruption: Interruption) -> FinishedRun:
    """Run all scenarios and write every report. Raises UsageError."""
    started = time.monotonic()
    found = plan_runs(request.plan)
    with open_reports(request.reports) as options:
        results = _results(request, found, options, interruption, started)
        return FinishedRun(results, write_reports(results, options))


def _results(
    request: RunRequest, found: RunPlan, options: ReportOptions, interruption: Interruption, started: float
) -> Results:
    """Run all scenarios and return the results; `started` is the monotonic time in s of the start."""
    plans = found.plans
    if request.plan.permissions.updates_golden:
        from sim_action.runner.golden_update import refuse_shared_goldens

        plans = refuse_shared_goldens(plans)
    outcomes = _outcomes(request, plans, options, interruption)
    return Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        wall_time=time.monotonic() - started,
        shard=found.shard,
        selected=bool(request.plan.suite.numbers),
        outcomes=(
            *audited_over_variations(outcomes),
            *map(Outcome.of_nothing, found.empty),
            *map(Outcome.of_unmatched, found.unmatched),
        ),
    )


def _outcomes(
    request: RunRequest, plans: Sequence[Plan], options: ReportOptions, interruption: Interruption
) -> list[Outcome]:
    """Return the outcomes in the order of the files; a scenario has one for each engine."""
    every = [run for plan in plans if not isinstance(plan, Refused) for run in plan]
    repeat, folder = request.repeat, options.folder
    every = [run.traced_at_every_step() for run in every] if repeat > 1 else every
    with _folder_of_motions(every) as motions:
        if request.fail_fast and any(isinstance(plan, Refused) for plan in plans):
            ran = iter([skipped(run) for run in every])
        else:
            listener = ProgressListener(total=len(every) * repeat, verbosity=request.reports.verbosity)
            replays = "report" not in request.reports.silenced
            asked = partial(
                execute, fail_fast=request.fail_fast, formats=request.recordings, repeat=repeat, motions=motions
            )
            ready = partial(make_ready, options)
            turns = asked(every, folder, request.jobs, listener, interruption, replays=replays, meanwhile=ready)
            listener.close()
            ran = iter([_outcome(run, turns[index :: len(every)], folder) for index, run in enumerate(every)])
        files = iter([None if motions is None else motion_file(motions, index) for index in range(len(every))])
        return [outcome for plan in plans for outcome in _outcomes_of(plan, ran, files)]


@contextmanager
def _folder_of_motions(every: Sequence[LoadedScenario]) -> Iterator[Path | None]:
    """Make a folder for the motion of runs that are compared; it exists until they are. None: none is compared."""
    if not any(run.compared for run in every):
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def _outcome(run: LoadedScenario, turns: Sequence[Outcome], folder: Path) -> Outcome:
    """Return one outcome for all repetitions of a run."""
    if len(turns) == 1:
        return turns[0]
    from sim_action.runner.repeat import merge_repeats

    return merge_repeats(run, turns, folder)


def _outcomes_of(plan: Plan, ran: Iterator[Outcome], files: Iterator[Path | None]) -> tuple[Outcome, ...]:
    """Return the outcomes of one scenario, whose runs come next in `ran`; `files`: those of their motions."""
    if isinstance(plan, Refused):
        return (Outcome.of_refused(plan),)
    outcomes, motions = tuple(islice(ran, len(plan))), tuple(islice(files, len(plan)))
    if len(plan) == 1 and plan[0].scenario.agreement is None:
        return outcomes
    from sim_action.runner.engine_agreement import with_agreement

    return with_agreement(plan[0], outcomes, motions)
