"""The use case `run`: plan the scenarios, execute them, write the reports."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path

from sim_action.core.errors import ExitCode, InvalidScenario, SystemRefusal, UsageError, is_refusal
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import counted, note, warn
from sim_action.reports import ReportOptions, ReportRequest
from sim_action.reports.progress import GateKey, ProgressListener
from sim_action.reports.writing import make_ready, open_reports, remove_earlier, write_reports
from sim_action.results.artifacts import RunFiles, run_files
from sim_action.results.journal import JOURNAL_FILE, Event, Header, Journal, Listener
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.runner.child_outcome import skipped, without_verdict
from sim_action.runner.outcome_assembly import OutcomeAssembly, originals, planned_outcomes
from sim_action.runner.process_pool import Pool, PoolOptions
from sim_action.runner.run_keys import RunKeys, RunOptions, TakenOver, take_over
from sim_action.runner.run_plan import EarlyStop, Plan, PlanRequest, RunPlan, Runs, Scheduler, plan_runs
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The options of `run`."""

    plan: PlanRequest
    reports: ReportRequest
    jobs: int
    fail_fast: bool
    recordings: tuple[str, ...] = ()  # the formats to record each run in
    repeat: int = 1
    resume: bool = False  # True to take over outcomes of the earlier call in the output folder
    valid_only: bool = False  # True if nothing runs unless all scenarios are valid
    cluster: str | None = None  # the address of the cluster that runs the scenarios; None: this machine does
    budget: int | None = None  # the largest number of runs, with all repetitions; None: any

    def __post_init__(self) -> None:
        """Refuse options that a cluster cannot follow. Raise UsageError."""
        permissions = self.plan.permissions
        refused = {
            "--resume": self.resume,
            "--update-golden": permissions.updates_golden,
            "--allow-outside": permissions.outside,
        }
        if self.cluster is not None and any(refused.values()):
            names = " and ".join(name for name, is_set in refused.items() if is_set)
            raise UsageError(f"--cluster cannot be combined with {names}")


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """A call that has ended: its results, and its exit code, which counts reports that could not be written."""

    results: Results
    exit_code: ExitCode


def run_scenarios(request: RunRequest, interruption: Interruption, listener: Listener | None = None) -> FinishedRun:
    """Run all scenarios and write every report. Raises UsageError; InvalidScenario if `request.valid_only`."""
    started = time.monotonic()
    with closing(_keys(request)) as keys:
        run_plan = plan_runs(request.plan)
        run_plan = replace(run_plan, plans=_affordable(request, run_plan.plans))
        if run_plan.shard is not None and not run_plan.plans:
            warn(f"{run_plan.shard} has no scenario: the selection has only {run_plan.shard.total}; use fewer shards")
        if request.valid_only:
            refuse_invalid([plan for plan in run_plan.plans if isinstance(plan, Refused)])
        with (
            _schedule(request, run_plan, keys) as schedule,
            open_reports(request.reports, keeps_earlier=request.resume) as options,
        ):
            call = _Call(request, run_plan, options, keys, started=started, schedule=schedule)
            results = call.results(interruption, listener)
            taken_over = call.taken.finals if request.resume else None
            report_options = replace(options, taken_over=taken_over, permissions=request.plan.permissions)
            return FinishedRun(results, write_reports(results, report_options))


def _affordable(request: RunRequest, plans: Sequence[Plan]) -> Sequence[Plan]:
    """Return the plans with the repetitions that are run. Raise UsageError if there are more runs than allowed."""
    size = sum(map(_size, plans))
    if request.repeat > 1 or request.plan.permissions.updates_golden:
        plans = [plan if isinstance(plan, Refused) else originals(plan) for plan in plans]
        if sum(map(_size, plans)) < size:
            warn("the confidence of verdicts is not found with --repeat and --update-golden")
    runs = sum(map(_size, plans)) * request.repeat
    if request.budget is not None and runs > request.budget:
        raise UsageError(
            f"--budget: {counted(runs, 'run')} would be needed, {request.budget} are allowed; select fewer"
        )
    return plans


