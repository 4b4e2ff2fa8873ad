"""Read the links and joints of SDF into the draft of a robot; each part keeps the place of its source.

An SDF joint has a frame of its own, and its axis goes through the origin of that frame. In a draft, it is the frame of
the child link. So the axis is rotated into the child link's frame. If it does not go through the origin of that frame,
the frame of the link is moved to the joint, without a rotation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import ZERO, Pose, Quaternion, Vector3
from sim_action.core.records import dataclass, replace
from sim_action.robot.audit.elements import no_direction, note_contact, note_parts, note_sensors
from sim_action.robot.documents.sdf_elements import (
    MODEL_FRAME,
    Notes,
    SdfProblem,
    amount_of,
    flag_attribute,
    flag_of,
    limit_of,
    needed,
    number_of,
    numbers_of,
    text_of,
    vector_of,
)
from sim_action.robot.documents.urdf_elements import LENGTHS, MAX_NUMBER, is_numbers
from sim_action.robot.model.draft import (
    SHAPES,
    UNLIMITED,
    InertialDraft,
    JointDraft,
    LimitDraft,
    LinkDraft,
    MeshDraft,
    MotionDraft,
    Paint,
    ShapeDraft,
    last_digit,
    origin_at,
)
from sim_action.robot.model.robot_model import WORLD, Mimic, Surface
from sim_action.robot.reading.sdf.auto_inertia import auto_inertia, stated_moments
from sim_action.robot.reading.sdf.composition import FRAMES_NAMED, PARENT_MODEL_FLAG, Entry
from sim_action.robot.reading.sdf.frames import Frames

_FRICTION: Final = "surface/friction/ode"
_CONTACT: Final = "collision/surface/contact/ode"
_DEFAULT_FRICTION: Final = 1.0
_NEVER_SLIDES: Final = 1e9
EMPTY: Final = "empty"  # the tag of a shape that does not collide

_INSTEAD: Final[Mapping[str, str]] = {
    "plane": "it has no bounds, so it can be part of a world only: use a <box>",
    "heightmap": "it can be part of a world only",
    "image": "convert it to a mesh",
    "polyline": "convert it to a mesh",
    "cone": "convert it to a mesh",
}


class LinkReader:
    """Reads links. Problems become findings in `notes`."""

    def __init__(self, notes: Notes, frames: Frames) -> None:
        self._notes, self._frames = notes, frames

    def read(self, entry: Entry, frame: Pose) -> LinkDraft:
        """Return a link. `frame`: its frame in the draft, in the outermost model's frame. Raises SdfProblem."""
        element = entry.element
        self._note_unsupported_parts(element, f"link '{entry.full_name}'")
        inertial = self._inertial(entry, frame)
        shapes = {tag: tuple(self._shapes(entry, tag, frame)) for tag in ("collision", "visual")}
        return LinkDraft(
            entry.full_name,
            self._notes.places[element],
            inertial,
            shapes["collision"],
            shapes["visual"],
            surface=Surface() if element.find("collision") is None else self._surface(element, entry.full_name),
        )

    def _inertial(self, entry: Entry, frame: Pose) -> InertialDraft | None:
        source = entry.element.find("inertial")
        if source is None:
            # A link that is fixed to the world needs no mass.
            if entry.owner.static or entry.full_name == WORLD:
                return None
            # SDF's defaults count as for an empty one.
            source = Element("inertial")
            self._notes.places[source] = self._notes.places[entry.element]
        if flag_attribute(source, "auto") and (computed := self._computed_inertial(source, entry, frame)) is not None:
            return computed
        self._note_defaults(source, entry.full_name)
        mass, inertia = source.find("mass"), source.find("inertia")
        holder = source if inertia is None else inertia
        moments = stated_moments(holder)
        return InertialDraft(
            origin_at(self._placed(entry, source, frame), self._notes.places[source]),
            1.0 if mass is None else numbers_of(mass, 1)[0],
            moments,
            max(last_digit(repr(moment)) for moment in moments),
            self._notes.places[source if mass is None else mass],
            self._notes.places[holder],
        )

    def _computed_inertial(self, source: Element, entry: Entry, frame: Pose) -> InertialDraft | None:
        """Return the inertia of the link's collisions; None if that failed."""
        collisions = [(holder, self._placed(entry, holder, frame)) for holder in entry.element.findall("collision")]
        inertia = self._notes.attempt(lambda source: auto_inertia(source, collisions), source)
        if inertia is None:
            return None
        place = self._notes.places[source]
        return InertialDraft(
            origin_at(Pose(inertia.centre_xyz), place), inertia.mass, inertia.moments, 0.0, place, place
        )

    def _note_defaults(self, inertial: Element, name: str) -> None:
        units = {"mass": "kg"} | {f"inertia/{name}": "kg m^2" for name in ("ixx", "iyy", "izz")}
        absent = [f"{path} = 1 {unit}" for path, unit in units.items() if inertial.find(path) is None]
        if absent:
            lacking = "incomplete" if len(inertial) else "missing or empty"
            message = f"<inertial> of link '{name}' is {lacking}; SDF's defaults are used: {', '.join(absent)}"
            self._notes.add("default-inertia", inertial, message)

    def _shapes(self, entry: Entry, tag: str, frame: Pose) -> Iterator[ShapeDraft]:
        """Yield the collisions or visuals of a link."""
        for holder in entry.element.findall(tag):
            # A visual shape without a valid size is left out without a finding.
            shape = visual_shape(holder) if tag == "visual" else shape_in(holder)
            if shape is None:
                continue
            if tag == "collision" and shape.find("submesh") is not None:
                message = "<submesh> is not supported; if allowed, the whole mesh collides"
                self._notes.add("unsupported-part", shape, message)
            yield ShapeDraft(
                "sphere" if shape.tag == "ellipsoid" else shape.tag,
                origin_at(self._placed(entry, holder, frame), self._notes.places[holder]),
                self._notes.places[shape],
                shape_sizes(shape),
                _mesh(shape, entry.owner.file.path) if shape.tag == "mesh" else None,
                _paint(holder) if tag == "visual" else None,
            )

    def _placed(self, entry: Entry, holder: Element, frame: Pose) -> Pose:
        pose = self._frames.placed(entry.owner, holder.find("pose"), self._frames.in_root(entry))
        return geometry.compose(geometry.inverse(frame), pose)

    def _surface(self, link: Element, name: str) -> Surface:
        """Return the surface of a link, which is one for all its collisions: their smallest friction is used."""
        surfaces = [_surface(collision) for collision in link.findall("collision") if _collides(collision)]
        # Engines take no friction above the default.
        by_friction = {min(_friction(surface, "mu"), _DEFAULT_FRICTION): surface for surface in reversed(surfaces)}
        source = by_friction[min(by_friction)] if by_friction else link
        if len(by_friction) > 1:
            least, most = min(by_friction), max(by_friction)
            message = (
                f"the collisions of link '{name}' have frictions from {least:g} to {most:g}: {least:g} is used for "
                "all; for different ones, make them links of their own, joined by fixed joints"
            )
            self._notes.add("shared-friction", source, message)
        mu, mu2 = _friction(source, "mu"), _friction(source, "mu2")
        if source.find("mu2") is not None and mu2 != mu:
            self._notes.add("two-frictions", source, no_direction("mu", f"{mu:g}", "mu2", f"{mu2:g}"))
        contact = link.find(_CONTACT)
        stated = Surface() if contact is None else _contact_surface(contact)
        return replace(stated, friction=min(mu, _DEFAULT_FRICTION))

    def _note_unsupported_parts(self, link: Element, owner: str) -> None:
        note_parts(self._notes, link, owner)
        note_sensors(self._notes, link, owner)
        for collision in link.findall("collision"):
            name = f"collision '{collision.get('name', '')}' of {owner}"
            note_parts(self._notes, collision, name)
            note_contact(self._notes, collision, name)


