"""Gazebo worlds of ROS 1: finding the file, the robot in it, and models that nodes spawn.

`sim_action.world.world_files` reads the files, in which `load_model` finds the robot by its name.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core.errors import ModelError
from sim_action.core.geometry import Pose
from sim_action.core.wording import did_you_mean
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.xml_document import ModelDocument, parse_document, read_document
from sim_action.robot.reading.sdf.composition import Entry
from sim_action.ros.ros1.gazebo_plugins import DRIVE_PLUGINS
from sim_action.world import Body
from sim_action.world.world_files import Loss, WorldFile, plugin_names, read_world_file
from sim_action.world.world_files.losses import by_kind

_EMPTY_WORLD: Final = Path("worlds/empty.world")  # Gazebo's own world, which has only a ground and a light


class BadWorld(Exception):
    """A world, or a model in it, that cannot be read."""


class MissingWorld(BadWorld):
    """A world file that does not exist; `path`: its name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        worlds = [file.name for file in path.parent.glob("*.world")] if path.is_absolute() else []
        near = did_you_mean(path.name, worlds) if worlds else ""
        advice = "add the file, or correct the name of the world"
        if not path.is_absolute():
            own = f"of Gazebo's own worlds, sim-action has only {_EMPTY_WORLD}"
            advice = f"{own}; for a world of a package, give its path: $(find PACKAGE)/..."
        super().__init__(f"the world file '{path}' does not exist{near}; {advice}")


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


def read_world(path: Path) -> WorldFile:
    """Read a .world file; the first model with a plugin that drives is the robot. Raises BadWorld."""
    return _converted(path, _read(path, path.resolve()), _drives)


def body_of(name: str, description: str, pose: Pose) -> tuple[Body, tuple[Loss, ...]]:
    """Return a body and its losses, from the SDF of a model that nodes spawn. Raises BadWorld."""
    read = _spawned(name, description, pose, lambda _: False)
    bodies = read.world.objects
    if len(bodies) != 1:
        raise BadWorld(f"a model that is spawned must be one body with a collision shape, found {len(bodies)}")
    return bodies[0].model_copy(update={"name": name}), remarks_once(read.losses)


def remarks_once(losses: Collection[Loss]) -> tuple[Loss, ...]:
    """Return all losses of a world, and one remark of each kind."""
    remarks = by_kind(loss for loss in losses if loss.is_remark)
    return (*(loss for loss in losses if not loss.is_remark), *remarks)


def flat_robot(root: Element, description: str) -> Element:
    """Return a URDF as it is, and an SDF that nodes spawn with the plugins and links of all models in it."""
    # The reader of models has the message about an SDF that cannot be read.
    with suppress(BadWorld):
        if root.tag != "robot" and (robot := _spawned("robot", description, Pose(), lambda _: True).robot) is not None:
            return robot.entry.flat_model
    return root


def _spawned(name: str, description: str, pose: Pose, is_robot: Callable[[Entry], bool]) -> WorldFile:
    """Return a world with a model that nodes spawn. Raises BadWorld."""
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
    return _converted(Path("spawned"), ModelDocument(root, places), is_robot)


def _drives(model: Entry) -> bool:
    return model.scope is not None and not model.scope.static and not DRIVE_PLUGINS.isdisjoint(plugin_names(model))


def _read(path: Path, source: Path | bytes) -> ModelDocument:
    try:
        return read_document(source) if isinstance(source, Path) else parse_document(source, str(path))
    except ModelError as error:
        raise BadWorld(str(error)) from None


def _converted(path: Path, document: ModelDocument, is_robot: Callable[[Entry], bool]) -> WorldFile:
    # The nodes of the launch run with the rights of the job; they can read any file.
    workspace = Workspace(path.resolve().parent, path.resolve().parent, allow_outside=True)
    try:
        return read_world_file(path, Packages(workspace), is_robot, document)
    except ModelError as error:
        raise BadWorld(f"{path}: {error}") from None
