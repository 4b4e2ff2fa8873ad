"""SDF texts, and what loading makes of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.geometry import Vector3, rotate
from sim_action.core.workspace import Workspace
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from tests.ros_workspace import written

INERTIAL = (
    "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz>"
    "<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>"
)
SPHERE = "<collision name='c'><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>"


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}{INERTIAL}{SPHERE}</link>'


def joint(name: str, parent: str, child: str, inside: str = "", kind: str = "fixed") -> str:
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def sdf(*parts: str, version: str = "1.9", attributes: str = "") -> str:
    """One part a line, the first on line 3."""
    body = "\n".join(parts)
    return f'<sdf version="{version}">\n<model name="m"{attributes}>\n{body}\n</model>\n</sdf>\n'


def load(folder: Path, text: str, allow: tuple[str, ...] = ()) -> RobotModel:
    written(folder / "robot.sdf", text)
    return load_named(folder, "robot.sdf", allow)


def load_named(folder: Path, name: str, allow: tuple[str, ...] = ()) -> RobotModel:
    return load_model(Robot(model=name, allow=allow), Workspace(folder, folder))


def position(model: RobotModel, name: str) -> Vector3:
    """Of a link in the base frame."""
    return link_poses(model, {})[name].position_xyz


def facing(model: RobotModel, name: str) -> Vector3:
    """Where the x axis of a link points, in the base frame."""
    return rotate(link_poses(model, {})[name].orientation_xyzw, (1.0, 0.0, 0.0))


def near(x: float, y: float, z: float) -> object:
    return pytest.approx((x, y, z), abs=1e-12)


def rules(model: RobotModel) -> list[str]:
    return [finding.rule for finding in model.findings]