def _collides(collision: Element) -> bool:
    return collision.find(f"geometry/{EMPTY}") is None


def _surface(collision: Element) -> Element:
    stated = collision.find(_FRICTION)
    return collision if stated is None else stated


def _friction(friction: Element, tag: str) -> float:
    stated = number_of(friction, tag, _DEFAULT_FRICTION)
    return _NEVER_SLIDES if stated < 0 else stated


def _contact_surface(contact: Element) -> Surface:
    """Return the surface with the stiffness and damping of a <contact>. Raises SdfProblem."""
    # Models write a stiffness of 0 for "not specified".
    surface = Surface(stiffness=amount_of(contact, "kp") or None)
    return surface if contact.find("kd") is None else replace(surface, damping=amount_of(contact, "kd"))


def shape_in(holder: Element) -> Element | None:
    """Return the shape of a <collision> or <visual>; None if it is <empty/>. Raises SdfProblem."""
    shape = next(iter(needed(holder, "geometry")), None)
    if shape is None:
        raise SdfProblem("missing-part", holder, "<geometry> has no shape")
    return None if shape.tag == EMPTY else shape


def shape_sizes(shape: Element) -> dict[str, tuple[float, ...]]:
    """Return the sizes of a plain shape; an ellipsoid with equal radii is a sphere. Raises SdfProblem."""
    if shape.tag == "mesh":
        return {}
    if shape.tag in SHAPES:
        return {name: numbers_of(needed(shape, name), LENGTHS.get(name, 1)) for name in SHAPES[shape.tag]}
    if shape.tag != "ellipsoid":
        instead = _INSTEAD.get(shape.tag, f"the shapes are {', '.join((*SHAPES, 'ellipsoid', 'mesh'))}")
        raise SdfProblem("unknown-shape", shape, f"<{shape.tag}> is not supported: {instead}")
    if len(set(radii := vector_of(needed(shape, "radii")))) > 1:
        message = "an <ellipsoid> with different radii is not supported: convert it to a mesh"
        raise SdfProblem("unknown-shape", shape, message)
    return {"radius": radii[:1]}


