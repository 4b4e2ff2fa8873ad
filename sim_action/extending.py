"""The names for packages that bring assertions and sensors of their own.

An assertion derives from `Assertion`; its monitor may be a `SignalMonitor`, which compares a signal with `Bounds`. A
sensor derives from `Sensor`; a reading is a `Values`. A package names its classes in the groups of entry points
`sim_action.assertions` and `sim_action.sensors`. `sim_action.testing` tests them.
"""

from __future__ import annotations

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Bounds, SignalMonitor, check_bounds
from sim_action.assertions.monitors.goals import Goal, Invariant
from sim_action.core.field_types import (
    Metres,
    MetresPerSecond,
    NonNegativeSeconds,
    PositiveMetres,
    PositiveMetresPerSecond,
    PositiveNewtons,
    PositiveRadians,
    PositiveRadiansPerSecond,
    PositiveRatio,
    PositiveSeconds,
    Radians,
    RadiansPerSecond,
    Ratio,
)
from sim_action.core.units import ACCELERATION, ANGULAR_SPEED, FORCE, LENGTH, RATIO, SPEED, display
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.observation import Observation
from sim_action.state.readings import ReadingColumn, Values
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.state.verdict import Judged, Signal, Verdict
from sim_action.world.scene import Scene

__all__ = [
    "ACCELERATION",
    "ANGULAR_SPEED",
    "FORCE",
    "LENGTH",
    "RATIO",
    "SPEED",
    "Assertion",
    "Bounds",
    "Channels",
    "ClearanceWatch",
    "Goal",
    "Invariant",
    "Judged",
    "Measure",
    "Metres",
    "MetresPerSecond",
    "Monitor",
    "Mount",
    "NonNegativeSeconds",
    "Observation",
    "PositiveMetres",
    "PositiveMetresPerSecond",
    "PositiveNewtons",
    "PositiveRadians",
    "PositiveRadiansPerSecond",
    "PositiveRatio",
    "PositiveSeconds",
    "Radians",
    "RadiansPerSecond",
    "Ratio",
    "ReadingColumn",
    "Scene",
    "Sensor",
    "Sight",
    "Signal",
    "SignalMonitor",
    "State",
    "Truth",
    "Values",
    "Verdict",
    "check_bounds",
    "display",
]
