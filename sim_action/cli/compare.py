"""`sim-action compare`."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

import click

from sim_action.cli.options import Bounded, output_dir, refuse_typed, switch, text_option
from sim_action.core.discovery import compared_name
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.files import whole_file
from sim_action.core.records import dataclass, field
from sim_action.core.wording import escaped_line, system_reason, warn
from sim_action.reports.comparison import comparison_markdown, print_comparison
from sim_action.reports.github.step_outputs import append_outputs
from sim_action.results.comparison import Comparison, Thresholds, compare_outcomes
from sim_action.results.output_folder import is_comparison, is_foreign
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
def compare(
    old: str,
    new: str | None,
    *,
    output_dir: str,
    margin: float,
    slower: float,
    strict: bool,
    allow_removed: bool,
    markdown: str | None,
    summary: bool,
) -> ExitCode:
    """Compare two runs: new failures, fixed scenarios, weaker checks, smaller margins.

    OLD and NEW are results.json files, or folders. A folder contains one results.json, or the results.json files of all
    shards. The default of NEW is the folder of --output-dir. Runs of a gate are compared in pairs with the same draws.

    Exit code: 0 no scenario newly fails; 1 a scenario newly fails or is flaky, the pass rate of a gate fell
    significantly, or every scenario was removed; 2 the results are missing or unreadable, or the command line is
    invalid; 3 internal error of sim-action.
    """
    if new is not None:
        refuse_typed("NEW", "output_dir")
    thresholds = Thresholds(margin, slower)
    return compare_results(CompareRequest(old, new or output_dir, thresholds, strict, markdown, summary, allow_removed))


STANDARD_OUTPUT: Final = "-"


@dataclass(frozen=True, slots=True)
class CompareRequest:
    """The options of `compare`."""

    old: str  # old, new: files, folders or globs of results, as typed
    new: str
    thresholds: Thresholds = field(default_factory=Thresholds)
    strict: bool = False  # treat warnings as failures
    # file for the Markdown; "-" prints it instead of the text for terminals; None writes none
    markdown: str | None = None
    summary: bool = True  # add the comparison to the job summary on GitHub
    allow_removed: bool = False  # accept a new run that has no scenario of the old run


def compare_results(request: CompareRequest) -> ExitCode:
    """Report the changes and return the exit code. Raises UsageError."""
    if request.markdown not in (None, STANDARD_OUTPUT):
        _refuse_foreign(Path(request.markdown))
    old, new = read_run(request.old), read_run(request.new)
    if compared_name(request.old) == compared_name(request.new):
        warn(f"{request.old} is compared with itself, which shows no change; name the results of another run")
    comparison = compare_outcomes(
        old.outcomes,
        new.outcomes,
        request.thresholds,
        allow_removed=request.allow_removed,
        gates=(old.gates, new.gates),
    )
    if request.markdown not in (None, STANDARD_OUTPUT):
        _write(Path(request.markdown), comparison)
    _write_for_github(comparison, request, os.environ)
    # A closed output does not change the result.
    with suppress(BrokenPipeError):
        if request.markdown == STANDARD_OUTPUT:
            sys.stdout.write(comparison_markdown(comparison))
            sys.stdout.flush()
        else:
            print_comparison(comparison, os.environ)
    return comparison.exit_code(strict=request.strict)


def _refuse_foreign(path: Path) -> None:
    """Raise UsageError if the file exists and `compare` did not write it."""
    try:
        foreign = is_foreign(path, is_comparison)
    except (OSError, ValueError) as error:
        raise UsageError(escaped_line(f"--markdown {path} cannot be written: {system_reason(error)}")) from None
    if foreign:
        raise UsageError(
            escaped_line(f"--markdown {path} exists and is not a comparison; name another file, or remove it")
        )


def _write(path: Path, comparison: Comparison) -> None:
    try:
        with whole_file(path) as file:
            file.write(_encoded(comparison))
    except OSError as error:
        raise UsageError(escaped_line(f"--markdown {path} cannot be written: {error.strerror}")) from None


def _write_for_github(comparison: Comparison, request: CompareRequest, environment: Mapping[str, str]) -> None:
    """Append to the outputs and the job summary of a GitHub step, if there are any."""
    counts = {"newly-failing": str(comparison.failures), "warnings": str(comparison.warnings)}
    summary = environment.get("GITHUB_STEP_SUMMARY") if request.summary else None
    try:
        append_outputs(counts, environment)
        if summary:
            with Path(summary).open("ab") as file:
                file.write(_encoded(comparison) + b"\n")
    except OSError as error:
        raise UsageError(f"the job summary or the outputs cannot be written: {error.strerror}") from None


def _encoded(comparison: Comparison) -> bytes:
    return comparison_markdown(comparison).encode("utf-8", errors="replace")
