"""Gazebo worlds (SDF): boxes, cylinders and spheres become bodies; a ground plane always exists.

http://sdformat.org/spec (world, model, link, collision, geometry). A note reports everything that is left out.
"""

from __future__ import annotations

import os
from collections.abc import Container, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from pydantic import ValidationError

from sim_action.core import geometry
from sim_action.core.geometry import Pose, quaternion_from_rpy, rpy_from_quaternion
from sim_action.ros.ros1.gazebo_plugins import plugin_name, plugins_of
from sim_action.world import Body, World

_DEFAULT_VERSION: Final = "1.6"


class BadWorld(Exception):
    """A world, or a model in it, that cannot be read."""


@dataclass(frozen=True, slots=True)
class WorldRobot:
    """The robot of a world: a model with supported plugins.

    Attributes:
        description: SDF.
        pose: pose of the model.
        file: file of the description; None if it is in the world file itself.
    """

    name: str
    description: str
    pose: Pose
    file: Path | None = None


@dataclass(frozen=True, slots=True)
class WorldFile:
    """The content of a .world file; `notes`: what was left out."""

    world: World
    robot: WorldRobot | None
    notes: tuple[str, ...]


def read_world(path: Path, folders: tuple[Path, ...], known: Container[str]) -> WorldFile:
    """Read a .world file. Raises BadWorld.

    Args:
        path: the file.
        folders: where `model://` is searched.
        known: plugins that make a model a robot.
    """
    try:
        root = ET.parse(path).getroot()  # noqa: S314 - a world that the user names
        world = root if root.tag == "world" else root.find("world")
        if world is None:
            raise BadWorld(f"{path} has no <world>")
        version = root.get("version", _DEFAULT_VERSION)
        return _Reading(folders, known, version).read(world)
    except (OSError, ET.ParseError, ValueError) as error:
        raise BadWorld(f"{path}: {_said(error)}") from None


class _Reading:
    """The state of reading one world; `version`: of its SDF."""

    def __init__(self, folders: tuple[Path, ...], known: Container[str], version: str) -> None:
        self._folders, self._known, self._version = folders, known, version
        self._notes: list[str] = []
        self._bodies: dict[str, Body] = {}
        self._robot: WorldRobot | None = None

    def read(self, world: Element) -> WorldFile:
        """Read a world. Raises ValueError, ET.ParseError, OSError."""
        for model in world.findall("model"):
            self._add(model, model.get("name", "model"), _pose(model), None)
        for include in world.findall("include"):
            self._include(include)
        for plugin in world.findall("plugin"):
            self._notes.append(f"the plugin {plugin_name(plugin)} of the world is not supported and has no effect")
        kept: dict[str, Any] = {"objects": tuple(self._bodies.values())}
        if (gravity := world.findtext("gravity")) is not None:
            kept["gravity"] = tuple(map(float, gravity.split()))
        return WorldFile(World.model_validate(kept), self._robot, tuple(self._notes))

    def _include(self, include: Element) -> None:
        uri = (include.findtext("uri") or "").strip().removeprefix("model://")
        if uri in {"ground_plane", "sun"}:
            return
        if (file := _included(uri, self._folders)) is None:
            there = ", ".join(map(str, self._folders)) or "any folder"
            self._notes.append(f"model://{uri} was not found in {there}; it is left out")
            return
        model = ET.parse(file).getroot().find("model")  # noqa: S314 - a model that the user names
        if model is None:
            raise ValueError(f"{file} has no <model>")
        more = include.findall("plugin")
        model.extend(more)
        name = (include.findtext("name") or model.get("name") or uri).strip()
        # With plugins of the include, the file is not the whole description.
        self._add(model, name, geometry.compose(_pose(include), _pose(model)), None if more else file)

    def _add(self, model: Element, name: str, pose: Pose, file: Path | None) -> None:
        plugins = [plugin.name for plugin in plugins_of(model)]
        moves = not _is_static(model) and any(plugin in self._known for plugin in plugins)
        if moves and self._robot is None:
            text = f'<sdf version="{self._version}">{ET.tostring(model, encoding="unicode")}</sdf>'
            self._robot = WorldRobot(name, file.read_text(encoding="utf-8") if file else text, pose, file)
            return
        if plugins:
            self._notes.append(
                f"'{name}' is simulated as a body, not as a robot; its plugins have no effect: {', '.join(plugins)}"
            )
        for body in _bodies_of(model, name, pose, self._notes):
            self._bodies.setdefault(body.name, body)


