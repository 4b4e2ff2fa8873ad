"""YAML text -> Scenario -> Simulation(Backend, Commands, Monitors) -> Trace + Verdicts -> Outcome -> Reports.

The names exported here are what a controller script needs: what it is given (`Observation`) and what it may
return (`Twist`, `JointTargets`).
"""

from sim_action.command import Command, JointTargets
from sim_action.geometry import Pose, Twist
from sim_action.observation import Contact, JointState, Observation

__version__ = "0.1.0"

__all__ = ["Command", "Contact", "JointState", "JointTargets", "Observation", "Pose", "Twist", "__version__"]
