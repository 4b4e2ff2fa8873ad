"""`sim-action doctor`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from sim_action.core.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from sim_action.app.doctor import Finding


@click.command(short_help="Look at this installation.")
def doctor() -> ExitCode:
    """Look at this installation, and say how to get parts that are missing.

    It looks at engines, extras, ROS, limits and folders. Each engine drives a robot for a moment.

    Exit code: 0 scenarios can run; 1 something prevents it.
    """
    from sim_action.app.doctor import findings
    from sim_action.core.wording import log_line

    marks = {"good": "ok", "missing": "-", "bad": "!"}
    colours = {"good": "green", "missing": None, "bad": "red"}
    states: list[str] = []
    for finding in (*findings(), _ros(), _ros2()):
        mark = click.style(f"{marks[finding.state]:<3}", fg=colours[finding.state])
        click.echo(f"{mark}{finding.name:<16} {log_line(finding.text)}")
        states.append(finding.state)
    return ExitCode.of_command(has_failed="bad" in states)


def _ros() -> Finding:
    from sim_action.app.doctor import Finding

    if sys.platform != "linux":
        return Finding("missing", "ROS 1", "its nodes run on Linux only")
    from sim_action.ros.ros1.installation import find_ros

    try:
        ros = find_ros()
    except UsageError as error:
        return Finding("missing", "ROS 1", str(error))
    return Finding("good", "ROS 1", f"in {ros.prefix}, for {ros.python}")


def _ros2() -> Finding:
    from sim_action.app.doctor import Finding

    if sys.platform != "linux":
        return Finding("missing", "ROS 2", "its nodes run on Linux only")
    from sim_action.ros.ros2.installation import find_ros

    try:
        ros = find_ros()
    except UsageError as error:
        return Finding("missing", "ROS 2", str(error))
    return Finding("good", "ROS 2", str(ros))
