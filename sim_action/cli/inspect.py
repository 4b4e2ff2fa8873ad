"""`sim-action inspect`."""

from __future__ import annotations

from typing import Any

import click

from sim_action.cli.options import ALLOW_OUTSIDE, asked_model, model_flags
from sim_action.core.errors import ExitCode


@click.command()
@click.argument("model")
@click.option("--json", "as_json", is_flag=True, help="For programs.")
@model_flags
@ALLOW_OUTSIDE
def inspect(model: str, as_json: bool, **flags: Any) -> ExitCode:
    """Show what a robot model is: a built-in one, or a file. MODEL is as a scenario in this folder would name it.

    Exit code: 2 if no engine could take it.
    """
    from sim_action.app.inspect import inspection_text
    from sim_action.app.inspect_process import inspect_apart

    found = inspect_apart(*asked_model(model, flags))
    click.echo(found.model_dump_json(indent=2) if as_json else inspection_text(found))
    return ExitCode.PASSED
