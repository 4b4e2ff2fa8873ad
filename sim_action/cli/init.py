"""`sim-action init`."""

from __future__ import annotations

import click


@click.command(short_help="Create an example scenario and a workflow.")
@click.argument("folder", default=".", metavar="[FOLDER]")
@click.option(
    "--robot",
    metavar="NAME",
    default="turtlebot3_burger",
    show_default=True,
    help="Built-in robot of the scenario; sim-action models lists them.",
)
@click.option("--force", is_flag=True, help="Overwrite existing files.")
def init(folder: str, robot: str, force: bool) -> None:
    """Create an example scenario with explanations, which passes, and a GitHub workflow that runs it.

    FOLDER is created if it does not exist. The default is the current folder.
    """
    from pathlib import Path

    from sim_action.app.init import write_scaffold
    from sim_action.app.schema import schema_here, schema_text

    for path in write_scaffold(Path(folder), schema_text(schema_here("scenario")), force=force, robot=robot):
        click.echo(f"wrote {path}")
    click.echo(f"next: sim-action run {Path(folder) / 'simulation'}")
