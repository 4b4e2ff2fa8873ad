"""YAML text -> Scenario -> Simulation(Backend, Commands, Monitors) -> Trace + Verdicts -> Outcome -> Reports.

The names exported here are what code of the user's needs: a controller is given a `RobotDescription` and an
`Observation`, and may return a `Twist` or `JointTargets`; an assertion is given a `Trace` and returns a `Verdict`. They
are imported at first use, so that `sim-action --help` does not wait for them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_action.command import Command, JointTargets
    from sim_action.commands.robot_description import JointDescription, RobotDescription
    from sim_action.geometry import Pose, Twist
    from sim_action.observation import Contact, JointState, Observation
    from sim_action.readings import CameraImage, ContactReading, ImuReading, LidarScan, OdometryReading
    from sim_action.trace import Trace
    from sim_action.verdict import Verdict

__version__ = "0.1.0"

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
    "CameraImage": "sim_action.readings",
    "Command": "sim_action.command",
    "Contact": "sim_action.observation",
    "ContactReading": "sim_action.readings",
    "ImuReading": "sim_action.readings",
    "JointDescription": "sim_action.commands.robot_description",
    "JointState": "sim_action.observation",
    "JointTargets": "sim_action.command",
    "LidarScan": "sim_action.readings",
    "Observation": "sim_action.observation",
    "OdometryReading": "sim_action.readings",
    "Pose": "sim_action.geometry",
    "RobotDescription": "sim_action.commands.robot_description",
    "Trace": "sim_action.trace",
    "Twist": "sim_action.geometry",
    "Verdict": "sim_action.verdict",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
