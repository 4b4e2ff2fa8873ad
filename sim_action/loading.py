"""YAML -> Scenario. Every error has file, line and column, and all of them are reported at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError

from sim_action import scenario_checks
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS, CommandSource
from sim_action.discovery import file_name
from sim_action.drives import DRIVES, Drive
from sim_action.errors import InvalidScenario, ModelError, RefusedModel
from sim_action.location import Location, Problem
from sim_action.messages import did_you_mean, escaped_line, shown
from sim_action.models import check_text, load_model
from sim_action.models.library import ModelLibrary
from sim_action.permissions import Permissions
from sim_action.registry import Table
from sim_action.regular_files import open_regular
from sim_action.robot_model import RobotModel
from sim_action.scenario import DrivenRobot, Expectation, ExpectationOptions, LoadedScenario, Scenario
from sim_action.scene import Scene, SpecProblems
from sim_action.spec_errors import spec_errors
from sim_action.workspace import PathError, Workspace
from sim_action.yaml_document import MAX_BYTES, Document, KeyPath, location_after, read_document

Model = TypeVar("Model", bound=BaseModel)

_PERMISSIONS: Final = Permissions()


def load_scenario(
    path: Path, permissions: Permissions = _PERMISSIONS, models: ModelLibrary | None = None, *, evaluate: bool = False
) -> LoadedScenario:
    """Reads a scenario file, and checks everything that can be checked without running it.

    Args:
        path: of the file; problems name it so.
        permissions: what it may do.
        models: those that scenarios of the same suite have read.
        evaluate: whether xacro is, which runs what is written in it.

    Raises InvalidScenario with all problems.
    """
    try:
        workspace = Workspace.around(path, allow_outside=permissions.outside)
    except (PathError, OSError, RuntimeError) as error:
        raise InvalidScenario([Problem(Location(file_name(path)), escaped_line(str(error)))]) from None
    document = read_document(file_name(path), _read_text(path))
    loader = _Loader(document, workspace, permissions, models or ModelLibrary(), evaluate=evaluate)
    scenario = loader.load()
    return LoadedScenario(scenario, path, document, workspace, loader.model, loader.unchecked)


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
    return _scene(loaded.scenario, model, loaded.workspace)


def _scene(scenario: Scenario, model: RobotModel, workspace: Workspace) -> Scene:
    return Scene(scenario.robot, model, scenario.world, scenario.physics, workspace)


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
        self._models = models
        self._evaluate = evaluate
        self._document = document
        self._workspace = workspace
        self._permissions = permissions
        self._problems: dict[tuple[KeyPath, str], Problem] = {}
        self._command_paths: list[KeyPath] = []
        self._expect_paths: list[KeyPath] = []

    def load(self) -> Scenario:
        data = self._document.data
        if not isinstance(data, dict):
            what = "the file is empty" if data is None else "the file holds no map of keys"
            self._note((), f"{what}; a scenario begins with 'name:', 'robot:', 'expect:', 'time_limit:'")
            raise InvalidScenario(self._problems.values())
        scenario = self._validated(Scenario, self._with_families(data), ())
        if scenario is not None:
            self._check(scenario, states_drive="drive" in data["robot"])
        if scenario is None or self._problems:
            raise InvalidScenario(sorted(self._problems.values(), key=self._place))
        return scenario

    def _place(self, problem: Problem) -> tuple[bool, int, int]:
        """Those of the scenario come first, in the order of its lines."""
        where = problem.location
        return where.file != self._document.file, where.line or 0, where.column or 0

    # --- families: the parts whose class depends on a key ---

    def _with_families(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """The document's data, with drive, commands and expectations made into objects."""
        parts = dict(data)
        if "commands" in data:
            parts["commands"] = self._commands(data["commands"])
        if isinstance(data.get("expect"), tuple):
            parts["expect"] = self._expectations(data["expect"])
        robot = data.get("robot")
        if isinstance(robot, dict) and "drive" in robot:
            parts["robot"] = {**robot, "drive": self._drive(robot["drive"], ("robot", "drive"))}
        return parts

    def _commands(self, data: Any) -> tuple[CommandSource, ...]:
        entries: list[tuple[KeyPath, Any]]
        entries = [(("commands", index), entry) for index, entry in enumerate(data)] if isinstance(data, tuple) else []
        found = [(path, self._command(entry, path)) for path, entry in entries or [(("commands",), data)]]
        self._command_paths = [path for path, source in found if source is not None]
        return tuple(source for _, source in found if source is not None)

    def _command(self, data: Any, path: KeyPath) -> CommandSource | None:
        key = self._family_key(COMMANDS, data, path, beside=CommandSource)
        if key is None:
            return None
        source = self._validated(COMMANDS.load(key), data, path)
        if source is not None:
            self._note_all(path, source.problems(self._workspace))
            if source.runs_user_code and self._permissions.scripts_refused:
                self._note((*path, key), self._permissions.scripts_refused)
        return source

    def _expectations(self, data: tuple[Any, ...]) -> tuple[Expectation, ...]:
        found = [(("expect", index), self._expectation(entry, ("expect", index))) for index, entry in enumerate(data)]
        self._expect_paths = [path for path, expectation in found if expectation is not None]
        return _with_unique_names(tuple(expectation for _, expectation in found if expectation is not None))

    def _expectation(self, data: Any, path: KeyPath) -> Expectation | None:
        data = {data: None} if isinstance(data, str) else data
        key = self._family_key(ASSERTIONS, data, path, beside=ExpectationOptions)
        if key is None:
            return None
        spec = {} if data[key] is None else data[key]
        assertion = self._validated(ASSERTIONS.load(key), spec, (*path, key))
        beside = {name: value for name, value in data.items() if name != key}
        options = self._validated(ExpectationOptions, beside, path)
        if assertion is None or options is None:
            return None
        if options.before is not None and options.before <= options.after:
            self._note((*path, "before"), f"must be later than 'after' ({options.after:g} s)")
        return Expectation(
            assertion=assertion,
            location=self._document.location((*path, key)),
            name=options.name or assertion.title,
            after=options.after,
            before=float("inf") if options.before is None else options.before,
            severity=options.severity,
        )

    def _drive(self, data: Any, path: KeyPath) -> Drive | None:
        key = self._family_key(DRIVES, data, path)
        return None if key is None else self._validated(DRIVES.load(key), data[key], (*path, key))

    def _family_key(
        self, table: Table[Any], data: Any, path: KeyPath, beside: type[BaseModel] | None = None
    ) -> str | None:
        """The one key of `data` that the table knows; `beside`: the class of the keys that may stand next to it."""
        names = ", ".join(table)
        if not isinstance(data, dict):
            self._note(path, f"expected a map with one {table.kind} ({names}), found {shown(data)}")
            return None
        known = [key for key in data if key in table]
        if len(known) == 1 and (beside or len(data) == 1):
            return str(known[0])
        others = [key for key in data if key not in table and key not in (beside.model_fields if beside else ())]
        if len(known) > 1:
            self._note((*path, known[1]), f"'{known[0]}' and '{known[1]}' in one entry; begin each with '- '")
        elif others:
            self._note((*path, others[0]), f"unknown {table.kind} '{others[0]}'{did_you_mean(others[0], table)}")
        else:
            self._note(path, f"names no {table.kind}; give one of {names}")
        return None

    def _validated(self, model: type[Model], data: Any, path: KeyPath) -> Model | None:
        try:
            return model.model_validate(data)
        except ValidationError as error:
            for location, message in spec_errors(model, data, error):
                # A part that was refused is missing from the whole: that is not a second problem.
                if not self._has_problem_below((*path, *location)):
                    self._note((*path, *location), message)
            return None

    def _has_problem_below(self, path: KeyPath) -> bool:
        return any(len(noted) > len(path) and noted[: len(path)] == path for noted, _ in self._problems)

    def _check(self, scenario: Scenario, *, states_drive: bool) -> None:
        """What a whole scenario must satisfy."""
        self._note_all((), scenario_checks.time_problems(scenario, self._expect_paths))
        self._note_all((), scenario_checks.rate_problems(scenario, self._command_paths))
        self._note_all((), scenario_checks.rule_problems(scenario))
        self._note_all((), scenario_checks.name_problems(scenario))
        try:
            if scenario.robot.is_xacro and not self._evaluate:
                self._check_text(scenario.robot)
                return
            self.model = self._models.load(scenario.robot, self._workspace)
        except RefusedModel as error:
            # They are mended in the model's own file.
            self._problems |= {((problem.location.file,), str(problem)): problem for problem in error.problems}
            return
        except ModelError as error:
            self._note(("robot", "model"), str(error))
            return
        self._check_scene(_scene(scenario, self.model, self._workspace), scenario, states_drive=states_drive)

    def _check_text(self, robot: DrivenRobot) -> None:
        """What can be said before xacro has run; the rest is checked by the process that runs it."""
        if self._permissions.scripts_refused:
            self._note(("robot", "model"), self._permissions.scripts_refused)
        name = f"{robot.model} is evaluated when it runs: until then, what is said of links and joints is not checked"
        self.unchecked = (name, *check_text(robot, self._workspace))

    def _check_scene(self, scene: Scene, scenario: Scenario, *, states_drive: bool) -> None:
        self._note_all((), scenario_checks.robot_problems(scenario, scene.model))
        # A drive that was written and refused is missing from the scenario: that is not a second problem.
        if not states_drive:
            self._note_all((), scenario_checks.wheel_problems(scenario, scene.model))
        for path, expectation in zip(self._expect_paths, scenario.expect, strict=True):
            self._note_all((*path, expectation.assertion.key), expectation.assertion.problems(scene))

    # --- notes ---

    def _note_all(self, path: KeyPath, problems: SpecProblems) -> None:
        for below, message in problems:
            self._note((*path, *below), message)

    def _note(self, path: KeyPath, message: str) -> None:
        self._problems.setdefault((path, message), self._document.problem(path, message))


def _with_unique_names(expectations: tuple[Expectation, ...]) -> tuple[Expectation, ...]:
    """Reports tell assertions apart by name: the second of a name becomes "name (2)"."""
    taken = {expectation.name for expectation in expectations}
    seen: set[str] = set()
    unique = []
    for expectation in expectations:
        name = expectation.name
        if name in seen:
            name = next(free for n in count(2) if (free := f"{name} ({n})") not in taken)
        seen.add(name)
        taken.add(name)
        unique.append(replace(expectation, name=name))
    return tuple(unique)
