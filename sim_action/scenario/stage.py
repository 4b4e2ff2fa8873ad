"""The stage of a scenario: its world file is read into it, and its moving bodies and disturbances are checked.

`world: {file: ..., robot: NAME}` adds bodies, ground and losses of the file, and maybe the robot. The checks are about
times, speeds and names, and about bodies that overlap.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, Self

from sim_action.core import units
from sim_action.core.errors import Location, ModelError, Problem, RefusedModel
from sim_action.core.field_types import Placement
from sim_action.core.records import dataclass, field
from sim_action.core.wording import did_you_mean, first_of
from sim_action.core.workspace import PathError, Workspace, similar_name
from sim_action.core.yaml_document import KeyPath, ProblemList, SpecProblems
from sim_action.robot.documents.packages import Packages
from sim_action.robot.model.joint_selection import links_with_shapes
from sim_action.robot.model.robot_spec import IN_WORLD
from sim_action.scenario.model import Scenario
from sim_action.state.observation import Clash
from sim_action.state.timeline import is_late, late_problems
from sim_action.world import GROUND, Body, Disturbance, Physics, World, placed
from sim_action.world.body import placements
from sim_action.world.claims import INCOMPLETE_WORLD, NOT_SIMULATED, OVERLAPPING_BODIES, AuditWarning
from sim_action.world.scene import Scene, WorldPlaces

if TYPE_CHECKING:
    from sim_action.world.parts import Part
    from sim_action.world.world_files import WorldFile


_FILE: KeyPath = ("world", "file")
_SUFFIXES: Final = (".world", ".sdf")
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
        world_file = self._worlds[key]
        if isinstance(world_file, ModelError):
            raise world_file.with_traceback(None)
        return world_file


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
        world_file = library.load(world.file, world.robot, workspace, scenario.robot.packages)
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
    _note_names(scenario, world_file, problems)
    _note_missing(world_file, problems, allowed)
    stated = {key: getattr(world_file.world, key) for key in world_file.stated if key not in world.model_fields_set}
    # A second body of the same name is reported already.
    names = {body.name for body in world.objects}
    objects = (*world.objects, *(body for body in world_file.world.objects if body.name not in names))
    changed: dict[str, Any] = {"world": world.model_copy(update={**stated, "objects": objects})}
    base = world_file.robot.base if world_file.robot is not None else None
    if base is not None and "pose" not in scenario.robot.model_fields_set:
        changed["robot"] = scenario.robot.model_copy(update={"pose": Placement.of(base)})
    place = world_file.robot.place if world_file.robot is not None and "robot" in changed else None
    warnings = tuple(_warnings(world_file, Location(world.file), allowed))
    places = WorldPlaces({name: at for name, at in world_file.places.items() if name not in names}, place)
    return FilledScenario(scenario.model_copy(update=changed), world_file.parts, warnings, places)


def _nearest_file(file: str, workspace: Workspace) -> str:
    """Return a hint with a similar name in the same folder of the workspace, if there is one."""
    try:
        path = (workspace.directory / file).resolve()
    except (OSError, ValueError, RuntimeError):
        return ""
    return "" if workspace.refusal(path.parent) is not None else similar_name(path, _SUFFIXES)


def _note_names(scenario: Scenario, world_file: WorldFile, problems: ProblemList) -> None:
    name, file = scenario.world.robot, scenario.world.file
    if name is not None and world_file.robot is None:
        problems.note(("world", "robot"), f"{file} has no model '{name}'{did_you_mean(name, world_file.models)}")
    body_names = {body.name for body in world_file.world.objects}
    for index, body in enumerate(scenario.world.objects):
        if body.name in body_names:
            message = f"{file} has a body '{body.name}', too; names are unique: give this one another name"
            problems.note(("world", "objects", index, "name"), message)


def _note_missing(world_file: WorldFile, problems: ProblemList, allowed: AbstractSet[str]) -> None:
    if INCOMPLETE_WORLD in allowed:
        return
    same: dict[str, list[tuple[Location, str]]] = {}
    for loss in world_file.losses:
        if loss.is_missing and loss.location is not None:
            # The rest of a message is where it was searched, and a hint that only the first few have.
            same.setdefault(loss.message.partition(" (")[0], []).append((loss.location, loss.message))
    for places in same.values():
        (first, message), *others = places
        lines = first_of([str(place) for place, _ in others], _MAX_LINES)
        also = f"; {len(places)} times, also at {lines}" if others else ""
        remedy = f"to run without it: allow: [{INCOMPLETE_WORLD}]"
        problems.note_elsewhere(Problem(first, f"{message}{also}; {remedy} [{INCOMPLETE_WORLD}]"))


def _warnings(world_file: WorldFile, location: Location, allowed: AbstractSet[str]) -> Iterator[AuditWarning]:
    from sim_action.world.world_files.losses import by_kind  # a usual run does without it

    for loss in by_kind(world_file.losses):
        rule = INCOMPLETE_WORLD if loss.is_missing else NOT_SIMULATED
        if loss.is_missing or rule not in allowed:
            yield AuditWarning(rule=rule, message=loss.message, location=loss.location or location)
    if NOT_SIMULATED not in allowed:
        for remark in world_file.remarks:
            yield AuditWarning(rule=NOT_SIMULATED, message=remark.message, location=remark.location)
        if not world_file.has_ground:
            message = f"{location.file} has no ground plane; the ground z = 0 is there all the same"
            yield AuditWarning(rule=NOT_SIMULATED, message=message, location=location)


DEPTH: Final = 0.005  # m. A smaller overlap is a contact, such as of fingers; it is resolved while the robot settles.

MAX_FILE_OVERLAP_M: Final = 0.02
"""Bodies of a world file that begin deeper in each other are an error; engines move others apart without a throw."""

_MAX_NAMED: Final = 3
_REMEDY: Final = f"run with it: allow: [{OVERLAPPING_BODIES}] [{OVERLAPPING_BODIES}]"
_ADVISED: Final = 0.001  # advised times are rounded up to this step in s


def motion_problems(scenario: Scenario, parts: Mapping[str, Sequence[Part]]) -> SpecProblems:
    """Yield bodies that move too fast, in no time, or after the end; `parts`: of each body of a file."""
    for index, body in enumerate(scenario.world.objects):
        limit = scenario.time_limit
        yield from late_problems(("world", "objects", index, "appears"), body.appears, limit)
        yield from late_problems(("world", "objects", index, "disappears"), body.disappears, limit)
        own = body.parts() if not body.is_read else parts.get(body.name)
        # An unreadable file is reported elsewhere.
        start = (
            body.pose.model_copy(update={"z": placed(body, own).position_xyz[2]}) if body.path and own else body.pose
        )
        for below, message in _path_problems(body, start, scenario.physics, limit):
            yield ("world", "objects", index, "path", *below), message


def disturbance_problems(scene: Scene, time_limit: float) -> SpecProblems:
    """Yield disturbances after the end, of missing bodies or links, or of fixed ones."""
    for index, disturbance in enumerate(scene.world.disturbances):
        problems = (
            *_time_problems(disturbance, time_limit),
            *_target_problems(disturbance, scene),
            *_speed_problems(disturbance, scene.physics),
        )
        for below, message in problems:
            yield ("world", "disturbances", index, *below), message


def paths_of(world: World) -> dict[str, KeyPath]:
    """Return name of a body or another robot -> its keys."""
    objects, actors = ((entry.name for entry in group) for group in (world.objects, world.actors))
    paths: dict[str, KeyPath] = {name: ("world", "objects", index) for index, name in enumerate(objects)}
    return paths | {name: ("world", "actors", index) for index, name in enumerate(actors)}


@dataclass(frozen=True, slots=True)
class Clashes:
    """The moving bodies that begin inside something, each once, the deepest first."""

    paths: Mapping[str, KeyPath]  # name of a body or another robot -> its keys
    places: Mapping[str, Location]  # name of a body of the world file -> its place
    own: tuple[Clash, ...]  # clashes with a body of the scenario
    of_file: tuple[Clash, ...]  # clashes of bodies of the world file only, or with the ground
    are_allowed: bool  # True if none of them is an error

    @classmethod
    def of(
        cls, world: World, overlaps: Iterable[Clash], places: Mapping[str, Location], allowed: Collection[str] = ()
    ) -> Self:
        """Return the clashes that are deeper than a contact; `allowed`: the rules that the scenario allows."""
        deepest: dict[str, Clash] = {}
        for clash in sorted(overlaps, key=lambda clash: -clash.depth):
            if clash.depth > DEPTH:
                deepest.setdefault(clash.body, clash)
        theirs = {*places, GROUND}
        of_file = tuple(clash for clash in deepest.values() if {clash.body, clash.other} <= theirs)
        own = tuple(clash for clash in deepest.values() if clash not in of_file)
        return cls(paths_of(world), places, own, of_file, OVERLAPPING_BODIES in allowed)

    def problems(self) -> SpecProblems:
        """Yield the problems of bodies of the scenario."""
        for clash in () if self.are_allowed else self.own:
            name = clash.other if clash.body in self.places else clash.body
            move = f"move {'it' if name == clash.body else repr(name)}"
            message = f"{_in_other(clash)}, which would throw it out; {move}, or {_REMEDY}"
            yield (*self.paths[name], "pose"), message

    def problems_of_file(self) -> Iterator[Problem]:
        """Yield one problem about all bodies of the world file that begin too deep in others."""
        deep = [clash for clash in self.of_file if clash.depth > MAX_FILE_OVERLAP_M]
        if not deep or self.are_allowed:
            return
        limit, place = units.display(MAX_FILE_OVERLAP_M, "m"), self.places[deep[0].body]
        if len(deep) == 1:
            message = f"{_in_other(deep[0])}, which would throw it out; at most {limit} is allowed"
        else:
            begin = f"{len(deep)} bodies begin more than {limit} deep in others, which would throw them out"
            message = f"{begin}: {_few(deep)}"
        yield Problem(place, f"{message}; move {'it' if len(deep) == 1 else 'them'}, or {_REMEDY}")

    def notes(self) -> Iterator[str]:
        """Yield a note on bodies that the engine throws out, and one on bodies of the file that it moves apart."""
        if self.are_allowed and (deep := self._deep):
            bodies = "1 body begins inside another, and the engine throws it out"
            if len(deep) > 1:
                bodies = f"{len(deep)} bodies begin inside others, and the engine throws them out"
            yield f"{bodies}: {_few(deep)}"
        shallow = [clash for clash in self.of_file if clash.depth <= MAX_FILE_OVERLAP_M]
        if not shallow:
            return
        bodies = "1 body of the world file begins" if len(shallow) == 1 else f"{len(shallow)} bodies begin"
        place = self.places[shallow[0].body]
        yield f"{bodies} a little inside others, and the engine moves them apart: {_few(shallow)} ({place})"

    @property
    def _deep(self) -> tuple[Clash, ...]:
        deep = (*self.own, *(clash for clash in self.of_file if clash.depth > MAX_FILE_OVERLAP_M))
        return tuple(sorted(deep, key=lambda clash: -clash.depth))


def _few(clashes: Sequence[Clash]) -> str:
    return first_of([*map(_in_other, clashes)], _MAX_NAMED)


def _in_other(clash: Clash) -> str:
    where = "the ground" if clash.other == GROUND else f"'{clash.other}'"
    return f"'{clash.body}' begins {units.display(clash.depth, 'm')} deep in {where}"


def _path_problems(body: Body, pose: Placement, physics: Physics, limit: float) -> SpecProblems:
    places = placements(pose, body.path)
    if body.path and body.path[0].at >= limit:
        yield (0, "at"), f"{body.path[0].at:g} s is not earlier than time_limit ({limit:g} s): the body never moves"
    for index, ((before, start), (point, end)) in enumerate(pairwise(zip(body.path, places, strict=True)), start=1):
        if point.at <= before.at:
            earlier = f"must be later than the point before it, at {before.at:g} s"
            yield (index, "at"), f"{earlier}; a body cannot be at two places at the same time"
            continue
        if before.at >= limit > body.path[0].at:
            yield (index, "at"), f"the run ends before the body gets there: time_limit is {limit:g} s"
        for way, unit, bound, key in (
            (_way(start, end), "m", physics.max_speed, "max_speed"),
            (_turn(start, end), "rad", physics.max_turn_rate, "max_turn_rate"),
        ):
            speed = way / (point.at - before.at)
            if speed > bound:
                speed_text = (
                    f"{units.display(way, unit)} from {before.at:g} s on is {units.display(speed, f'{unit}/s')}"
                )
                most = f"more than physics.{key}, {units.display(bound, f'{unit}/s')}"
                least = math.ceil(way / bound / _ADVISED) * _ADVISED
                yield (index,), f"{speed_text}, {most}; it needs {least:.4g} s at least"


def _way(start: Placement, end: Placement) -> float:
    return math.dist((start.x, start.y, start.z or 0.0), (end.x, end.y, end.z or 0.0))


def _turn(start: Placement, end: Placement) -> float:
    return abs(end.roll - start.roll) + abs(end.pitch - start.pitch) + abs(end.yaw - start.yaw)


def _time_problems(disturbance: Disturbance, limit: float) -> SpecProblems:
    yield from late_problems(("at",), disturbance.at, limit)
    if disturbance.at < limit and disturbance.duration is not None and disturbance.end > limit:
        yield ("for",), f"it acts until {disturbance.end:g} s, but the run ends at time_limit ({limit:g} s)"


def _speed_problems(disturbance: Disturbance, physics: Physics) -> SpecProblems:
    """Yield pushes that would make the robot count as unstable. Bodies never do."""
    speed = math.hypot(*disturbance.velocity or ())
    if disturbance.body is None and speed > physics.max_speed:
        speed_text, bound = (units.display(value, "m/s") for value in (speed, physics.max_speed))
        yield ("velocity",), f"a push of {speed_text} is more than physics.max_speed, {bound}"


def _target_problems(disturbance: Disturbance, scene: Scene) -> SpecProblems:
    if disturbance.body is not None:
        yield from _body_problems(disturbance, disturbance.body, scene)
        return
    default = scene.model.root if disturbance.payload is None else scene.load_link
    link = scene.model.link_of(disturbance.link or default)
    where = ("link",) if disturbance.link else ()
    if scene.model.mjcf and (actuator := scene.model.mjcf.adhesion.get(disturbance.link or "")):
        if disturbance.adhesion is None:
            yield where, f"'{disturbance.link}' is an <adhesion> actuator: give 'adhesion', or name its link '{link}'"
        elif disturbance.adhesion > actuator[1]:
            most = units.display(actuator[1], "N")
            yield ("adhesion",), f"the actuator '{disturbance.link}' holds with {most} at most"
    if link not in scene.model.links_by_name and link in scene.world.names:
        yield where, f"the robot has no link '{link}'; say body: {link}"
    elif disturbance.adhesion is not None and link not in (shaped := links_with_shapes(scene.model)):
        hint = did_you_mean(link, shaped)
        yield where, f"the robot has no link '{link}' with a collision shape, so nothing touches it{hint}"
    elif disturbance.adhesion is None and (problem := scene.why_not_moved(link)) is not None:
        yield where, problem
    elif disturbance.payload is not None:
        yield from _payload_problems(disturbance, link, scene)
    elif disturbance.velocity is not None and (link != scene.model.root or scene.bolted):
        base = scene.model.root
        way = "give the link a 'force' for a short time" if scene.bolted else f"name its base link '{base}', or give"
        way = way if scene.bolted else f"{way} this one a 'force' for a short time"
        yield where, f"a push of 'velocity' moves the robot as a whole; {way}"


def _payload_problems(disturbance: Disturbance, link: str, scene: Scene) -> SpecProblems:
    """Yield a payload that takes all of the mass that is left of a link, or of which another one is a part."""
    taken = [
        other.payload or 0.0
        for other in scene.world.disturbances
        if (other.link or scene.load_link) == link and other.at < disturbance.end and disturbance.at < other.end
    ]
    mass = scene.model.links_by_name[link].mass or 0.0
    if mass + sum(min(0.0, payload) for payload in taken) <= 0.0 and min(taken) < 0.0:
        yield ("payload",), f"link '{link}' has only {units.display(mass, 'kg')}, and some of it must be left"
    elif not mass:
        yield ("link",), f"link '{link}' has no mass of its own; load the link that it is fixed to"


def _body_problems(disturbance: Disturbance, name: str, scene: Scene) -> SpecProblems:
    bodies = {body.name: body for body in scene.world.objects}
    body = bodies.get(name)
    if name in scene.actors:
        if scene.actors[name].bolted and disturbance.adhesion is None:
            yield ("body",), f"'{name}' is fixed to the world, so nothing moves it"
    elif body is None:
        hint = f"; say link: {name}" if name in scene.model.links_by_name else did_you_mean(name, scene.world.names)
        yield ("body",), f"there is no body '{name}'{hint}"
    elif body.mass is None and disturbance.adhesion is None:
        why = "goes its way" if body.path else "is fixed"
        yield ("body",), f"body '{name}' {why} whatever acts on it; only one with a 'mass' can be disturbed"
    elif body.appears is not None and is_late(body.appears, disturbance.at) and body.appears > disturbance.at:
        yield ("at",), f"body '{name}' is not there before it appears, at {body.appears:g} s"