def _mesh(shape: Element, file: Path) -> MeshDraft:
    """Return a mesh. `file`: the file from which its path starts. Raises SdfProblem."""
    uri = text_of(shape, "uri")
    if not uri:
        raise SdfProblem("missing-part", shape, "<mesh> has no <uri>")
    return MeshDraft(uri, file, vector_of(shape.find("scale"), (1.0, 1.0, 1.0)))


def visual_shape(visual: Element) -> Element | None:
    """Return the shape of a <visual>; None if it is neither a mesh nor a plain shape with a valid size."""
    shape = next(iter(visual.findall("geometry/*")), None)
    if shape is None or shape.tag == "mesh":
        return shape
    sizes = SHAPES.get(shape.tag, ())
    stated = all(is_numbers(shape.findtext(name) or "", LENGTHS.get(name, 1)) for name in sizes)
    return shape if sizes and stated else None


def _paint(visual: Element) -> Paint | None:
    """Return the colour of a visual, if it states one; the opacity is alpha * (1 - <transparency>)."""
    words = (visual.findtext("material/diffuse") or "").split()[:4]
    if not is_numbers(" ".join(words[:3]), 3):
        return None
    alpha = _clipped(words[3], 1.0) if len(words) > 3 else 1.0
    red, green, blue = (_clipped(word, 0.0) for word in words[:3])
    return (red, green, blue), alpha * (1 - _clipped(visual.findtext("transparency") or "", 0.0))


def _clipped(text: str, otherwise: float) -> float:
    return min(1.0, max(0.0, float(text))) if is_numbers(text, 1) else otherwise


_SUPPORTED: Final = ("revolute", "continuous", "prismatic", "ball", "universal", "revolute2", "fixed")
_URDF_TYPES: Final = {"ball": "spherical", "revolute2": "universal"}
_UNSUPPORTED: Final = {
    "screw": "no engine couples a rotation and a translation in one joint; use a revolute and a prismatic joint with "
    "<mimic>"
}
_TWO_AXES: Final = ("universal", "revolute2")
# The parts of an axis that are not read of a joint with several.
_NOT_OF_SEVERAL: Final = {
    "ball": ("limit", "mimic", "dynamics/friction", "dynamics/spring_stiffness"),
    **dict.fromkeys(_TWO_AXES, ("mimic",)),
}
_AXIS_TOLERANCE_M: Final = 1e-9  # poses in files are rounded


@dataclass(frozen=True, eq=False)
class ResolvedJoint:
    """A joint whose links, frame and axis are resolved."""

    entry: Entry
    type: str  # as in SDF
    parent: Entry | None  # the parent link; None is the world
    child: Entry
    pose: Pose  # the joint's frame, in the outermost model's frame
    axis_xyz: Vector3 | None  # in the frame of the child link; None for a fixed joint and a ball joint
    axis2_xyz: Vector3 | None = None  # the second axis of a universal joint, in the same frame

    def shift(self, child_pose: Pose) -> Vector3:
        """Return the offset in m, in the child link's frame, that moves the child's origin onto the axis."""
        if self.type in ("fixed", "prismatic"):
            return ZERO
        origin = geometry.compose(geometry.inverse(child_pose), self.pose).position_xyz
        if self.axis_xyz is None or self.axis2_xyz is not None:
            return origin if math.hypot(*origin) > _AXIS_TOLERANCE_M else ZERO
        length = math.hypot(*self.axis_xyz)
        away = math.hypot(*geometry.cross(origin, self.axis_xyz)) / length if length else 0.0
        return origin if away > _AXIS_TOLERANCE_M else ZERO