def body_of(name: str, description: str, pose: Pose) -> Body:
    """Return a body, from the SDF of a model with one link. Raises BadWorld."""
    try:
        root = ET.fromstring(description)  # noqa: S314 - of what is simulated
        model = root if root.tag == "model" else root.find("model")
        if model is None:
            raise BadWorld("it has no <model>")
        found = list(_bodies_of(model, name, pose, []))
    except (ET.ParseError, ValueError) as error:
        raise BadWorld(_said(error)) from None
    if len(found) != 1:
        raise BadWorld(f"a body needs exactly one collision shape, found {len(found)}")
    return found[0]


def _said(error: Exception) -> str:
    """Return the message of an error in one line."""
    if not isinstance(error, ValidationError):
        return str(error)
    return "; ".join(f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors(include_url=False))


def _included(uri: str, folders: tuple[Path, ...]) -> Path | None:
    paths = (folder / uri / file for folder in folders for file in ("model.sdf", "model-1_4.sdf"))
    return next((path for path in paths if path.is_file()), None)


def _is_static(model: Element) -> bool:
    return (model.findtext("static") or "").strip().lower() in {"1", "true"}


def _bodies_of(model: Element, name: str, pose: Pose, notes: list[str]) -> Iterator[Body]:
    is_static = _is_static(model)
    shapes = [(link, collision) for link in model.findall("link") for collision in link.findall("collision")]
    if len(shapes) > 1 and not is_static:
        notes.append(
            f"'{name}' has {len(shapes)} collision shapes, but a moving body can have only one: it does not move"
        )
        is_static = True
    for index, (link, collision) in enumerate(shapes):
        shape = _shape(collision.find("geometry"))
        called = name if index == 0 else f"{name}_{index + 1}"
        if shape is None:
            if collision.find("geometry/plane") is None:
                notes.append(f"a shape of '{name}' is neither box, cylinder nor sphere; it is left out")
            continue
        at = geometry.compose(pose, geometry.compose(_pose(link), _pose(collision)))
        x, y, z = at.position_xyz
        roll, pitch, yaw = rpy_from_quaternion(at.orientation_xyzw)
        mass = None if is_static else float(link.findtext("inertial/mass") or 1.0)
        placed = {"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw}
        yield Body.model_validate({"name": called, **shape, "pose": placed, **({"mass": mass} if mass else {})})


def _shape(element: Element | None) -> dict[str, Any] | None:
    if element is None:
        return None
    if (size := element.findtext("box/size")) is not None:
        return {"box": tuple(map(float, size.split()))}
    if (radius := element.findtext("cylinder/radius")) is not None:
        return {"cylinder": {"radius": float(radius), "height": float(element.findtext("cylinder/length") or 1)}}
    if (radius := element.findtext("sphere/radius")) is not None:
        return {"sphere": {"radius": float(radius)}}
    return None


def _pose(element: Element) -> Pose:
    x, y, z, roll, pitch, yaw = map(float, (element.findtext("pose") or "0 0 0 0 0 0").split())
    return Pose((x, y, z), quaternion_from_rpy(roll, pitch, yaw))


def model_folders() -> tuple[Path, ...]:
    """Return the folders in which Gazebo searches for models, from GAZEBO_MODEL_PATH."""
    return tuple(Path(folder) for folder in os.environ.get("GAZEBO_MODEL_PATH", "").split(os.pathsep) if folder)
