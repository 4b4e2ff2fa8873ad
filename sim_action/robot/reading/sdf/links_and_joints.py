"""Write the links and joints of SDF as URDF; each element keeps the place of its source.

An SDF joint has a frame of its own, and its axis goes through the origin of that frame. In URDF, it is the frame of the
child link. So the axis is rotated into the child link's frame. If it does not go through the origin of that frame, the
frame of the link in URDF is moved to the joint, without a rotation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import ZERO, Pose, Quaternion, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.audit.elements import note_contact, note_parts, note_sensors
from sim_action.robot.documents.sdf_elements import (
    MODEL_FRAME,
    Notes,
    SdfProblem,
    flag_attribute,
    flag_of,
    limit_of,
    needed,
    number_of,
    numbers_of,
    text_of,
    vector_of,
)
from sim_action.robot.documents.urdf_elements import UNLIMITED, is_numbers
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.robot_model import WORLD
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

# The sizes of each plain shape, and the count of numbers in each.
_SIZES: Final = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
}


class LinkWriter:
    """Writes links into a URDF."""

    def __init__(self, notes: Notes, frames: Frames, writer: UrdfWriter) -> None:
        self._notes, self._frames, self._writer = notes, frames, writer

    def write(self, entry: Entry, frame: Pose) -> None:
        """Write a link. `frame`: the URDF link's frame, in the outermost model's frame. Raises SdfProblem."""
        element, writer = entry.element, self._writer
        link = writer.add(writer.root, "link", element, name=entry.full_name)
        self._note_unsupported_parts(element, f"link '{entry.full_name}'")
        inertial = element.find("inertial")
        if inertial is None and not entry.owner.static and entry.full_name != WORLD:
            # SDF's defaults count as for an empty one. A link that is fixed to the world needs no mass.
            inertial = Element("inertial")
            self._notes.places[inertial] = self._notes.places[element]
        if inertial is not None and not self._write_auto_inertia(link, inertial, entry, frame):
            self._write_inertial(link, inertial, self._placed(entry, inertial, frame))
        for holder in element:
            if holder.tag in {"collision", "visual"}:
                self._write_shape(link, holder, entry, frame)
        if element.find("collision") is not None:
            self._write_surface(element, entry.full_name)

    def _write_inertial(self, link: Element, source: Element, pose: Pose) -> None:
        writer = self._writer
        inertial = writer.add(link, "inertial", source)
        writer.add_origin(inertial, source, pose)
        mass, inertia = source.find("mass"), source.find("inertia")
        self._note_defaults(source, link.attrib["name"])
        kilograms = 1.0 if mass is None else numbers_of(mass, 1)[0]
        writer.add(inertial, "mass", source if mass is None else mass, value=numbers(kilograms))
        holder = source if inertia is None else inertia
        moments = stated_moments(holder)
        writer.add(inertial, "inertia", holder, **{name: numbers(value) for name, value in moments.items()})

    def _write_auto_inertia(self, link: Element, source: Element, entry: Entry, frame: Pose) -> bool:
        """Write the inertia of the link's collisions, if it is `auto`. Return False if not, or if that failed."""
        if not flag_attribute(source, "auto"):
            return False
        collisions = [(holder, self._placed(entry, holder, frame)) for holder in entry.element.findall("collision")]
        inertia = self._notes.attempt(lambda source: auto_inertia(source, collisions), source)
        if inertia is None:
            return False
        writer = self._writer
        inertial = writer.add(link, "inertial", source)
        writer.add_origin(inertial, source, Pose(inertia.centre_xyz))
        writer.add(inertial, "mass", source, value=numbers(inertia.mass))
        writer.add(inertial, "inertia", source, **{name: numbers(value) for name, value in inertia.moments.items()})
        return True

    def _note_defaults(self, inertial: Element, name: str) -> None:
        units = {"mass": "kg"} | {f"inertia/{name}": "kg m^2" for name in ("ixx", "iyy", "izz")}
        absent = [f"{path} = 1 {unit}" for path, unit in units.items() if inertial.find(path) is None]
        if absent:
            lacking = "incomplete" if len(inertial) else "missing or empty"
            message = f"<inertial> of link '{name}' is {lacking}; SDF's defaults are used: {', '.join(absent)}"
            self._notes.add("default-inertia", inertial, message)

    def _write_shape(self, link: Element, holder: Element, entry: Entry, frame: Pose) -> None:
        is_visual = holder.tag == "visual"
        # A visual shape without a valid size is left out without a finding.
        shape = visual_shape(holder) if is_visual else shape_in(holder)
        if shape is None:
            return
        if not is_visual and shape.find("submesh") is not None:
            message = "<submesh> is not supported; if allowed, the whole mesh collides"
            self._notes.add("unsupported-part", shape, message)
        writer, file = self._writer, entry.owner.file.path
        written = writer.add(link, holder.tag, holder)
        writer.add_origin(written, holder, self._placed(entry, holder, frame))
        geometry_of_shape = writer.add(written, "geometry", holder)
        write_shape(writer, geometry_of_shape, shape, file)
        if is_visual:
            write_colour(writer, written, holder)

    def _placed(self, entry: Entry, holder: Element, frame: Pose) -> Pose:
        pose = self._frames.placed(entry.owner, holder.find("pose"), self._frames.in_root(entry))
        return geometry.compose(geometry.inverse(frame), pose)

    def _write_surface(self, link: Element, name: str) -> None:
        """Write the surface of a link. URDF has one per link: the smallest friction of its collisions is used."""
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
        writer = self._writer
        gazebo = writer.add(writer.root, "gazebo", source, reference=name)
        writer.add(gazebo, "mu1", source).text = numbers(_friction(source, "mu"))
        if source.find("mu2") is not None:
            writer.add(gazebo, "mu2", source).text = numbers(_friction(source, "mu2"))
        contact = link.find(_CONTACT)
        for tag in ("kp", "kd"):
            if contact is not None and contact.find(tag) is not None:
                writer.add(gazebo, tag, contact).text = numbers(number_of(contact, tag, 0.0))

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


