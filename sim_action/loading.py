"""YAML -> Scenario. Every error has file, line and column, and all of them are reported at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from sim_action import scenario_checks, world_checks
from sim_action.discovery import file_name
from sim_action.errors import InvalidScenario, ModelError, RefusedModel
from sim_action.location import Location, Problem
from sim_action.messages import escaped_line
from sim_action.models import check_text, load_model
from sim_action.models.library import ModelLibrary
from sim_action.parts import Part
from sim_action.permissions import Permissions
from sim_action.problem_list import ProblemList
from sim_action.regular_files import open_regular
from sim_action.robot_model import RobotModel
from sim_action.scenario import DrivenRobot, LoadedScenario, Scenario
from sim_action.scenario_parts import PartReader
from sim_action.scene import Scene
from sim_action.surroundings import read_surroundings
from sim_action.workspace import PathError, Workspace
from sim_action.yaml_document import MAX_BYTES, Document, location_after, read_document

_PERMISSIONS: Final = Permissions()


def load_scenario(
    path: Path, permissions: Permissions = _PERMISSIONS, models: ModelLibrary | None = None, *, evaluate: bool = False
) -> LoadedScenario:
    """Reads a scenario file, and checks everything that can be checked without running it.

    Args:
        path: of the file; problems name it so.
        permissions: what it may do.
        models: those that scenarios of the same suite have read.
        evaluate: whether models are read that may be read in a scenario's own process alone: xacro is code, and
            native code reads MJCF.

    Raises InvalidScenario with all problems.
    """
    try:
        workspace = Workspace.around(path, allow_outside=permissions.outside)
    except (PathError, OSError, RuntimeError) as error:
        raise InvalidScenario([Problem(Location(file_name(path)), escaped_line(str(error)))]) from None
    document = read_document(file_name(path), _read_text(path))
    loader = _Loader(document, workspace, permissions, models or ModelLibrary(), evaluate=evaluate)
    scenario = loader.load()
    return LoadedScenario(scenario, path, document, workspace, loader.model, loader.unchecked, loader.parts)


def load_all(
    paths: Iterable[Path], permissions: Permissions
) -> tuple[dict[Path, LoadedScenario], dict[Path, InvalidScenario]]:
    """Every path is in one of the two: the scenarios that can be run, and what is wrong with the others."""
    valid: dict[Path, LoadedScenario] = {}
    invalid: dict[Path, InvalidScenario] = {}
    models = ModelLibrary()
    for path in paths:
        try:
            valid[path] = load_scenario(path, permissions, models)
        except InvalidScenario as error:
            invalid[path] = error
    return valid, invalid


def build_scene(loaded: LoadedScenario) -> Scene:
    """The scene of a scenario; its model is read if that has not been done. Raises ModelError."""
    model = loaded.model or load_model(loaded.scenario.robot, loaded.workspace)
    return _scene(loaded.scenario, model, loaded.workspace, loaded.parts)


def _scene(scenario: Scenario, model: RobotModel, workspace: Workspace, parts: Mapping[str, tuple[Part, ...]]) -> Scene:
    return Scene(scenario.robot, model, scenario.world, scenario.physics, workspace, scenario.seed, parts=parts)


def _read_text(path: Path) -> str:
    where = Location(file_name(path))
    try:
        with open_regular(path, follow_link=True) as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InvalidScenario([Problem(where, f"cannot be read: {error.strerror}")]) from None
    if len(data) > MAX_BYTES:
        message = f"a scenario of more than {MAX_BYTES // 1000} kB is not read; is this the right file?"
        raise InvalidScenario([Problem(where, message)])
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        where = location_after(file_name(path), data[: error.start].decode("utf-8"))
        message = f"the byte 0x{data[error.start]:02x} is not UTF-8 text; save the file as UTF-8"
        raise InvalidScenario([Problem(where, message)]) from None


class _Loader:
    """One document while it becomes a scenario."""

    def __init__(
        self,
        document: Document,
        workspace: Workspace,
        permissions: Permissions,
        models: ModelLibrary,
        *,
        evaluate: bool,
    ) -> None:
        self.model: RobotModel | None = None
        self.unchecked: tuple[str, ...] = ()
        self.parts: Mapping[str, tuple[Part, ...]] = {}
        self._models = models
        self._evaluate = evaluate
        self._document = document
        self._workspace = workspace
        self._permissions = permissions
        self._problems = ProblemList(document)
        self._parts = PartReader(document, workspace, permissions, self._problems)

    def load(self) -> Scenario:
        data = self._document.data
        if not isinstance(data, dict):
            what = "the file is empty" if data is None else "the file holds no map of keys"
            self._problems.note((), f"{what}; a scenario begins with 'name:', 'robot:', 'expect:', 'time_limit:'")
            raise self._problems.error()
        scenario = self._parts.validated(Scenario, self._parts.with_families(data), ())
        if scenario is not None:
            self._check(scenario, states_drive="drive" in data["robot"])
        if scenario is None or self._problems:
            raise self._problems.error()
        return scenario

    def _check(self, scenario: Scenario, *, states_drive: bool) -> None:
        """What a whole scenario must satisfy."""
        parts = self._parts
        self._problems.note_all((), scenario_checks.time_problems(scenario, parts.expect_paths))
        self._problems.note_all((), scenario_checks.rate_problems(scenario, parts.command_paths, parts.sensor_paths))
        self._problems.note_all((), scenario_checks.trace_problems(scenario, parts.sensor_paths))
        self._problems.note_all((), scenario_checks.rule_problems(scenario))
        self._problems.note_all((), scenario_checks.name_problems(scenario))
        self._problems.note_all((), scenario_checks.engine_problems(scenario))
        self._problems.note_all((), world_checks.motion_problems(scenario))
        self.unchecked = tuple(remark for source in scenario.commands for remark in source.unchecked)
        self._problems.note_all((), scenario_checks.patch_problems(scenario))
        surroundings = read_surroundings(scenario.world, self._workspace)
        self.parts = surroundings.parts
        self._problems.note_all((), iter(surroundings.problems))
        try:
            if (scenario.robot.is_xacro or scenario.robot.is_mjcf) and not self._evaluate:
                self._check_text(scenario.robot)
                return
            self.model = self._models.load(scenario.robot, self._workspace)
        except RefusedModel as error:
            # They are mended in the model's own file.
            for problem in error.problems:
                self._problems.note_elsewhere(problem)
            return
        except ModelError as error:
            self._problems.note(("robot", "model"), str(error))
            return
        scene = _scene(scenario, self.model, self._workspace, self.parts)
        self._check_scene(scene, scenario, states_drive=states_drive)

    def _check_text(self, robot: DrivenRobot) -> None:
        """What can be said of a model that only the scenario's own process may read; the rest is checked there."""
        if robot.is_xacro and self._permissions.scripts_refused:
            self._problems.note(("robot", "model"), self._permissions.scripts_refused)
        self.unchecked += check_text(robot, self._workspace)

    def _check_scene(self, scene: Scene, scenario: Scenario, *, states_drive: bool) -> None:
        self._problems.note_all((), scenario_checks.robot_problems(scenario, scene.model))
        self._problems.note_all((), scenario_checks.follower_problems(scene))
        self._problems.note_all((), world_checks.disturbance_problems(scene, scenario.time_limit))
        self._problems.note_all((), scenario_checks.source_problems(scenario, scene, self._parts.command_paths))
        self._problems.note_all((), scenario_checks.sensor_problems(scene, scenario.sensors, self._parts.sensor_paths))
        # A drive that was written and refused is missing from the scenario: that is not a second problem.
        if not states_drive:
            paths = self._parts.sensor_paths
            self._problems.note_all((), scenario_checks.wheel_problems(scenario, scene, paths))
        for path, source in zip(self._parts.command_paths, scenario.commands, strict=True):
            self._problems.note_all(path, source.model_problems(scene))
        for path, expectation in zip(self._parts.expect_paths, scenario.expect, strict=True):
            self._problems.note_all((*path, expectation.assertion.key), expectation.assertion.problems(scene))
