"""`sim-action compare`."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import click

from sim_action.cli.options import Bounded, output_dir, refuse_typed, switch, text_option
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.files import whole_file
from sim_action.core.wording import escaped_line, warn
from sim_action.core.workspace import compared_name
from sim_action.reports.comparison import comparison_markdown, print_comparison
from sim_action.reports.github.step_outputs import append_outputs
from sim_action.results.comparison import Comparison, Thresholds, compare_outcomes
from sim_action.results.output_folder import is_comparison, refuse_foreign_file
from sim_action.results.shard_results import read_run


@click.command()
@click.argument("old")
@click.argument("new", required=False)
@output_dir("Folder of the new results if NEW is not given.")
@click.option(
    "--margin",
    type=Bounded(click.FloatRange(0, 1)),
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Warn if a margin, the distance between measured value and limit, shrinks below this share (0 to 1) of its "
    "old value.",
)
@click.option(
    "--slower",
    type=Bounded(click.FloatRange(0, 1)),
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Warn if the real-time factor, sim time divided by real time, drops below this share (0 to 1) of its old "
    "value.",
)
@switch("strict", "Treat warnings as failures.")
@switch("allow-removed", "Accept a new run that has no scenario of the old run.")
@text_option(
    "--markdown",
    metavar="FILE",
    text="Write the comparison as Markdown, such as for a comment on a pull request; - is standard output.",
)
@switch("summary", "On GitHub, add the comparison to the job summary.", env=True, default=True)
def compare(old: str, new: str | None, *, output_dir: str, margin: float, slower: float, **flags: Any) -> ExitCode:
    """Compare two runs: new failures, fixed scenarios, weaker checks, smaller margins.

    OLD and NEW are results.json files, or folders. A folder contains one results.json, or the results.json files of all
    shards. The default of NEW is the folder of --output-dir. Runs of a gate are compared in pairs with the same draws.

    Exit code: 0 no scenario newly fails; 1 a scenario newly fails or is flaky, the pass rate of a gate fell
    significantly, or every scenario was removed; 2 the results are missing or unreadable, or the command line is
    invalid; 3 internal error of sim-action.
    """
    if new is not None:
        refuse_typed("NEW", "output_dir")
    return compare_results(old, new or output_dir, Thresholds(margin, slower), **flags)


STANDARD_OUTPUT: Final = "-"


def compare_results(
    old: str,
    new: str,
    thresholds: Thresholds = Thresholds(),  # noqa: B008 - immutable
    *,
    strict: bool = False,
    markdown: str | None = None,
    summary: bool = True,
    allow_removed: bool = False,
) -> ExitCode:
    """Report the changes and return the exit code. Raises UsageError.

    `old`, `new`: files, folders or globs of results, as typed; `markdown`: the file for Markdown; "-" prints it instead
    of the text for terminals; None writes none. The others are the options of `compare`.
    """
    file = None if markdown in (None, STANDARD_OUTPUT) else Path(markdown)
    if file is not None:
        refuse_foreign_file("--markdown", file, is_comparison, "is not a comparison")
    before, after = read_run(old), read_run(new)
    if compared_name(old) == compared_name(new):
        warn(f"{old} is compared with itself, which shows no change; name the results of another run")
    comparison = compare_outcomes(
        before.outcomes, after.outcomes, thresholds, allow_removed=allow_removed, gates=(before.gates, after.gates)
    )
    if file is not None:
        _write(file, comparison)
    _write_for_github(comparison, os.environ, summary=summary)
    # A closed output does not change the result.
    with suppress(BrokenPipeError):
        if markdown == STANDARD_OUTPUT:
            sys.stdout.write(comparison_markdown(comparison))
            sys.stdout.flush()
        else:
            print_comparison(comparison, os.environ)
    return comparison.exit_code(strict=strict)


def _write(path: Path, comparison: Comparison) -> None:
    try:
        with whole_file(path) as file:
            file.write(_encoded(comparison))
    except OSError as error:
        raise UsageError(escaped_line(f"--markdown {path} cannot be written: {error.strerror}")) from None


def _write_for_github(comparison: Comparison, environment: Mapping[str, str], *, summary: bool) -> None:
    """Append to the outputs and the job summary of a GitHub step, if there are any."""
    counts = {"newly-failing": str(comparison.failures), "warnings": str(comparison.warnings)}
    path = environment.get("GITHUB_STEP_SUMMARY") if summary else None
    try:
        append_outputs(counts, environment)
        if path:
            with Path(path).open("ab") as file:
                file.write(_encoded(comparison) + b"\n")
    except OSError as error:
        raise UsageError(f"the job summary or the outputs cannot be written: {error.strerror}") from None


def _encoded(comparison: Comparison) -> bytes:
    return comparison_markdown(comparison).encode("utf-8", errors="replace")
