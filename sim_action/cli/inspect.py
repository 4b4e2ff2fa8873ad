"""`sim-action inspect`."""

from __future__ import annotations

from typing import Any

import click

from sim_action.cli.options import ALLOW_OUTSIDE, asked_model, model_flags
from sim_action.core.errors import ExitCode


@click.command()
@click.argument("model")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@model_flags
@ALLOW_OUTSIDE
def inspect(model: str, as_json: bool, **flags: Any) -> ExitCode:
    """Show the links, joints, masses and problems of a robot model.

    MODEL is a built-in name or a file, written as in a scenario of this folder. Exit code: 0 the model is usable, 2 it
    is refused.
    """
    from sim_action.app.inspect import inspection_text
    from sim_action.app.inspect_process import inspect_apart

    found = inspect_apart(*asked_model(model, flags))
    click.echo(found.model_dump_json(indent=2) if as_json else inspection_text(found))
    return ExitCode.PASSED
