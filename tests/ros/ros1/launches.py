"""Launches on real ROS with the results of their simulations, and packages for them."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.core.process import Interruption
from sim_action.ros.launches import LaunchRequest
from sim_action.ros.ros1.command import LaunchCall
from sim_action.ros.ros1.installation import Ros, find_ros
from sim_action.ros.ros1.launch.overlay import build_overlay
from sim_action.ros.ros1.launch_request import SimulationResult
from sim_action.ros.ros1.verdicts.findings import Findings
from tests.ros_workspace import ros_package, written

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples/ros1"


@cache
def missing_ros() -> str:
    """Why nodes cannot run here; empty if they can."""
    if sys.platform != "linux":
        return "nodes are watched by Linux's /proc"
    try:
        find_ros()
    except UsageError as error:
        return str(error)
    return ""


needs_ros = pytest.mark.skipif(bool(missing_ros()), reason=missing_ros())


def ros() -> Ros:
    return find_ros()


def package(workspace: Path, name: str, files: Mapping[str, str]) -> Path:
    """A catkin package, below the src of a workspace; programs can be run."""
    folder = ros_package(workspace / "src" / name)
    for path, text in files.items():
        if written(folder / path, text).suffix == ".py":
            (folder / path).chmod(0o755)
    return folder


def launched(folder: Path, request: LaunchRequest) -> Findings:
    """What there is of a launch when it is over; `folder`: an empty one."""
    overlay_folder, call = folder / "overlay", folder / "call"
    overlay_folder.mkdir(parents=True)
    call.mkdir()
    overlay = build_overlay(overlay_folder, ros(), request.workspace.resolve(), os.environ)
    made = LaunchCall(request, ros(), overlay, call)
    with Interruption() as interruption:
        return made.launched(made.files(), interruption)


def told(findings: Findings) -> SimulationResult:
    """By the one simulation that there was."""
    (run,) = findings.runs
    assert run.result is not None, findings.text
    return run.result
