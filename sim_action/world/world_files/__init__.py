"""World files of Gazebo (SDF, sdformat.org/spec): their models as bodies, one of them as the robot, and the losses.

Scenarios and the simulation of ROS 1 launch files read worlds here. Files are found by `Packages`, which lets no file
outside the workspace be read without permission.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.etree.ElementTree import Element

from pydantic import ValidationError

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass, field
from sim_action.robot.documents.packages import NEWEST, Packages
from sim_action.robot.documents.sdf_elements import Notes, flag_attribute, numbers_of, pose_of
from sim_action.robot.documents.urdf_elements import plugin_name
from sim_action.robot.documents.xml_document import ModelDocument, read_document
from sim_action.robot.model.findings import Finding, refuse_errors
from sim_action.robot.reading.sdf.composition import Entry
from sim_action.robot.reading.sdf.worlds import SdfWorld, base_pose, is_ground, read_sdf_world
from sim_action.world import GRAVITY, Ground, World
from sim_action.world.world_files.losses import HARMLESS_WORLD_PLUGINS, Loss, LossList, lost_parts
from sim_action.world.world_files.world_bodies import BodyReader, ReadBody, ShapeReader, said

if TYPE_CHECKING:
    from sim_action.world.parts import Part

__all__ = ["Loss", "WorldFile", "WorldRobot", "plugin_names", "read_world_file"]

_MISSING: Final = frozenset({"missing-include", "missing-package"})
"""Rules of findings that make a model missing from the world."""

_LEVEL_M: Final = 1e-3  # m, and a part of a direction: a greater pose of the ground is noted
_ABSENT: Final = "an included model that is missing"


@dataclass(frozen=True, eq=False)
class WorldRobot:
    """The model of a world that is the robot."""

    name: str
    entry: Entry  # the model, or the <include>
    pose: Pose  # pose of the model in the world
    base: Pose | None  # pose of its root link in the world; None if it is fixed to the world
    place: Location | None = None  # in the file


@dataclass(frozen=True, eq=False)
class WorldFile:
    """The content of a world file."""

    world: World
    # name of a body -> its parts, for bodies whose shapes are in files
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    robot: WorldRobot | None = None
    models: tuple[str, ...] = ()  # the names of all models
    losses: tuple[Loss, ...] = ()  # the parts that are not simulated
    remarks: tuple[Finding, ...] = ()  # warnings about the file
    stated: frozenset[str] = frozenset()  # the keys of `world` that the file states, besides its objects
    has_ground: bool = True  # True if the file has a ground plane
    places: Mapping[str, Location] = field(default_factory=dict)  # name of a body -> the place of its model in the file


def read_world_file(
    path: Path, packages: Packages, is_robot: Callable[[Entry], bool], document: ModelDocument | None = None
) -> WorldFile:
    """Read a world file. Raises ModelError.

    `path`: the file, which may be read; `is_robot`: returns True for a model that can be the robot; the first one is;
    `document`: the content of the file, if it was read already.
    """
    notes = Notes()
    world = read_sdf_world(path.resolve(), document or read_document(path), packages, notes)
    world_file = _WorldReader(world, packages, notes).read(is_robot)
    refuse_errors(finding for finding in notes.findings if finding.level == "fatal" and finding.rule not in _MISSING)
    return world_file


class _WorldReader:
    """The state of reading one world."""

    def __init__(self, world: SdfWorld, packages: Packages, notes: Notes) -> None:
        self._world, self._notes = world, notes
        self._losses = LossList(notes.places)
        self._shapes = ShapeReader(packages, self._losses, notes, has_ground=world.has_ground)
        self._bodies = BodyReader(world, self._shapes, self._losses)
        self._robot: WorldRobot | None = None

    def read(self, is_robot: Callable[[Entry], bool]) -> WorldFile:
        """Read the world; problems become findings."""
        element = self._world.element
        for tag, message in lost_parts(element):
            self._losses.add(tag, message)
        if self._world.version > NEWEST:
            own, newest = (".".join(map(str, version)) for version in (self._world.version, NEWEST))
            message = f"SDF {own} is newer than {newest}, and is read as that version"
            self._losses.remark(element, message, message)
        for wind in element.findall("wind/linear_velocity"):
            if any(self._notes.attempt(lambda tag: numbers_of(tag, 3), wind) or ()):
                message = f"<wind> is not simulated: there is no wind of {(wind.text or '').strip()} m/s"
                self._losses.remark(wind, message, message)
        for include in element.findall("include"):
            self._notes.attempt(self._note_include, include)
        for model, name in self._world.renamed.items():
            message = f"a second model '{name}' has another name here, with a number at its end"
            self._losses.remark(model, message, "models with the name of another one: they get a number")
        self._note_state(element.find("state"))
        bodies = [body for model in self._world.models.values() for body in self._read_model(model, is_robot)]
        self._notes.attempt(self._bodies.note_contact_bits, self._world.models.values())
        for plugin in element.findall("plugin"):
            if (name := plugin_name(plugin)) not in HARMLESS_WORLD_PLUGINS:
                message = f"the plugin {name} of the world is not supported and has no effect"
                self._losses.add(plugin, message)
        missing = tuple(
            Loss(message=finding.message, location=finding.location, kind=_ABSENT, is_missing=True)
            for finding in self._notes.findings
            if finding.rule in _MISSING
        )
        stated = dict(self._stated())
        return WorldFile(
            self._made({**stated, "objects": tuple(body.body for body in bodies)}),
            {body.body.name: body.parts for body in bodies if body.parts is not None},
            self._robot,
            tuple(self._world.models),
            (*missing, *self._losses.entries),
            tuple(finding for finding in self._notes.findings if finding.level == "warning"),
            frozenset(stated),
            self._shapes.has_ground,
            {body.body.name: body.place for body in bodies if body.place is not None},
        )

    def _made(self, keys: Mapping[str, Any]) -> World:
        """Return a world; a problem becomes a finding."""
        try:
            return World.model_validate(keys)
        except ValidationError as error:
            self._notes.add("bad-number", self._world.element, said(error))
            return World()

    def _stated(self) -> Iterator[tuple[str, Any]]:
        """Yield the gravity and the ground, if the file states them."""
        element = self._world.element
        # Up to SDF 1.5, gravity is a part of <physics>.
        stated = element.find("gravity")
        stated = element.find("physics/gravity") if stated is None else stated
        gravity = None if stated is None else self._notes.attempt(lambda tag: numbers_of(tag, 3), stated)
        if gravity is not None and gravity != (0.0, 0.0, -GRAVITY):
            yield "gravity", gravity
        if (friction := self._shapes.ground_friction) is not None and friction != Ground().friction:
            yield "ground", Ground(friction=friction)

    def _note_include(self, include: Element) -> None:
        """Note an <include> whose model is missing, or not at its pose. Raises SdfProblem."""
        if flag_attribute(include, "merge"):
            message = "an <include merge> in <world> is not supported and its model is missing: remove 'merge'"
            self._losses.add(include, message, is_missing=True)
        pose = pose_of(include.find("pose"))
        up = geometry.rotate(pose.orientation_xyzw, (0.0, 0.0, 1.0))
        if is_ground(include) and (abs(pose.position_xyz[2]) > _LEVEL_M or math.hypot(*up[:2]) > _LEVEL_M):
            message = "the <pose> of the ground plane is not simulated: the ground is z = 0; move the other models"
            self._losses.add(include, message)

    def _note_state(self, state: Element | None) -> None:
        """Note the losses in the models of a <state>."""
        for model in () if state is None else state.findall("model"):
            for holder in (model, *model.findall("link")):
                for tag, message in lost_parts(holder, f"state/{holder.tag}"):
                    self._losses.add(tag, message)

    def _read_model(self, model: Entry, is_robot: Callable[[Entry], bool]) -> Iterator[ReadBody]:
        if self._robot is None and is_robot(model):
            pose = self._notes.attempt(self._world.pose, model)
            base = self._notes.attempt(lambda name: base_pose(self._world, name), model.name)
            self._robot = WorldRobot(model.name, model, pose or Pose(), base, self._notes.places.get(model.element))
            return
        if plugins := plugin_names(model):
            message = f"'{model.name}' is simulated as a body, not as a robot; its plugins have no effect"
            kind = "a model with plugins is simulated as a body, not as a robot; its plugins have no effect"
            self._losses.add(model.element, f"{message}: {', '.join(plugins)}", kind=kind)
        yield from self._notes.attempt(lambda model: list(self._bodies.bodies(model)), model) or ()


def plugin_names(model: Entry) -> list[str]:
    """Return the plugins of a model, of the models in it, and of their sensors."""
    flat = model.flat_model
    return [*map(plugin_name, (*flat.iterfind("plugin"), *flat.iterfind("link/sensor/plugin")))]
