"""`sim-action explain`."""

from __future__ import annotations

import shutil

import click

_MAX_WIDTH = 100


@click.command(short_help="Explain an assertion, command source, drive or sensor.")
@click.argument("names", nargs=-1, metavar="[NAME]...")
def explain(names: tuple[str, ...]) -> None:
    """Explain what a scenario can name, with all of its keys: an assertion, a command source, a drive or a sensor.

    Without a NAME, all names are listed.

    Example: sim-action explain upright
    """
    from sim_action.app.explain import explanation, overview

    width = min(_MAX_WIDTH, shutil.get_terminal_size().columns - 1)
    click.echo("\n\n".join(explanation(name, width) for name in names) if names else overview())
