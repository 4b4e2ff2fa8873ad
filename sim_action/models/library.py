"""The models of a suite, each read once, however many of its scenarios name it."""

from __future__ import annotations

from collections.abc import Hashable

from sim_action.models import BUILT_IN, load_model
from sim_action.robot_model import RobotModel
from sim_action.workspace import PathError, Workspace
from sim_action.world import Robot


class ModelLibrary:
    """What was read stays what it was, whatever becomes of the files: make one for each call that reads scenarios."""

    def __init__(self) -> None:
        self._models: dict[Hashable, RobotModel] = {}

    def load(self, robot: Robot, workspace: Workspace) -> RobotModel:
        """As `load_model` does, or the model that it has returned for the same before. Raises ModelError."""
        key = (workspace.root, workspace.allow_outside, *_place(robot, workspace), _options(robot))
        if key not in self._models:
            self._models[key] = load_model(robot, workspace)
        return self._models[key]


def _place(robot: Robot, workspace: Workspace) -> tuple[Hashable, ...]:
    """Scenarios of several folders may mean one file; names of packages are seen from each folder anew."""
    if robot.model in BUILT_IN:
        return (robot.model,)
    if not robot.packages and "://" not in robot.model:
        try:
            return (workspace.file(robot.model),)
        except PathError:
            pass  # to be told by who reads it
    return workspace.directory, robot.model


def _options(robot: Robot) -> str:
    return robot.model_dump_json(include={"args", "packages", "allow"})
