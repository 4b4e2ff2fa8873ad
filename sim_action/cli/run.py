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
    from sim_action.runner.planning import PlanRequest
    from sim_action.scenario.source import Refused, Source


@click.command()
@PATHS
@selection_flags
@click.option(
    "--fail-fast",
    envvar="SIM_ACTION_FAIL_FAST",
    is_flag=True,
    help="Begin nothing more once a scenario has not passed.",
)
@click.option("--list", "list_only", is_flag=True, help="Print names, places and tags of scenarios, and run none.")
@click.option("--watch", is_flag=True, help="Go on: run again what is touched when files change, until Ctrl-C.")
@report_flags
@click.option("--shard", metavar="I/N", help="Run every N-th of the list only, variations counted, from the I-th on.")
@click.option(
    "--backend",
    envvar="SIM_ACTION_BACKEND",
    type=click.Choice(("pybullet", "mujoco", "all")),
    help="Engine that all run on, whatever they say; all: each on both, and compared.",
)
@click.option(
    "--seed",
    envvar="SIM_ACTION_SEED",
    type=click.IntRange(0, 2**63 - 1),
    metavar="N",
    help="Of everything drawn at random, whatever they say.",
)
@click.option(
    "--repeat",
    envvar="SIM_ACTION_REPEAT",
    type=click.IntRange(1, 1000),
    default=1,
    metavar="N",
    help="Run each scenario N times, each in a fresh interpreter: one that differs is flaky.",
)
@click.option(
    "--update-golden",
    is_flag=True,
    help="Write the golden trajectories that scenarios match, instead of comparing with them.",
)
@click.option(
    "--jobs",
    "-j",
    envvar="SIM_ACTION_JOBS",
    type=click.IntRange(min=1, max=256),
    metavar="N",
    help="At the same time.  [default: the cores]",
)
@click.option(
    "--record",
    envvar="SIM_ACTION_RECORD",
    multiple=True,
    metavar="FORMAT",
    help="Leave recordings of each run: mcap, csv, tum, gif, mp4; may be repeated.",
)
@click.option(
    "--allow-scripts",
    type=click.Choice(("auto", "true", "false")),
    default="auto",
    show_default=True,
    help="Run code that scenarios name; auto: but on pull_request_target and workflow_run.",
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
    """Run scenarios, report their verdicts.

    Exit code: 0 all passed, 1 a scenario failed, is flaky or has no verdict, 2 a scenario is invalid, 3 a fault of
    sim-action, 5 no scenario found, 130 interrupted; of several, the highest of 130, 3, 2, 1. A shard that has no
    scenario, of a list that has some, passes.
    """
    from sim_action.core.process import Interruption

    with Interruption() as interruption:
        from sim_action.app import run as running
        from sim_action.core.workspace import Permissions, scripts_refused
        from sim_action.recording.export import wanted_formats
        from sim_action.runner.planning import PlanRequest

        if repeat > 1 and update_golden:
            raise UsageError("a golden trajectory is written by one run: --update-golden goes with --repeat 1")
        permissions = Permissions(allow_outside, scripts_refused(allow_scripts, os.environ), update_golden)
        recordings = wanted_formats(record)
        plan = PlanRequest(discovered(paths, flags), permissions, shard, backend, seed)
        if list_only:
            return _listed(plan)
        request = running.RunRequest(plan, report_request(flags), jobs or _cores(), fail_fast, recordings, repeat)
        if not watch:
            return running.run(request, interruption).exit_code
        if shard is not None or update_golden:
            raise UsageError("--watch runs what is touched: it goes with no --shard, and no --update-golden")
        from sim_action.app import watch as watching

        return watching.watch(request, named_paths(paths), interruption)


def _listed(request: PlanRequest) -> ExitCode:
    """Prints what would run; what cannot be read is told as an error."""
    from sim_action.core.messages import log_line
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
    """The scenarios of this call, and the patterns without any that it tells of; only for a shard they are checked."""
    from sim_action.runner.planning import planned, source_of

    if request.shard is None:
        files = request.suite.read(request.permissions, request.seed)
        every = [each for several in files.values() for each in several]
        return [each for each in every if request.suite.numbered(each)], request.suite.empty
    found = planned(request)
    return [source_of(plan) for plan in found.plans], found.empty


def _cores() -> int:
    """Those that this process may use, where the system says."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
