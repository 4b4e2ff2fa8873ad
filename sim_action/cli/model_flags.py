"""The options of the command line that say what else than its file makes a robot model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.messages import shown

if TYPE_CHECKING:
    from sim_action.core.workspace import Workspace
    from sim_action.robot.spec import Robot

Command = Callable[..., ExitCode]


def model_flags(command: Command) -> Command:
    """Gives a command these options."""
    for option in (
        click.option("--package", "packages", multiple=True, metavar="NAME=FOLDER", help="As robot.packages."),
        click.option("--arg", "args", multiple=True, metavar="NAME=VALUE", help="Of a xacro file, as robot.args."),
    ):
        command = option(command)
    return command


def asked_model(model: str, flags: Mapping[str, Any]) -> tuple[Robot, Workspace]:
    """The robot of what was typed, and where its files are looked for. Raises UsageError."""
    from sim_action.core.workspace import Workspace
    from sim_action.robot.spec import Robot

    robot = Robot(model=model, args=_pairs("--arg", flags["args"]), packages=_pairs("--package", flags["packages"]))
    return robot, Workspace.around(Path("a scenario"), allow_outside=flags["allow_outside"])


def _pairs(option: str, texts: Iterable[str]) -> dict[str, Any]:
    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise UsageError(f"{option} takes NAME=VALUE, found {shown(text)}")
        pairs[name] = value
    return pairs
