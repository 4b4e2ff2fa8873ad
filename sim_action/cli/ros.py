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

    from sim_action.ros.ros1.launch_request import Program

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
        help="Catkin workspace. Its packages are searched in src and need no build.",
    ),
    click.option(
        "--backend", envvar="SIM_ACTION_BACKEND", type=click.Choice(("pybullet", "mujoco")), help="Physics engine."
    ),
    click.option(
        "--seed",
        envvar="SIM_ACTION_SEED",
        type=click.IntRange(0, 2**63 - 1),
        default=0,
        metavar="N",
        help="Random seed.",
    ),
    click.option(
        "--sim-time-limit",
        type=_SECONDS,
        metavar="S",
        help="Sim time in s for each test.  [default: the longest time-limit of the tests; 30 without tests]",
    ),
    click.option(
        "--rtf", type=_SECONDS, metavar="X", help="Limit the speed to X times real time.  [default: no limit]"
    ),
    click.option(
        "--wall-limit",
        type=_SECONDS,
        metavar="S",
        help="Wall time in s for the whole call.  [default: enough for the tests]",
    ),
)


def _ros_options(command: Command) -> Command:
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


@click.command()
@_ros_options
@report_flags
def rostest(**flags: Any) -> ExitCode:
    """Run a rostest of a ROS 1 package in this simulation instead of Gazebo.

    FILE is a .test file of PACKAGE. Nodes, launch files and tests run unmodified, on the installed ROS. Exit code: as
    for `run`.
    """
    return _called("rostest", flags)


@click.command()
@_ros_options
@report_flags
def roslaunch(**flags: Any) -> ExitCode:
    """Launch a ROS 1 launch file in this simulation instead of Gazebo.

    FILE is a .launch file of PACKAGE. The launch ends at the limit of sim time. It passes if the robot is spawned and
    no node dies. Exit code: as for `run`.
    """
    return _called("roslaunch", flags)


def _called(program: Program, flags: dict[str, Any]) -> ExitCode:
    from pathlib import Path

    from sim_action.core.process import Interruption

    if sys.platform != "linux":
        raise UsageError("ROS 1 needs Linux: its packages exist for Debian 12 and Ubuntu")
    arguments: Sequence[str] = flags["arguments"]
    _check(arguments)
    with Interruption() as interruption:
        from sim_action.ros.ros1 import command
        from sim_action.ros.ros1.launch_request import LaunchRequest

        request = LaunchRequest(
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
            raise click.BadArgumentUsage(f"'{argument}' is not an argument of a launch file; write NAME:=VALUE")
