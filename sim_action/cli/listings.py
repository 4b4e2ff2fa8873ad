"""What sim-action knows, as lists and schemas: `models`, `assertions`, `commands`, `sensors`, `schema`."""

from __future__ import annotations

import click


@click.command()
def models() -> None:
    """List the robots that need no path."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing(catalogue.models()))


@click.command()
def assertions() -> None:
    """List what can stand below `expect:`."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing(catalogue.assertions()))


@click.command()
def commands() -> None:
    """List what can stand below `commands:`, and the drives that turn twists into wheel speeds."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing((*catalogue.commands(), *catalogue.drives())))


@click.command()
def sensors() -> None:
    """List what can stand below `sensors:`."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing(catalogue.sensors()))


@click.command()
@click.argument("kind", type=click.Choice(("scenario", "results")), default="scenario")
def schema(kind: str) -> None:
    """Print the JSON Schema of scenario files, for editors, or that of results.json, for programs."""
    from sim_action.app.schema import results_schema, scenario_schema, schema_text

    click.echo(schema_text(scenario_schema() if kind == "scenario" else results_schema()), nl=False)
