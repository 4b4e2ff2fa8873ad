"""The subcommands of the command line, in one table. The module of each is imported when it is called.

Each parses its options, calls use cases of `app` or `ros` and prints the result. A module may import what its
subcommand needs; `run`, `prove` and the launch commands import most of it once they can handle a signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sim_action.core.records import dataclass


@dataclass(frozen=True, slots=True)
class Subcommand:
    """A subcommand."""

    module: str  # the module of this package with the command
    purpose: str  # the line about it in `sim-action --help`
    keys: tuple[str, ...] = ()  # the options that can be set in pyproject.toml
    # it handles signals by an `Interruption`; a signal ends each other subcommand at once
    handles_signals: bool = False


_REPORTS: Final = ("output_dir", "junit", "junit_strict", "report", "summary", "annotations", "verbose", "quiet")
_JUDGEMENT: Final = ("repeat", "unexercised", "confidence", "strict")
_RUNS: Final = ("paths", "backend", "seed", *_JUDGEMENT, "jobs", "fail_fast", "record")
_LAUNCHES: Final = (*_REPORTS, "strict")
_MARGINS: Final = ("paths", "backend", "seed", "jobs", *_REPORTS)
_PROOFS: Final = ("paths", "seed", "jobs", "output_dir", "report", "summary", "annotations", "quiet")

SUBCOMMANDS: Final[Mapping[str, Subcommand]] = {
    "run": Subcommand("run", "Run scenarios and report their verdicts.", (*_RUNS, *_REPORTS), handles_signals=True),
    "validate": Subcommand("validate", "Check scenarios without running them.", ("paths", "strict")),
    "matrix": Subcommand("matrix", "Split scenarios into shards.", ("paths",)),
    "merge": Subcommand("merge", "Join the results of shards.", _REPORTS),
    "compare": Subcommand("compare", "Compare two runs.", ("output_dir", "summary")),
    "prove": Subcommand("prove", "Find expectations that check nothing.", _PROOFS, handles_signals=True),
    "margins": Subcommand(
        "margins", "Find how far factors can move before a scenario fails.", _MARGINS, handles_signals=True
    ),
    "report": Subcommand("report", "Make the reports of a run that was killed.", _REPORTS),
    "view": Subcommand("view", "Open a report in the browser.", ("output_dir",)),
    "rostest": Subcommand("ros", "Run a rostest of ROS 1.", _LAUNCHES, handles_signals=True),
    "roslaunch": Subcommand("ros", "Run a ROS 1 launch file.", _LAUNCHES, handles_signals=True),
    "launchtest": Subcommand("ros", "Run a launch test of ROS 2 (experimental).", _LAUNCHES, handles_signals=True),
    "ros2": Subcommand("ros", "Build the messages of a ROS 2 workspace on the wheels."),
    "init": Subcommand("init", "Create an example scenario and a workflow."),
    "inspect": Subcommand("inspect", "Show and check a robot model."),
    "explain": Subcommand("listings", "Explain an assertion, command source, drive, sensor or key."),
    "guide": Subcommand("listings", "Print a reference for programs that write scenarios."),
    "doctor": Subcommand("doctor", "Look at this installation."),
    "models": Subcommand("listings", "List the built-in robots."),
    "assertions": Subcommand("listings", "List the assertions for `expect:`."),
    "commands": Subcommand("listings", "List what can drive the robot."),
    "sensors": Subcommand("listings", "List the sensors for `sensors:`."),
    "schema": Subcommand("listings", "Print a JSON Schema, for editors."),
}
