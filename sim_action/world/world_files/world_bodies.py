"""Bodies from the models of Gazebo (SDF): each collision shape becomes a shape of a body, or a loss.

A static model is one fixed body. A model that moves is one rigid body; if its links are not joined, each link is a body
of its own, with the name `model/link`. Joints that move are losses: the links that they join move as one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Quaternion, Vector3, rpy_from_quaternion
from sim_action.core.records import dataclass, field
from sim_action.meshes import mesh_bytes
from sim_action.robot.audit.elements import ALL_CONTACTS, ContactBits
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.sdf_elements import (
    Notes,
    SdfProblem,
    flag_attribute,
    needed,
    number_of,
    numbers_of,
    text_of,
    vector_of,
)
from sim_action.robot.model.robot_model import MOMENTS, WORLD, Moments
from sim_action.robot.reading.sdf.auto_inertia import auto_inertia, stated_moments
from sim_action.robot.reading.sdf.composition import SEPARATOR, Entry, Scope
from sim_action.robot.reading.sdf.frames import Frames
from sim_action.robot.reading.sdf.worlds import SdfWorld, joint_end
from sim_action.world import Body, Inertia, MeshFile, Shape
from sim_action.world.parts import MassProperties, Part, SurfacePart, displaced, moved, symmetric, turned_tensor
from sim_action.world.shape_files.mesh_file import read_mesh_parts
from sim_action.world.shapes import MIN_LENGTH_M, ShapeError
from sim_action.world.world_files.losses import LossList, lost_parts

_LENGTH_TOLERANCE_M: Final = 1e-3

# SDF's default, and the greatest value: engines multiply the two frictions of a contact, Gazebo takes the lesser one.
MAX_FRICTION: Final = 1.0

_MeshKey = tuple[Path, Vector3, bool]  # file, scale, and True if it moves
_UP_AXIS: Final = re.compile(rb"<up_axis>\s*([XY]_UP)")
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
    ground_friction: float | None = None  # of the ground plane; None if the file has none
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
        up = geometry.rotate(at.orientation_xyzw, vector_of(plane.find("normal"), (0.0, 0.0, 1.0)))
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
        scale = vector_of(mesh.find("scale"), (1.0, 1.0, 1.0))
        if min(scale) <= 0:
            stated_scale = f"the mesh '{uri}' of '{owner}' has the scale {' '.join(f'{number:g}' for number in scale)}"
            message = f"{stated_scale}; only positive numbers are supported; it is left out"
            self.losses.add(mesh, message, kind=_MESH_ABSENT, is_missing=True)
            return
        try:
            resolved = self.packages.resolve(uri, link.owner.file.path)
        except PackageError as error:
            message = f"the mesh '{uri}' of '{owner}' was not found; it is left out: {error}"
            self.losses.add(mesh, message, kind=_MESH_ABSENT, is_missing=True)
            return
        for note in resolved.notes:
            self.notes.add(note.rule, mesh, note.text)
        path = resolved.path
        parts = self._parts_of_mesh(path, scale, moves=moves)
        if isinstance(parts, str):
            message = f"a mesh of '{owner}' cannot be used: {parts}; it is left out"
            self.losses.add(mesh, message, kind=_MESH_ABSENT, is_missing=True)
            return
        if moves and not self._is_convex(path, scale):
            message = f"'{owner}' moves and is not convex: its convex hull collides"
            self.losses.add(mesh, message, kind="a mesh that moves and is not convex: its convex hull collides")
        if turned := _UP_AXIS.search(mesh_bytes(path)):
            kind = "the <up_axis> of a mesh is ignored, as in Gazebo and RViz"
            self.losses.remark(mesh, f"{kind}: {turned[1].decode()} of '{uri}'", kind)
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

        if len(parts) != 1 or not isinstance(parts[0], SurfacePart) or (simplification := simplified(parts[0])) is None:
            return parts
        surface, way = simplification
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
    problems = ((".".join(map(str, problem["loc"])), problem["msg"]) for problem in error.errors(include_url=False))
    return "; ".join(f"{key}{': ' if key else ''}{text.removeprefix('Value error, ')}" for key, text in problems)


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


LINK_SEPARATOR: Final = "/"
"""Between the names of a model and of its link; `::` would be a command in the output of a workflow."""

_DEFAULT_OF_ONE: Final = ("mass", "inertia/ixx", "inertia/iyy", "inertia/izz")  # the parts of <inertial> that are 1
_NOTHING: Final = 1e-9  # m, and a part of a quaternion: less is rounding


@dataclass(frozen=True, eq=False)
class ReadBody:
    """A body of a world file; `parts`: in its frame, if its shape is in a file; `place`: of its model."""

    body: Body
    parts: tuple[Part, ...] | None
    place: Location | None


@dataclass(frozen=True, eq=False)
class _Group:
    """Links that move as one."""

    links: tuple[Entry, ...]
    fixed: bool


class BodyReader:
    """Reads the models of a world as bodies."""

    def __init__(self, world: SdfWorld, shapes: ShapeReader, losses: LossList) -> None:
        self._world, self._shapes, self._losses = world, shapes, losses

    def bodies(self, model: Entry) -> Iterator[ReadBody]:
        """Yield the bodies of a model; the ground is none. Raises SdfProblem."""
        assert model.scope is not None
        self._note_lost_parts(model, model.scope)
        groups = [(group, self._shapes_of(model, group)) for group in _groups(self._world.frames, model.scope)]
        shaped = [(group, shapes) for group, shapes in groups if shapes]
        for group, shapes in shaped:
            first = group.links[0]
            if len(shaped) == 1:
                in_model = geometry.compose(
                    geometry.inverse(self._world.frames.in_root(model)), self._world.frames.in_root(first)
                )
                frame = geometry.compose(self._world.link_pose(model, first), geometry.inverse(in_model))
                yield self._body(model, model.name, group, shapes, frame)
            else:
                own = first.full_name.removeprefix(f"{model.name}{SEPARATOR}").replace(SEPARATOR, LINK_SEPARATOR)
                name = f"{model.name}{LINK_SEPARATOR}{own}"
                yield self._body(model, name, group, shapes, self._world.link_pose(model, first))

    def _note_lost_parts(self, model: Entry, scope: Scope) -> None:
        for inner in scope.scopes():
            for tag, message in lost_parts(inner.element, moves=not inner.static):
                self._losses.add(tag, message, model.name)
        for entry in (model, *scope.all_of("model")):
            if entry.element.tag == "include":
                for tag, message in lost_parts(entry.element):
                    self._losses.add(tag, message, model.name)
        for link in scope.all_of("link"):
            for sensor in link.element.findall("sensor"):
                kind = "a sensor of a body measures nothing: only the robot has sensors"
                self._losses.remark(sensor, f"{kind} ('{model.name}')", kind)
            for tag, message in lost_parts(link.element, moves=not link.owner.static):
                self._losses.add(tag, message, model.name)

    def note_contact_bits(self, models: Iterable[Entry]) -> None:
        """Note shapes whose bits would keep them from touching another model or the ground. Raises SdfProblem."""
        contacts = [
            (model.name, not link.owner.static, contact, ContactBits.of(contact))
            for model in models
            for link in (model.scope.all_of("link") if model.scope else ())
            for contact in link.element.findall("collision/surface/contact")
        ]
        for name, moves, contact, bits in contacts:
            others = (other for of, moving, _, other in contacts if of != name and (moves or moving))
            if not all(map(bits.meets, (ALL_CONTACTS, *others))):
                message = "the bitmask of a <contact> is not simulated: the shape collides with every other one"
                self._losses.add(contact, message, name)

    def _shapes_of(self, model: Entry, group: _Group) -> list[PlacedShape]:
        shapes = list[PlacedShape]()
        for link in group.links:
            at = self._world.link_pose(model, link)
            for collision in link.element.findall("collision"):
                pose = geometry.compose(at, self._in_link(link, collision))
                shapes += self._shapes.shapes(link, pose, collision, model.name, moves=not group.fixed)
        return shapes

    def _in_link(self, link: Entry, holder: Element) -> Pose:
        """Return the pose of a part of a link in the frame of the link."""
        frames = self._world.frames
        in_link = frames.in_root(link)
        placed = frames.placed(link.owner, holder.find("pose"), in_link)
        return geometry.compose(geometry.inverse(in_link), placed)

    def _body(self, model: Entry, name: str, group: _Group, shapes: Sequence[PlacedShape], frame: Pose) -> ReadBody:
        keys: dict[str, Any] = {"name": name, "friction": self._friction(shapes, model.name)}
        if not group.fixed:
            keys |= self._weight(model, name, group, frame)
        specs = [shape.seen_from(frame) for shape in shapes]
        # One shape at the frame of the body needs no list.
        if len(shapes) == 1 and _is_nothing(specs[0].pose.pose):
            keys |= shapes[0].spec
        else:
            keys["shapes"] = tuple(specs)
        is_read = any(shape.own_parts is not None for shape in shapes)
        parts = tuple(part for shape in shapes for part in shape.parts(frame)) if is_read else None
        try:
            body = Body.model_validate({**keys, "pose": Placement.of(frame)})
        except ValidationError as error:
            raise SdfProblem("bad-shape", model.element, f"'{name}': {said(error)}") from None
        return ReadBody(body, parts, self._losses.places.get(model.element))

    def _friction(self, shapes: Sequence[PlacedShape], owner: str) -> float:
        by_friction = {self._shapes.friction(shape.collision, owner): shape.collision for shape in shapes}
        if len(by_friction) > 1:
            kind = "shapes of one body with different friction: the smallest is used for all"
            self._losses.add(by_friction[min(by_friction)], f"'{owner}' has {kind}", kind=kind)
        return min(by_friction, default=MAX_FRICTION)

    def _weight(self, model: Entry, name: str, group: _Group, frame: Pose) -> dict[str, Any]:
        """Return the keys `mass`, `center_of_mass` and `inertia` of a body. Raises SdfProblem."""
        whole = joined([self._link_weight(model, link, frame) for link in group.links])
        keys: dict[str, Any] = {"mass": whole.mass, "center_of_mass": whole.centre_xyz}
        try:
            moments = {moment: float(whole.inertia[place]) for moment, place in MOMENTS.items()}
            return {**keys, "inertia": Inertia.model_validate(moments)}
        except ValidationError as error:
            message = f"the inertia of '{name}' is that of uniform density: {said(error)}"
            kind = "an impossible <inertia>: that of uniform density is used"
            self._losses.add(group.links[0].element, message, kind=kind)
            return keys

    def _link_weight(self, model: Entry, link: Entry, frame: Pose) -> MassProperties:
        stated = link.element.find("inertial")
        inertial = Element("inertial") if stated is None else stated
        mass = number_of(inertial, "mass", 1.0)
        if mass <= 0:
            raise SdfProblem("bad-number", inertial, f"<mass> of '{model.name}' is {mass:g}: expected more than 0")
        used = "SDF's defaults are used, 1 kg and 1 kg m^2"
        if flag_attribute(inertial, "auto"):
            try:
                return self._computed_weight(model, link, inertial, frame)
            except SdfProblem as problem:
                kind = f"an <inertial auto> that cannot be computed: without <mass> and <inertia>, {used}"
                self._losses.add(inertial, f"'{model.name}': {problem}; {used}", kind=kind)
        elif absent := [path for path in _DEFAULT_OF_ONE if inertial.find(path) is None]:
            message = f"'{model.name}' has no {', '.join(absent)} in <inertial>: {used}, as in Gazebo"
            self._losses.remark(link.element, message, f"a body with an incomplete <inertial>: {used}, as in Gazebo")
        at = geometry.compose(self._world.link_pose(model, link), self._in_link(link, inertial))
        own = geometry.compose(geometry.inverse(frame), at)
        moments = stated_moments(inertial if (inertia := inertial.find("inertia")) is None else inertia)
        return MassProperties(mass, own.position_xyz, stated_tensor(moments, own.orientation_xyzw))

    def _computed_weight(self, model: Entry, link: Entry, inertial: Element, frame: Pose) -> MassProperties:
        """Return the weight of <inertial auto>. Raises SdfProblem."""
        in_body = geometry.compose(geometry.inverse(frame), self._world.link_pose(model, link))
        collisions = [
            (holder, geometry.compose(in_body, self._in_link(link, holder)))
            for holder in link.element.findall("collision")
        ]
        inertia = auto_inertia(inertial, collisions)
        return MassProperties(inertia.mass, inertia.centre_xyz, stated_tensor(inertia.moments, geometry.IDENTITY))


def _groups(frames: Frames, scope: Scope) -> list[_Group]:
    """Return the links of a model that move as one: groups of joined links, and all static links."""
    links = tuple(scope.all_of("link"))
    if scope.static:
        return [_Group(links, fixed=True)] if links else []
    groups = {link: [link] for link in links if not link.owner.static}
    held = [link for link in links if link.owner.static]
    bolted: set[int] = set()
    for joint in scope.all_of("joint"):
        names = text_of(joint.element, "parent"), text_of(joint.element, "child")
        ends = [joint_end(frames, joint, tag) for tag in ("parent", "child")]
        joined = [end for end in ends if end in groups]
        if WORLD in names or any(end is not None and end not in groups for end in ends):
            bolted.update(id(end) for end in joined)
        if len(joined) == 2 and (one := groups[joined[0]]) is not (other := groups[joined[1]]):
            one += other
            groups.update(dict.fromkeys(other, one))
    moving = list({id(group): group for group in groups.values()}.values())
    moving_groups = [_Group(tuple(group), fixed=any(id(link) in bolted for link in group)) for group in moving]
    return [*moving_groups, *([_Group(tuple(held), fixed=True)] if held else [])]


def _is_nothing(pose: Pose) -> bool:
    x, y, z, _ = pose.orientation_xyzw
    return all(abs(part) < _NOTHING for part in (*pose.position_xyz, x, y, z))


def joined(lumps: Sequence[MassProperties]) -> MassProperties:
    """Return several masses as one."""
    total = sum(lump.mass for lump in lumps)
    centre = sum(lump.mass / total * np.array(lump.centre_xyz) for lump in lumps)
    arms = [np.array(lump.centre_xyz) - centre for lump in lumps]
    inertia = sum(lump.inertia + lump.mass * displaced(arm) for lump, arm in zip(lumps, arms, strict=True))
    x, y, z = np.asarray(centre).tolist()
    return MassProperties(total, (x, y, z), np.asarray(inertia))


def stated_tensor(moments: Moments, orientation: Quaternion) -> NDArray[np.float64]:
    """Return the tensor of stated moments, whose axes have an orientation, in the outer axes."""
    return turned_tensor(symmetric(moments), orientation)
