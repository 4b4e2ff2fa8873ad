"""YAML text -> Scenario -> Simulation(Engine, Commands, Monitors) -> Trace + Verdicts -> Outcome -> Reports.

The names exported here are what code of the user's needs: a controller is given a `RobotDescription` and an
`Observation`, and may return a `Twist`, `JointTargets` or a `LinkWrench`; an assertion is given a `Trace` and returns
a `Verdict`. They are imported at first use, so that `sim-action --help` does not wait for them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_action.commands.robot_description import JointDescription, RobotDescription
    from sim_action.core.geometry import Pose, Twist
    from sim_action.robot.link_motion import LinkMotion
    from sim_action.state.command import Command, JointTargets, LinkWrench
    from sim_action.state.observation import Contact, JointState, LinkState, Observation
    from sim_action.state.readings import CameraImage, ContactReading, ImuReading, LidarScan, OdometryReading
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict

__version__ = "0.9.0"

__all__ = [
    "CameraImage",
    "Command",
    "Contact",
    "ContactReading",
    "ImuReading",
    "JointDescription",
    "JointState",
    "JointTargets",
    "LidarScan",
    "LinkMotion",
    "LinkState",
    "LinkWrench",
    "Observation",
    "OdometryReading",
    "Pose",
    "RobotDescription",
    "Trace",
    "Twist",
    "Verdict",
    "__version__",
]

_HOMES = {
    "CameraImage": "sim_action.state.readings",
    "Command": "sim_action.state.command",
    "Contact": "sim_action.state.observation",
    "ContactReading": "sim_action.state.readings",
    "ImuReading": "sim_action.state.readings",
    "JointDescription": "sim_action.commands.robot_description",
    "JointState": "sim_action.state.observation",
    "JointTargets": "sim_action.state.command",
    "LidarScan": "sim_action.state.readings",
    "LinkMotion": "sim_action.robot.link_motion",
    "LinkState": "sim_action.state.observation",
    "LinkWrench": "sim_action.state.command",
    "Observation": "sim_action.state.observation",
    "OdometryReading": "sim_action.state.readings",
    "Pose": "sim_action.core.geometry",
    "RobotDescription": "sim_action.commands.robot_description",
    "Trace": "sim_action.state.trace",
    "Twist": "sim_action.core.geometry",
    "Verdict": "sim_action.state.verdict",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