def shape_in(holder: Element) -> Element | None:
    """Return the shape of a <collision> or <visual>; None if it is <empty/>. Raises SdfProblem."""
    shape = next(iter(needed(holder, "geometry")), None)
    if shape is None:
        raise SdfProblem("missing-part", holder, "<geometry> has no shape")
    return None if shape.tag == EMPTY else shape


def write_shape(writer: UrdfWriter, parent: Element, shape: Element, file: Path) -> None:
    """Write a shape into a <geometry> of URDF. `file`: the file from which paths of meshes start. Raises SdfProblem."""
    if shape.tag == "mesh":
        uri = text_of(shape, "uri")
        if not uri:
            raise SdfProblem("missing-part", shape, "<mesh> has no <uri>")
        scale = vector_of(shape.find("scale"), (1.0, 1.0, 1.0))
        writer.files[writer.add(parent, "mesh", shape, filename=uri, scale=numbers(*scale))] = file
    elif shape.tag in _SIZES:
        sizes = {name: numbers(*numbers_of(needed(shape, name), count)) for name, count in _SIZES[shape.tag].items()}
        writer.add(parent, shape.tag, shape, **sizes)
    elif shape.tag != "ellipsoid":
        instead = _INSTEAD.get(shape.tag, f"the shapes are {', '.join((*_SIZES, 'ellipsoid', 'mesh'))}")
        raise SdfProblem("unknown-shape", shape, f"<{shape.tag}> is not supported: {instead}")
    elif len(set(radii := vector_of(needed(shape, "radii")))) > 1:
        message = "an <ellipsoid> with different radii is not supported: convert it to a mesh"
        raise SdfProblem("unknown-shape", shape, message)
    else:
        writer.add(parent, "sphere", shape, radius=numbers(radii[0]))


