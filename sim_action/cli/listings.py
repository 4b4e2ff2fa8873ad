"""Lists, explanations, the guide and schemas: `sim-action models`, `explain`, `guide`, `schema` and others."""

from __future__ import annotations

import shutil

import click

from sim_action.app import catalogue
from sim_action.app.catalogue import explanation, overview
from sim_action.app.schema import schema_here, schema_text
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.drives import DRIVES
from sim_action.sensors import SENSORS

_MAX_WIDTH = 100


@click.command()
def models() -> None:
    """List the built-in robots."""
    click.echo(catalogue.listing(catalogue.models()))


@click.command()
def assertions() -> None:
    """List the assertions for `expect:`."""
    click.echo(catalogue.listing((*catalogue.entries(ASSERTIONS), *catalogue.of_packages(ASSERTIONS))))


@click.command()
def commands() -> None:
    """List what can drive the robot: the command sources for `commands:`, and the drives."""
    click.echo(
        catalogue.listing((*catalogue.entries(COMMANDS), *catalogue.of_packages(COMMANDS), *catalogue.entries(DRIVES)))
    )


@click.command()
def sensors() -> None:
    """List the sensors for `sensors:`."""
    click.echo(catalogue.listing((*catalogue.entries(SENSORS), *catalogue.of_packages(SENSORS))))


@click.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
def explain(names: tuple[str, ...]) -> None:
    """Explain what a scenario can name: an assertion, a command source, a drive, a sensor or a key, with its own keys.

    Without a NAME, all names are listed.

    Example: sim-action explain upright
    """
    width = min(_MAX_WIDTH, shutil.get_terminal_size().columns - 1)
    click.echo("\n\n".join(explanation(name, width) for name in names) if names else overview())


@click.command()
def guide() -> None:
    """Print a compact reference of scenarios, for programs that write them: rules, ten examples, all parts and keys."""
    click.echo(catalogue.guide())


@click.command()
@click.argument("kind", type=click.Choice(("scenario", "base", "results", "proof")), default="scenario")
def schema(kind: str) -> None:
    """Print the JSON Schema of scenario files (the default), of base files (*.base.yml), of results.json, or of proofs.

    Editors use the first two to complete keys, to explain them and to mark mistakes. They include the parts of
    installed packages. Save the schema as a file, and name the file in the first line of a scenario: "#
    yaml-language-server: $schema=scenario.schema.json".
    """
    click.echo(schema_text(schema_here(kind)), nl=False)
