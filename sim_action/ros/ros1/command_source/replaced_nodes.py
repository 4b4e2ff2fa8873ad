"""The nodes of Gazebo in a launch file: a scenario replaces most of them, and the others are losses.

The scenario is the robot, the world and the drive. Further models, other worlds and controllers of joints are missing.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import PurePath
from typing import Final

from sim_action.core.field_types import FrozenModel

_EMPTY_WORLD: Final = "empty.world"
_OTHER_MODEL: Final = frozenset({"-file", "-database", "-sdf"})
_WITH_VALUES: Final = frozenset({"--namespace", "--timeout", "--shutdown-timeout"})
_COMMANDS: Final = frozenset({"load", "unload", "start", "stop", "spawn", "kill", "list", "reload-libraries"})

REPLACED_CONTROLLERS: Final[Mapping[str, str]] = {
    "joint_state_controller/JointStateController": "the robot publishes joint_states",
    "diff_drive_controller/DiffDriveController": "the drive of the scenario follows the twists",
}
"""Type of a controller -> the reason why its absence is not a loss."""


class ReplacedNode(FrozenModel):
    """A node that is not launched: package and type, and its arguments in one text."""

    program: str
    args: str = ""


def lost_nodes(nodes: Sequence[ReplacedNode], world: str, types: Mapping[str, str]) -> Iterator[str]:
    """Yield a message for each part of a launch file that the scenario does not replace.

    Args:
        nodes: the nodes that are not launched.
        world: the name of the world; empty if there is none.
        types: name of a controller -> its type.
    """
    worlds = [world, *(word for node in nodes for word in _words(node) if word.endswith(".world"))]
    for name in dict.fromkeys(worlds):
        if name and PurePath(name).name != _EMPTY_WORLD:
            yield f"the world '{PurePath(name).name}' of the launch file is not simulated: add its objects to 'world'"
    spawned = [node for node in nodes if node.program == "gazebo_ros/spawn_model"]
    robots = [node for node in spawned if not _OTHER_MODEL.intersection(_words(node))] or spawned
    for node in spawned:
        if node is not robots[0]:
            name = _after(_words(node), "-model")
            yield f"the model '{name}' is not spawned: the scenario has one robot, and its objects are in 'world'"
    for name in _controllers(nodes):
        if (kind := types.get(name, "")) not in REPLACED_CONTROLLERS:
            yield f"the controller '{name}' ({kind or 'without a type'}) does not run: drive joints with other commands"


def _controllers(nodes: Sequence[ReplacedNode]) -> Iterator[str]:
    """Yield the names of the controllers that nodes of the controller manager would load."""
    for node in nodes:
        words = _words(node)
        if node.program == "controller_manager/controller_manager" and words[:1] not in (["spawn"], ["load"]):
            continue
        if node.program in {"controller_manager/spawner", "controller_manager/controller_manager"}:
            options = {index + 1 for index, word in enumerate(words) if word in _WITH_VALUES}
            kept = (word for index, word in enumerate(words) if index not in options)
            yield from (word for word in kept if not word.startswith("-") and word not in _COMMANDS)


def _words(node: ReplacedNode) -> list[str]:
    try:
        return shlex.split(node.args)
    except ValueError:
        return node.args.split()


def _after(words: Sequence[str], option: str) -> str:
    return next((after for word, after in pairwise(words) if word == option), "")
