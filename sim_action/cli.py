"""The command line. What a subcommand needs is imported when it is called, so that `--help` stays quick."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn

import click

from sim_action import __version__
from sim_action.errors import ExitCode, SimActionError, UsageError
from sim_action.model_flags import asked_model, model_flags
from sim_action.report_flags import report_flags, report_request

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from sim_action.permissions import AllowScripts

_BEFORE_IMPORTS = {
    # A process that forks must have started no thread, and results must not depend on how many cores there are.
    "OPENBLAS_NUM_THREADS": "1",
    # Looking for plugins takes longer than reading a scenario, and nobody's plugin belongs in it.
    "PYDANTIC_DISABLE_PLUGINS": "__all__",
}

_PATHS = click.argument("paths", nargs=-1, metavar="[PATHS]...")
_ALLOW_OUTSIDE = click.option(
    "--allow-outside", is_flag=True, help="Let scenarios name files outside of their workspace."
)


def main() -> NoReturn:
    """The entry point."""
    _open_closed_streams()
    leave(call(sys.argv[1:]))


def leave(code: int) -> NoReturn:
    """Ends the process, with everything said."""
    with suppress(BrokenPipeError):
        sys.stdout.flush()
    sys.stderr.flush()
    # Taking the interpreter apart would take longer than reading a scenario.
    os._exit(code)


def _open_closed_streams() -> None:
    """A shell may close them (`>&-`): what is opened next would take their numbers, and get what is printed."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(descriptor, "w" if descriptor else "r"))


def call(arguments: Sequence[str]) -> int:
    """Does what a command line says and returns the exit code: the one place that catches errors."""
    os.environ.update(_BEFORE_IMPORTS)
    try:
        return program.main(list(arguments), standalone_mode=False, prog_name="sim-action") or ExitCode.PASSED
    except click.ClickException as error:
        _complain(error.format_message())
        if isinstance(error, click.UsageError) and error.ctx:
            click.echo(f"Try '{error.ctx.command_path} --help'.", err=True)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        return ExitCode.INTERRUPTED
    except SimActionError as error:
        for line in str(error).split("\n"):
            _complain(line)
        return error.exit_code
    except BrokenPipeError:
        # Whoever read our output has gone; there is nobody left to tell.
        return ExitCode.FAILED
    except Exception:  # noqa: BLE001 - the last stop: whatever it is, it is a fault of ours
        sys.excepthook(*sys.exc_info())
        click.echo("sim-action: this is a fault of sim-action; please report it with the lines above", err=True)
        return ExitCode.INTERNAL


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="sim-action")
def program() -> None:
    """Simulation tests for robots: a YAML scenario, a headless physics engine, a verdict.

    PATHS are scenario files, folders (every *.sim.yml in and below them) or globs; left out: the current folder.
    """


@program.command()
@_PATHS
@report_flags
@click.option("--shard", metavar="I/N", help="Run every N-th scenario of the list only, beginning with the I-th.")
@click.option(
    "--jobs", "-j", type=click.IntRange(min=1, max=256), metavar="N", help="At the same time.  [default: the cores]"
)
@click.option(
    "--allow-scripts",
    type=click.Choice(("auto", "true", "false")),
    default="auto",
    show_default=True,
    help="Run code that scenarios name; auto: but on pull_request_target and workflow_run.",
)
@_ALLOW_OUTSIDE
def run(
    paths: Sequence[str],
    shard: str | None,
    jobs: int | None,
    allow_scripts: AllowScripts,
    allow_outside: bool,
    **reports: Any,
) -> ExitCode:
    """Run scenarios, report their verdicts.

    Exit code: 0 all passed, 1 a scenario failed or has no verdict, 2 a scenario is invalid, 3 a fault of sim-action,
    5 no scenario found, 130 interrupted; of several, the highest of 130, 3, 2, 1. A shard that has no scenario, of a
    list that has some, passes.
    """
    from sim_action.interruption import Interruption

    with Interruption() as interruption:
        from sim_action import running
        from sim_action.permissions import Permissions, scripts_refused

        files, empty = _discovered(paths)
        request = running.RunRequest(
            files=files,
            empty=empty,
            shard=shard,
            jobs=jobs or len(os.sched_getaffinity(0)),
            permissions=Permissions(allow_outside, scripts_refused(allow_scripts, os.environ)),
            reports=report_request(reports),
        )
        return running.run(request, interruption)


@program.command()
@_PATHS
@click.option("--shards", type=click.IntRange(min=1, max=256), metavar="N", required=True, help="How many, at most.")
@click.option("--durations", metavar="PATH", help="An earlier results.json, by which to balance them.")
def matrix(paths: Sequence[str], shards: int, durations: str | None) -> ExitCode:
    """Deal scenarios to shards that take about equally long; print them as JSON, for the matrix of a GitHub job.

    Exit code: 5 if there is no scenario.
    """
    from pathlib import Path

    from sim_action.matrix import known_durations, matrix_text
    from sim_action.outcome import Results

    files, empty = _discovered(paths)
    if not files:
        return ExitCode.NO_SCENARIO
    known: dict[str, float] = {}
    try:
        known = known_durations(Results.read(Path(durations))) if durations else known
    except UsageError as error:
        _note(f"{error}; every scenario counts the same")
    click.echo(matrix_text(files, empty, shards, known))
    return ExitCode.PASSED


