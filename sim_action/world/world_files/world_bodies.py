"""Bodies from the models of Gazebo (SDF).

A static model is one fixed body. A model that moves is one rigid body; if its links are not joined, each link is a body
of its own, with the name `model/link`. Joints that move are losses: the links that they join move as one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Quaternion, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.audit.unsupported_parts import ALL_CONTACTS, ContactBits
from sim_action.robot.documents.sdf_elements import SdfProblem, flag_attribute, number_of, text_of
from sim_action.robot.model.robot_model import WORLD
from sim_action.robot.reading.sdf.auto_inertia import auto_inertia
from sim_action.robot.reading.sdf.composition import SEPARATOR, Entry, Scope
from sim_action.robot.reading.sdf.worlds import SdfWorld
from sim_action.world import Body, Inertia
from sim_action.world.mass_properties import MassProperties, displaced, symmetric, turned_tensor, uniform_properties
from sim_action.world.parts import Part
from sim_action.world.world_files.losses import LossList, lost_parts
from sim_action.world.world_files.world_shapes import MAX_FRICTION, PlacedShape, ShapeReader, said

LINK_SEPARATOR: Final = "/"
"""Between the names of a model and of its link; `::` would be a command in the output of a workflow."""

_NOTHING: Final = 1e-9  # m, and a part of a quaternion: less is rounding
_MOMENTS: Final = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}


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


@dataclass(frozen=True, eq=False)
class _Weight:
    """The stated mass in kg, its centre in m, and its inertia (3, 3) about that; None: of uniform density."""

    mass: float
    centre: Vector3 | None
    inertia: Any | None


class BodyReader:
    """Reads the models of a world as bodies."""

    def __init__(self, world: SdfWorld, shapes: ShapeReader, losses: LossList) -> None:
        self._world, self._shapes, self._losses = world, shapes, losses

    def bodies(self, model: Entry) -> Iterator[ReadBody]:
        """Yield the bodies of a model; the ground is none. Raises SdfProblem."""
        assert model.scope is not None
        self._note_lost_parts(model, model.scope)
        groups = [(group, self._shapes_of(model, group)) for group in _groups(model.scope)]
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
        for each in (model, *scope.all_of("model")):
            if each.element.tag == "include":
                for tag, message in lost_parts(each.element):
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
        found = list[PlacedShape]()
        for link in group.links:
            at = self._world.link_pose(model, link)
            for collision in link.element.findall("collision"):
                pose = geometry.compose(at, self._in_link(link, collision))
                found += self._shapes.shapes(link, pose, collision, model.name, moves=not group.fixed)
        return found

    def _in_link(self, link: Entry, holder: Element) -> Pose:
        """Return the pose of a part of a link in the frame of the link."""
        frames = self._world.frames
        in_link = frames.in_root(link)
        placed = frames.placed(link.owner, holder.find("pose"), in_link)
        return geometry.compose(geometry.inverse(in_link), placed)

    def _body(self, model: Entry, name: str, group: _Group, shapes: Sequence[PlacedShape], frame: Pose) -> ReadBody:
        keys: dict[str, Any] = {"name": name, "friction": self._friction(shapes, model.name)}
        if not group.fixed:
            keys |= self._weight(model, name, group, shapes, frame)
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
        found = {self._shapes.friction(shape.collision, owner): shape.collision for shape in shapes}
        if len(found) > 1:
            kind = "shapes of one body with different friction: the smallest is used for all"
            self._losses.add(found[min(found)], f"'{owner}' has {kind}", kind=kind)
        return min(found, default=MAX_FRICTION)

    def _weight(
        self, model: Entry, name: str, group: _Group, shapes: Sequence[PlacedShape], frame: Pose
    ) -> dict[str, Any]:
        """Return the keys `mass`, `center_of_mass` and `inertia` of a body. Raises SdfProblem."""
        weights = [self._link_weight(model, link, frame) for link in group.links]
        total = sum(weight.mass for weight in weights)
        if len(weights) == 1 and weights[0].centre is None and weights[0].inertia is None:
            return {"mass": total}

        lumps = []
        for link, weight in zip(group.links, weights, strict=True):
            parts = [part for shape in shapes if _is_of(shape, link) for part in shape.parts(frame)]
            at = geometry.compose(geometry.inverse(frame), self._world.link_pose(model, link))
            uniform = lump_of(weight.mass, parts, at.position_xyz)
            inertia = uniform.inertia if weight.inertia is None else weight.inertia
            lumps.append(MassProperties(weight.mass, weight.centre or uniform.centre_xyz, inertia))
        whole = joined(lumps)
        keys: dict[str, Any] = {"mass": total, "center_of_mass": whole.centre_xyz}
        try:
            moments = {moment: float(whole.inertia[place]) for moment, place in _MOMENTS.items()}
            return {**keys, "inertia": Inertia.model_validate(moments)}
        except ValidationError as error:
            message = f"the inertia of '{name}' is that of uniform density: {said(error)}"
            kind = "an impossible <inertia>: that of uniform density is used"
            self._losses.add(group.links[0].element, message, kind=kind)
            return keys

    def _link_weight(self, model: Entry, link: Entry, frame: Pose) -> _Weight:
        inertial = link.element.find("inertial")
        if inertial is None:
            return _Weight(1.0, None, None)
        mass = _mass(model, inertial)
        if flag_attribute(inertial, "auto"):
            try:
                return self._computed_weight(model, link, inertial, frame)
            except SdfProblem as problem:
                kind = "an <inertial auto> that cannot be computed: <mass>, or 1 kg, is used"
                message = f"'{model.name}': {problem}; <mass>, or 1 kg, is used"
                self._losses.add(inertial, message, kind=kind)
                return _Weight(mass, None, None)
        at = geometry.compose(self._world.link_pose(model, link), self._in_link(link, inertial))
        own = geometry.compose(geometry.inverse(frame), at)
        stated = inertial.find("inertia")
        if stated is None:
            return _Weight(mass, own.position_xyz if inertial.find("pose") is not None else None, None)

        moments = {name: number_of(stated, name, 1.0 if name[1] == name[2] else 0.0) for name in _MOMENTS}
        return _Weight(mass, own.position_xyz, stated_tensor(moments, own.orientation_xyzw))

    def _computed_weight(self, model: Entry, link: Entry, inertial: Element, frame: Pose) -> _Weight:
        """Return the weight of <inertial auto>. Raises SdfProblem."""
        in_body = geometry.compose(geometry.inverse(frame), self._world.link_pose(model, link))
        collisions = [
            (holder, geometry.compose(in_body, self._in_link(link, holder)))
            for holder in link.element.findall("collision")
        ]
        found = auto_inertia(inertial, collisions)
        return _Weight(found.mass, found.centre_xyz, stated_tensor(found.moments, geometry.IDENTITY))


def _mass(model: Entry, inertial: Element) -> float:
    mass = number_of(inertial, "mass", 1.0)
    if mass <= 0:
        raise SdfProblem("bad-number", inertial, f"<mass> of '{model.name}' is {mass:g}: expected more than 0")
    return mass


def _groups(scope: Scope) -> list[_Group]:
    """Return the links of a model that move as one: those that are joined, and all that are static."""
    links = tuple(scope.all_of("link"))
    if scope.static:
        return [_Group(links, fixed=True)] if links else []
    groups = {link: [link] for link in links if not link.owner.static}
    held = [link for link in links if link.owner.static]
    bolted: set[int] = set()
    for joint in scope.all_of("joint"):
        names = text_of(joint.element, "parent"), text_of(joint.element, "child")
        ends = [_link_named(joint.owner, name) for name in names]
        joined = [end for end in ends if end in groups]
        if WORLD in names or any(end is not None and end not in groups for end in ends):
            bolted.update(id(end) for end in joined)
        if len(joined) == 2 and (one := groups[joined[0]]) is not (other := groups[joined[1]]):
            one += other
            groups.update(dict.fromkeys(other, one))
    moving = list({id(group): group for group in groups.values()}.values())
    found = [_Group(tuple(group), fixed=any(id(link) in bolted for link in group)) for group in moving]
    return [*found, *([_Group(tuple(held), fixed=True)] if held else [])]


def _link_named(scope: Scope, name: str) -> Entry | None:
    """Return the link that a joint names, directly or by a frame or a model."""
    entry = scope.find(name)
    for _ in range(len(scope.members)):
        if entry is None or entry.kind == "link":
            return entry
        if entry.scope is not None:
            return next(entry.scope.all_of("link"), None)
        attached = entry.element.get("attached_to", "") if entry.kind == "frame" else text_of(entry.element, "child")
        entry = entry.owner.find(attached) if attached else next(entry.owner.all_of("link"), None)
    return None


def _is_of(shape: PlacedShape, link: Entry) -> bool:
    return any(collision is shape.collision for collision in link.element.findall("collision"))


def _is_nothing(pose: Pose) -> bool:
    x, y, z, _ = pose.orientation_xyzw
    return all(abs(part) < _NOTHING for part in (*pose.position_xyz, x, y, z))


def lump_of(mass: float, parts: Sequence[Part], otherwise: Vector3) -> MassProperties:
    """Return a mass of uniform density in parts; without parts, at a point."""
    if not parts:
        return MassProperties(mass, otherwise, np.zeros((3, 3)))
    centre, inertia = uniform_properties(parts)
    x, y, z = centre.tolist()
    return MassProperties(mass, (x, y, z), mass * inertia)


def joined(lumps: Sequence[MassProperties]) -> MassProperties:
    """Return several masses as one."""
    total = sum(lump.mass for lump in lumps)
    centre = sum(lump.mass / total * np.array(lump.centre_xyz) for lump in lumps)
    arms = [np.array(lump.centre_xyz) - centre for lump in lumps]
    inertia = sum(lump.inertia + lump.mass * displaced(arm) for lump, arm in zip(lumps, arms, strict=True))
    x, y, z = np.asarray(centre).tolist()
    return MassProperties(total, (x, y, z), np.asarray(inertia))


def stated_tensor(moments: Mapping[str, float], orientation: Quaternion) -> NDArray[np.float64]:
    """Return the tensor of stated moments, whose axes have an orientation, in the outer axes."""
    entries = symmetric(moments[name] for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return turned_tensor(entries, orientation)
