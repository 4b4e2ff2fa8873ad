"""The errors that `sim_action.run` and its siblings raise, with the messages of the command line.

Each has `problems`: what to fix, each with its place and its message; empty if no file is at fault.
"""

from sim_action.core.errors import InternalError as InternalError
from sim_action.core.errors import InvalidScenario as InvalidScenario
from sim_action.core.errors import Location as Location
from sim_action.core.errors import MissingScenario as MissingScenario
from sim_action.core.errors import Problem as Problem
from sim_action.core.errors import SimActionError as SimActionError
from sim_action.core.errors import SystemRefusal as SystemRefusal
from sim_action.core.errors import UsageError as UsageError
