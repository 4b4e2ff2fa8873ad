"""The world file of a scenario, `world: {file: ..., robot: NAME}`: its bodies, its ground, its robot and its losses."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from itertools import islice
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final

from sim_action.core.errors import Location, ModelError, Problem, RefusedModel
from sim_action.core.field_types import Placement
from sim_action.core.records import dataclass, field
from sim_action.core.wording import did_you_mean, nearest
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import KeyPath
from sim_action.core.yaml_errors import ProblemList
from sim_action.robot.documents.packages import Packages
from sim_action.robot.model.robot_spec import IN_WORLD
from sim_action.scenario.model import Scenario
from sim_action.world.claims import INCOMPLETE_WORLD, NOT_SIMULATED, AuditWarning
from sim_action.world.scene import WorldPlaces

if TYPE_CHECKING:
    from sim_action.world.parts import Part
    from sim_action.world.world_files import WorldFile

_FILE: KeyPath = ("world", "file")
_SUFFIXES: Final = (".world", ".sdf")
_MAX_NAMES_READ: Final = 1_000
_MAX_LINES: Final = 3


class WorldLibrary:
    """A cache of world files, so that the variations of a scenario read each file only once."""

    def __init__(self) -> None:
        self._worlds: dict[Hashable, WorldFile | ModelError] = {}

    def load(self, file: str, robot: str | None, workspace: Workspace, packages: Mapping[str, str]) -> WorldFile:
        """Return the world in a file that a scenario names. Raises PathError; ModelError, also from the cache.

        :param robot: name of the model that is the robot, if one of them is.
        :param packages: folders of packages by name, as in `robot.packages`.
        """
        from sim_action.world.world_files import read_world_file  # a usual run does without it

        path = workspace.file(file)
        key = (path, robot, workspace, tuple(sorted(packages.items())))
        if key not in self._worlds:
            try:
                self._worlds[key] = read_world_file(
                    path, Packages(workspace, packages), lambda model: model.name == robot
                )
            except ModelError as error:
                error.__context__ = error.__cause__ = None
                self._worlds[key] = error.with_traceback(None)
        found = self._worlds[key]
        if isinstance(found, ModelError):
            raise found.with_traceback(None)
        return found


@dataclass(frozen=True, eq=False)
class FilledScenario:
    """A scenario whose world has the bodies of its world file after its own."""

    scenario: Scenario
    # name of a body of the file -> its parts, if its shape is in a file
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    warnings: tuple[AuditWarning, ...] = ()  # the parts of the file that are not simulated
    places: WorldPlaces = field(default_factory=WorldPlaces)  # of the models in the file


def with_robot_of_world(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data of a scenario; its robot is the model of the world file if it names no other."""
    world, robot = data.get("world"), data.get("robot", {})
    if not isinstance(world, dict) or not isinstance(robot, dict) or "model" in robot:
        return dict(data)
    file, name = world.get("file"), world.get("robot")
    if not isinstance(file, str) or not isinstance(name, str):
        return dict(data)
    return {**data, "robot": {"model": f"{file}{IN_WORLD}{name}", **robot}}