def resolve_joint(notes: Notes, frames: Frames, entry: Entry) -> ResolvedJoint:
    """Resolve the links, the frame and the axis of a joint. Raises SdfProblem."""
    child, parent = (frames.end_of(entry, tag) for tag in ("child", "parent"))
    if child is None:
        message = f"joint '{entry.full_name}' has the world as its child: the world must be the parent"
        raise SdfProblem("unknown-link", entry.element, message)
    kind = _type(notes, entry)
    pose = frames.in_root(entry)
    has_axis = kind not in ("fixed", "ball")
    turned = pose.orientation_xyzw
    tags = ["axis", "axis2"] if kind in _TWO_AXES else ["axis"] if has_axis else []
    to_child = geometry.conjugate(frames.in_root(child).orientation_xyzw)
    axes = [geometry.rotate(to_child, _axis(notes, frames, entry, turned, tag)) for tag in tags]
    return ResolvedJoint(entry, kind, parent, child, pose, *axes, *[None] * (1 - len(axes)))


def _type(notes: Notes, entry: Entry) -> str:
    element, name = entry.element, entry.full_name
    kind = element.get("type", "")
    if kind in _UNSUPPORTED and not entry.owner.static:
        message = f"{kind} joint '{name}' is not supported: {_UNSUPPORTED[kind]}; if allowed, it is fixed"
        notes.add("unsupported-joint", element, message)
    elif kind == "gearbox":
        raise SdfProblem(
            "joint-type",
            element,
            f"joint '{name}' is a gearbox, which is not supported: use <mimic> in the <axis> of a joint",
        )
    elif kind not in {*_SUPPORTED, *_UNSUPPORTED}:
        allowed = ", ".join(_SUPPORTED)
        raise SdfProblem(
            "joint-type", element, f"joint '{name}' has the unknown type '{kind}'; the types are {allowed}"
        )
    if kind not in _SUPPORTED or entry.owner.static:
        return "fixed"
    return "continuous" if kind == "revolute" and not _is_limited(element.find("axis/limit")) else kind


def _is_limited(limit: Element | None) -> bool:
    return limit_of(limit, "lower", -UNLIMITED) > -UNLIMITED or limit_of(limit, "upper", UNLIMITED) < UNLIMITED


def _axis(notes: Notes, frames: Frames, entry: Entry, turned: Quaternion, tag: str = "axis") -> Vector3:
    """Return an axis in the frame of the outermost model; `turned`: the joint's frame in it. Raises SdfProblem."""
    axis = needed(entry.element, tag)
    xyz = axis.find("xyz")
    vector = vector_of(xyz, (0.0, 0.0, 1.0))
    scope, name = entry.owner, "" if xyz is None else xyz.get("expressed_in", "")
    _check_flag(notes, entry, axis)
    orientation = turned
    if name:
        frame = frames.named(scope, name, axis if xyz is None else xyz)
        orientation = (frames.in_root(frame) if frame else frames.model_in_root(scope)).orientation_xyzw
    return geometry.rotate(orientation, vector)


def _check_flag(notes: Notes, entry: Entry, axis: Element) -> None:
    """Check the flag of SDF 1.5 and 1.6 for axes in the model's frame; newer versions ignore it. Raises SdfProblem."""
    flag = axis.find(PARENT_MODEL_FLAG)
    if flag is None or not flag_of(axis, PARENT_MODEL_FLAG) or entry.owner.file.version < FRAMES_NAMED:
        return
    message = f"<{PARENT_MODEL_FLAG}> of joint '{entry.full_name}' is ignored: it is a part of SDF 1.5 and 1.6"
    notes.add("passed-over", flag, f'{message}; for an axis in that frame, write <xyz expressed_in="{MODEL_FRAME}">')


