"""Robot models: from what a scenario names to one clean, absolute URDF and a `RobotModel`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from sim_action.core.errors import ModelError
from sim_action.core.messages import did_you_mean
from sim_action.core.workspace import PathError, Workspace
from sim_action.robot.document import ModelDocument, read_document
from sim_action.robot.findings import notes_of
from sim_action.robot.model_files import find_model_file, is_model_folder
from sim_action.robot.packages import PackageError, Packages
from sim_action.robot.robot_model import RobotModel
from sim_action.robot.urdf import model_of, read_urdf

if TYPE_CHECKING:
    from sim_action.robot.spec import Robot

_BUILT_IN_FOLDER: Final = Path(__file__).parent / "built_in"

BUILT_IN: Final = MappingProxyType(
    {"turtlebot3_burger": "two-wheeled robot, 1 kg, diff drive: wheel radius 0.033 m, separation 0.160 m"}
)
"""Name of each model that comes with sim-action -> what it is."""


def load_model(robot: Robot, workspace: Workspace) -> RobotModel:
    """Reads the model that a robot names: a built-in one, or a file. Raises ModelError.

    Evaluates xacro, which runs what is written in it.
    """
    model = _read_model(robot, workspace)
    return replace(model, findings=notes_of(model.findings))


def _read_model(robot: Robot, workspace: Workspace) -> RobotModel:
    if robot.model in BUILT_IN:
        return read_urdf(_BUILT_IN_FOLDER / f"{robot.model}.urdf")
    packages = Packages(workspace, robot.packages)
    path = _path(robot.model, packages)
    if not robot.is_xacro:
        return _model(read_document(path), path, packages, robot.allow)
    # xacro takes 40 ms to import.
    from sim_action.robot.expansion import read_xacro

    document, warnings = read_xacro(path, robot.args, packages)
    model = _model(document, path, packages, robot.allow)
    return replace(model, findings=(*model.findings, *warnings))


def _model(document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str]) -> RobotModel:
    """The model in a document of URDF or SDF, whatever its file is called, or of MJCF in a file called .xml."""
    if document.root.tag == "mujoco" and path.suffix == ".xml":
        # MuJoCo takes 0.1 s to import.
        from sim_action.robot.mjcf import read_mjcf

        return read_mjcf(path, packages)
    if document.root.tag != "sdf":
        return model_of(document, path, packages, allow)
    from sim_action.robot.sdf import urdf_of_sdf

    urdf, findings = urdf_of_sdf(document, path, packages, allow)
    model = model_of(urdf, path, packages, allow)
    return replace(model, findings=(*model.findings, *findings))


def check_text(robot: Robot, workspace: Workspace) -> tuple[str, ...]:
    """Looks at a file of xacro or MJCF as text; returns what was left unchecked. Raises ModelError."""
    packages = Packages(workspace, robot.packages)
    path = _path(robot.model, packages)
    if robot.is_mjcf:
        read_document(path)
        what = "what is said of links and joints is not checked"
        return (f"{robot.model} is read by MuJoCo when it runs: until then, {what}",)
    from sim_action.robot import expansion

    return expansion.check_text(path, robot.args, packages)


def _path(name: str, packages: Packages) -> Path:
    if "/" not in name and "." not in name:
        formats = "or the path of a .urdf, .xacro, .sdf or .xml file"
        raise ModelError(f"unknown robot '{name}'{did_you_mean(name, BUILT_IN)}, {formats}")
    workspace = packages.workspace
    try:
        if "://" in name or is_model_folder(workspace.directory / name):
            return find_model_file(name, workspace.directory / "scenario", packages).path
        return workspace.file(name)
    except (PathError, PackageError) as error:
        raise ModelError(str(error)) from None
