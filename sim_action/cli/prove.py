"""`sim-action prove`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from sim_action.cli import options
from sim_action.core.errors import ExitCode


@click.command()
@options.PATHS
@options.text_option(
    "--only",
    metavar="MUTANT,...",
    text="Run only these mutants, such as silenced or motor-off:wheel_left_joint; repeatable.",
    multiple=True,
)
@options.text_option(
    "--budget",
    metavar="TIME",
    text='Run only the most telling mutants, as many as fit into this time, such as "2 min".  [default: all mutants]',
)
@options.text_option("--json", "json_file", metavar="FILE", text="Write the findings as JSON.")
@options.switch("strict", "Fail if an expectation has noticed nothing, or if a scenario does not pass.")
@options.ENGINE_OPTION
@options.SEED_OPTION
@options.jobs_option("runs")
@options.output_dir("Folder with the report, in its subfolder proof.")
@options.switches(
    "Write report.html with a replay of each mutant that moved the robot another way, and that nothing noticed.",
    "On GitHub, mark the line of each expectation that checks nothing, and of each invalid scenario.",
)
@options.flag("--quiet", "-q", text="Show no progress.", env=True)
@options.code_flags
@options.PACKAGES
@options.ALLOW_OUTSIDE
def prove(
    paths: Sequence[str],
    *,
    only: tuple[str, ...],
    budget: str | None,
    json_file: str | None,
    strict: bool,
    jobs: int | None,
    output_dir: str,
    quiet: bool,
    **flags: Any,
) -> ExitCode:
    """Run each scenario again with injected faults, and report the expectations that notice them.

    PATHS are scenario files, globs, or folders, as for "run". Each scenario that passes runs once more for each mutant:
    commands silenced, left and right swapped, a motor off, an object missing, a wall across the way, and others. An
    expectation that notices no mutant checks nothing here. Only the first variation of a scenario is proven.

    Exit code: 0 everything ran; 1 with --strict: an expectation has noticed nothing, or a scenario does not pass; 2 a
    scenario or the command line is invalid; 3 internal error of sim-action; 5 no scenario found; 130 interrupted.
    """
    from sim_action.core.process import Interruption, usable_cores

    with Interruption() as interruption:
        from sim_action.app.prove import PROOF_FOLDER, ProveRequest, prove_scenarios
        from sim_action.reports import ReportRequest

        seconds = None if budget is None else _seconds(budget)
        request = ProveRequest(
            options.plan_request(paths, flags),
            ReportRequest(
                Path(output_dir) / PROOF_FOLDER, None, False, "quiet" if quiet else "normal", options.silenced(flags)
            ),
            jobs or usable_cores(),
            tuple(name for names in only for name in _names(names)),
            seconds,
            None if json_file is None else Path(json_file),
            strict,
        )
        return prove_scenarios(request, interruption)


def _names(text: str) -> list[str]:
    """Return the names of an option, which are separated by commas. Raise BadParameter if there is none."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise click.BadParameter(f"expected names of mutants, not '{text}'", param_hint="'--only'")
    return names


def _seconds(text: str) -> float:
    """Return the time of an option in s. Raise BadParameter."""
    from sim_action.core import units

    try:
        seconds = units.parse(text, units.TIME)
    except units.UnitError as error:
        raise click.BadParameter(str(error), param_hint="'--budget'") from None
    if not seconds > 0:
        raise click.BadParameter("expected a time greater than 0", param_hint="'--budget'")
    return seconds
