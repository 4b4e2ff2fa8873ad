"""The nodes of a launch file that roslaunch could not start. It prints an error and goes on without them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.results.outcome import Failure
from sim_action.ros.ros1.command_source.file_problems import Packages, program_problem
from sim_action.ros.ros1.verdicts.launch_output import NotLaunched, nodes_not_launched
from sim_action.ros.ros1.verdicts.launch_tags import LaunchTags
from sim_action.world.world_files.losses import Loss

_FALSE: Final = frozenset({"", "false", "0"})

WINDOW_PACKAGES: Final[Mapping[str, str]] = {
    "rviz": "it draws what others publish",
    "rqt_.*": "it draws what others publish, or sends what a person types",
    "plotjuggler.*": "it draws what others publish",
    "image_view": "it shows images to a person",
    "joint_state_publisher_gui": "it sends what a person sets",
}
"""Package of a program with a window, as a regular expression -> the reason why its absence is not a loss."""


@dataclass(frozen=True, slots=True)
class AbsentNodes:
    """The nodes that were not started.

    Attributes:
        failures: of required nodes; they are errors in any case.
        losses: of other nodes.
    """

    failures: tuple[Failure, ...] = ()
    losses: tuple[Loss, ...] = ()

    @classmethod
    def of(cls, text: str, tags: LaunchTags, workspace: Path) -> AbsentNodes:
        """Return the nodes that the output of a launch reports."""
        nodes = [node for node in nodes_not_launched(text) if not _has_window(node.package)]
        if not nodes:
            return cls()
        packages = Packages.around(workspace.resolve())
        failures, losses = list[Failure](), list[Loss]()
        for node in nodes:
            tag = tags.node(node.package, node.program)
            place = tag.place if tag else Location(tags.file)
            message = _message(node, tag.given.get("name", node.program) if tag else node.program, packages)
            if tag and tag.given.get("required", "").strip().lower() not in _FALSE:
                message = f"{message}; the node is required"
                failures.append(Failure(kind="invalid", title="no such node", message=message, location=place))
            else:
                losses.append(Loss(message=message, location=place))
        return cls(tuple(failures), tuple(losses))


def _has_window(package: str) -> bool:
    return any(re.fullmatch(pattern, package) for pattern in WINDOW_PACKAGES)


def _message(node: NotLaunched, name: str, packages: Packages) -> str:
    reason = packages.missing_message(node.package) or program_problem(node.package, node.program, packages)
    return escaped_line(f"the node '{name}' ({node.package}/{node.program}) was not started: {reason or node.reason}")
