"""`sim-action run`."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

import click

from sim_action.cli.options import (
    ALLOW_OUTSIDE,
    PATHS,
    discovered,
    named_paths,
    report_flags,
    report_request,
    selection_flags,
)
from sim_action.core.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_action.core.workspace import AllowScripts
    from sim_action.runner.run_plan import PlanRequest
    from sim_action.scenario.source import Refused, Source


@click.command()
@PATHS
@selection_flags
@click.option(
    "--fail-fast",
    envvar="SIM_ACTION_FAIL_FAST",
    is_flag=True,
    help="Start no further scenario after the first one that does not pass.",
)
@click.option("--list", "list_only", is_flag=True, help="Print the name, place and tags of each scenario; run nothing.")
@click.option("--watch", is_flag=True, help="Keep running: rerun the affected scenarios when files change.")
@report_flags
@click.option(
    "--shard", metavar="I/N", help="Run only shard I of N: every N-th scenario or variation, starting with the I-th."
)
@click.option(
    "--backend",
    envvar="SIM_ACTION_BACKEND",
    type=click.Choice(("pybullet", "mujoco", "all")),
    help='Physics engine for all scenarios; overrides "backend:" in the files. all: run on both and compare.',
)
@click.option(
    "--seed",
    envvar="SIM_ACTION_SEED",
    type=click.IntRange(0, 2**63 - 1),
    metavar="N",
    help='Random seed for all scenarios; overrides "seed:" in the files.',
)
@click.option(
    "--repeat",
    envvar="SIM_ACTION_REPEAT",
    type=click.IntRange(1, 1000),
    default=1,
    metavar="N",
    help="Run each scenario N times. It is flaky if the runs differ.",
)
@click.option(
    "--update-golden",
    is_flag=True,
    help='Write the golden trajectories of "matches" instead of comparing with them.',
)
@click.option(
    "--jobs",
    "-j",
    envvar="SIM_ACTION_JOBS",
    type=click.IntRange(min=1, max=256),
    metavar="N",
    help="Number of scenarios to run in parallel.  [default: number of cores]",
)
@click.option(
    "--record",
    envvar="SIM_ACTION_RECORD",
    multiple=True,
    metavar="FORMAT",
    help="Record each run as mcap, csv, tum, gif or mp4; repeatable.",
)
@click.option(
    "--allow-scripts",
    type=click.Choice(("auto", "true", "false")),
    default="auto",
    show_default=True,
    help="Allow scenarios to run code. auto: yes, except on pull_request_target and workflow_run.",
)
@ALLOW_OUTSIDE
def run(
    paths: Sequence[str],
    *,
    fail_fast: bool,
    list_only: bool,
    watch: bool,
    shard: str | None,
    backend: str | None,
    seed: int | None,
    repeat: int,
    update_golden: bool,
    jobs: int | None,
    record: tuple[str, ...],
    allow_scripts: AllowScripts,
    allow_outside: bool,
    **flags: Any,
) -> ExitCode:
    """Run scenarios and report their verdicts.

    Exit code: 0 all passed, 1 a scenario failed, is flaky or has no verdict, 2 a scenario is invalid, 3 a fault of
    sim-action, 5 no scenario found, 130 interrupted. If several apply, the first of 130, 3, 2, 1 is returned. An empty
    shard passes if other shards have scenarios.
    """
    from sim_action.core.process import Interruption

    with Interruption() as interruption:
        from sim_action.app.run import RunRequest, run_scenarios
        from sim_action.core.workspace import Permissions, scripts_refused
        from sim_action.recording.export import wanted_formats
        from sim_action.runner.run_plan import PlanRequest

        if repeat > 1 and update_golden:
            raise UsageError("--update-golden cannot be combined with --repeat")
        permissions = Permissions(allow_outside, scripts_refused(allow_scripts, os.environ), update_golden)
        recordings = wanted_formats(record)
        plan = PlanRequest(discovered(paths, flags), permissions, shard, backend, seed)
        if list_only:
            return _listed(plan)
        request = RunRequest(plan, report_request(flags), jobs or _cores(), fail_fast, recordings, repeat)
        if not watch:
            return run_scenarios(request, interruption).exit_code
        if shard is not None or update_golden:
            raise UsageError("--watch cannot be combined with --shard or --update-golden")
        from sim_action.app.watch import watch_scenarios

        return watch_scenarios(request, named_paths(paths), interruption)


def _listed(request: PlanRequest) -> ExitCode:
    """Print the selected scenarios; report unreadable ones as errors."""
    from sim_action.core.wording import log_line
    from sim_action.scenario.selection import listing
    from sim_action.scenario.source import Refused

    scenarios, empty = _meant(request)
    for line in listing(scenarios):
        click.echo(line)
    errors = [each.error for each in scenarios if isinstance(each, Refused)]
    for line in (line for error in errors for line in str(error).split("\n")):
        click.echo(log_line(line), err=True)
    if not request.suite.files:
        return ExitCode.NO_SCENARIO
    found = [*(error.exit_code for error in errors), *(ExitCode.INVALID for _ in empty)]
    return max(found, default=ExitCode.PASSED)


def _meant(request: PlanRequest) -> tuple[Sequence[Source | Refused], Sequence[str]]:
    """Return the selected scenarios and the patterns without any. Scenarios are only checked for a shard."""
    from sim_action.runner.run_plan import plan_runs, source_of

    if request.shard is None:
        files = request.suite.read(request.permissions, request.seed)
        every = [each for several in files.values() for each in several]
        return [each for each in every if request.suite.numbered(each)], request.suite.empty
    found = plan_runs(request)
    return [source_of(plan) for plan in found.plans], found.empty


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
