"""`sim-action margins`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from sim_action.cli.options import (
    ALLOW_OUTSIDE,
    ENGINE_OPTION,
    PACKAGES,
    PATHS,
    SEED_OPTION,
    Bounded,
    code_flags,
    code_permissions,
    discovered,
    jobs_option,
    named_packages,
    not_empty,
    report_flags,
    report_request,
    selection_flags,
)
from sim_action.core.errors import ExitCode
from sim_action.core.records import replace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_action.runner.margin_search import FactorRequest


@click.command()
@PATHS
@selection_flags
@click.option(
    "--factor",
    "factors",
    multiple=True,
    callback=not_empty,
    metavar="KEY[=FROM:TO]",
    help="Vary only these factors, such as friction, latency=0 s:2 s or world.objects.box.mass=1 kg:9 kg; repeatable.  "
    "[default: those of --at-least, else all]",
)
@click.option(
    "--at-least",
    "at_least",
    multiple=True,
    callback=not_empty,
    metavar="FACTOR=AMOUNT",
    help="Fail if a scenario fails so near to the nominal value, such as friction=20% or latency=50 ms; repeatable.",
)
@click.option(
    "--runs",
    type=Bounded(click.IntRange(2, 1000)),
    default=20,
    show_default=True,
    metavar="N",
    help="Largest number of runs for each factor, 2 to 1000.",
)
@click.option(
    "--budget",
    type=Bounded(click.IntRange(1)),
    metavar="N",
    help="Vary nothing if there may be more than N runs.  [default: any number]",
)
@click.option("--shard", callback=not_empty, metavar="I/N", help="Only part I of N of the scenarios, such as 1/4.")
@ENGINE_OPTION
@SEED_OPTION
@jobs_option("runs")
@report_flags
@code_flags
@PACKAGES
@ALLOW_OUTSIDE
def margins(
    paths: Sequence[str],
    *,
    factors: tuple[str, ...],
    at_least: tuple[str, ...],
    runs: int,
    budget: int | None,
    shard: str | None,
    backend: str | None,
    seed: int | None,
    jobs: int | None,
    packages: tuple[str, ...],
    allow_outside: bool,
    **flags: Any,
) -> ExitCode:
    """Find how far each factor of a scenario can move before the scenario fails.

    PATHS are as for "run". Each factor varies alone, in both directions; bisection finds where the scenario begins to
    fail. Reports are in the folder margins below --output-dir. Only the first variation of a scenario is varied.

    Exit code: 0 every scenario passes and has the margins of --at-least; 1 one does not; others as of "run".
    """
    from sim_action.core.process import Interruption, usable_cores

    with Interruption() as interruption:
        from sim_action.app.margins import MARGINS_FOLDER, MarginsRequest, find_margins
        from sim_action.runner.run_plan import PlanRequest

        requests = _requests(factors, at_least)
        suite = discovered(paths, flags, outside=allow_outside)
        allowed = code_permissions(flags, {path.parent: None for path in suite.files})
        permissions = replace(allowed, outside=allow_outside, packages=named_packages(packages))
        reports = report_request(flags)
        request = MarginsRequest(
            PlanRequest(suite, permissions, shard, backend, seed),
            replace(reports, folder=reports.folder / MARGINS_FOLDER),
            jobs or usable_cores(),
            requests,
            runs,
            budget,
        )
        return find_margins(request, interruption)


def _requests(factors: Sequence[str], at_least: Sequence[str]) -> tuple[FactorRequest, ...]:
    """Return the factors that the options name. Raise BadParameter."""
    from sim_action.runner.margin_search import FactorRequest

    requests: dict[str, FactorRequest] = {}
    for text in factors:
        name, equals, bounds = text.partition("=")
        requests[name] = FactorRequest(name)
        if equals:
            texts = bounds.split(":")
            if len(texts) != 2:
                raise click.BadParameter(f"expected KEY=FROM:TO, found '{text}'", param_hint="'--factor'")
            (low, unit), (high, other) = (_number(each, "--factor") for each in texts)
            if unit != other:
                raise click.BadParameter(f"both ends need the same unit: '{text}'", param_hint="'--factor'")
            requests[name] = FactorRequest(name, (low, high), unit=unit)
    for text in at_least:
        name, _, amount = text.partition("=")
        number, unit = _number(amount.strip().removesuffix("%"), "--at-least")
        if not number > 0:
            message = f"expected FACTOR=AMOUNT, such as friction=20%, found '{text}'"
            raise click.BadParameter(message, param_hint="'--at-least'")
        request = requests.get(name, FactorRequest(name))
        if amount.rstrip().endswith("%"):
            requests[name] = replace(request, share=number / 100)
        else:
            requests[name] = replace(request, distance=number, unit=request.unit or unit)
    return tuple(requests.values())


def _number(text: str, option: str) -> tuple[float, str]:
    """Return a number in SI units, and the unit. Raise BadParameter."""
    from sim_action.core import units

    try:
        return units.with_si_unit(text.strip())
    except units.UnitError as error:
        raise click.BadParameter(str(error), param_hint=f"'{option}'") from None