def refuse_invalid(refused: Sequence[Refused]) -> None:
    """Raise InvalidScenario with the problems of all scenarios that are refused, or the InternalError of one."""
    errors = [refusal.error for refusal in refused]
    for error in errors:
        if not isinstance(error, InvalidScenario):
            raise error
    if len(errors) == 1:
        raise errors[0]
    if errors:
        problems = dict.fromkeys(problem for refusal in refused for problem in refusal.problems)
        raise InvalidScenario(problems)


def _keys(request: RunRequest) -> RunKeys:
    options = RunOptions(request.plan.permissions, request.repeat, request.recordings, _has_replays(request))
    return RunKeys(request.plan.suite.files, options, request.reports.outputs)


Schedule = Callable[[Runs, Listener, Interruption], Scheduler]
"""A function that returns the scheduler for runs: the pool of this machine, or the scheduler of a cluster."""


@contextmanager
def _schedule(request: RunRequest, run_plan: RunPlan, keys: RunKeys) -> Iterator[Schedule]:
    """Return what schedules the runs of a plan. Raise UsageError if the cluster cannot run them."""
    pool = partial(Pool, options=PoolOptions(request.jobs, keys))
    if request.cluster is None:
        yield pool
        return
    from sim_action.runner.cluster.address import ClusterAddress  # a usual run does without it

    address = ClusterAddress.parse(request.cluster)
    every = [run for plan in run_plan.plans if not isinstance(plan, Refused) for run in plan]
    if not every:
        yield pool
        return
    from sim_action.runner.cluster.dask_executor import opened_cluster  # a usual run does without it

    with opened_cluster(address, every, request.plan.permissions, request.reports.outputs) as cluster:
        yield cluster.scheduler


