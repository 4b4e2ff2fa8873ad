"""`sim-action inspect`."""

from __future__ import annotations

import os
from typing import Any

import click

from sim_action.app.inspect import inspect_apart, inspection_json, inspection_text, losses_text
from sim_action.cli.options import asked_model, code_flags, flag, model_flags
from sim_action.core.errors import ExitCode
from sim_action.results.masking import Mask


@click.command()
@click.argument("model")
@flag("--json", "as_json", text="Print JSON.")
@flag(
    "--losses",
    text="List the parts of the model that are not simulated as its files state them, with file, line and consequence.",
)
@click.option(
    "--srdf", metavar="FILE", help="The SRDF of the model, as robot.srdf; default: MODEL with the suffix .srdf."
)
@model_flags
@code_flags
@flag(
    "--allow-outside",
    text="Allow a model outside the workspace. The workspace is the git repository, else the current folder.",
)
def inspect(model: str, as_json: bool, losses: bool, **flags: Any) -> ExitCode:
    """Show the links, joints and masses of a robot model, and the problems in it.

    MODEL is the name of a built-in robot, or a path relative to the current folder.

    Exit code: 0 the model is usable; 2 the model is refused, or the command line is invalid; 3 internal error of
    sim-action.
    """
    robot, workspace = asked_model(model, flags)
    inspection = inspect_apart(robot, workspace)
    mask = Mask.of(os.environ, workspace.pass_env)
    described = losses_text if losses else inspection_text
    click.echo(inspection_json(inspection, mask) if as_json else mask.text(described(inspection)))
    return ExitCode.PASSED
