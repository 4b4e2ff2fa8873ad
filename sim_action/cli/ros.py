"""`sim-action rostest`, `roslaunch`, `launchtest` and `ros2`."""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import click

from sim_action.cli import options
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.wording import log_line
from sim_action.engines import ENGINES

if TYPE_CHECKING:
    from sim_action.ros.launches import Program

Command = Callable[..., ExitCode]
_POSITIVE: Final = options.Bounded(click.FloatRange(min=0, min_open=True, max=1e9))

_BACKEND: Final = click.option(
    "--backend",
    envvar="SIM_ACTION_BACKEND",
    type=click.Choice(tuple(ENGINES)),
    help=f"Physics engine.  [default: {' if it is installed, else '.join(ENGINES)}]",
)
_SEED: Final = click.option(
    "--seed",
    envvar="SIM_ACTION_SEED",
    type=options.SEED,
    default=0,
    show_default=True,
    metavar="N",
    help="Random seed.",
)
_ALLOW_LOSSES: Final = click.option(
    "--allow-losses/--no-allow-losses",
    envvar="SIM_ACTION_ALLOW_LOSSES",
    default=False,
    help="Warn about parts of the launch that are not simulated.  [default: they are an error]",
)


def _workspace(shown: str) -> Callable[[Command], Command]:
    """Return the option of a workspace; `shown`: its help."""
    folder = click.Path(exists=True, file_okay=False)
    variable = "SIM_ACTION_WORKSPACE"
    return click.option("--workspace", envvar=variable, default=".", metavar="FOLDER", type=folder, help=shown)


def _sim_time_limit(shown: str) -> Callable[[Command], Command]:
    return click.option("--sim-time-limit", type=_POSITIVE, metavar="S", help=shown)


_OPTIONS: Final = (
    click.argument("package"),
    click.argument("file"),
    _workspace("Catkin workspace. Its packages are searched in src and need no build.  [default: the current folder]"),
    _BACKEND,
    _SEED,
    click.option(
        "--rtf",
        type=_POSITIVE,
        metavar="X",
        help="Slow the simulation down to X times real time.  [default: as fast as possible]",
    ),
    click.option(
        "--wall-limit",
        type=_POSITIVE,
        metavar="S",
        help="Stop after S seconds of real time.  [default: enough for all time limits]",
    ),
    _ALLOW_LOSSES,
    options.strict_option,
)


def _ros_options(sim_time_limit: str, arguments: str) -> Callable[[Command], Command]:
    """Add the options of both commands; `sim_time_limit`: help of that option; `arguments`: how they are shown."""
    words = click.argument("arguments", nargs=-1, metavar=arguments)
    return options.with_options(*_OPTIONS[:2], words, *_OPTIONS[2:], _sim_time_limit(sim_time_limit))


@click.command()
@_ros_options("End the simulation after this sim time in s.  [default: the time-limit of each test]", "[ARG:=VALUE]...")
@options.report_flags
@options.code_flags
def rostest(**flags: Any) -> ExitCode:
    """Run a rostest of a ROS 1 package, with sim-action as simulator instead of Gazebo.

    FILE is a .test file of PACKAGE. Nodes, launch files and tests run unmodified. An installed ROS 1 is needed.

    Exit code: as for `run`.
    """
    return _called("rostest", flags)


@click.command()
@_ros_options("End the launch after this sim time in s.  [default: 30]", "[PACKAGE FILE]... [ARG:=VALUE]...")
@options.report_flags
@options.code_flags
def roslaunch(**flags: Any) -> ExitCode:
    """Run launch files of ROS 1 as one launch, with sim-action as simulator instead of Gazebo.

    FILE is a .launch file of PACKAGE; arguments are for all files. An installed ROS 1 is needed. The launch ends at
    --sim-time-limit. It passes if the robot is spawned, every node is started and no node dies.

    Exit code: as for `run`.
    """
    return _called("roslaunch", flags)


@click.command()
@click.argument("package")
@click.argument("file")
@click.argument("arguments", nargs=-1, metavar="[ARG:=VALUE]...")
@_workspace("Workspace of ROS 2, or its install folder.  [default: the current folder]")
@_BACKEND
@_SEED
@_sim_time_limit("End the simulation after this sim time in s.  [default: 60]")
@_ALLOW_LOSSES
@options.strict_option
@options.report_flags
@options.code_flags
def launchtest(**flags: Any) -> ExitCode:
    """Run a launch test of a ROS 2 package, with sim-action as simulator instead of Gazebo. Experimental.

    FILE is a test for launch_testing in PACKAGE, or its path. The robot is the one that the test spawns by `create` of
    ros_gz_sim. An installed ROS 2 with launch_testing is needed.

    Exit code: as for `run`.
    """
    return _called("launchtest", flags)