def visual_shape(visual: Element) -> Element | None:
    """Return the shape of a <visual>; None if it is neither a mesh nor a plain shape with a valid size."""
    shape = next(iter(visual.findall("geometry/*")), None)
    if shape is None or shape.tag == "mesh":
        return shape
    sizes = _SIZES.get(shape.tag, {})
    stated = all(is_numbers(shape.findtext(name) or "", count) for name, count in sizes.items())
    return shape if sizes and stated else None


def write_colour(writer: UrdfWriter, written: Element, visual: Element) -> None:
    """Write the colour of a visual, if it states one; the opacity is alpha * (1 - <transparency>)."""
    words = (visual.findtext("material/diffuse") or "").split()[:4]
    text, alpha = " ".join(words[:3]), words[3] if len(words) > 3 else "1"
    if is_numbers(text, 3):
        opacity = _clipped(alpha, 1.0) * (1 - _clipped(visual.findtext("transparency") or "", 0.0))
        material = writer.add(written, "material", visual, name=f"of visual '{visual.get('name', '')}'")
        writer.add(material, "color", visual, rgba=f"{text} {opacity:g}")


def _clipped(text: str, otherwise: float) -> float:
    return min(1.0, max(0.0, float(text))) if is_numbers(text, 1) else otherwise


class UrdfWriter:
    """A URDF document that is being written.

    `name`: name of the robot; `source`: the <model> element; `sources`: the file and line of each element of the SDF.
    """

    def __init__(self, name: str, source: Element, sources: Mapping[Element, Location]) -> None:
        self.root = Element("robot", name=name)
        self._sources = sources
        self._places = {self.root: sources[source]}
        self.files: dict[Element, Path] = {}  # <mesh> -> the file from which its path starts

    def add(self, parent: Element, tag: str, source: Element, **attributes: str) -> Element:
        """Add an element with the place of `source`."""
        element = ET.SubElement(parent, tag, attributes)
        self._places[element] = self._sources[source]
        return element

    def add_origin(self, parent: Element, source: Element, pose: Pose) -> None:
        """Add an <origin>."""
        rpy = geometry.rpy_from_quaternion(pose.orientation_xyzw)
        self.add(parent, "origin", source, xyz=numbers(*pose.position_xyz), rpy=numbers(*rpy))

    def share(self, parent: Element, source: Element) -> None:
        """Add an element of the SDF itself, with all its children."""
        parent.append(source)
        self._places.update((part, self._sources[part]) for part in source.iter())

    def document(self) -> ModelDocument:
        """Return the document."""
        return ModelDocument(self.root, self._places, self.files)


def numbers(*values: float) -> str:
    """Return numbers as text for URDF, with all digits."""
    return " ".join(repr(value + 0.0) for value in values)  # + 0.0 turns -0.0 into 0.0


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
    type: str  # the URDF type
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


def _kind_of_axis(kind: str, axis: Element) -> str:
    return ("revolute" if _is_limited(axis.find("limit")) else "continuous") if kind in _TWO_AXES else kind


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


