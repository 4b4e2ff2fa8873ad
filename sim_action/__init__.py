"""YAML text -> Scenario -> Simulation(Engine, Commands, Monitors) -> Trace + Verdicts -> Outcome -> Reports.

The names exported here are for programs, and for code that scenarios name. A program calls `run`, `margins`, `load`
and `validate`, and may build a `Scenario` of the parts in `sim_action.parts`; the errors are in `sim_action.errors`. A
controller is given a `RobotDescription` and an `Observation`, and may return a `Twist`, `JointTargets` or a
`LinkWrench`; an assertion is given a `Trace` and returns a `Verdict`. All are imported at first use, so that
`sim-action --help` does not wait for them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_action.app.library import load as load
    from sim_action.app.library import margins as margins
    from sim_action.app.library import run as run
    from sim_action.app.library import validate as validate
    from sim_action.app.library_results import GateOutcome as GateOutcome
    from sim_action.app.library_results import Outcome as Outcome
    from sim_action.app.library_results import Results as Results
    from sim_action.commands.controller_answers import JointDescription as JointDescription
    from sim_action.commands.controller_answers import RobotDescription as RobotDescription
    from sim_action.core.geometry import Pose as Pose
    from sim_action.core.geometry import Twist as Twist
    from sim_action.core.version import __version__ as __version__
    from sim_action.robot.model.kinematics import LinkMotion as LinkMotion
    from sim_action.scenario.written import Scenario as Scenario
    from sim_action.state.command import Command as Command
    from sim_action.state.command import JointTargets as JointTargets
    from sim_action.state.command import LinkWrench as LinkWrench
    from sim_action.state.joint_motion import JointMotion as JointMotion
    from sim_action.state.observation import Contact as Contact
    from sim_action.state.observation import JointState as JointState
    from sim_action.state.observation import LinkState as LinkState
    from sim_action.state.observation import Observation as Observation
    from sim_action.state.readings import CameraImage as CameraImage
    from sim_action.state.readings import ContactReading as ContactReading
    from sim_action.state.readings import ImuReading as ImuReading
    from sim_action.state.readings import LidarScan as LidarScan
    from sim_action.state.readings import OdometryReading as OdometryReading
    from sim_action.state.trace import Trace as Trace
    from sim_action.state.verdict import Verdict as Verdict

_HOMES = {
    "sim_action.app.library": ("load", "margins", "run", "validate"),
    "sim_action.app.library_results": ("GateOutcome", "Outcome", "Results"),
    "sim_action.commands.controller_answers": ("JointDescription", "RobotDescription"),
    "sim_action.core.geometry": ("Pose", "Twist"),
    "sim_action.core.version": ("__version__",),
    "sim_action.robot.model.kinematics": ("LinkMotion",),
    "sim_action.scenario.written": ("Scenario",),
    "sim_action.state.command": ("Command", "JointTargets", "LinkWrench"),
    "sim_action.state.joint_motion": ("JointMotion",),
    "sim_action.state.observation": ("Contact", "JointState", "LinkState", "Observation"),
    "sim_action.state.readings": ("CameraImage", "ContactReading", "ImuReading", "LidarScan", "OdometryReading"),
    "sim_action.state.trace": ("Trace",),
    "sim_action.state.verdict": ("Verdict",),
}
_MODULES = {name: module for module, names in _HOMES.items() for name in names}
__all__ = list(_MODULES)


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "errors", "parts"]
