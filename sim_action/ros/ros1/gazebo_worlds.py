"""Gazebo worlds of ROS 1: finding the file, the robot in it, and models that nodes spawn.

`sim_action.world.world_files` reads the files. A loss reports everything that is left out.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Container, Iterable
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.errors import ModelError
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.xml_document import ModelDocument, parse_document, read_document
from sim_action.robot.reading.sdf.composition import Entry
from sim_action.world import Body, World
from sim_action.world.world_files import Loss, WorldFile, plugin_names, read_world_file

_EMPTY_WORLD: Final = Path("worlds/empty.world")
"""Gazebo's own world, which has only a ground and a light."""


class BadWorld(Exception):
    """A world, or a model in it, that cannot be read."""


class MissingWorld(BadWorld):
    """A world file that does not exist; `path`: its name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        there = [file.name for file in path.parent.glob("*.world")] if path.is_absolute() else []
        near = did_you_mean(path.name, there) if there else ""
        advice = "add the file, or correct the name of the world"
        if not path.is_absolute():
            own = f"of Gazebo's own worlds, sim-action has only {_EMPTY_WORLD}"
            advice = f"{own}; for a world of a package, give its path: $(find PACKAGE)/..."
        super().__init__(f"the world file '{path}' does not exist{near}; {advice}")


@dataclass(frozen=True, slots=True)
class WorldRobot:
    """The robot of a world, in SDF; `file`: of its description; None if it is in the world file itself."""

    name: str
    description: str
    pose: Pose
    file: Path | None = None


@dataclass(frozen=True, slots=True)
class GazeboWorld:
    """The content of a .world file; `losses`: what was left out."""

    world: World
    robot: WorldRobot | None
    losses: tuple[Loss, ...]


def find_world(stated: str) -> Path | None:
    """Return the path of a world file; None for Gazebo's own empty world. Raises MissingWorld."""
    path = Path(stated)
    folders = [Path(folder) for folder in os.environ.get("GAZEBO_RESOURCE_PATH", "").split(os.pathsep) if folder]
    for file in (path, *(folder / path for folder in folders)):
        if file.is_absolute() and file.is_file():
            return file
    if path == _EMPTY_WORLD or (path.parts[-2:] == _EMPTY_WORLD.parts and path.parent.parent.name[:6] == "gazebo"):
        return None
    # The packages of a launch are links.
    raise MissingWorld(path.resolve() if path.is_absolute() else path)


def read_world(path: Path, folders: tuple[Path, ...], known: Container[str]) -> GazeboWorld:
    """Read a .world file; `folders`: for `model://`; `known`: plugins that make a model a robot. Raises BadWorld."""
    if not path.is_file():
        raise MissingWorld(path)
    document = _read(path, path.resolve())
    found = _converted(path, document, folders, lambda model: _drives(model, known))
    robot = None
    if found.robot is not None:
        entry, version = found.robot.entry, document.root.get("version", "1.6")
        assert entry.scope is not None
        # With plugins of the include, the file is not the whole description.
        is_file = entry.element is not entry.scope.element and not entry.included_plugins
        file = entry.scope.file.path if is_file else None
        text = f'<sdf version="{version}">{ET.tostring(entry.whole_model, encoding="unicode")}</sdf>'
        description = text if file is None else file.read_text(encoding="utf-8")
        robot = WorldRobot(found.robot.name, description, found.robot.pose, file)
    return GazeboWorld(found.world, robot, _without_remarks(found))


def body_of(name: str, description: str, pose: Pose) -> tuple[Body, tuple[Loss, ...]]:
    """Return a body and its losses, from the SDF of a model that nodes spawn. Raises BadWorld."""
    document = _read(Path("spawned"), description.encode())
    model = document.root if document.root.tag == "model" else document.root.find("model")
    if model is None:
        raise BadWorld("it has no <model>")
    model.set("name", name)
    for stated in model.findall("pose"):
        model.remove(stated)
    at = ET.SubElement(model, "pose", rotation_format="quat_xyzw")
    at.text = " ".join(map(repr, (*pose.position_xyz, *pose.orientation_xyzw)))
    world = ET.Element("world")
    world.append(model)
    root = ET.Element("sdf", version=document.root.get("version", "1.6"))
    root.append(world)
    places = {**document.places, **dict.fromkeys((at, world, root), document.places[model])}
    found = _converted(Path("spawned"), ModelDocument(root, places), model_folders(), lambda _: False)
    bodies = found.world.objects
    if len(bodies) != 1:
        raise BadWorld(f"a model that is spawned must be one body with a collision shape, found {len(bodies)}")
    return bodies[0].model_copy(update={"name": name}), _without_remarks(found)


def model_folders() -> tuple[Path, ...]:
    """Return the folders in which Gazebo searches for models, from GAZEBO_MODEL_PATH."""
    return tuple(Path(folder) for folder in os.environ.get("GAZEBO_MODEL_PATH", "").split(os.pathsep) if folder)


def _drives(model: Entry, known: Container[str]) -> bool:
    return model.scope is not None and not model.scope.static and any(name in known for name in plugin_names(model))


def _without_remarks(found: WorldFile) -> tuple[Loss, ...]:
    return tuple(loss for loss in found.losses if not loss.is_remark)


def _read(path: Path, source: Path | bytes) -> ModelDocument:
    try:
        return read_document(source) if isinstance(source, Path) else parse_document(source, str(path))
    except ModelError as error:
        raise BadWorld(str(error)) from None


def _converted(
    path: Path, document: ModelDocument, folders: Iterable[Path], is_robot: Callable[[Entry], bool]
) -> WorldFile:
    environment = {**os.environ, "GAZEBO_MODEL_PATH": os.pathsep.join(map(str, folders))}
    # The nodes of the launch run with the rights of the job; they can read any file.
    workspace = Workspace(path.resolve().parent, path.resolve().parent, allow_outside=True)
    try:
        return read_world_file(path, Packages(workspace, environment=environment), is_robot, document)
    except ModelError as error:
        raise BadWorld(f"{path}: {error}") from None
