"""`sim-action run`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import click

from sim_action.cli import options
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.records import replace
from sim_action.engines import ENGINES

if TYPE_CHECKING:
    from sim_action.runner.run_plan import PlanRequest
    from sim_action.scenario.model import ConfidenceKind, Unexercised
    from sim_action.scenario.selection import Unmatched
    from sim_action.scenario.source import Refused, Source

_ON_LISTS: Final = (
    *("paths", "only", "exclude", "tags", "exclude_tags", "list_only", "plan_gate", "shard", "backend", "seed"),
    *("allow_scripts", "packages", "allow_outside"),
)
"""The options with an effect on --list. Those on --plan-gate, which looks for the times of an earlier run:"""
_ON_PLANS: Final = (
    *(name for name in _ON_LISTS if name not in ("list_only", "shard", "backend")),
    "output_dir",
    "jobs",
)

_WISHED_RATE: Final = "97%"


@click.command(cls=options.CommandWithOptionalValues)
@options.PATHS
@options.selection_flags
@options.switch(
    "fail-fast", "Start no more scenarios after one did not pass. Scenarios that are running finish.", env=True
)
@options.switch(
    "resume",
    "Continue the earlier run in the output folder: take over each verdict that nothing has changed for, and run "
    "the other scenarios.",
    env=True,
)
@options.flag("--list", "list_only", text="Print name, file, line and tags of each scenario, and run nothing.")
@click.option(
    "--plan-gate",
    cls=options.OptionalValue,
    pattern=r"[\d.]* ?%?",
    flag_value=_WISHED_RATE,
    callback=options.not_empty,
    metavar="[RATE]",
    help="Print the number of runs that a robot with the true pass rate RATE needs to pass each gate, and its chances "
    f"with other numbers. Run nothing.  [default: {_WISHED_RATE}]",
)
@options.flag("--watch", text="Run scenarios again when their files change, until Ctrl-C.")
@options.flag(
    "--live",
    text="With --watch: print a URL that shows progress and results in the browser. Only this machine can open it.",
)
@options.PORT
@options.report_flags
@options.text_option(
    "--shard",
    metavar="I/N",
    text="Run shard I of N: every N-th scenario or variation, starting with the I-th. To balance shards by duration, "
    'use "sim-action matrix".',
)
@click.option(
    "--backend",
    envvar="SIM_ACTION_BACKEND",
    type=click.Choice((*ENGINES, "all")),
    help="Physics engine for all scenarios; all: run each scenario on both engines and compare the runs.  "
    '[default: "backend:" in the file of each scenario]',
)
@options.SEED_OPTION
@click.option(
    "--repeat",
    envvar="SIM_ACTION_REPEAT",
    type=options.Bounded(click.IntRange(1, 1000)),
    default=1,
    metavar="N",
    help="Run each scenario N times, 1 to 1000. A scenario is flaky, and fails, if its runs are not equal bit for bit.",
)
@click.option(
    "--unexercised",
    envvar="SIM_ACTION_UNEXERCISED",
    type=click.Choice(("error", "warn")),
    help='Effect of an expectation that is never judged, in files without "unexercised:". error: the scenario does not '
    "pass; warn: it is only reported.  [default: error]",
)
@click.option(
    "--confidence",
    envvar="SIM_ACTION_CONFIDENCE",
    cls=options.OptionalValue,
    pattern="|numerical|full",
    flag_value="numerical",
    type=click.Choice(("numerical", "full")),
    help="Repeat each run with half the step and another start; a verdict that these could change is inconclusive. "
    "full: also with a quarter of the step.",
)
@click.option(
    "--budget",
    type=options.Bounded(click.IntRange(1)),
    metavar="N",
    help="Run nothing if there are more than N runs, with the repetitions of --confidence.",
)
@options.strict_option
@options.flag(
    "--update-golden",
    text='Save this run as the golden trajectory of each "matches", instead of comparing with it. Nothing is saved if '
    "another expectation failed or was not exercised.",
)
@options.flag(
    "--force", text="With --update-golden: save also a run that did not pass. The first line of the file says so."
)
@options.jobs_option("scenarios to run")
@options.text_option(
    "--cluster",
    metavar="ADDRESS",
    text="Run the scenarios on a cluster of Dask: tcp://HOST:PORT is its scheduler; local:N starts N workers on this "
    "machine. --jobs does not count then. It needs pip install 'sim-action[dask]'.",
)
@options.text_option(
    "--record",
    metavar="FORMAT",
    text="Record each run as mcap, csv, tum, gif or mp4; repeatable. mcap needs pip install 'sim-action[mcap]'; gif "
    "and mp4 need 'sim-action[video]'.",
    env=True,
    multiple=True,
)
@options.code_flags
@options.PACKAGES
@options.ALLOW_OUTSIDE
def run(
    paths: Sequence[str],
    *,
    fail_fast: bool,
    resume: bool,
    list_only: bool,
    plan_gate: str | None,
    watch: bool,
    live: bool,
    port: int,
    repeat: int,
    unexercised: Unexercised | None,
    confidence: ConfidenceKind | None,
    budget: int | None,
    strict: bool,
    update_golden: bool,
    force: bool,
    jobs: int | None,
    cluster: str | None,
    record: tuple[str, ...],
    **flags: Any,
) -> ExitCode:
    """Run scenarios and report their verdicts.

    PATHS are scenario files, globs, or folders. A folder stands for every *.sim.yml and *.sim.yaml in it and below. The
    default is the current folder.

    Exit code: 0 all scenarios passed; 1 a scenario failed, is flaky, was not exercised, or has no verdict (crash,
    script error, or stopped at its wall, memory or output limit), or a gate failed or is inconclusive; 2 a scenario or
    the command line is invalid; 3 internal error of sim-action; 5 no scenario found; 130 interrupted. If several apply,
    the first of 130, 3, 2, 1 is returned.

    With --shard: a shard that gets no scenario passes if another shard gets one.
    """
    from sim_action.core.process import Interruption, usable_cores

    with Interruption() as interruption:
        from sim_action.app.run import RunRequest, run_scenarios
        from sim_action.recording.export import wanted_formats

        if plan_gate is not None:
            _refuse_others("--plan-gate", _ON_PLANS)
        if list_only:
            _refuse_others("--list", _ON_LISTS)
        _check_golden(updates=update_golden, force=force, repeat=repeat)
        if confidence is not None and (update_golden or repeat > 1):
            raise UsageError("--confidence cannot be combined with --repeat or --update-golden")
        if resume and (update_golden or watch):
            raise UsageError("--resume cannot be combined with --update-golden or --watch")
        if cluster is not None and watch:
            raise UsageError("--cluster cannot be combined with --watch")
        recordings = wanted_formats(record)
        plan = options.plan_request(paths, flags)
        permissions = replace(plan.permissions, updates_golden=update_golden, forces_golden=force)
        plan = replace(plan, permissions=permissions, unexercised=unexercised, strict=strict, confidence=confidence)
        if plan_gate is not None:
            return _planned(plan, plan_gate, flags["output_dir"], jobs or usable_cores())
        if list_only:
            return _listed(plan)
        reports = options.report_request(flags)
        request = RunRequest(
            *(plan, reports, jobs or usable_cores(), fail_fast, recordings, repeat, resume),
            cluster=cluster,
            budget=budget,
        )
        served = options.live_port(live=live, port=port, watch=watch)
        if not watch:
            return run_scenarios(request, interruption).exit_code
        if plan.shard is not None or update_golden:
            raise UsageError("--watch cannot be combined with --shard or --update-golden")
        from sim_action.app.watch import watch_scenarios

        return watch_scenarios(request, options.named_paths(paths), interruption, live_port=served)


def _refuse_others(option: str, names: Sequence[str]) -> None:
    """Raise UsageError for an option on the command line without an effect on an option that runs nothing."""
    others = (param.name or "" for param in click.get_current_context().command.params if param.name not in names)
    options.refuse_typed(f"{option} runs nothing, and", *others)


def _check_golden(*, updates: bool, force: bool, repeat: int) -> None:
    """Raise UsageError if an option cannot be combined with --update-golden, or needs it."""
    if force and not updates:
        raise UsageError("--force needs --update-golden")
    if updates and repeat > 1:
        raise UsageError("--update-golden cannot be combined with --repeat")


def _planned(request: PlanRequest, rate: str, folder: str, jobs: int) -> ExitCode:
    """Print the plans of all gates."""
    from pathlib import Path

    from sim_action.app.plan_gate import gate_plans, is_plannable, wished_rate

    wish = wished_rate(rate)
    scenarios, empty, unmatched = _meant(request)
    if scenarios:
        for line in gate_plans(scenarios, wish, Path(folder), jobs):
            click.echo(line)
    return _complained(request, [scenario for scenario in scenarios if not is_plannable(scenario)], empty, unmatched)


def _listed(request: PlanRequest) -> ExitCode:
    """Print the selected scenarios; report unreadable ones as errors."""
    from sim_action.core.wording import note
    from sim_action.reports.gate_chances import gate_listing
    from sim_action.scenario.selection import listing

    scenarios, empty, unmatched = _meant(request)
    for line in listing(scenarios):
        click.echo(line)
    # Scripts read the lines of standard output, one for each run.
    for line in gate_listing(scenarios):
        note(line)
    return _complained(request, scenarios, empty, unmatched)


def _complained(
    request: PlanRequest, scenarios: Sequence[Source | Refused], empty: Sequence[str], unmatched: Sequence[Unmatched]
) -> ExitCode:
    """Report unreadable scenarios, and options without any, as errors."""
    from sim_action.core.wording import log_line
    from sim_action.scenario.source import Refused

    errors = [scenario.error for scenario in scenarios if isinstance(scenario, Refused)]
    for line in (line for error in errors for line in str(error).split("\n")):
        click.echo(log_line(line), err=True)
    unreadable = (problem for pattern in unmatched[:1] for problem in pattern.unreadable)
    for problem in (*unmatched, *unreadable):
        click.echo(log_line(str(problem)), err=True)
    if not request.suite.files:
        return ExitCode.of_command(has_scenarios=False)
    return ExitCode.of_command(
        (*(error.exit_code for error in errors), *(ExitCode.INVALID for _ in (*empty, *unmatched)))
    )


def _meant(request: PlanRequest) -> tuple[Sequence[Source | Refused], Sequence[str], Sequence[Unmatched]]:
    """Return the selected scenarios, checked for a shard only, and the paths and options without any."""
    from sim_action.runner.run_plan import plan_runs, source_of

    if request.shard is None:
        contents = request.suite.read(request.permissions, request.seed)
        return request.suite.numbered_in(contents), request.suite.empty, contents.unmatched
    run_plan = plan_runs(request)
    return [source_of(plan) for plan in run_plan.plans], run_plan.empty, run_plan.unmatched
