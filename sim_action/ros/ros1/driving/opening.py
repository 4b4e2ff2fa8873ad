"""From a spec to nodes that drive: they are launched, the simulation becomes one of them, and is asked tick by tick."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.commands import ClosedLoop
from sim_action.core.errors import ScriptError, SourceProblem, UsageError
from sim_action.ros.ros1.driving.file_problems import Packages, launch_file, why_no_ros
from sim_action.ros.ros1.driving.launch_text import launch_text
from sim_action.ros.ros1.driving.launched import Launching, Nodes, variables
from sim_action.ros.ros1.driving.robot_topics import topics_of
from sim_action.ros.ros1.driving.workspaces import workspace_of
from sim_action.ros.ros1.installation import Ros, find_ros
from sim_action.ros.ros1.launching import free_port
from sim_action.ros.ros1.overlay import Overlay

if TYPE_CHECKING:
    from sim_action.ros.ros1.driving.spec import RosCommands, RosNodes
    from sim_action.ros.ros1.node.robot import RobotNode
    from sim_action.world.scene import Scene

_KEY: Final = "ros1"


def opened(source: RosCommands, scene: Scene) -> ClosedLoop:
    """The live half of a source. Raises SourceProblem, ScriptError."""
    if why := why_no_ros():
        raise SourceProblem(why, _KEY)
    spec, ros, port = source.ros1, find_ros(), free_port()
    workspace = workspace_of(spec.workspace, scene.workspace)
    launching = Launching(
        ros, workspace, _file_of(spec, workspace), spec.launch[2:] if spec.launch else (), port, scene.model.urdf
    )
    try:
        nodes = Nodes(launching)
    except UsageError as error:
        # Such as messages of a package that nobody can write.
        raise SourceProblem(str(error), _KEY) from None
    try:
        node = _joined(nodes, ros, port, source, scene)
    except BaseException:
        nodes.close()
        raise
    return ClosedLoop(node.tick, sensors=node.sensors, close=node.close, notes=node.notes)


def _file_of(spec: RosNodes, workspace: Path) -> Callable[[Overlay, Path], Path]:
    """Where the launch file is, once there is an overlay, and a folder for what has to be written."""

    def named(overlay: Overlay, folder: Path) -> Path:
        if spec.launch is None:
            (folder / "nodes.launch").write_text(launch_text(spec.nodes or ()), encoding="utf-8")
            return folder / "nodes.launch"
        package = Packages.around(workspace).folder(spec.launch[0])
        found = launch_file(package, spec.launch[1]) if package else None
        if package is None or found is None:
            raise SourceProblem(f"'{'/'.join(spec.launch[:2])}' is gone", _KEY)
        return Path(overlay.variables["ROS_PACKAGE_PATH"]) / spec.launch[0] / found.relative_to(package)

    return named


def _joined(nodes: Nodes, ros: Ros, port: int, source: RosCommands, scene: Scene) -> RobotNode:
    """The simulation as one more node. Raises ScriptError."""
    os.environ.update(variables(nodes, port))
    # Behind what is ours: the distribution's other packages are for another Python.
    sys.path += [str(ros.modules), str(nodes.folder / "overlay/modules")]
    try:
        from sim_action.ros.ros1.node.robot import RobotNode, RobotSpec
    except ImportError as error:
        version = ".".join(map(str, sys.version_info[:3]))
        raise ScriptError(
            f"Python {version} cannot import the rospy of {ros.modules}: {error}; run sim-action by the Python that "
            f"ROS was installed for, such as in an environment that {ros.python} -m venv has made"
        ) from None
    nodes.await_start()
    robot = RobotSpec(scene.model, source.rate, scene.sensors, topics_of(scene.sensors, source.ros1.topics))
    return RobotNode(nodes, robot, source.ros1.start_within)
