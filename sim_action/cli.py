"""The command line. What a subcommand needs is imported when it is called, so that `--help` stays quick."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, NoReturn

import click

from sim_action import __version__
from sim_action.errors import ExitCode, SimActionError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from sim_action.catalogue import Entry

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
    code = call()
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


def call() -> int:
    """Does what the command line says and returns the exit code: the one place that catches errors."""
    os.environ.update(_BEFORE_IMPORTS)
    try:
        return program.main(standalone_mode=False, prog_name="sim-action") or ExitCode.PASSED
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        return ExitCode.INTERRUPTED
    except SimActionError as error:
        click.echo(f"sim-action: {error}", err=True)
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
@click.option("--output-dir", default="sim-results", show_default=True, help="Where results, JUnit and traces go.")
@click.option("--junit", metavar="PATH", help="Where the JUnit XML goes.  [default: junit.xml in the output dir]")
@click.option("--junit-strict", is_flag=True, help="Leave out of it what junit-10.xsd forbids.")
@click.option(
    "--jobs", "-j", type=click.IntRange(min=1, max=256), metavar="N", help="At the same time.  [default: the cores]"
)
@click.option("--verbose", "-v", is_flag=True, help="Show notes, diagnostics and what controllers print.")
@click.option("--quiet", "-q", is_flag=True, help="Show what failed, and one closing line.")
@_ALLOW_OUTSIDE
def run(  # noqa: PLR0917 - click passes what was typed
    paths: Sequence[str],
    output_dir: str,
    junit: str | None,
    junit_strict: bool,
    jobs: int | None,
    verbose: bool,
    quiet: bool,
    allow_outside: bool,
) -> ExitCode:
    """Run scenarios, report their verdicts.

    Exit code: 0 all passed, 1 a scenario failed or has no verdict, 2 a scenario is invalid, 3 a fault of sim-action,
    5 no scenario found, 130 interrupted; of several, the highest of 130, 3, 2, 1.
    """
    from pathlib import Path

    from sim_action.interruption import Interruption

    if verbose and quiet:
        raise UsageError("--verbose and --quiet do not go together")
    with Interruption() as interruption:
        from sim_action import running

        files, empty = _discovered(paths)
        request = running.RunRequest(
            files=files,
            empty=empty,
            folder=Path(output_dir),
            junit=Path(junit) if junit else None,
            junit_strict=junit_strict,
            jobs=jobs or len(os.sched_getaffinity(0)),
            verbosity="verbose" if verbose else "quiet" if quiet else "normal",
            allow_outside=allow_outside,
        )
        return running.run(request, interruption)


@program.command()
@_PATHS
@_ALLOW_OUTSIDE
def validate(paths: Sequence[str], allow_outside: bool) -> ExitCode:
    """Find everything that is wrong with scenarios without running them."""
    from sim_action.loading import load_all
    from sim_action.messages import escaped_line

    files, empty = _discovered(paths)
    valid, invalid = load_all(files, allow_outside=allow_outside)
    for error in invalid.values():
        for problem in error.problems:
            click.echo(escaped_line(str(problem)))
    click.echo(f"{len(valid)} valid, {len(invalid)} invalid", err=bool(invalid))
    if not files:
        return ExitCode.NO_SCENARIO
    return ExitCode.INVALID if invalid or empty else ExitCode.PASSED


@program.command()
def schema() -> None:
    """Print the JSON Schema of scenario files, for editors."""
    from sim_action.schema import schema_text

    click.echo(schema_text(), nl=False)


@program.command()
@click.argument("folder", default=".", metavar="[DIR]")
@click.option("--force", is_flag=True, help="Overwrite files that are there.")
def init(folder: str, force: bool) -> None:
    """Write a commented scenario that passes, and a workflow that runs it."""
    from pathlib import Path

    from sim_action.scaffold import write_scaffold
    from sim_action.schema import schema_text

    for path in write_scaffold(Path(folder), schema_text(), force=force):
        click.echo(f"wrote {path}")
    click.echo(f"next: sim-action run {Path(folder) / 'simulation'}")


@program.command()
def models() -> None:
    """List the robots that need no path."""
    from sim_action import catalogue

    _print(catalogue.models())


@program.command()
def assertions() -> None:
    """List what can stand below `expect:`."""
    from sim_action import catalogue

    _print(catalogue.assertions())


@program.command()
def commands() -> None:
    """List what can stand below `commands:`, and the drives that turn twists into wheel speeds."""
    from sim_action import catalogue

    _print((*catalogue.commands(), *catalogue.drives()))


def _discovered(paths: Sequence[str]) -> tuple[list[Path], list[str]]:
    """The scenario files, and what was named but holds none."""
    from sim_action.discovery import discover, unique
    from sim_action.messages import escaped_line

    found = discover(paths or ["."])
    empty = [pattern for pattern, files in found.items() if not files]
    for pattern in empty:
        click.echo(escaped_line(f"sim-action: no scenario in or at '{pattern}'"), err=True)
    return unique(found), empty


def _print(entries: Iterable[Entry]) -> None:
    for entry in entries:
        click.echo(f"{click.style(entry.name, bold=True)}\n  {entry.summary}")
        for field in entry.fields:
            default = f"  [{field.default}]" if field.default else ""
            description = f"  {field.description}" if field.description else ""
            click.echo(f"    {field.name}: {field.takes}{default}{description}")
