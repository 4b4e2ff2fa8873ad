"""The models of a suite, each read once, however many of its scenarios name it."""

from __future__ import annotations

from collections.abc import Hashable

from sim_action.core.errors import ModelError
from sim_action.core.workspace import PathError, Workspace
from sim_action.robot import BUILT_IN, load_model
from sim_action.robot.robot_model import RobotModel
from sim_action.robot.spec import Robot


class ModelLibrary:
    """What was read stays what it was, whatever becomes of the files: make one for each call that reads scenarios."""

    def __init__(self) -> None:
        self._models: dict[Hashable, RobotModel | ModelError] = {}

    def load(self, robot: Robot, workspace: Workspace) -> RobotModel:
        """As `load_model` does, or what has come of the same before, be it the same error. Raises ModelError."""
        key = (workspace.root, workspace.allow_outside, *_place(robot, workspace), _options(robot))
        if key not in self._models:
            self._models[key] = _read(robot, workspace)
        found = self._models[key]
        if isinstance(found, ModelError):
            raise found.with_traceback(None)
        return found


def _read(robot: Robot, workspace: Workspace) -> RobotModel | ModelError:
    try:
        return load_model(robot, workspace)
    except ModelError as error:
        # Without what was being read when it was raised, which would be kept with it.
        error.__context__ = error.__cause__ = None
        return error.with_traceback(None)


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
