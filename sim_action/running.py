"""`sim-action run`, from files to reports: load -> execute -> report."""

from __future__ import annotations

import platform
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

from sim_action import __version__
from sim_action.aftermath import skipped
from sim_action.agreement import compared
from sim_action.engine_choice import runs_of
from sim_action.errors import ExitCode, Fault, InvalidScenario, UsageError
from sim_action.execution import execute
from sim_action.interruption import Interruption
from sim_action.loading import load_all
from sim_action.outcome import Outcome, Results
from sim_action.permissions import Permissions
from sim_action.reporting import ReportRequest, report_options, write_reports
from sim_action.reports.progress import ProgressListener
from sim_action.scenario import LoadedScenario
from sim_action.scenario_files import read_file
from sim_action.selection import Scenarios, Selection, selected
from sim_action.sharding import Shard
from sim_action.source import Refused

Plan = tuple[LoadedScenario, ...] | Refused
"""A scenario once for each engine that it runs on, or why it runs on none."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What the command line asks for; `empty`: what was named but holds no scenario; from `shard` on: as typed."""

    files: list[Path]
    empty: list[str]
    reports: ReportRequest
    permissions: Permissions
    jobs: int
    selection: Selection
    fail_fast: bool
    shard: str | None
    backend: str | None
    seed: int | None

    def read(self) -> list[Scenarios]:
        """What is selected of each file. Raises UsageError."""
        return selected([read_file(path, self.permissions, self.seed) for path in self.files], self.selection)


def run(request: RunRequest, interruption: Interruption) -> ExitCode:
    """Runs everything, writes every report, and returns what the process says to its caller."""
    started = time.monotonic()
    files = request.read()
    # If there is no scenario at all, the exit code says so.
    empty = request.empty if files else []
    shard = Shard.parse(request.shard, len(files) + len(empty)) if request.shard is not None else None
    options = report_options(request.reports)
    outcomes = _outcomes(request, shard.dealt(files) if shard else files, options.folder, interruption)
    if shard is None or shard.index == 1:
        outcomes += map(Outcome.of_nothing, empty)
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        wall_time=time.monotonic() - started,
        shard=shard,
        outcomes=tuple(outcomes),
    )
    write_reports(results, options)
    return results.exit_code


def _outcomes(request: RunRequest, files: list[Scenarios], folder: Path, interruption: Interruption) -> list[Outcome]:
    """Of each scenario, in the order of the files; several of one that runs on several engines."""
    sources = [source for scenarios in files for source in scenarios]
    planned = list(_once(_planned(scenario, request) for scenario in load_all(sources, request.permissions)))
    every = [run for plan in planned if not isinstance(plan, Refused) for run in plan]
    if request.fail_fast and any(isinstance(plan, Refused) for plan in planned):
        ran = iter([skipped(run) for run in every])
    else:
        listener = ProgressListener(total=len(every), verbosity=request.reports.verbosity)
        asked = partial(execute, fail_fast=request.fail_fast, replays="report" not in request.reports.silenced)
        ran = iter(asked(every, folder, request.jobs, listener, interruption))
        listener.close()
    return [outcome for plan in planned for outcome in _outcomes_of(plan, ran, folder)]


def _once(planned: Iterable[Plan]) -> Iterator[Plan]:
    """What is wrong with a scenario once, not for each of its variations."""
    told = set[tuple[str, str]]()
    for plan in planned:
        if isinstance(plan, Refused):
            if (plan.file, plan.name) in told:
                continue
            told.add((plan.file, plan.name))
        yield plan


def _planned(scenario: LoadedScenario | Refused, request: RunRequest) -> Plan:
    """The scenario once for each engine that it runs on."""
    if isinstance(scenario, Refused):
        return scenario
    try:
        return runs_of(_seeded(scenario, request.seed), request.backend)
    except InvalidScenario as error:
        return scenario.source.refused(error)
    except UsageError:
        raise
    except Exception as error:  # noqa: BLE001 - the other scenarios have results to give
        return scenario.source.refused(Fault.of(error))


def _outcomes_of(plan: Plan, ran: Iterator[Outcome], folder: Path) -> tuple[Outcome, ...]:
    """Of one scenario, whose runs come next in `ran`."""
    if isinstance(plan, Refused):
        return (Outcome.of_refused(plan),)
    return compared(plan[0], tuple(islice(ran, len(plan))), folder)


def _seeded(loaded: LoadedScenario, seed: int | None) -> LoadedScenario:
    """The scenario with the seed that was typed; None: with its own, as one whose variations are of the seed."""
    varies = any(varied.key == "seed" for varied in loaded.source.variation)
    return (
        loaded
        if seed is None or varies
        else replace(loaded, scenario=loaded.scenario.model_copy(update={"seed": seed}))
    )
