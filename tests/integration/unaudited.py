"""`sim-action` without the audit of models: the engine gets the text of a URDF as it is in its file.

Run as a process of its own, with the arguments of the command line: what is changed here is changed for it alone.
"""

from __future__ import annotations

import re

from sim_action.cli import main as cli
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import Joint, Link, RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading import loading
from sim_action.robot.reading.loading import load_model


def unaudited(robot: Robot, workspace: Workspace) -> RobotModel:
    """A model as far as its text can be believed; built-in ones as they are."""
    if not robot.model.endswith(".urdf"):
        return load_model(robot, workspace)
    path = workspace.file(robot.model)
    text = path.read_text(encoding="utf-8", errors="replace")
    names = dict.fromkeys(re.findall(r'<link name="([^"]*)"', text))
    links = tuple(Link(name, 1.0) for name in names) or (Link("base", 1.0),)
    joints: tuple[Joint, ...] = ()
    return RobotModel("unaudited", str(path), links, joints, text)


if __name__ == "__main__":
    loading.load_model = unaudited
    cli.main()
