"""The subcommands of the command line, one per file.

Each parses its options, calls one use case in `app` or `ros` and prints the result. A subcommand imports its
dependencies when it is called, so that `--help` stays quick.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from sim_action.cli.compare import compare
from sim_action.cli.doctor import doctor
from sim_action.cli.init import init
from sim_action.cli.inspect import inspect
from sim_action.cli.listings import assertions, commands, explain, models, schema, sensors
from sim_action.cli.matrix import matrix
from sim_action.cli.merge import merge
from sim_action.cli.prove import prove
from sim_action.cli.report import report
from sim_action.cli.ros import launchtest, roslaunch, rostest
from sim_action.cli.run import run
from sim_action.cli.validate import validate
from sim_action.cli.view import view

if TYPE_CHECKING:
    import click

SUBCOMMANDS: Final[tuple[click.Command, ...]] = (
    run,
    validate,
    matrix,
    merge,
    compare,
    prove,
    report,
    view,
    rostest,
    roslaunch,
    launchtest,
    init,
    inspect,
    explain,
    doctor,
    models,
    assertions,
    commands,
    sensors,
    schema,
)

TAKE_DEFAULTS: Final = (
    "run",
    "validate",
    "matrix",
    "merge",
    "prove",
    "report",
    "view",
    "compare",
    "rostest",
    "roslaunch",
    "launchtest",
)
"""The subcommands whose options can be set in pyproject.toml."""

INTERRUPTIBLE: Final = ("run", "prove", "rostest", "roslaunch", "launchtest")
"""The subcommands that handle signals themselves, by an `Interruption`; a signal ends each other one at once."""
