"""YAML text -> Scenario -> Simulation(Engine, Commands, Monitors) -> Trace + Verdicts -> Outcome -> Reports.

The names exported here are for programs, and for code that scenarios name. A program calls `run`, `load` and
`validate`, and may build a `Scenario` of the parts in `sim_action.parts`; the errors are in `sim_action.errors`. A
controller is given a `RobotDescription` and an `Observation`, and may return a `Twist`, `JointTargets` or a
`LinkWrench`; an assertion is given a `Trace` and returns a `Verdict`. All are imported at first use, so that
`sim-action --help` does not wait for them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from sim_action.core.version import __version__

if TYPE_CHECKING:
    from sim_action.app.library import load, run, validate
    from sim_action.app.library_results import GateOutcome, Outcome, Results
    from sim_action.commands.robot_description import JointDescription, RobotDescription
    from sim_action.core.geometry import Pose, Twist
    from sim_action.robot.model.link_motion import LinkMotion
    from sim_action.scenario.written import Scenario
    from sim_action.state.command import Command, JointTargets, LinkWrench
    from sim_action.state.observation import Contact, JointState, LinkState, Observation
    from sim_action.state.readings import CameraImage, ContactReading, ImuReading, LidarScan, OdometryReading
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict

__all__ = [
    "CameraImage",
    "Command",
    "Contact",
    "ContactReading",
    "GateOutcome",
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
    "Outcome",
    "Pose",
    "Results",
    "RobotDescription",
    "Scenario",
    "Trace",
    "Twist",
    "Verdict",
    "__version__",
    "load",
    "run",
    "validate",
]

_HOMES = {
    "CameraImage": "sim_action.state.readings",
    "Command": "sim_action.state.command",
    "Contact": "sim_action.state.observation",
    "ContactReading": "sim_action.state.readings",
    "GateOutcome": "sim_action.app.library_results",
    "ImuReading": "sim_action.state.readings",
    "JointDescription": "sim_action.commands.robot_description",
    "JointState": "sim_action.state.observation",
    "JointTargets": "sim_action.state.command",
    "LidarScan": "sim_action.state.readings",
    "LinkMotion": "sim_action.robot.model.link_motion",
    "LinkState": "sim_action.state.observation",
    "LinkWrench": "sim_action.state.command",
    "Observation": "sim_action.state.observation",
    "OdometryReading": "sim_action.state.readings",
    "Outcome": "sim_action.app.library_results",
    "Pose": "sim_action.core.geometry",
    "Results": "sim_action.app.library_results",
    "RobotDescription": "sim_action.commands.robot_description",
    "Scenario": "sim_action.scenario.written",
    "Trace": "sim_action.state.trace",
    "Twist": "sim_action.core.geometry",
    "Verdict": "sim_action.state.verdict",
    "load": "sim_action.app.library",
    "run": "sim_action.app.library",
    "validate": "sim_action.app.library",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "errors", "parts"]
