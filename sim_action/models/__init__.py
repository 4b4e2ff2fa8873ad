"""Robot models: from what a scenario names to one clean, absolute URDF and a `RobotModel`."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import Final

from sim_action.errors import ModelError
from sim_action.messages import did_you_mean
from sim_action.models.urdf import read_urdf
from sim_action.robot_model import RobotModel
from sim_action.workspace import PathError, Workspace

_BUILT_IN_FOLDER: Final = Path(__file__).parent / "built_in"

BUILT_IN: Final = MappingProxyType(
    {"turtlebot3_burger": "two-wheeled robot, 1 kg, diff drive: wheel radius 0.033 m, separation 0.160 m"}
)
"""Name of each model that comes with sim-action -> what it is."""


def load_model(name: str, workspace: Workspace) -> RobotModel:
    """Reads the model that a scenario names: a built-in one, or the path of a URDF file. Raises ModelError."""
    if name in BUILT_IN:
        return read_urdf(_BUILT_IN_FOLDER / f"{name}.urdf")
    if "/" not in name and "." not in name:
        raise ModelError(f"unknown robot '{name}'{did_you_mean(name, BUILT_IN)}, or the path of a .urdf file")
    if "://" in name:
        raise ModelError(f"'{name}': addresses are not read yet; give the path of the file from the scenario's folder")
    if name.endswith(".xacro"):
        raise ModelError(f"'{name}': xacro is not read yet; expand it first: xacro robot.urdf.xacro > robot.urdf")
    try:
        return read_urdf(workspace.file(name), workspace)
    except PathError as error:
        raise ModelError(str(error)) from None