@program.command()
@click.argument("results", nargs=-1, required=True, metavar="RESULTS...")
@click.option("--scenarios", multiple=True, metavar="PATHS", help="What has to be in the results; may be repeated.")
@report_flags
def merge(results: Sequence[str], scenarios: Sequence[str], **reports: Any) -> ExitCode:
    """Join the results of shards to those of one run, and report them.

    RESULTS are results.json files, folders (every one in and below them) or globs. A shard that has left none, or a
    scenario of --scenarios that none has, is an error among the outcomes. Exit code: as of `run`.
    """
    from sim_action import merging
    from sim_action.joining import Listing

    listing = Listing(*_discovered(scenarios)) if scenarios else None
    if listing and not listing.files:
        raise UsageError("--scenarios finds none; is this where the shards ran, with the repository checked out?")
    return merging.merge(merging.MergeRequest(results, listing, report_request(reports)))


@program.command()
@_PATHS
@_ALLOW_OUTSIDE
def validate(paths: Sequence[str], allow_outside: bool) -> ExitCode:
    """Find everything that is wrong with scenarios without running them."""
    from sim_action.loading import load_all
    from sim_action.messages import log_line
    from sim_action.permissions import Permissions

    files, empty = _discovered(paths)
    valid, invalid = load_all(files, Permissions(allow_outside))
    for error in invalid.values():
        for problem in error.problems:
            click.echo(log_line(str(problem)))
    for loaded in valid.values():
        for remark in loaded.unchecked:
            click.echo(log_line(f"{loaded.file}: not checked: {remark}"))
    click.echo(f"{len(valid)} valid, {len(invalid)} invalid", err=bool(invalid))
    if not files:
        return ExitCode.NO_SCENARIO
    return ExitCode.INVALID if invalid or empty else ExitCode.PASSED


@program.command()
@click.argument("kind", type=click.Choice(("scenario", "results")), default="scenario")
def schema(kind: str) -> None:
    """Print the JSON Schema of scenario files, for editors, or that of results.json, for programs."""
    from sim_action.schema import results_schema, scenario_schema, schema_text

    click.echo(schema_text(scenario_schema() if kind == "scenario" else results_schema()), nl=False)


@program.command()
@click.argument("folder", default=".", metavar="[DIR]")
@click.option("--force", is_flag=True, help="Overwrite files that are there.")
def init(folder: str, force: bool) -> None:
    """Write a commented scenario that passes, and a workflow that runs it."""
    from pathlib import Path

    from sim_action.scaffold import write_scaffold
    from sim_action.schema import scenario_schema, schema_text

    for path in write_scaffold(Path(folder), schema_text(scenario_schema()), force=force):
        click.echo(f"wrote {path}")
    click.echo(f"next: sim-action run {Path(folder) / 'simulation'}")


@program.command()
def models() -> None:
    """List the robots that need no path."""
    from sim_action import catalogue, catalogue_text

    click.echo(catalogue_text.listing(catalogue.models()))


@program.command()
@click.argument("model")
@click.option("--json", "as_json", is_flag=True, help="For programs.")
@model_flags
@_ALLOW_OUTSIDE
def inspect(model: str, as_json: bool, **flags: Any) -> ExitCode:
    """Show what a robot model is: a built-in one, or a file. MODEL is as a scenario in this folder would name it.

    Exit code: 2 if no engine could take it.
    """
    from sim_action.inspection import inspect_model
    from sim_action.inspection_text import inspection_text

    found = inspect_model(*asked_model(model, flags))
    click.echo(found.model_dump_json(indent=2) if as_json else inspection_text(found))
    return ExitCode.PASSED


@program.command()
def assertions() -> None:
    """List what can stand below `expect:`."""
    from sim_action import catalogue, catalogue_text

    click.echo(catalogue_text.listing(catalogue.assertions()))


@program.command()
def commands() -> None:
    """List what can stand below `commands:`, and the drives that turn twists into wheel speeds."""
    from sim_action import catalogue, catalogue_text

    click.echo(catalogue_text.listing((*catalogue.commands(), *catalogue.drives())))


def _discovered(paths: Sequence[str]) -> tuple[list[Path], list[str]]:
    """The scenario files, and what was named but holds none."""
    from sim_action.discovery import compared_name, discover, unique

    found = discover(paths or ["."])
    # However it is spelled, it is one outcome.
    empty: dict[str, str] = {}
    for pattern in (pattern for pattern, matches in found.items() if not matches):
        empty.setdefault(compared_name(pattern), pattern)
    files = unique(found)
    for pattern in empty.values():
        # Beside others, it is in the reports.
        (_note if files else _complain)(f"no scenario in or at '{pattern}'")
    return files, list(empty.values())


def _note(message: str) -> None:
    from sim_action.messages import log_line

    click.echo(log_line(f"sim-action: {message}"), err=True)


def _complain(message: str) -> None:
    from sim_action.reports.annotations import complaint

    click.echo(complaint(message, os.environ), err=True)
