"""The subcommands of the command line, one a file: each takes what was typed, calls one thing and says what came of it.

What a subcommand needs is imported when it is called, so that `--help` stays quick.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from sim_action.subcommands.compare import compare
from sim_action.subcommands.init import init
from sim_action.subcommands.inspect import inspect
from sim_action.subcommands.listings import assertions, commands, models, schema, sensors
from sim_action.subcommands.matrix import matrix
from sim_action.subcommands.merge import merge
from sim_action.subcommands.ros import roslaunch, rostest
from sim_action.subcommands.run import run
from sim_action.subcommands.validate import validate
from sim_action.subcommands.view import view

if TYPE_CHECKING:
    import click

SUBCOMMANDS: Final[tuple[click.Command, ...]] = (
    run,
    validate,
    matrix,
    merge,
    compare,
    view,
    rostest,
    roslaunch,
    init,
    inspect,
    models,
    assertions,
    commands,
    sensors,
    schema,
)

TAKE_DEFAULTS: Final = ("run", "validate", "matrix", "merge", "view")
"""Whose options may stand in pyproject.toml."""
