"""The options of the command line that say which reports there are and where they go."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

import click

from sim_action.core.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from sim_action.reports.writing import ReportRequest

Command = Callable[..., ExitCode]

_FILES: Final = (
    click.option(
        "--output-dir",
        envvar="SIM_ACTION_OUTPUT_DIR",
        default="sim-results",
        show_default=True,
        help="Where results, JUnit and traces go.",
    ),
    click.option(
        "--junit",
        envvar="SIM_ACTION_JUNIT",
        metavar="PATH",
        help="Where the JUnit XML goes.  [default: junit.xml in the output dir]",
    ),
    click.option(
        "--junit-strict",
        envvar="SIM_ACTION_JUNIT_STRICT",
        is_flag=True,
        help="Leave out of it what junit-10.xsd forbids.",
    ),
)
_SWITCHES: Final = (
    click.option(
        "--report/--no-report",
        envvar="SIM_ACTION_REPORT",
        default=True,
        help="Write report.html, with a replay of each run.  [default: yes]",
    ),
    click.option(
        "--summary/--no-summary",
        envvar="SIM_ACTION_SUMMARY",
        default=True,
        help="Write the job summary, on GitHub.  [default: yes]",
    ),
    click.option(
        "--annotations/--no-annotations",
        envvar="SIM_ACTION_ANNOTATIONS",
        default=True,
        help="Annotate lines, on GitHub.  [default: yes]",
    ),
)
_VERBOSITY: Final = (
    click.option(
        "--verbose",
        "-v",
        envvar="SIM_ACTION_VERBOSE",
        is_flag=True,
        help="Show notes, diagnostics and what controllers print.",
    ),
    click.option(
        "--quiet", "-q", envvar="SIM_ACTION_QUIET", is_flag=True, help="Show what failed, and one closing line."
    ),
)


def report_flags(command: Command) -> Command:
    """Gives a command these options."""
    for option in reversed((*_FILES, *_SWITCHES, *_VERBOSITY)):
        command = option(command)
    return command


def report_request(flags: Mapping[str, Any]) -> ReportRequest:
    """What was typed, by the names that click gives it. Raises UsageError."""
    from pathlib import Path

    from sim_action.reports.writing import ReportRequest

    if flags["verbose"] and flags["quiet"]:
        raise UsageError("--verbose and --quiet do not go together")
    return ReportRequest(
        folder=Path(flags["output_dir"]),
        junit=Path(flags["junit"]) if flags["junit"] else None,
        junit_strict=flags["junit_strict"],
        verbosity="verbose" if flags["verbose"] else "quiet" if flags["quiet"] else "normal",
        silenced=frozenset(name for name in ("report", "summary", "annotations") if not flags[name]),
    )
