"""Load scenarios: from YAML text to checked `LoadedScenario` objects.

Every error has its file, line and column, and all of them are reported at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core import errors
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import counted
from sim_action.core.yaml_document import KeyPath, ProblemList, SpecProblem, SpecProblems
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.loading import ModelLibrary, check_text, load_model, package_problems, srdf_problems
from sim_action.scenario import checks as scenario_checks
from sim_action.scenario import stage
from sim_action.scenario.checks import audit_combination, audit_robot, audit_scenario
from sim_action.scenario.faults import fault_problems
from sim_action.scenario.files import read_only_scenario
from sim_action.scenario.model import DrivenActor, DrivenRobot, LoadedScenario, Scenario
from sim_action.scenario.part_reader import OwnPaths, PartReader, Unfolded, unfolded, with_roles
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.stage import WorldLibrary, filled, with_robot_of_world
from sim_action.state.timeline import is_late
from sim_action.world.claims import AuditWarning, ClaimFinding, allowed_rules, unknown_rules
from sim_action.world.scene import EGO, Fitting, Scene, WorldPlaces
from sim_action.world.shape_files import ShapeLibrary, read_surroundings

if TYPE_CHECKING:
    from sim_action.world.parts import Part

_PERMISSIONS: Final = Permissions()


@dataclass(frozen=True, slots=True)
class Libraries:
    """Robot models, body shapes and world files that the scenarios of a suite share, each read once."""

    models: ModelLibrary = field(default_factory=ModelLibrary)
    shapes: ShapeLibrary = field(default_factory=ShapeLibrary)
    worlds: WorldLibrary = field(default_factory=WorldLibrary)


def load_scenario(
    path: Path, permissions: Permissions = _PERMISSIONS, libraries: Libraries | None = None, *, evaluate: bool = False
) -> LoadedScenario:
    """Read a file with one scenario, which problems name `path`, and check it without a run. Raises InvalidScenario."""
    return checked(read_only_scenario(path, permissions), permissions, libraries, evaluate=evaluate)


def checked(
    source: Source, permissions: Permissions, libraries: Libraries | None = None, *, evaluate: bool = False
) -> LoadedScenario:
    """Check everything of a scenario that can be checked without a run.

    `evaluate` allows models that run code: xacro, and MJCF, which native code reads. Such models are otherwise only
    read in the scenario's own process. Raises InvalidScenario with all problems.
    """
    document, problems = with_roles(source.document)
    commands = unfolded(document)
    commands = replace(commands, problems=(*problems, *commands.problems)) if problems else commands
    document = commands.document
    if isinstance(document.data, dict) and "events" in document.data:
        from sim_action.scenario.events import event_places  # few scenarios have events

        document = event_places(document)
    source = replace(source, document=document)
    loader = _Loader(source, permissions, libraries or Libraries(), commands, evaluate=evaluate)
    scenario = loader.load()
    if source.group is not None:
        scenario = scenario.model_copy(update={"name": source.name})
    model, parts, places = loader.model, loader.parts, loader.places
    return LoadedScenario(
        *(scenario, source, model, loader.unchecked, parts, loader.warnings),
        places=places,
        actor_models=loader.actor_models,
    )


def load_all(
    sources: Iterable[Source | Refused], permissions: Permissions, libraries: Libraries | None = None
) -> list[LoadedScenario | Refused]:
    """Load all scenarios; each becomes a LoadedScenario, or a Refused with its problems.

    Models and shapes are read once. If one variation is invalid, its whole scenario is refused, unless only randomly
    drawn values are wrong: then only these variations are. A fault of sim-action concerns one scenario only.
    `libraries` holds models that were read before. Raises UsageError.
    """
    libraries = libraries or Libraries()
    loaded: list[LoadedScenario | Refused] = []
    for several in scenarios_of(sources):
        scenarios = list(_sharing(_loaded_or_refused(source, permissions, libraries) for source in several))
        if any(isinstance(scenario, Refused) for scenario in scenarios):
            scenarios = list(refused_together(several, scenarios))
        loaded += scenarios
    return loaded


def _sharing(loaded: Iterable[LoadedScenario | Refused]) -> Iterator[LoadedScenario | Refused]:
    """Yield the variations of a scenario, of which each shares the equal parts with the one before."""
    previous: LoadedScenario | Refused | None = None
    for scenario in loaded:
        previous = (
            shared(scenario, previous)
            if isinstance(scenario, LoadedScenario) and isinstance(previous, LoadedScenario)
            else scenario
        )
        yield previous


def shared(loaded: LoadedScenario, previous: LoadedScenario) -> LoadedScenario:
    """Return a scenario that shares the equal parts with a similar one; models and shapes are shared already."""
    # Only variations need it.
    from sim_action.scenario.sharing import share_parts

    return replace(
        loaded,
        scenario=share_parts(loaded.scenario, previous.scenario),
        source=share_parts(loaded.source, previous.source),
        unchecked=share_parts(loaded.unchecked, previous.unchecked),
        warnings=share_parts(loaded.warnings, previous.warnings),
        places=share_parts(loaded.places, previous.places),
    )


def scenarios_of(sources: Iterable[Source | Refused]) -> Iterator[tuple[Source | Refused, ...]]:
    """Yield the variations of each scenario together; a scenario without variations alone."""
    for _, several in groupby(enumerate(sources), lambda pair: _scenario_of(*pair)):
        yield tuple(source for _, source in several)


def _scenario_of(index: int, source: Source | Refused) -> Hashable:
    return (source.path, source.group) if isinstance(source, Source) and source.group is not None else index


def _loaded_or_refused(
    source: Source | Refused, permissions: Permissions, libraries: Libraries
) -> LoadedScenario | Refused:
    if isinstance(source, Refused):
        return source
    try:
        return checked(source, permissions, libraries)
    except errors.InvalidScenario as error:
        return source.refused(error)
    except errors.UsageError:
        raise
    except Exception as error:  # noqa: BLE001 - the other scenarios have results to give
        fault = errors.InternalError.of(error)
        if not isinstance(fault, errors.PackageFault):
            return source.refused(fault)
        place = source.document.path_of_key(fault.part)
        return source.refused(errors.InvalidScenario([source.document.problem(place, str(fault))]))


def build_scene(loaded: LoadedScenario) -> Scene:
    """Return the scene of a scenario; read its model if necessary. Raises ModelError."""
    model = loaded.model or load_model(loaded.scenario.robot, loaded.workspace)
    scene = _scene(loaded.scenario, model, loaded.source, loaded.parts, loaded.places)
    return _with_actors(scene, loaded.scenario, loaded.source, loaded.actor_models)


def _with_actors(scene: Scene, scenario: Scenario, source: Source, models: Mapping[str, RobotModel]) -> Scene:
    """Return a scene with the other robots of its world."""
    actors = {}
    for actor in scenario.world.actors:
        model = models.get(actor.name) or load_model(actor, source.workspace)
        actors[actor.name] = _scene(scenario.as_seen_by(actor), model, source, scene.parts, WorldPlaces())
    if not actors:
        return scene
    robots = {EGO: scene, **actors}
    for own, seen in actors.items():
        others = {name: robot for name, robot in robots.items() if name != own}
        actors[own] = replace(seen, actors=others, shared=scene.shared, owner=own)
    return replace(scene, actors=actors)


def _scene(
    scenario: Scenario, model: RobotModel, source: Source, parts: Mapping[str, tuple[Part, ...]], places: WorldPlaces
) -> Scene:
    return Scene(
        scenario.robot,
        model,
        scenario.world,
        scenario.physics,
        source.workspace,
        scenario.seed,
        parts=parts,
        sensors=tuple(
            Fitting(
                mounted.name, mounted.sensor.key, mounted.link or model.root, mounted.rate, mounted.pose, mounted.sensor
            )
            for mounted in scenario.sensors
        ),
        file=source.document.file,
        variation=source.values_in_file_names,
        acted_on=bool(scenario.commands or scenario.world.disturbances or scenario.events or scenario.world.actors),
        places=places,
        stuck=frozenset(
            fault.target for fault in scenario.faults if fault.stuck and not is_late(fault.at, scenario.time_limit)
        ),
    )


def _in_document(problems: SpecProblems, written: int) -> SpecProblems:
    for path, message in problems:
        index = path[2] if path[:2] == ("world", "objects") and len(path) > 2 else -1
        yield (("world", "file") if isinstance(index, int) and index >= written else path), message


class _Loader:
    """Turns one document into a scenario."""

    def __init__(
        self, source: Source, permissions: Permissions, libraries: Libraries, commands: Unfolded, *, evaluate: bool
    ) -> None:
        self.model: RobotModel | None = None
        self.actor_models: dict[str, RobotModel] = {}
        self.unchecked: tuple[str, ...] = ()
        self.parts: Mapping[str, tuple[Part, ...]] = {}
        self.warnings: tuple[AuditWarning, ...] = ()
        self.places = WorldPlaces()
        self._libraries = libraries
        self._evaluate = evaluate
        self._source = source
        self._data = source.document.data
        self._workspace = source.workspace
        self._permissions = permissions
        self._problems = ProblemList(source.document)
        self._allowed = allowed_rules(self._data) if isinstance(self._data, dict) else frozenset()
        for problem in commands.problems:
            self._problems.note_elsewhere(problem)
        self._parts = PartReader(
            *(source.document, source.workspace, permissions, self._problems, self._allowed), refused=commands.refused
        )

    def load(self) -> Scenario:
        assert isinstance(self._data, dict)  # checked when the file was read
        data = with_robot_of_world(self._data)
        scenario = self._parts.validated(Scenario, self._parts.with_families(data), ())
        if scenario is not None:
            written = len(scenario.world.objects)
            filled_scenario = filled(scenario, self._workspace, self._libraries.worlds, self._problems, self._allowed)
            scenario, self.parts, self.warnings = (
                filled_scenario.scenario,
                filled_scenario.parts,
                filled_scenario.warnings,
            )
            self.places = filled_scenario.places
            # A refused event is missing from the scenario, so others have other places there.
            if scenario.events and not self._problems.has_below(("events",)):
                from sim_action.scenario.events import with_events  # few scenarios have events

                scenario = with_events(scenario)
            self._check(scenario, written, states_drive="drive" in data["robot"])
        if scenario is None or self._problems:
            raise self._problems.error()
        return scenario

    def _check(self, scenario: Scenario, written: int, *, states_drive: bool) -> None:
        """Check the scenario as a whole; `written`: number of bodies that are not from a world file."""
        self._problems.note_all((), _in_document(self._own_problems(scenario), written))
        if not self._problems:  # a source with a problem may be the code
            self._problems.note_all((), scenario_checks.environment_problems(scenario))
        if (gate := self._source.gate) is not None:
            for problem in scenario_checks.gate_problems(gate, self._source, scenario):
                self._problems.note_elsewhere(problem)
        self._take(audit_scenario(scenario, self._parts.expect_paths, self._parts.command_paths))
        self.unchecked = tuple(remark for source in scenario.all_commands for remark in source.unchecked)
        surroundings = read_surroundings(scenario.world, self._workspace, self._libraries.shapes, self.parts)
        self.parts = surroundings.parts
        self._problems.note_all((), iter(surroundings.problems))
        self._problems.note_all((), stage.motion_problems(scenario, self.parts))
        if scenario.world.objects:
            from sim_action.scenario.body_overlaps import clashes  # a usual run does without it

            clashing = clashes(scenario.world)
            overlaps = stage.Clashes.of(scenario.world, clashing, self.places.bodies, self._allowed)
            self._problems.note_all((), overlaps.problems())
            for problem in overlaps.problems_of_file():
                self._problems.note_elsewhere(problem)
        # A robot in a world file has the same problem as the file.
        is_refused = bool(scenario.robot.name_in_world) and self._problems.has_below(("world",))
        self.model = None if is_refused else self._read_model(scenario.robot)
        for actor, _, path in self._actors(scenario):
            if (model := self._read_model(actor, path)) is not None:
                self.actor_models[actor.name] = model
        if len(self.actor_models) < len(scenario.world.actors):
            # What one process alone may read is checked there.
            self.model = None
        if self.model is not None:
            scene = _scene(scenario, self.model, self._source, self.parts, self.places)
            scene = _with_actors(scene, scenario, self._source, self.actor_models)
            self._check_scene(scene, scenario, states_drive=states_drive)

    def _actors(self, scenario: Scenario) -> Iterator[tuple[DrivenActor, OwnPaths, KeyPath]]:
        for index, (actor, paths) in enumerate(zip(scenario.world.actors, self._parts.actor_paths, strict=True)):
            yield actor, paths, ("world", "actors", index)

    def _take(self, findings: Iterable[ClaimFinding]) -> None:
        """Note the errors of the audit of claims, and keep its warnings, except for rules that the scenario allows."""
        kept = [finding for finding in findings if finding.rule not in self._allowed]
        for finding in kept:
            if finding.is_error:
                self._problems.note(finding.path, f"{finding.message} [{finding.rule}]")
        document = self._source.document
        self.warnings += tuple(finding.warning(document) for finding in kept if not finding.is_error)

    def _own_problems(self, scenario: Scenario) -> SpecProblems:
        """Yield the problems that are visible without reading other files."""
        parts = self._parts
        yield from scenario_checks.time_problems(scenario, parts.expect_paths)
        yield from scenario_checks.rate_problems(scenario, parts.command_paths, parts.sensor_paths)
        yield from scenario_checks.transmission_problems(scenario, parts.command_paths, parts.sensor_paths)
        yield from scenario_checks.trace_problems(scenario, parts.sensor_paths)
        yield from scenario_checks.reading_problems(scenario, parts.expect_paths)
        yield from scenario_checks.rule_problems(scenario)
        others = list(scenario.commands)
        for actor, paths, path in self._actors(scenario):
            seen = scenario.as_seen_by(actor)
            yield from scenario_checks.rate_problems(seen, paths.commands, paths.sensors)
            yield from scenario_checks.transmission_problems(seen, paths.commands, paths.sensors)
            yield from _of_actor(scenario_checks.rule_problems(seen), path)
            for at, source in zip(paths.commands, actor.commands, strict=True):
                yield from (((*at, *key), message) for key, message in source.actor_problems(others))
                if not source.is_for_actors:
                    yield at, f"'{source.key}' drives only the robot under test; use a script or a process, or 'ego'"
            others += actor.commands
        yield from unknown_rules(scenario.allow)
        for path, expectation in zip(parts.expect_paths, scenario.expect, strict=True):
            yield from unknown_rules(expectation.allow, path)
        yield from scenario_checks.name_problems(scenario)
        yield from scenario_checks.engine_problems(scenario)
        yield from scenario_checks.compared_body_problems(scenario)
        yield from scenario_checks.patch_problems(scenario)
        has_events = scenario.events or any(expected.since for expected in scenario.expect)
        if has_events and not self._problems.has_below(("events",)):
            from sim_action.scenario.events import event_problems  # few scenarios have events

            yield from event_problems(scenario)

    def _read_model(self, robot: DrivenRobot, path: KeyPath = ("robot",)) -> RobotModel | None:
        """Return the robot model at `path`; None if it has a noted problem, or only the run may read it."""
        wrong = (*package_problems(robot, self._workspace), *srdf_problems(robot, self._workspace))
        if wrong:
            self._problems.note_all((), _of_actor(wrong, path))
            return None
        try:
            if (robot.is_xacro or robot.is_mjcf) and not self._evaluate:
                if robot.is_xacro and self._permissions.scripts_refused:
                    self._problems.note((*path, "model"), self._permissions.scripts_refused)
                self.unchecked += check_text(robot, self._workspace)
                return None
            return self._libraries.models.load(robot, self._workspace)
        except errors.RefusedModel as error:
            # They must be fixed in the model's own file.
            for problem in error.problems:
                self._problems.note_elsewhere(problem)
        except errors.ModelError as error:
            self._problems.note((*path, "model"), str(error))
        return None

    def _check_scene(self, scene: Scene, scenario: Scenario, *, states_drive: bool) -> None:
        own = OwnPaths(self._parts.command_paths, self._parts.sensor_paths)
        self._check_robot(scene, scenario, own, ("robot",), states_drive=states_drive)
        for actor, paths, path in self._actors(scenario):
            # A refused drive is missing from the scenario. That is not a second problem.
            states = actor.drive is not None or self._problems.has_below((*path, "drive"))
            self._check_robot(scene.actors[actor.name], scenario.as_seen_by(actor), paths, path, states_drive=states)
        self._problems.note_all((), scenario_checks.recorded_link_problems(scenario, scene.model))
        self._problems.note_all((), stage.disturbance_problems(scene, scenario.time_limit))
        drive, limit = scenario.robot.drive, scenario.time_limit
        self._problems.note_all((), fault_problems(scenario.faults, scene, drive, scenario.sensors, limit))
        if scenario.events and not self._problems.has_below(("events",)):
            from sim_action.scenario.events import condition_problems  # few scenarios have events

            self._problems.note_all((), condition_problems(scenario, scene))
        if scenario.agreement is not None:
            self._problems.note_all((), scenario_checks.agreement_problems(scene, scenario.agreement))
        for path, expectation in zip(self._parts.expect_paths, scenario.expect, strict=True):
            self._problems.note_all((*path, expectation.assertion.key), expectation.assertion.problems(scene))
        self._take(audit_robot(scene, scenario, self._parts.expect_paths, self._parts.command_paths))
        for path, expectation in zip(self._parts.expect_paths, scenario.expect, strict=True):
            if not self._problems.has_below(path):  # a wrong part is the reason
                self._take(audit_combination(path, expectation, scene))

    def _check_robot(
        self, scene: Scene, scenario: Scenario, paths: OwnPaths, path: KeyPath, *, states_drive: bool
    ) -> None:
        """Check a robot with its commands and sensors; `path`: of the robot."""
        note = self._problems.note_all
        note((), _of_actor(scenario_checks.robot_problems(scenario, scene.model), path))
        note((), _of_actor(scenario_checks.follower_problems(scene), path))
        note((), scenario_checks.source_problems(scenario, scene, paths.commands))
        note((), scenario_checks.sensor_problems(scene, scenario.sensors, paths.sensors))
        # A refused drive is missing from the scenario. That is not a second problem.
        if not states_drive:
            note((), _of_actor(scenario_checks.wheel_problems(scenario, scene, paths.sensors), path))
        for at, source in zip(paths.commands, scenario.commands, strict=True):
            note(at, source.model_problems(scene))


def _of_actor(problems: Iterable[SpecProblem], to: KeyPath) -> SpecProblems:
    for path, message in problems:
        yield ((*to, *path[1:]) if path[:1] == ("robot",) else path), message


def refused_together(
    sources: Sequence[Source | Refused], scenarios: Sequence[LoadedScenario | Refused]
) -> Sequence[LoadedScenario | Refused]:
    """Return all variations of a scenario of which some are refused; all are, unless only drawn values are wrong."""
    refused = [scenario for scenario in scenarios if isinstance(scenario, Refused)]
    alike = len(scenarios) == len(refused) > 1 and len({scenario.problems for scenario in refused}) == 1
    pairs = list(zip(sources, scenarios, strict=True))
    if refused and not alike and any(source.gate is not None for source in sources):
        # A gate without some of its runs has no verdict, so none of them is worth its time.
        advised = [_with_advice(source, refusal) for source, refusal in pairs if isinstance(refusal, Refused)]
        drawn = {place for source in sources if isinstance(source, Source) for place, _ in source.draws}
        return [_counted_by_sample(_as_one(advised, sources[0].number), advised, drawn, len(sources))]
    if alike or any(isinstance(scenario, Refused) and not _is_of_draws(source, scenario) for source, scenario in pairs):
        return [_as_one(refused, sources[0].number)]
    return [
        source.refused_alone(scenario) if isinstance(source, Source) and isinstance(scenario, Refused) else scenario
        for source, scenario in pairs
    ]


def _with_advice(source: Source | Refused, refused: Refused) -> Refused:
    """Return a refusal, with advice for values that were drawn."""
    if not isinstance(source, Source) or not source.is_of_draws(refused):
        return refused
    alone = source.refused_alone(refused)
    return replace(alone, name=refused.name, group=None, variation=(), gate=None)


def _counted_by_sample(
    whole: Refused, refused: Sequence[Refused], drawn: AbstractSet[errors.Location], samples: int
) -> Refused:
    """Return a refusal with one problem for each drawn value: the first one, and the number of samples that have one.

    Args:
        whole: with all problems.
        refused: the samples that cannot run.
        drawn: the places of drawn values.
        samples: the number of samples.
    """
    if isinstance(whole.error, errors.InternalError):
        return whole
    counts = Counter(
        place for refusal in refused for place in {problem.location for problem in refusal.problems} & drawn
    )
    problems: dict[object, errors.Problem] = {}
    for problem in whole.problems:
        place = problem.location
        if place not in drawn:
            problems[problem] = problem
        elif place not in problems:
            text = f"{problem.message}; {counts[place]:,} of {counted(samples, 'sample')} have a problem here"
            problems[place] = errors.Problem(place, text)
    return replace(whole, error=errors.InvalidScenario(problems.values()))


def _is_of_draws(source: Source | Refused, refused: Refused) -> bool:
    return isinstance(source, Source) and source.is_of_draws(refused)


def _as_one(refused: Sequence[Refused], number: int) -> Refused:
    """Return one refusal with the problems of all variations, each once.

    A fault of sim-action is reported alone, as it may hide other problems. `number`: of the first variation, where the
    refusal is reported.
    """
    if fault := next((refusal for refusal in refused if isinstance(refusal.error, errors.InternalError)), None):
        return replace(fault, number=number)
    problems: list[errors.Problem] = []
    messages: set[str] = set()
    for refusal in refused:
        problems += [problem for problem in refusal.problems if problem.message not in messages]
        messages.update(problem.message for problem in refusal.problems)
    return replace(refused[0], error=errors.InvalidScenario(problems), number=number)
