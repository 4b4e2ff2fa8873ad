"""The controller of a scenario that nodes of ROS 1 drive: it launches them, and joins them as one more node."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from sim_action.commands import ClosedLoop
from sim_action.core.errors import ScriptError, SourceProblem, UsageError
from sim_action.ros.ros1.catkin_packages import find_launch_file, workspace_of
from sim_action.ros.ros1.command_source.file_problems import Packages, why_no_ros
from sim_action.ros.ros1.command_source.launched_nodes import KEY, LaunchedNodes, LaunchSpec
from sim_action.ros.ros1.command_source.node_spec import RosNodes, launch_text
from sim_action.ros.ros1.installation import find_ros
from sim_action.ros.ros1.launch.launch_process import free_port
from sim_action.ros.ros1.launch.overlay import Overlay
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.ros.ros1.node.robot_node import RobotNode


def _variables(nodes: LaunchedNodes, port: int) -> Mapping[str, str]:
    """Return the environment variables that make a process a node of this launch."""
    wanted = ("ROS_HOSTNAME", "ROS_HOME", "ROS_PACKAGE_PATH", "ROS_ROOT")
    master = {"ROS_MASTER_URI": f"http://localhost:{port}", "ROS_LOG_DIR": str(nodes.folder / "log")}
    return {**{name: nodes.overlay.variables[name] for name in wanted}, **master}


def open_nodes(spec: RosNodes, rate: float, scene: Scene) -> ClosedLoop:
    """Launch nodes, and return their controller; `rate`: ticks per second. Raises SourceProblem, ScriptError."""
    if why := why_no_ros():
        raise SourceProblem(why, KEY)
    ros, port = find_ros(), free_port()
    workspace = workspace_of(spec.workspace, scene.workspace)
    arguments = spec.launch[2:] if spec.launch else ()
    file = _file_of(spec, workspace)
    launching = LaunchSpec(ros, workspace, file, arguments, port, scene.model.urdf, spec.allow_losses, scene.seed)
    try:
        nodes = LaunchedNodes(launching)
    except UsageError as error:
        # Such as messages that genpy cannot generate.
        raise SourceProblem(str(error), KEY) from None
    try:
        node = _joined(nodes, launching, spec, rate, scene)
    except BaseException:
        nodes.close()
        raise
    return ClosedLoop(
        node.tick,
        sensors=node.sensors,
        close=node.close,
        notes=node.notes,
        losses=nodes.losses,
        repeats=True,
        transcript=node.transcript,
        not_reproducible=node.not_reproducible,
    )


def _file_of(spec: RosNodes, workspace: Path) -> Callable[[Overlay, Path], Path]:
    """Return a function that finds or writes the launch file, once there is an overlay."""

    def named(overlay: Overlay, folder: Path) -> Path:
        if spec.launch is None:
            (folder / "nodes.launch").write_text(launch_text(spec.nodes or ()), encoding="utf-8")
            return folder / "nodes.launch"
        package = Packages.around(workspace).folder(spec.launch[0])
        found = find_launch_file(package, spec.launch[1]) if package else None
        if package is None or found is None:
            raise SourceProblem(f"'{'/'.join(spec.launch[:2])}' does not exist any more", KEY)
        return Path(overlay.variables["ROS_PACKAGE_PATH"]) / spec.launch[0] / found.relative_to(package)

    return named


def _joined(nodes: LaunchedNodes, launch: LaunchSpec, spec: RosNodes, rate: float, scene: Scene) -> RobotNode:
    """Make the simulation one more node. Raises ScriptError."""
    os.environ.update(_variables(nodes, launch.port))
    ros = launch.ros
    # At the end: the other packages of the distribution are for another Python.
    sys.path += [str(ros.modules), str(nodes.folder / "overlay/modules")]
    try:
        from sim_action.ros.ros1.node.robot_node import RobotNode  # the rest of the module runs without it
    except ImportError as error:
        version = ".".join(map(str, sys.version_info[:3]))
        raise ScriptError(
            f"Python {version} cannot import the rospy of {ros.modules}: {error}; run sim-action with the Python that "
            f"ROS was installed for, for example in an environment made by {ros.python} -m venv"
        ) from None
    nodes.await_start()
    return RobotNode(nodes, scene, spec, rate)
