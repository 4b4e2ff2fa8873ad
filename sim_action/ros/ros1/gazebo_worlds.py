"""Gazebo worlds (SDF): models become bodies, or the robot; a ground plane always exists.

http://sdformat.org/spec (world, model, link, collision, geometry). A loss reports everything that is left out.
"""

from __future__ import annotations

import os
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core.geometry import Pose
from sim_action.core.wording import did_you_mean
from sim_action.ros.ros1.gazebo_plugins import plugin_name, plugins_of
from sim_action.ros.ros1.losses import Loss
from sim_action.ros.ros1.model_bodies import (
    BadWorld,
    PlacedModel,
    Sources,
    bodies_of,
    include_pose,
    included_model,
    is_static,
    pose_in,
    said,
)
from sim_action.ros.ros1.world_tags import HARMLESS_WORLD_PLUGINS, lost_tags
from sim_action.world import Body, World

_DEFAULT_VERSION: Final = "1.6"
# Gazebo's own world, which has only a ground and a light.
_EMPTY_WORLD: Final = Path("worlds/empty.world")
_OWN_MODELS: Final = frozenset({"ground_plane", "sun"})


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
    """The content of a .world file; `losses`: what was left out."""

    world: World
    robot: WorldRobot | None
    losses: tuple[Loss, ...]


def find_world(stated: str) -> Path | None:
    """Return the path of a world file; None for Gazebo's own empty world. Raises MissingWorld."""
    path = Path(stated)
    folders = [Path(folder) for folder in os.environ.get("GAZEBO_RESOURCE_PATH", "").split(os.pathsep) if folder]
    found = next((each for each in (path, *(folder / path for folder in folders)) if _is_file(each)), None)
    if found is not None:
        return found
    if path == _EMPTY_WORLD or (path.parts[-2:] == _EMPTY_WORLD.parts and path.parent.parent.name[:6] == "gazebo"):
        return None
    # The packages of a launch are links.
    raise MissingWorld(path.resolve() if path.is_absolute() else path)


def _is_file(path: Path) -> bool:
    return path.is_absolute() and path.is_file()


def read_world(path: Path, folders: tuple[Path, ...], known: Container[str]) -> WorldFile:
    """Read a .world file. Raises BadWorld.

    Args:
        path: the file.
        folders: where `model://` is searched.
        known: plugins that make a model a robot.
    """
    if not path.is_file():
        raise MissingWorld(path)
    sources = Sources(folders, _package)
    try:
        root = sources.document(path).root
        world = root if root.tag == "world" else root.find("world")
        if world is None:
            raise BadWorld(f"{path} has no <world>")
        return _Reading(sources, known, root.get("version", _DEFAULT_VERSION), path).read(world)
    except (OSError, ET.ParseError, ValueError) as error:
        raise BadWorld(f"{path}: {said(error)}") from None


def _package(name: str) -> Path | None:
    folders = (Path(folder) / name for folder in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if folder)
    return next((folder for folder in folders if folder.is_dir()), None)


class _Reading:
    """The state of reading one world; `version`: of its SDF."""

    def __init__(self, sources: Sources, known: Container[str], version: str, path: Path) -> None:
        self._sources, self._known, self._version, self._path = sources, known, version, path
        self._states: Mapping[str, Element] = {}
        self._bodies: dict[str, Body] = {}
        self._robot: WorldRobot | None = None

    def read(self, world: Element) -> WorldFile:
        """Read a world. Raises ValueError, BadWorld."""
        for tag, message in lost_tags(world):
            self._sources.lose(tag, message)
        self._states = dict(self._read_state(world.find("state")))
        for model in world.findall("model"):
            self._add(model, model.get("name", "model"), pose_in(model), None)
        for include in world.findall("include"):
            self._include(include)
        for plugin in world.findall("plugin"):
            if (name := plugin_name(plugin)) not in HARMLESS_WORLD_PLUGINS:
                self._sources.lose(plugin, f"the plugin {name} of the world is not supported and has no effect")
        kept: dict[str, Any] = {"objects": tuple(self._bodies.values())}
        # Up to SDF 1.5, gravity is a part of <physics>.
        if (gravity := world.findtext("gravity") or world.findtext("physics/gravity")) is not None:
            kept["gravity"] = tuple(map(float, gravity.split()))
        return WorldFile(World.model_validate(kept), self._robot, tuple(self._sources.losses))

    def _read_state(self, state: Element | None) -> Iterator[tuple[str, Element]]:
        """Yield the name and the state of each model."""
        if state is None:
            return
        for tag, message in lost_tags(state):
            if len(tag) or tag.text:
                self._sources.lose(tag, message)
        for model in state.findall("model"):
            for tag, message in lost_tags(model, "state/model"):
                self._sources.lose(tag, message)
            for link in model.findall("link"):
                for tag, message in lost_tags(link, "state/link"):
                    self._sources.lose(tag, message)
            yield model.get("name", ""), model

    def _include(self, include: Element) -> None:
        uri = (include.findtext("uri") or "").strip().removeprefix("model://")
        if uri in _OWN_MODELS:
            return
        if (found := included_model(include, self._sources)) is None:
            return
        model, file = found
        more = include.findall("plugin")
        model.extend(more)
        if (static := include.find("static")) is not None:
            for old in model.findall("static"):
                model.remove(old)
            model.append(static)
        name = (include.findtext("name") or model.get("name") or uri).strip()
        # With plugins of the include, the file is not the whole description.
        self._add(model, name, include_pose(include, model), None if more else file, file)

    def _add(self, model: Element, name: str, pose: Pose, file: Path | None, source: Path | None = None) -> None:
        plugins = [plugin.name for plugin in plugins_of(model)]
        state = self._states.get(name)
        pose = pose_in(state) if state is not None and state.find("pose") is not None else pose
        moves = not is_static(model) and any(plugin in self._known for plugin in plugins)
        if moves and self._robot is None:
            text = f'<sdf version="{self._version}">{ET.tostring(model, encoding="unicode")}</sdf>'
            self._robot = WorldRobot(name, file.read_text(encoding="utf-8") if file else text, pose, file)
            return
        if plugins:
            message = f"'{name}' is simulated as a body, not as a robot; its plugins have no effect"
            self._sources.lose(model, f"{message}: {', '.join(plugins)}")
        links = {link.get("name", ""): pose_in(link) for link in (state.findall("link") if state is not None else [])}
        placed = PlacedModel(model, name, pose, source or self._path, is_static(model), links)
        for body in bodies_of(placed, self._sources):
            self._bodies.setdefault(body.name, body)