def filled(
    scenario: Scenario, workspace: Workspace, library: WorldLibrary, problems: ProblemList, allowed: AbstractSet[str]
) -> FilledScenario:
    """Add the world file of a scenario to it; `allowed`: rules of the audit of claims that it allows."""
    world = scenario.world
    if world.file is None:
        return FilledScenario(scenario)
    try:
        found = library.load(world.file, world.robot, workspace, scenario.robot.packages)
    except RefusedModel as error:
        for problem in error.problems:
            problems.note_elsewhere(problem)
        return FilledScenario(scenario)
    except PathError as error:
        problems.note(_FILE, f"{error}{_nearest_file(world.file, workspace)}")
        return FilledScenario(scenario)
    except ModelError as error:
        problems.note(_FILE, str(error))
        return FilledScenario(scenario)
    if world.robot is not None and scenario.robot.model != f"{world.file}{IN_WORLD}{world.robot}":
        message = f"world.robot makes '{world.robot}' of {world.file} the robot; remove robot.model or world.robot"
        problems.note(("robot", "model"), message)
    _note_names(scenario, found, problems)
    _note_missing(found, problems, allowed)
    stated = {key: getattr(found.world, key) for key in found.stated if key not in world.model_fields_set}
    # A second body of the same name is reported already.
    names = {body.name for body in world.objects}
    objects = (*world.objects, *(body for body in found.world.objects if body.name not in names))
    changed: dict[str, Any] = {"world": world.model_copy(update={**stated, "objects": objects})}
    base = found.robot.base if found.robot is not None else None
    if base is not None and "pose" not in scenario.robot.model_fields_set:
        changed["robot"] = scenario.robot.model_copy(update={"pose": Placement.of(base)})
    place = found.robot.place if found.robot is not None and "robot" in changed else None
    warnings = tuple(_warnings(found, Location(world.file), allowed))
    places = WorldPlaces({name: at for name, at in found.places.items() if name not in names}, place)
    return FilledScenario(scenario.model_copy(update=changed), found.parts, warnings, places)


def _nearest_file(file: str, workspace: Workspace) -> str:
    """Return a hint with a similar name in the same folder of the workspace, if there is one."""
    try:
        folder = (workspace.directory / file).resolve().parent
        if workspace.refusal(folder) is not None:
            return ""
        names = {each.name.lower(): each.name for each in islice(folder.iterdir(), _MAX_NAMES_READ)}
    except (OSError, ValueError, RuntimeError):
        return ""
    near = nearest(PurePath(file).name.lower(), sorted(name for name in names if name.endswith(_SUFFIXES)))
    return "" if near is None else f"; did you mean '{names[near]}'?"


def _note_names(scenario: Scenario, found: WorldFile, problems: ProblemList) -> None:
    name, file = scenario.world.robot, scenario.world.file
    if name is not None and found.robot is None:
        problems.note(("world", "robot"), f"{file} has no model '{name}'{did_you_mean(name, found.models)}")
    known = {body.name for body in found.world.objects}
    for index, body in enumerate(scenario.world.objects):
        if body.name in known:
            message = f"{file} has a body '{body.name}', too; names are unique: give this one another name"
            problems.note(("world", "objects", index, "name"), message)


def _note_missing(found: WorldFile, problems: ProblemList, allowed: AbstractSet[str]) -> None:
    if INCOMPLETE_WORLD in allowed:
        return
    same: dict[str, list[tuple[Location, str]]] = {}
    for loss in found.losses:
        if loss.is_missing and loss.location is not None:
            # The rest of a message is where it was searched, and a hint that only the first few have.
            same.setdefault(loss.message.partition(" (")[0], []).append((loss.location, loss.message))
    for places in same.values():
        (first, message), *others = places
        lines = ", ".join(str(place) for place, _ in others[:_MAX_LINES])
        more = f" and {len(others) - _MAX_LINES} more" if len(others) > _MAX_LINES else ""
        also = f"; {len(places)} times, also at {lines}{more}" if others else ""
        remedy = f"to run without it: allow: [{INCOMPLETE_WORLD}]"
        problems.note_elsewhere(Problem(first, f"{message}{also}; {remedy} [{INCOMPLETE_WORLD}]"))


def _warnings(found: WorldFile, here: Location, allowed: AbstractSet[str]) -> Iterator[AuditWarning]:
    from sim_action.world.world_files.losses import by_kind  # a usual run does without it

    for loss in by_kind(found.losses):
        rule = INCOMPLETE_WORLD if loss.is_missing else NOT_SIMULATED
        if loss.is_missing or rule not in allowed:
            yield AuditWarning(rule=rule, message=loss.message, location=loss.location or here)
    if NOT_SIMULATED not in allowed:
        for remark in found.remarks:
            yield AuditWarning(rule=NOT_SIMULATED, message=remark.message, location=remark.location)
        if not found.has_ground:
            message = f"{here.file} has no ground plane; the ground z = 0 is there all the same"
            yield AuditWarning(rule=NOT_SIMULATED, message=message, location=here)
