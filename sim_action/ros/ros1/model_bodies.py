"""Bodies from the models of Gazebo (SDF): boxes, cylinders, spheres and meshes, also of nested models."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from pydantic import ValidationError

from sim_action.core import geometry
from sim_action.core.errors import Location, ModelError
from sim_action.core.geometry import Pose, quaternion_from_rpy, rpy_from_quaternion
from sim_action.core.workspace import Workspace
from sim_action.robot.xml_document import ModelDocument, read_document
from sim_action.ros.ros1.losses import Loss
from sim_action.ros.ros1.world_tags import lost_tags, lost_tags_below
from sim_action.world import Body

_MODEL: Final = "model://"
_FILE: Final = "file://"
_PACKAGE: Final = "package://"
_MAX_DEPTH: Final = 20

# SDF's default, and the greatest value: engines multiply the two frictions of a contact, Gazebo takes the lesser one.
_FRICTION: Final = 1.0
# m, and the relative error of a moment of inertia that is not reported.
_LENGTH_TOLERANCE_M: Final = 1e-3
_INERTIA_TOLERANCE: Final = 0.2


class BadWorld(Exception):
    """A world, or a model in it, that cannot be read."""


@dataclass(frozen=True, eq=False)
class Sources:
    """The files of a world.

    Attributes:
        folders: where `model://` is searched.
        packages: name -> folder of packages, for `package://`.
        documents: all files that were read.
        losses: grows while models are read.
    """

    folders: tuple[Path, ...] = ()
    packages: Callable[[str], Path | None] = lambda _: None
    documents: dict[Path, ModelDocument] = field(default_factory=dict)
    losses: list[Loss] = field(default_factory=list)

    def document(self, path: Path) -> ModelDocument:
        """Return a file, read at the first call. Raises BadWorld."""
        if path not in self.documents:
            try:
                self.documents[path] = read_document(path.resolve())
            except ModelError as error:
                raise BadWorld(str(error)) from None
        return self.documents[path]

    def place(self, element: Element) -> Location | None:
        """Return the place of an element."""
        found = (document.places.get(element) for document in self.documents.values())
        return next((place for place in found if place is not None), None)

    def lose(self, element: Element, message: str) -> None:
        """Note a loss at an element."""
        self.losses.append(Loss(message=message, location=self.place(element)))

    def model_file(self, uri: str) -> Path | None:
        """Return the file of a model in the folders."""
        name = uri.removeprefix(_MODEL)
        paths = (folder / name / file for folder in self.folders for file in ("model.sdf", "model-1_4.sdf"))
        return next((path for path in paths if path.is_file()), None)

    def mesh_file(self, uri: str, referrer: Path) -> Path | None:
        """Return the file of a mesh."""
        if uri.startswith(_MODEL):
            found = (folder / uri.removeprefix(_MODEL) for folder in self.folders)
            return next((path for path in found if path.is_file()), None)
        if uri.startswith(_PACKAGE):
            name, _, rest = uri.removeprefix(_PACKAGE).partition("/")
            folder = self.packages(name)
            path = folder / rest if folder else None
        else:
            path = referrer.parent / unquote(uri.removeprefix(_FILE))
        return path if path is not None and path.is_file() else None


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """A model that becomes bodies.

    Attributes:
        pose: world frame.
        file: the file that it is in.
        link_poses: link -> pose in the world frame that replaces its own, from a <state>.
    """

    element: Element
    name: str
    pose: Pose
    file: Path
    is_static: bool
    link_poses: Mapping[str, Pose] = field(default_factory=dict)
    depth: int = 0


def is_static(model: Element) -> bool:
    """Return True if nothing in a model moves."""
    return (model.findtext("static") or "").strip().lower() in {"1", "true"}


def pose_in(element: Element) -> Pose:
    """Return the pose of an element. Raises ValueError."""
    x, y, z, roll, pitch, yaw = map(float, (element.findtext("pose") or "0 0 0 0 0 0").split())
    return Pose((x, y, z), quaternion_from_rpy(roll, pitch, yaw))


def bodies_of(placed: PlacedModel, sources: Sources) -> Iterator[Body]:
    """Yield the bodies of a model. Raises ValueError, BadWorld."""
    found = list(_shapes(placed, sources))
    fixed = placed.is_static
    if len(found) > 1 and not fixed:
        message = (
            f"'{placed.name}' has {len(found)} collision shapes, but a moving body can have only one: it does not move"
        )
        sources.lose(placed.element, message)
        fixed = True
    for index, shape in enumerate(found):
        called = placed.name if index == 0 else f"{placed.name}_{index + 1}"
        made = _body(called, shape, sources, fixed=fixed)
        if made is not None:
            yield made


@dataclass(frozen=True, eq=False)
class _Shape:
    """A collision shape of a link; `owner`: name of its model; `pose`: world frame."""

    owner: str
    link: Element
    collision: Element
    pose: Pose
    file: Path


def _shapes(placed: PlacedModel, sources: Sources) -> Iterator[_Shape]:
    """Yield the shapes of a model and of the models in it, and note the tags that are lost."""
    model, moves = placed.element, not placed.is_static
    if placed.depth > _MAX_DEPTH:
        raise BadWorld(f"'{placed.name}' has more than {_MAX_DEPTH} models inside each other")
    for tag, message in lost_tags(model, moves=moves):
        sources.lose(tag, f"{message} ('{placed.name}')")
    for link in model.findall("link"):
        at = placed.link_poses.get(link.get("name", "")) or geometry.compose(placed.pose, pose_in(link))
        for tag, message in lost_tags_below(link, moves=moves):
            sources.lose(tag, f"{message} ('{placed.name}')")
        for collision in link.findall("collision"):
            geometry_of = collision.find("geometry")
            if geometry_of is not None and (geometry_of.find("empty") is not None or len(geometry_of) == 0):
                continue
            pose = geometry.compose(at, pose_in(collision))
            if not _is_ground(geometry_of, pose, collision, sources, placed.name):
                yield _Shape(placed.name, link, collision, pose, placed.file)
    for inner in inner_models(placed, sources):
        yield from _shapes(inner, sources)


def inner_models(placed: PlacedModel, sources: Sources) -> Iterator[PlacedModel]:
    """Yield the nested and the included models of a model. Raises BadWorld."""
    for model in placed.element.findall("model"):
        pose = geometry.compose(placed.pose, pose_in(model))
        yield PlacedModel(model, placed.name, pose, placed.file, placed.is_static, depth=placed.depth + 1)
    for include in placed.element.findall("include"):
        if (found := included_model(include, sources)) is not None:
            model, file = found
            pose = geometry.compose(placed.pose, include_pose(include, model))
            yield PlacedModel(model, placed.name, pose, file, placed.is_static, depth=placed.depth + 1)


def included_model(include: Element, sources: Sources) -> tuple[Element, Path] | None:
    """Return the model of an <include> and its file; None if there is no such model. Raises BadWorld."""
    uri = (include.findtext("uri") or "").strip()
    for tag, message in lost_tags(include):
        sources.lose(tag, message)
    if (file := sources.model_file(uri)) is None:
        there = ", ".join(map(str, sources.folders)) or "any folder of GAZEBO_MODEL_PATH"
        advice = "models are not downloaded: add it to the repository, and its folder to GAZEBO_MODEL_PATH"
        sources.lose(include, f"{uri} was not found in {there}; {advice}")
        return None
    model = sources.document(file).root.find("model")
    if model is None:
        raise BadWorld(f"{file} has no <model>")
    return model, file


def include_pose(include: Element, model: Element) -> Pose:
    """Return the pose of an included model: that of the <include>, if it has one, before that of its file."""
    return geometry.compose(pose_in(include), pose_in(model))


def _is_ground(shape: Element | None, pose: Pose, collision: Element, sources: Sources, name: str) -> bool:
    """Return True for a plane. It is the ground, which always exists; a loss is noted if it is another plane."""
    plane = shape.find("plane") if shape is not None else None
    if plane is None:
        return False
    normal = tuple(map(float, (plane.findtext("normal") or "0 0 1").split()))
    up = geometry.rotate(pose.orientation_xyzw, (normal[0], normal[1], normal[2]))
    is_level = up[2] > 0 and math.hypot(up[0], up[1]) < _LENGTH_TOLERANCE_M
    if not is_level or abs(pose.position_xyz[2]) > _LENGTH_TOLERANCE_M:
        sources.lose(collision, f"a plane of '{name}' is not the ground z = 0; it is left out")
    return True


def _body(name: str, shape: _Shape, sources: Sources, *, fixed: bool) -> Body | None:
    mass = None if fixed else float(shape.link.findtext("inertial/mass") or 1.0)
    keys = _shape_keys(shape, sources, moves=mass is not None)
    if keys is None:
        return None
    x, y, z = shape.pose.position_xyz
    roll, pitch, yaw = rpy_from_quaternion(shape.pose.orientation_xyzw)
    placed = {"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw}
    friction = _friction(shape, sources)
    more = {"mass": mass} if mass else {}
    body = Body.model_validate({"name": name, **keys, "pose": placed, "friction": friction, **more})
    if mass:
        _check_inertia(body, mass, shape, sources)
    return body


def _friction(shape: _Shape, sources: Sources) -> float:
    stated = shape.collision.find("surface/friction/ode")
    along = float((stated.findtext("mu") if stated is not None else None) or _FRICTION)
    across = float((stated.findtext("mu2") if stated is not None else None) or along)
    if stated is not None and min(along, across) < _FRICTION and along != across:
        message = (
            f"the friction of '{shape.owner}' depends on the direction; <mu>{along:g}</mu> is used for all directions"
        )
        sources.lose(stated, message)
    return min(along, _FRICTION)


def _shape_keys(shape: _Shape, sources: Sources, *, moves: bool) -> dict[str, Any] | None:
    """Return the shape as a key of a body; None if it is lost."""
    element = shape.collision.find("geometry")
    if element is None:
        sources.lose(shape.collision, f"a collision of '{shape.owner}' has no <geometry>; it is left out")
        return None
    if (size := element.findtext("box/size")) is not None:
        return {"box": tuple(map(float, size.split()))}
    if (radius := element.findtext("cylinder/radius")) is not None:
        return {"cylinder": {"radius": float(radius), "height": float(element.findtext("cylinder/length") or 1)}}
    if (radius := element.findtext("sphere/radius")) is not None:
        return {"sphere": {"radius": float(radius)}}
    if (mesh := element.find("mesh")) is not None:
        return _mesh_keys(mesh, shape, sources, moves=moves)
    kind = element[0].tag
    sources.lose(element[0], f"a <{kind}> of '{shape.owner}' is neither box, cylinder, sphere nor mesh; it is left out")
    return None


def _mesh_keys(mesh: Element, shape: _Shape, sources: Sources, *, moves: bool) -> dict[str, Any] | None:
    for tag, message in lost_tags(mesh):
        sources.lose(tag, f"{message} ('{shape.owner}')")
    uri = (mesh.findtext("uri") or "").strip()
    file = sources.mesh_file(uri, shape.file)
    if file is None:
        sources.lose(mesh, f"the mesh '{uri}' of '{shape.owner}' was not found; it is left out")
        return None
    scale = tuple(map(float, (mesh.findtext("scale") or "1 1 1").split()))
    if len(set(scale)) != 1 or scale[0] <= 0:
        message = f"the mesh '{uri}' of '{shape.owner}' has the scale {' '.join(f'{each:g}' for each in scale)}"
        sources.lose(mesh, f"{message}; only equal positive numbers are supported; it is left out")
        return None
    keys = {"mesh": {"file": str(file.resolve()), "scale": scale[0]}}
    return keys if _is_usable(keys, mesh, sources, shape.owner, moves=moves) else None


def _is_usable(keys: dict[str, Any], mesh: Element, sources: Sources, name: str, *, moves: bool) -> bool:
    """Return True if a mesh can be a body. A moving body is a convex hull, which is noted if the mesh is not convex."""
    from sim_action.world.parts import SurfacePart
    from sim_action.world.shape_files import ShapeLibrary
    from sim_action.world.shape_files.shape_error import ShapeError

    folder = Path(keys["mesh"]["file"]).parent
    body = Body.model_validate({"name": "mesh", **keys})
    try:
        parts = ShapeLibrary().parts(body, Workspace(folder, folder, allow_outside=True))
    except ShapeError as error:
        sources.lose(mesh, f"a mesh of '{name}' cannot be used: {error}; it is left out")
        return False
    if moves and (len(parts) > 1 or any(isinstance(part, SurfacePart) for part in parts)):
        sources.lose(mesh, f"'{name}' moves and is not convex: its convex hull collides")
    return True


def _check_inertia(body: Body, mass: float, shape: _Shape, sources: Sources) -> None:
    """Note a loss if an inertial is not that of a body of uniform density."""
    inertial = shape.link.find("inertial")
    if inertial is None:
        return
    if any(abs(found) > _LENGTH_TOLERANCE_M for found in pose_in(inertial).position_xyz):
        sources.lose(inertial, f"the centre of mass of '{body.name}' is that of a body of uniform density")
    moments = [inertial.findtext(f"inertia/{name}") for name in ("ixx", "iyy", "izz")]
    uniform = _uniform_moments(body, mass)
    if uniform is None or None in moments:
        return
    stated = [float(moment or 0) for moment in moments]
    if any(abs(one - other) > _INERTIA_TOLERANCE * other for one, other in zip(stated, uniform, strict=True)):
        text, other = (" ".join(f"{value:.3g}" for value in values) for values in (stated, uniform))
        message = f"the inertia {text} of '{body.name}' is not simulated: it is that of a body of uniform density"
        sources.lose(inertial, f"{message}, {other}")


def _uniform_moments(body: Body, mass: float) -> tuple[float, float, float] | None:
    if body.box is not None:
        x, y, z = body.box
        return mass * (y * y + z * z) / 12, mass * (x * x + z * z) / 12, mass * (x * x + y * y) / 12
    if body.cylinder is not None:
        radius, height = body.cylinder.radius, body.cylinder.height
        across = mass * (3 * radius * radius + height * height) / 12
        return across, across, mass * radius * radius / 2
    if body.sphere is not None:
        moment = 0.4 * mass * body.sphere.radius**2
        return moment, moment, moment
    return None


def body_of(name: str, description: str, pose: Pose) -> tuple[Body, tuple[Loss, ...]]:
    """Return a body and its losses, from the SDF of a model with one shape. Raises BadWorld."""
    sources = Sources(model_folders())
    try:
        root = ET.fromstring(description)  # noqa: S314 - the model that is simulated
        model = root if root.tag == "model" else root.find("model")
        if model is None:
            raise BadWorld("it has no <model>")
        found = list(bodies_of(PlacedModel(model, name, pose, Path("spawned"), is_static(model)), sources))
    except (ET.ParseError, ValueError) as error:
        raise BadWorld(said(error)) from None
    if len(found) != 1:
        raise BadWorld(f"a body needs exactly one collision shape, found {len(found)}")
    return found[0], tuple(sources.losses)


def said(error: Exception) -> str:
    """Return the message of an error in one line."""
    if not isinstance(error, ValidationError):
        return str(error)
    return "; ".join(f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors(include_url=False))


def model_folders() -> tuple[Path, ...]:
    """Return the folders in which Gazebo searches for models, from GAZEBO_MODEL_PATH."""
    return tuple(Path(folder) for folder in os.environ.get("GAZEBO_MODEL_PATH", "").split(os.pathsep) if folder)
