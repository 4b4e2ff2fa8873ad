"""The errors that `sim_action.run` and its siblings raise, with the messages of the command line.

Each has `problems`: what to fix, each with its place and its message; empty if no file is at fault.
"""

from __future__ import annotations

from sim_action.core.errors import (
    InternalError,
    InvalidScenario,
    Location,
    MissingScenario,
    Problem,
    SimActionError,
    SystemRefusal,
    UsageError,
)

__all__ = [
    "InternalError",
    "InvalidScenario",
    "Location",
    "MissingScenario",
    "Problem",
    "SimActionError",
    "SystemRefusal",
    "UsageError",
]