class JointReader:
    """Reads joints. Problems become findings in `notes`."""

    def __init__(self, notes: Notes, frames: Frames) -> None:
        self._notes, self._frames = notes, frames

    def read(self, resolved: ResolvedJoint, origin: Pose) -> JointDraft:
        """Return a joint. `origin`: the child link's frame in the parent link's frame. Raises SdfProblem."""
        element, name = resolved.entry.element, resolved.entry.full_name
        place = self._notes.places[element]
        owner = f"joint '{name}'"
        note_sensors(self._notes, element, owner)
        note_parts(self._notes, element, owner, frozenset({"axis", "axis2"} if resolved.axis_xyz is None else ()))
        for tag in _NOT_OF_SEVERAL.get(resolved.type, ()):
            for part in element.findall(f"axis/{tag}") + element.findall(f"axis2/{tag}"):
                meaning = "it is read of a joint with one axis"
                self._notes.leave_out(f"{resolved.type}/{tag}", part, f"<{part.tag}> of {owner}", meaning=meaning)
        motion = MotionDraft()
        second: MotionDraft | None = None
        mimic: Mimic | None = None
        if resolved.axis2_xyz is not None:
            second = self._motion(needed(element, "axis2"), resolved.axis2_xyz, resolved.type, f"{name}_2")
        if resolved.axis_xyz is not None:
            axis = needed(element, "axis")
            motion = self._motion(axis, resolved.axis_xyz, resolved.type, name if second is None else f"{name}_1")
            mimic = self._mimic(axis, resolved.entry) if second is None else None
        elif resolved.type == "ball":
            motion = MotionDraft(damping=amount_of(element, "axis/dynamics/damping") or None)
        return JointDraft(
            name,
            _URDF_TYPES.get(resolved.type, resolved.type),
            WORLD if resolved.parent is None else resolved.parent.full_name,
            resolved.child.full_name,
            place,
            origin_at(origin, place),
            motion,
            second,
            mimic,
        )

    def _motion(self, axis: Element, xyz: Vector3, kind: str, name: str) -> MotionDraft:
        """Return the motion of an axis; `name`: of the joint that it becomes."""
        place, limit, dynamics = self._notes.places, axis.find("limit"), axis.find("dynamics")
        if start := number_of(axis, "initial_position", 0.0):
            message = f"<initial_position> is ignored: set robot.joints: {{{name}: {start:g}}} in the scenario"
            self._notes.add("passed-over", axis, message)
        motion = MotionDraft(xyz, place[axis], _limits(axis, kind, place[axis if limit is None else limit]))
        if dynamics is None:
            return motion
        stiffness = amount_of(dynamics, "spring_stiffness")
        return replace(
            motion,
            damping=amount_of(dynamics, "damping"),
            friction=amount_of(dynamics, "friction"),
            spring=(stiffness, number_of(dynamics, "spring_reference", 0.0)) if stiffness else (0.0, 0.0),
        )

    def _mimic(self, axis: Element, entry: Entry) -> Mimic | None:
        mimic = axis.find("mimic")
        if mimic is None:
            return None
        name = mimic.get("joint", "")
        leader = self._frames.named(entry.owner, name, mimic) if name else None
        if leader is None or leader.kind != "joint" or mimic.get("axis", "axis") != "axis":
            raise SdfProblem(
                "unknown-frame", mimic, f"<mimic> refers to '{name}'; it must refer to a joint with one axis"
            )
        multiplier = number_of(mimic, "multiplier", 1.0)
        offset = number_of(mimic, "offset", 0.0) - multiplier * number_of(mimic, "reference", 0.0)
        if abs(offset) > MAX_NUMBER:
            message = f"<offset> minus <multiplier> times <reference> is {offset:g}: at most {MAX_NUMBER:g} is possible"
            raise SdfProblem("bad-number", mimic, message)
        return Mimic(leader.full_name, multiplier, offset)


def _limits(axis: Element, kind: str, place: Location) -> LimitDraft | None:
    """Return the limits of an axis; None if nothing is limited. `kind`: the type of its joint. Raises SdfProblem."""
    limit = axis.find("limit")
    effort, velocity = (_most(limit, tag) for tag in ("effort", "velocity"))
    lower, upper = limit_of(limit, "lower", -UNLIMITED), limit_of(limit, "upper", UNLIMITED)
    if kind == "continuous" or (kind in _TWO_AXES and not _is_limited(limit)):
        return None if effort is velocity is None else LimitDraft(place, effort=effort, velocity=velocity)
    return LimitDraft(place, lower, upper, effort, velocity)


def _most(limit: Element | None, tag: str) -> float | None:
    """Return the largest effort or velocity; None without a limit."""
    most = limit_of(limit, tag, -1.0)
    return most if 0 <= most < UNLIMITED else None