@click.command()
@click.argument("action", type=click.Choice(("prepare",)), metavar="prepare")
@click.argument("workspace", default=".", type=click.Path(exists=True, file_okay=False))
@click.option(
    "--scenario",
    "scenarios",
    multiple=True,
    metavar="PATH",
    help="Build what these scenarios need, in their workspaces instead of WORKSPACE; repeatable.",
)
@options.code_flags
def ros2(**flags: Any) -> ExitCode:
    """Build the packages of a ROS 2 workspace that have messages of their own, into its install folder.

    For the wheels of PyPI, which have no colcon. Packages that have not changed are not built again. Packages in Python
    need no build; those in C++ are built if these need them.

    Exit code: 0 all are built; 2 a package cannot be built, or ROS 2 is missing.
    """
    from pathlib import Path

    from sim_action.core.files import cache_folder
    from sim_action.core.workspace import discover
    from sim_action.ros.ros2.installation import find_ros
    from sim_action.ros.ros2.preparation import needed_by, prepare
    from sim_action.scenario.child_environment import code_environment

    packages_by_workspace: dict[Path, set[str] | None] = {Path(flags["workspace"]).resolve(): None}
    if flags["scenarios"]:
        packages_by_workspace = {**needed_by(path for paths in discover(flags["scenarios"]).values() for path in paths)}
    permissions = options.code_permissions(flags, packages_by_workspace)
    if not packages_by_workspace:
        return ExitCode.PASSED
    permissions.require_scripts("ros2 prepare runs the build files of packages")
    if sys.platform != "linux":
        raise UsageError("the wheels of ROS 2 are for Linux")
    cache = cache_folder("ros2")
    if cache is None:
        raise UsageError("builds need a cache folder; set XDG_CACHE_HOME")
    seen = code_environment(os.environ, permissions.pass_env)
    for workspace, names in packages_by_workspace.items():
        for line in prepare(workspace, find_ros(), cache, seen, names):
            click.echo(log_line(line))
    return ExitCode.PASSED


def _called(program: Program, flags: dict[str, Any]) -> ExitCode:
    from pathlib import Path

    from sim_action.core.process import Interruption
    from sim_action.ros.launches import LaunchRequest, argument_problem

    permissions = options.code_permissions(flags, [Path(flags["workspace"])])
    permissions.require_scripts(f"{program} runs nodes and launch files")
    if sys.platform != "linux":
        if program == "launchtest":
            raise UsageError("nodes of ROS 2 need Linux: sim-action watches their threads in /proc")
        raise UsageError("ROS 1 needs Linux: its packages exist for Debian 12 and Ubuntu")
    more, arguments = _split(flags["arguments"]) if program == "roslaunch" else ((), flags["arguments"])
    for problem in filter(None, map(argument_problem, arguments)):
        raise click.BadArgumentUsage(problem)
    request = LaunchRequest(
        program,
        flags["package"],
        flags["file"],
        tuple(arguments),
        Path(flags["workspace"]),
        flags["backend"] or "auto",
        flags["seed"],
        flags["sim_time_limit"],
        flags.get("rtf"),
        flags.get("wall_limit"),
        replays=flags["report"],
        allows_losses=flags["allow_losses"],
        pass_env=permissions.pass_env,
        more=more,
        strict=flags["strict"],
    )
    with Interruption() as interruption:
        if program == "launchtest":
            from sim_action.ros.ros2.launch import launch_test

            return launch_test.run(request, options.report_request(flags), interruption)
        from sim_action.ros.ros1 import command

        return command.run(request, options.report_request(flags), interruption)


def _split(words: Sequence[str]) -> tuple[tuple[tuple[str, str], ...], Sequence[str]]:
    """Return further launch files, each with its package, and the arguments."""
    count = next((index for index, word in enumerate(words) if ":=" in word), len(words))
    if count % 2:
        raise click.BadArgumentUsage(f"'{words[count - 1]}' has no FILE; write PACKAGE FILE, or NAME:=VALUE")
    return tuple(itertools.pairwise(words[:count]))[::2], words[count:]