class JointWriter:
    """Writes joints into a URDF."""

    def __init__(self, notes: Notes, frames: Frames, writer: UrdfWriter) -> None:
        self._notes, self._frames, self._writer = notes, frames, writer

    def write(self, resolved: ResolvedJoint, origin: Pose) -> None:
        """Write a joint. `origin`: the child link's frame in the parent link's frame. Raises SdfProblem."""
        element, writer = resolved.entry.element, self._writer
        joint = writer.add(
            writer.root,
            "joint",
            element,
            name=resolved.entry.full_name,
            type=_URDF_TYPES.get(resolved.type, resolved.type),
        )
        writer.add_origin(joint, element, origin)
        owner = f"joint '{resolved.entry.full_name}'"
        note_sensors(self._notes, element, owner)
        note_parts(self._notes, element, owner, frozenset({"axis", "axis2"} if resolved.axis_xyz is None else ()))
        writer.add(joint, "parent", element, link=WORLD if resolved.parent is None else resolved.parent.full_name)
        writer.add(joint, "child", element, link=resolved.child.full_name)
        if resolved.axis_xyz is not None:
            axis = needed(element, "axis")
            kind = _kind_of_axis(resolved.type, axis)
            self._write_axis(joint, axis, resolved.axis_xyz, kind)
            if resolved.axis2_xyz is None:
                self._write_mimic(joint, axis, resolved.entry)
        for tag in _NOT_OF_SEVERAL.get(resolved.type, ()):
            for part in element.findall(f"axis/{tag}") + element.findall(f"axis2/{tag}"):
                meaning = "it is read of a joint with one axis"
                self._notes.leave_out(f"{resolved.type}/{tag}", part, f"<{part.tag}> of {owner}", meaning=meaning)
        damping = number_of(element, "axis/dynamics/damping", 0.0)
        if resolved.type == "ball" and damping:
            writer.add(joint, "dynamics", element, damping=numbers(damping))
        if resolved.axis2_xyz is not None:
            second = needed(element, "axis2")
            self._write_axis(joint, second, resolved.axis2_xyz, _kind_of_axis(resolved.type, second), "2")

    def _write_axis(self, joint: Element, axis: Element, xyz: Vector3, kind: str, number: str = "") -> None:
        """Write an axis with its limits and dynamics; `number`: at the end of the tags."""
        self._writer.add(joint, f"axis{number}", axis, xyz=numbers(*xyz))
        limit = axis.find("limit")
        bounds = {"lower": limit_of(limit, "lower", -UNLIMITED), "upper": limit_of(limit, "upper", UNLIMITED)}
        attributes = {} if kind == "continuous" else {tag: numbers(bound) for tag, bound in bounds.items()}
        for tag in ("effort", "velocity"):
            most = limit_of(limit, tag, -1.0)
            if 0 <= most < UNLIMITED:
                attributes[tag] = numbers(most)
        if attributes:
            self._writer.add(joint, f"limit{number}", axis if limit is None else limit, **attributes)
        self._write_dynamics(joint, axis, number)

    def _write_dynamics(self, joint: Element, axis: Element, number: str) -> None:
        name = f"{joint.attrib['name']}_{number or 1}" if "universal" in joint.attrib["type"] else joint.attrib["name"]
        start = number_of(axis, "initial_position", 0.0)
        if start:
            message = f"<initial_position> is ignored: set robot.joints: {{{name}: {start:g}}} in the scenario"
            self._notes.add("passed-over", axis, message)
        dynamics = axis.find("dynamics")
        if dynamics is None:
            return
        stated = {tag: numbers(number_of(dynamics, tag, 0.0)) for tag in ("damping", "friction")}
        if number_of(dynamics, "spring_stiffness", 0.0):
            tags = ("spring_stiffness", "spring_reference")
            stated |= {tag: numbers(number_of(dynamics, tag, 0.0)) for tag in tags}
        self._writer.add(joint, f"dynamics{number}", dynamics, **stated)

    def _write_mimic(self, joint: Element, axis: Element, entry: Entry) -> None:
        mimic = axis.find("mimic")
        if mimic is None:
            return
        name = mimic.get("joint", "")
        leader = self._frames.named(entry.owner, name, mimic) if name else None
        if leader is None or leader.kind != "joint" or mimic.get("axis", "axis") != "axis":
            raise SdfProblem(
                "unknown-frame", mimic, f"<mimic> refers to '{name}'; it must refer to a joint with one axis"
            )
        multiplier = number_of(mimic, "multiplier", 1.0)
        offset = number_of(mimic, "offset", 0.0) - multiplier * number_of(mimic, "reference", 0.0)
        stated = {"multiplier": numbers(multiplier), "offset": numbers(offset)}
        self._writer.add(joint, "mimic", mimic, joint=leader.full_name, **stated)