class _Call:
    """One call with its plan: `started` is the time on `time.monotonic()` of its start.

    `taken`: the outcomes that are taken over from an earlier call.
    """

    def __init__(
        self,
        request: RunRequest,
        run_plan: RunPlan,
        options: ReportOptions,
        keys: RunKeys,
        *,
        started: float,
        schedule: Schedule,
    ) -> None:
        self._request, self._options, self._keys, self._started = request, options, keys, started
        self._run_plan = run_plan
        self._schedule = schedule
        self._plans = run_plan.plans
        if request.plan.permissions.updates_golden:
            from sim_action.runner.golden_update import refuse_shared_goldens  # a usual run does without it

            self._plans = refuse_shared_goldens(self._plans)
        every = [run for plan in self._plans if not isinstance(plan, Refused) for run in plan]
        self._every = [run.traced_at_every_step() for run in every] if request.repeat > 1 else every
        self.taken = TakenOver()
        self._early_stop = EarlyStop((), ())

    def results(self, interruption: Interruption, listener: Listener | None) -> Results:
        """Run all scenarios and return the results."""
        request, options, header = self._request, self._options, self._header()
        listeners: list[Listener] = []
        with _folder_of_motions(self._every) as motions:
            assembly = OutcomeAssembly(self._plans, request.repeat, options.folder, motions, partial(_emit, listeners))
            if request.resume:
                self._resume(header, assembly)
            options.room.reserve(max(len(header.planned), len(self._every) * request.repeat))
            taken = self.taken.records
            journal = Journal(options.folder, header, warn, self._started, taken, make_room=options.room.make)
            runs = len(self._every) * request.repeat - self.taken.runs(request.repeat)
            if request.repeat == 1:
                self._early_stop = EarlyStop(self._every, assembly.places)
            terminal = ProgressListener(runs, request.reports.verbosity, gates=self._runs_of_gates())
            listeners += [
                receiver for receiver in (journal, self._early_stop, terminal, listener) if receiver is not None
            ]
            self._print_chances()
            repetitions = sum(bool(run.repetition) for run in self._every)
            if repetitions and request.reports.verbosity != "quiet":
                judged = counted(len(self._every) - repetitions, "run")
                note(f"{counted(repetitions, 'repetition')} for the confidence of {judged}")
            assembly.begin(self._run_plan.of_nothing)
            assembly.take_over(self.taken.records)
            stopped = self.taken.not_passed or any(isinstance(plan, Refused) for plan in self._plans)
            if request.fail_fast and stopped:
                assembly.end([skipped(run) for run in self._every * request.repeat])
            else:
                assembly.end(self._executed(assembly, motions, interruption))
            terminal.close()
        return journal.close()

    def _print_chances(self) -> None:
        """Print what robots of known rates would get from the gates, unless quiet."""
        if self._run_plan.gates and self._request.reports.verbosity != "quiet":
            from sim_action.reports.gate_chances import print_chances  # a usual run does without it

            # A closed stream does not change a verdict.
            with suppress(OSError, ValueError):
                print_chances(self._run_plan.gates, sys.stderr, os.environ)

    def _runs_of_gates(self) -> Counter[GateKey]:
        gates = (run.source.gate for run in self._every * self._request.repeat)
        return Counter((gate.file, gate.name) for gate in gates if gate is not None)

    def _resume(self, header: Header, assembly: OutcomeAssembly) -> None:
        """Take over outcomes of the earlier call, and remove all other files that it has left."""
        options = self._options
        self.taken = take_over(
            options.folder, header.planned, self._every, assembly, files=self._files(options.folder), keys=self._keys
        )
        for remark in self.taken.remarks:
            note(f"--resume: {remark}")
        # The journal is replaced as a whole.
        remove_earlier(self._request.reports, self.taken.files | {JOURNAL_FILE})

    def _executed(self, assembly: OutcomeAssembly, motions: Path | None, interruption: Interruption) -> list[Outcome]:
        """Run all scenarios and return one outcome for each run; runs that ended before an error keep theirs."""
        try:
            request = self._request
            runs = Runs(
                self._every,
                self._options.folder,
                request.repeat,
                assembly.places,
                assembly.first_turns,
                _has_replays(request),
                request.recordings,
                motions,
                assembly.ended,
                request.fail_fast,
                self._early_stop.is_needless,
            )
            return self._schedule(runs, assembly, interruption).outcomes(self._make_ready)
        except (OSError, MemoryError) as error:
            if not is_refusal(error):
                raise
            failure = Failure.of_fault(SystemRefusal(error))
            return [without_verdict(run, failure) for run in self._every * self._request.repeat]

    def _make_ready(self) -> None:
        self._keys.prepare()
        make_ready(self._options)

    def _header(self) -> Header:
        """Return the header of the journal."""
        run_plan, options = self._run_plan, self._options
        of_runs = [path.as_posix() for files in self._files(Path()) for path in files]
        return Header.of_call(
            planned_outcomes(self._plans, run_plan.of_nothing),
            (*options.files, *of_runs),
            run_plan.shard,
            selected=bool(self._request.plan.suite.numbers),
            gates=run_plan.gates,
        )

    def _files(self, folder: Path) -> list[RunFiles]:
        names = [run.scenario.name for run in self._every] * self._request.repeat
        return run_files(names, folder, replays=_has_replays(self._request), formats=self._request.recordings)


def _emit(listeners: Iterable[Listener], event: Event) -> None:
    for listener in listeners:
        listener(event)


def _size(plan: Plan) -> int:
    return 0 if isinstance(plan, Refused) else len(plan)


def _has_replays(request: RunRequest) -> bool:
    return "report" not in request.reports.silenced


@contextmanager
def _folder_of_motions(every: Sequence[LoadedScenario]) -> Iterator[Path | None]:
    """Make a folder for the motion of runs that are compared; it exists until they are. None: none is compared."""
    if not any(run.compared for run in every):
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)
