"""The collision shapes of an SDF: each becomes a shape of a body, or a loss."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element

import numpy as np
from pydantic import ValidationError

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3, rpy_from_quaternion
from sim_action.core.records import dataclass, field
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.sdf_elements import Notes, SdfProblem, needed, number_of, numbers_of, text_of, vector_of
from sim_action.robot.reading.sdf.composition import Entry
from sim_action.world import MeshFile, Shape
from sim_action.world.parts import Part, SurfacePart, moved
from sim_action.world.shape_files.mesh_file import read_mesh_parts
from sim_action.world.shape_files.shape_error import ShapeError
from sim_action.world.shapes import MIN_LENGTH_M
from sim_action.world.world_files.losses import LossList, lost_parts

_LENGTH_TOLERANCE_M: Final = 1e-3

# SDF's default, and the greatest value: engines multiply the two frictions of a contact, Gazebo takes the lesser one.
MAX_FRICTION: Final = 1.0

_MeshKey = tuple[Path, Vector3, bool]  # file, scale, and True if it moves
_MESH_ABSENT: Final = "a mesh that cannot be used: it is left out"


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A collision shape; `pose`: world frame."""

    collision: Element
    spec: Mapping[str, Any]  # its keys, without the pose
    pose: Pose
    own_parts: tuple[Part, ...] | None = None  # the parts of a mesh, in its own frame; None for other shapes

    def seen_from(self, frame: Pose) -> Shape:
        """Return the shape of a body whose frame has this pose in the world. Raises SdfProblem."""
        seen = geometry.compose(geometry.inverse(frame), self.pose)
        x, y, z = seen.position_xyz
        roll, pitch, yaw = rpy_from_quaternion(seen.orientation_xyzw)
        placed = {"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw}
        try:
            return Shape.model_validate({**self.spec, "pose": placed})
        except ValidationError as error:
            raise SdfProblem("bad-shape", self.collision, said(error)) from None

    def parts(self, frame: Pose) -> list[Part]:
        """Return the parts in the frame of the body. Raises SdfProblem."""
        shape = self.seen_from(frame)
        if self.own_parts is None:
            return list(shape.parts())
        return [moved(part, shape.pose.pose) for part in self.own_parts]


@dataclass(eq=False)
class ShapeReader:
    """Reads collision shapes; meshes are read once."""

    packages: Packages
    losses: LossList
    notes: Notes
    has_ground: bool = False
    ground_friction: float | None = None  # that of the ground plane; None if there is none in the file
    _meshes: dict[_MeshKey, tuple[Part, ...] | str] = field(default_factory=dict)
    _simplified: dict[_MeshKey, float] = field(default_factory=dict)

    def shapes(self, link: Entry, at: Pose, collision: Element, owner: str, *, moves: bool) -> Iterator[PlacedShape]:
        """Yield the shapes of a <collision>; `at`: pose of its frame in the world. Raises SdfProblem."""
        holder = needed(collision, "geometry")
        shape = next(iter(holder), None)
        if shape is None or shape.tag == "empty":
            return
        if shape.tag == "plane":
            self._read_plane(shape, at, collision, owner)
        elif shape.tag == "mesh":
            yield from self._mesh(shape, at, collision, link, owner, moves=moves)
        elif shape.tag == "capsule":
            # A cylinder and two balls have exactly its surface.
            radius, length = _size(shape, "radius"), _size(shape, "length")
            yield PlacedShape(collision, {"cylinder": {"radius": radius, "height": length}}, at)
            for z in (-length / 2, length / 2):
                end = geometry.compose(at, Pose((0.0, 0.0, z)))
                yield PlacedShape(collision, {"sphere": {"radius": radius}}, end)
        elif (spec := _plain(shape)) is not None:
            yield PlacedShape(collision, spec, at)
        else:
            message = f"a <{shape.tag}> of '{owner}' is neither box, cylinder, sphere, capsule nor mesh; it is left out"
            kind = f"a <{shape.tag}> is neither box, cylinder, sphere, capsule nor mesh; it is left out"
            self.losses.add(shape, message, kind=kind)

    def friction(self, collision: Element, owner: str) -> float:
        """Return the friction of a <collision>; direction-dependent friction is a loss. Raises SdfProblem."""
        stated = collision.find("surface/friction/ode")
        if stated is None:
            return MAX_FRICTION
        # ODE takes a negative coefficient as infinite.
        along, across = (value if value >= 0 else math.inf for value in _coefficients(stated))
        if min(along, across) < MAX_FRICTION and along != across:
            used = f"<mu>{along:g}</mu> is used for all directions"
            message = f"the friction of '{owner}' depends on the direction; {used}"
            kind = "friction that depends on the direction: <mu> is used for all directions"
            self.losses.add(stated, message, kind=kind)
        return min(along, MAX_FRICTION)

    def _read_plane(self, plane: Element, at: Pose, collision: Element, owner: str) -> None:
        """Read a plane, which is the ground; another plane is a loss."""
        normal = plane.find("normal")
        x, y, z = (0.0, 0.0, 1.0) if normal is None else vector_of(normal)
        up = geometry.rotate(at.orientation_xyzw, (x, y, z))
        is_level = up[2] > 0 and math.hypot(up[0], up[1]) < _LENGTH_TOLERANCE_M
        if not is_level or abs(at.position_xyz[2]) > _LENGTH_TOLERANCE_M:
            message = f"a plane of '{owner}' is not the ground z = 0; it is left out"
            self.losses.add(collision, message, kind="a plane that is not the ground z = 0: it is left out")
            return
        self.has_ground = True
        self.ground_friction = self.friction(collision, owner)

    def _mesh(
        self, mesh: Element, at: Pose, collision: Element, link: Entry, owner: str, *, moves: bool
    ) -> Iterator[PlacedShape]:
        for tag, message in lost_parts(mesh):
            self.losses.add(tag, message, owner)
        uri = text_of(mesh, "uri")
        stated = mesh.find("scale")
        scale = (1.0, 1.0, 1.0) if stated is None else vector_of(stated)
        if min(scale) <= 0:
            stated_scale = f"the mesh '{uri}' of '{owner}' has the scale {' '.join(f'{each:g}' for each in scale)}"
            message = f"{stated_scale}; only positive numbers are supported; it is left out"
            self.losses.add(mesh, message, kind=_MESH_ABSENT, is_missing=True)
            return
        try:
            found = self.packages.resolve(uri, link.owner.file.path)
        except PackageError as error:
            message = f"the mesh '{uri}' of '{owner}' was not found; it is left out: {error}"
            self.losses.add(mesh, message, kind=_MESH_ABSENT, is_missing=True)
            return
        for note in found.notes:
            self.notes.add(note.rule, mesh, note.text)
        path = found.path
        parts = self._parts_of_mesh(path, scale, moves=moves)
        if isinstance(parts, str):
            message = f"a mesh of '{owner}' cannot be used: {parts}; it is left out"
            self.losses.add(mesh, message, kind=_MESH_ABSENT, is_missing=True)
            return
        if moves and not self._is_convex(path, scale):
            message = f"'{owner}' moves and is not convex: its convex hull collides"
            self.losses.add(mesh, message, kind="a mesh that moves and is not convex: its convex hull collides")
        if (way := self._simplified.get((path, scale, moves))) is not None:
            kind = "a mesh with many triangles is simplified"
            moved_by = f"its points move by up to {1000 * way:.2g} mm"
            self.losses.remark(mesh, f"'{uri}' of '{owner}' has many triangles and is simplified: {moved_by}", kind)
        factor = scale[0] if len(set(scale)) == 1 else scale
        yield PlacedShape(collision, {"mesh": {"file": str(path), "scale": factor}}, at, parts)

    def _is_convex(self, path: Path, scale: Vector3) -> bool:
        parts = self._parts_of_mesh(path, scale, moves=False)
        return not isinstance(parts, str) and len(parts) == 1 and not isinstance(parts[0], SurfacePart)

    def _with_fewer_triangles(self, key: _MeshKey, parts: tuple[Part, ...]) -> tuple[Part, ...]:

        if len(parts) != 1 or not isinstance(parts[0], SurfacePart) or (found := simplified(parts[0])) is None:
            return parts
        surface, way = found
        if way > 0:
            self._simplified[key] = way
        return (surface,)

    def _parts_of_mesh(self, path: Path, scale: Vector3, *, moves: bool) -> tuple[Part, ...] | str:
        """Return the parts of a mesh in its own frame, or the reason why it cannot be used."""
        key = (path, scale, moves)
        if key not in self._meshes:
            try:
                spec = MeshFile.model_validate({"file": path.name, "scale": scale})
                parts = tuple(read_mesh_parts(path, spec, moves=moves))
                self._meshes[key] = self._with_fewer_triangles(key, parts)
            except (ShapeError, ValidationError) as error:
                self._meshes[key] = said(error)
        return self._meshes[key]


def _plain(shape: Element) -> dict[str, Any] | None:
    """Return a box, cylinder or ball as keys; None for another shape. Raises SdfProblem."""
    if shape.tag == "box":
        return {"box": tuple(map(_resolved, vector_of(needed(shape, "size"))))}
    if shape.tag == "cylinder":
        return {"cylinder": {"radius": _size(shape, "radius"), "height": _size(shape, "length")}}
    if shape.tag == "sphere":
        return {"sphere": {"radius": _size(shape, "radius")}}
    if shape.tag == "ellipsoid" and len(set(radii := vector_of(needed(shape, "radii")))) == 1:
        return {"sphere": {"radius": radii[0]}}
    return None


def _coefficients(stated: Element) -> tuple[float, float]:
    along = number_of(stated, "mu", MAX_FRICTION)
    return along, number_of(stated, "mu2", along)


def _size(shape: Element, tag: str) -> float:
    return _resolved(numbers_of(needed(shape, tag), 1)[0])


def _resolved(length: float) -> float:
    """Return a length that engines can resolve: worlds mark the floor with thinner shapes, and Gazebo accepts them."""
    return max(length, MIN_LENGTH_M) if length > 0 else length


def said(error: Exception) -> str:
    """Return the message of an error in one line."""
    if not isinstance(error, ValidationError):
        return str(error)
    found = ((".".join(map(str, each["loc"])), each["msg"]) for each in error.errors(include_url=False))
    return "; ".join(f"{key}{': ' if key else ''}{text.removeprefix('Value error, ')}" for key, text in found)


MAX_TRIANGLES: Final = 1_000  # a mesh of a world with more triangles is simplified: each costs time at every step
_CELLS_M: Final = (0.001, 0.002, 0.005, 0.01, 0.02)


def simplified(surface: SurfacePart) -> tuple[SurfacePart, float] | None:
    """Return a surface with at most MAX_TRIANGLES, and the greatest way in m of a point; None if 2 cm are too few."""
    if len(surface.triangles) <= MAX_TRIANGLES:
        return surface, 0.0
    for size in _CELLS_M:
        cells, numbers = np.unique(np.floor(surface.points_xyz / size), axis=0, return_inverse=True)
        corners = numbers.reshape(-1)[surface.triangles]
        a, b, c = corners.T
        corners = corners[(a != b) & (b != c) & (c != a)]
        # The first corner is the least one, so that a triangle and its copy are equal.
        first = corners.argmin(axis=1)
        turned = np.stack([np.take_along_axis(corners, (first[:, None] + k) % 3, axis=1)[:, 0] for k in range(3)], 1)
        kept = np.unique(turned, axis=0)
        if 0 < len(kept) <= MAX_TRIANGLES:
            sums, counts = np.zeros((len(cells), 3)), np.zeros(len(cells))
            np.add.at(sums, numbers.reshape(-1), surface.points_xyz)
            np.add.at(counts, numbers.reshape(-1), 1.0)
            points = sums / counts[:, None]
            edges = points[kept]
            areas = np.linalg.norm(np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0]), axis=1)
            moved = float(np.linalg.norm(points[numbers.reshape(-1)] - surface.points_xyz, axis=1).max())
            return SurfacePart(points, kept[areas > 0]), moved
    return None
