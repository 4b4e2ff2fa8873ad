"""Worlds of Gazebo (SDF): boxes, cylinders, spheres and planes become bodies of ours; a ground plane is there anyway.

http://sdformat.org/spec (world, model, link, collision, geometry). What a body cannot be is told, not guessed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from pydantic import ValidationError

from sim_action import geometry
from sim_action.geometry import Pose, quaternion_from_rpy, rpy_from_quaternion
from sim_action.world import Body, World


class BadWorld(Exception):
    """A world, or a model in it, that cannot be read."""


def read_world(path: Path, folders: tuple[Path, ...]) -> tuple[World, list[str]]:
    """A .world file, and what was left out of it; `folders`: where `model://` is looked for. Raises BadWorld."""
    try:
        root = ET.parse(path).getroot()  # noqa: S314 - a world that the user names
        world = root if root.tag == "world" else root.find("world")
        if world is None:
            raise BadWorld(f"{path} has no <world>")
        return _read(world, folders)
    except (OSError, ET.ParseError, ValueError) as error:
        raise BadWorld(f"{path}: {_said(error)}") from None


def _read(world: Element, folders: tuple[Path, ...]) -> tuple[World, list[str]]:
    """Raises ValueError, ET.ParseError, OSError."""
    notes: list[str] = []
    bodies: dict[str, Body] = {}
    for body in _bodies(world, folders, notes):
        bodies.setdefault(body.name, body)
    kept: dict[str, Any] = {"objects": tuple(bodies.values())}
    if (gravity := world.findtext("gravity")) is not None:
        kept["gravity"] = tuple(map(float, gravity.split()))
    return World.model_validate(kept), notes


def body_of(name: str, description: str, pose: Pose) -> Body:
    """A body, from the SDF of a model with one link. Raises BadWorld."""
    try:
        root = ET.fromstring(description)  # noqa: S314 - of what is simulated
        model = root if root.tag == "model" else root.find("model")
        if model is None:
            raise BadWorld("it has no <model>")
        found = list(_bodies_of(model, name, pose, []))
    except (ET.ParseError, ValueError) as error:
        raise BadWorld(_said(error)) from None
    if len(found) != 1:
        raise BadWorld(f"a body of one collision shape is wanted, and it has {len(found)}")
    return found[0]


def _said(error: Exception) -> str:
    """In a line."""
    if not isinstance(error, ValidationError):
        return str(error)
    return "; ".join(f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors(include_url=False))


def _bodies(world: Element, folders: tuple[Path, ...], notes: list[str]) -> Iterator[Body]:
    for model in world.findall("model"):
        yield from _bodies_of(model, model.get("name", "model"), _pose(model), notes)
    for include in world.findall("include"):
        uri = (include.findtext("uri") or "").strip().removeprefix("model://")
        if uri in {"ground_plane", "sun"}:
            continue
        if (found := _included(uri, folders)) is None:
            notes.append(
                f"model://{uri} was not found in {', '.join(map(str, folders)) or 'any folder'}; it is left out"
            )
            continue
        name = (include.findtext("name") or found.get("name") or uri).strip()
        yield from _bodies_of(found, name, geometry.compose(_pose(include), _pose(found)), notes)


def _included(uri: str, folders: tuple[Path, ...]) -> Element | None:
    for folder in folders:
        for file in ("model.sdf", "model-1_4.sdf"):
            path = folder / uri / file
            if path.is_file():
                return ET.parse(path).getroot().find("model")  # noqa: S314 - a model that the user names
    return None


def _bodies_of(model: Element, name: str, pose: Pose, notes: list[str]) -> Iterator[Body]:
    is_static = (model.findtext("static") or "").strip().lower() in {"1", "true"}
    shapes = [(link, collision) for link in model.findall("link") for collision in link.findall("collision")]
    if len(shapes) > 1 and not is_static:
        notes.append(f"'{name}' has {len(shapes)} shapes, and what moves has one here: it does not move")
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
    """Where Gazebo looks for models, by GAZEBO_MODEL_PATH."""
    return tuple(Path(folder) for folder in os.environ.get("GAZEBO_MODEL_PATH", "").split(os.pathsep) if folder)
