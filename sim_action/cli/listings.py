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


@click.command(short_help="Print a JSON Schema, for editors.")
@click.argument("kind", type=click.Choice(("scenario", "base", "results")), default="scenario")
def schema(kind: str) -> None:
    """Print the JSON Schema of scenario files (the default), of base files (*.base.yml), or of results.json.

    Editors use the first two to complete keys, to explain them and to mark mistakes. Save the schema as a file, and
    name the file in the first line of a scenario: "# yaml-language-server: $schema=scenario.schema.json".
    """
    from sim_action.app.schema import SCHEMAS, schema_text

    click.echo(schema_text(SCHEMAS[kind]()), nl=False)
