"""`sim-action init`."""

from __future__ import annotations

import click


@click.command()
@click.argument("folder", default=".", metavar="[DIR]")
@click.option("--force", is_flag=True, help="Overwrite existing files.")
def init(folder: str, force: bool) -> None:
    """Write a commented scenario that passes and a workflow that runs it."""
    from pathlib import Path

    from sim_action.app.init import write_scaffold
    from sim_action.app.schema import scenario_schema, schema_text

    for path in write_scaffold(Path(folder), schema_text(scenario_schema()), force=force):
        click.echo(f"wrote {path}")
    click.echo(f"next: sim-action run {Path(folder) / 'simulation'}")
