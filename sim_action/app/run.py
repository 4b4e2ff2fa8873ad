"""The use case `run`: plan the scenarios, execute them, write the reports."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sim_action.core.errors import ExitCode
from sim_action.core.process import Interruption
from sim_action.core.wording import warn
from sim_action.reports import ReportOptions, ReportRequest, make_ready, open_reports, write_reports
from sim_action.reports.progress import ProgressListener
from sim_action.results.artifacts import run_files
from sim_action.results.events import Event, Listener
from sim_action.results.journal import Header, Journal
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.runner.child_outcome import skipped
from sim_action.runner.outcome_assembly import OutcomeAssembly, planned_outcomes
from sim_action.runner.process_pool import execute
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


def run_scenarios(request: RunRequest, interruption: Interruption, listener: Listener | None = None) -> ExitCode:
    """Run all scenarios, write every report and return the exit code. Raises UsageError.

    `listener` receives all events.
    """
    started = time.monotonic()
    found = plan_runs(request.plan)
    with open_reports(request.reports) as options:
        results = _results(request, found, options, interruption, started=started, listener=listener)
        return write_reports(results, options)


def _results(
    request: RunRequest,
    found: RunPlan,
    options: ReportOptions,
    interruption: Interruption,
    *,
    started: float,
    listener: Listener | None,
) -> Results:
    """Run all scenarios and return the results; `started` is the monotonic time in s of the start."""
    plans = found.plans
    if request.plan.permissions.updates_golden:
        from sim_action.runner.golden_update import refuse_shared_goldens

        plans = refuse_shared_goldens(plans)
    every = [run for plan in plans if not isinstance(plan, Refused) for run in plan]
    if request.repeat > 1:
        every = [run.traced_at_every_step() for run in every]
    journal = Journal(options.folder, _header(request, found, plans, every, options), warn, started)
    terminal = ProgressListener(total=len(every) * request.repeat, verbosity=request.reports.verbosity)
    listeners = [each for each in (journal, terminal, listener) if each is not None]
    with _folder_of_motions(every) as motions:
        assembly = OutcomeAssembly(plans, request.repeat, options.folder, motions, partial(_emit, listeners))
        assembly.begin(_of_patterns(found))
        if request.fail_fast and any(isinstance(plan, Refused) for plan in plans):
            assembly.end([skipped(run) for run in every])
        else:
            assembly.end(
                execute(
                    every,
                    options.folder,
                    request.jobs,
                    assembly,
                    interruption,
                    places=assembly.places,
                    fail_fast=request.fail_fast,
                    replays=_has_replays(request),
                    formats=request.recordings,
                    repeat=request.repeat,
                    motions=motions,
                    meanwhile=partial(make_ready, options),
                )
            )
        terminal.close()
    return journal.close()


def _emit(listeners: Iterable[Listener], event: Event) -> None:
    for listener in listeners:
        listener(event)


def _of_patterns(found: RunPlan) -> list[Outcome]:
    """Return the outcomes of paths and patterns on the command line that match no scenario."""
    return [*map(Outcome.of_nothing, found.empty), *map(Outcome.of_unmatched, found.unmatched)]


def _has_replays(request: RunRequest) -> bool:
    return "report" not in request.reports.silenced


def _header(
    request: RunRequest,
    found: RunPlan,
    plans: Sequence[Plan],
    every: Sequence[LoadedScenario],
    options: ReportOptions,
) -> Header:
    """Return the header of the journal; `every`: all runs."""
    names = [run.scenario.name for run in every] * request.repeat
    of_runs = run_files(names, options.folder, replays=_has_replays(request), formats=request.recordings)
    names_of_files = (path.relative_to(options.folder).as_posix() for files in of_runs for path in files)
    return Header.of_call(
        planned_outcomes(plans, _of_patterns(found)),
        (*options.files, *names_of_files),
        found.shard,
        selected=bool(request.plan.suite.numbers),
    )


@contextmanager
def _folder_of_motions(every: Sequence[LoadedScenario]) -> Iterator[Path | None]:
    """Make a folder for the motion of runs that are compared; it exists until they are. None: none is compared."""
    if not any(run.compared for run in every):
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)
