"""Lists and schemas: `sim-action models`, `assertions`, `commands`, `sensors`, `schema`."""

from __future__ import annotations

import click


@click.command()
def models() -> None:
    """List the built-in robots."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing(catalogue.models()))


@click.command()
def assertions() -> None:
    """List the assertions for `expect:`."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing(catalogue.assertions()))


@click.command(short_help="List what can drive the robot.")
def commands() -> None:
    """List what can drive the robot: the command sources for `commands:`, and the drives."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing((*catalogue.commands(), *catalogue.drives())))


@click.command()
def sensors() -> None:
    """List the sensors for `sensors:`."""
    from sim_action.app import catalogue

    click.echo(catalogue.listing(catalogue.sensors()))


@click.command(short_help="Print the JSON Schema of scenarios.")
@click.argument("kind", type=click.Choice(("scenario", "results")), default="scenario")
def schema(kind: str) -> None:
    """Print the JSON Schema of scenario files (the default), or of results.json."""
    from sim_action.app.schema import results_schema, scenario_schema, schema_text

    click.echo(schema_text(scenario_schema() if kind == "scenario" else results_schema()), nl=False)
