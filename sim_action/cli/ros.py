"""`sim-action rostest` and `sim-action roslaunch`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import click

from sim_action.cli.options import report_flags, report_request
from sim_action.core.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_action.ros.ros1.call import Program

Command = Callable[..., ExitCode]

_SECONDS: Final = click.FloatRange(min=0, min_open=True, max=1e9)

_OPTIONS: Final = (
    click.argument("package"),
    click.argument("file"),
    click.argument("arguments", nargs=-1, metavar="[ARG:=VALUE]..."),
    click.option(
        "--workspace",
        envvar="SIM_ACTION_WORKSPACE",
        default=".",
        show_default="the current folder",
        type=click.Path(exists=True, file_okay=False),
        help="A catkin workspace; packages are in its src, or below it, and need no build.",
    ),
    click.option(
        "--backend", envvar="SIM_ACTION_BACKEND", type=click.Choice(("pybullet", "mujoco")), help="Engine to run on."
    ),
    click.option(
        "--seed",
        envvar="SIM_ACTION_SEED",
        type=click.IntRange(0, 2**63 - 1),
        default=0,
        metavar="N",
        help="Of everything drawn at random.",
    ),
    click.option(
        "--sim-time-limit",
        type=_SECONDS,
        metavar="S",
        help="Of sim time, for each test.  [default: the longest time-limit of the tests; 30 s without tests]",
    ),
    click.option("--rtf", type=_SECONDS, metavar="X", help="Hold sim time to X times wall time.  [default: no hold]"),
    click.option("--wall-limit", type=_SECONDS, metavar="S", help="For all of it.  [default: enough for the tests]"),
)


def _ros_options(command: Command) -> Command:
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


@click.command()
@_ros_options
@report_flags
def rostest(**flags: Any) -> ExitCode:
    """Run a rostest of a ROS 1 package, with this simulation in Gazebo's place.

    FILE is a .test file of PACKAGE. Nodes, launch files and tests run unmodified, on the ROS that is installed here.
    Exit code: as of run.
    """
    return _called("rostest", flags)


@click.command()
@_ros_options
@report_flags
def roslaunch(**flags: Any) -> ExitCode:
    """Launch nodes of a ROS 1 package, with this simulation in Gazebo's place, until a limit of sim time.

    FILE is a .launch file of PACKAGE. It passes if the robot is spawned and no node dies. Exit code: as of run.
    """
    return _called("roslaunch", flags)


def _called(program: Program, flags: dict[str, Any]) -> ExitCode:
    from pathlib import Path

    from sim_action.core.process import Interruption

    if sys.platform != "linux":
        raise UsageError("ROS 1 has packages for Linux alone: Debian 12, and Ubuntu")
    arguments: Sequence[str] = flags["arguments"]
    _check(arguments)
    with Interruption() as interruption:
        from sim_action.ros.ros1 import command
        from sim_action.ros.ros1.call import RosRequest

        request = RosRequest(
            program,
            flags["package"],
            flags["file"],
            tuple(arguments),
            Path(flags["workspace"]),
            flags["backend"] or "auto",
            flags["seed"],
            flags["sim_time_limit"],
            flags["rtf"],
            flags["wall_limit"],
            replays=flags["report"],
        )
        return command.run(request, report_request(flags), interruption)


def _check(arguments: Sequence[str]) -> None:
    for argument in arguments:
        name, sign, _ = argument.partition(":=")
        if not (sign and name.isidentifier()):
            raise click.BadArgumentUsage(f"'{argument}' is no argument of a launch file; write NAME:=VALUE")
