"""Write the links of SDF as URDF: inertials, shapes, visuals and contact surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.robot.audit.unsupported_parts import note_contact, note_parts, note_sensors
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
from sim_action.robot.documents.urdf_elements import is_numbers
from sim_action.robot.reading.sdf.auto_inertia import auto_inertia
from sim_action.robot.reading.sdf.composition import Entry
from sim_action.robot.reading.sdf.frames import Frames
from sim_action.robot.reading.sdf.urdf_writer import UrdfWriter, numbers

_MOMENTS: Final = {"ixx": 1.0, "ixy": 0.0, "ixz": 0.0, "iyy": 1.0, "iyz": 0.0, "izz": 1.0}
"""The moments of inertia and their defaults in SDF, in kg m^2."""

_FRICTION: Final = "surface/friction/ode"
_CONTACT: Final = "collision/surface/contact/ode"
_DEFAULT_FRICTION: Final = 1.0
_NEVER_SLIDES: Final = 1e9

EMPTY: Final = "empty"
"""The tag of a shape that does not collide."""

_INSTEAD: Final[Mapping[str, str]] = MappingProxyType(
    {
        "plane": "it has no bounds, so it can be part of a world only: use a <box>",
        "heightmap": "it can be part of a world only",
        "image": "convert it to a mesh",
        "polyline": "convert it to a mesh",
        "cone": "convert it to a mesh",
    }
)

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
        """Write a link. Raises SdfProblem.

        :param frame: the URDF link's frame, in the outermost model's frame.
        """
        element, writer = entry.element, self._writer
        link = writer.add(writer.root, "link", element, name=entry.full_name)
        self._note_unsupported_parts(element, f"link '{entry.full_name}'")
        inertial = element.find("inertial")
        if inertial is not None and flag_attribute(inertial, "auto"):
            self._write_auto_inertia(link, inertial, entry, frame)
        elif inertial is not None:
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
        moments = {name: numbers(number_of(holder, name, default)) for name, default in _MOMENTS.items()}
        writer.add(inertial, "inertia", holder, **moments)

    def _write_auto_inertia(self, link: Element, source: Element, entry: Entry, frame: Pose) -> None:
        """Write the inertia of the link's collisions. If that is allowed to fail, the link has no <inertial>."""
        collisions = [(holder, self._placed(entry, holder, frame)) for holder in entry.element.findall("collision")]
        found = self._notes.attempt(lambda source: auto_inertia(source, collisions), source)
        if found is None:
            return
        writer = self._writer
        inertial = writer.add(link, "inertial", source)
        writer.add_origin(inertial, source, Pose(found.centre_xyz))
        writer.add(inertial, "mass", source, value=numbers(found.mass))
        writer.add(inertial, "inertia", source, **{name: numbers(value) for name, value in found.moments.items()})

    def _note_defaults(self, inertial: Element, name: str) -> None:
        units = {"mass": "kg"} | {f"inertia/{name}": "kg m^2" for name in ("ixx", "iyy", "izz")}
        absent = [f"{path} = 1 {unit}" for path, unit in units.items() if inertial.find(path) is None]
        if absent:
            message = f"<inertial> of link '{name}' is incomplete; SDF's defaults are used: {', '.join(absent)}"
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
        found = {min(_friction(surface, "mu"), _DEFAULT_FRICTION): surface for surface in reversed(surfaces)}
        source = found[min(found)] if found else link
        if len(found) > 1:
            least, most = min(found), max(found)
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
    """Write a shape into a <geometry> of URDF. Raises SdfProblem.

    :param file: the file from which paths of meshes start.
    """
    if shape.tag == "mesh":
        write_mesh(writer, parent, shape, file)
        return
    if shape.tag not in _WRITERS:
        instead = _INSTEAD.get(shape.tag, f"the shapes are {', '.join((*_WRITERS, 'mesh'))}")
        raise SdfProblem("unknown-shape", shape, f"<{shape.tag}> is not supported: {instead}")
    _WRITERS[shape.tag](writer, parent, shape)


def write_mesh(writer: UrdfWriter, parent: Element, mesh: Element, file: Path) -> None:
    """Write a mesh into a <geometry> of URDF. Raises SdfProblem."""
    uri = text_of(mesh, "uri")
    if not uri:
        raise SdfProblem("missing-part", mesh, "<mesh> has no <uri>")
    scale = mesh.find("scale")
    writer.add_mesh(parent, mesh, uri, (1.0, 1.0, 1.0) if scale is None else vector_of(scale), file)


def _box(writer: UrdfWriter, parent: Element, shape: Element) -> None:
    writer.add(parent, "box", shape, size=numbers(*vector_of(needed(shape, "size"))))


def _sphere(writer: UrdfWriter, parent: Element, shape: Element) -> None:
    writer.add(parent, "sphere", shape, radius=_length(shape, "radius"))


def _cylinder(writer: UrdfWriter, parent: Element, shape: Element) -> None:
    writer.add(parent, shape.tag, shape, radius=_length(shape, "radius"), length=_length(shape, "length"))


def _ellipsoid(writer: UrdfWriter, parent: Element, shape: Element) -> None:
    radii = vector_of(needed(shape, "radii"))
    if len(set(radii)) > 1:
        raise SdfProblem(
            "unknown-shape", shape, "an <ellipsoid> with different radii is not supported: convert it to a mesh"
        )
    writer.add(parent, "sphere", shape, radius=numbers(radii[0]))


def _length(shape: Element, tag: str) -> str:
    return numbers(*numbers_of(needed(shape, tag), 1))


_WRITERS: Final[Mapping[str, Callable[[UrdfWriter, Element, Element], None]]] = MappingProxyType(
    {"box": _box, "sphere": _sphere, "cylinder": _cylinder, "capsule": _cylinder, "ellipsoid": _ellipsoid}
)


def visual_shape(visual: Element) -> Element | None:
    """Return the shape of a <visual>; None if it is neither a mesh nor a plain shape with a valid size."""
    shape = next(iter(visual.findall("geometry/*")), None)
    if shape is None or shape.tag == "mesh":
        return shape
    sizes = _SIZES.get(shape.tag, {})
    stated = all(is_numbers(shape.findtext(name) or "", count) for name, count in sizes.items())
    return shape if sizes and stated else None


def write_colour(writer: UrdfWriter, written: Element, visual: Element) -> None:
    """Write the colour of a visual, if it states one; the opacity is alpha times that of <transparency>."""
    words = (visual.findtext("material/diffuse") or "").split()[:4]
    text, alpha = " ".join(words[:3]), words[3] if len(words) > 3 else "1"
    if is_numbers(text, 3):
        opacity = _clipped(alpha, 1.0) * (1 - _clipped(visual.findtext("transparency") or "", 0.0))
        material = writer.add(written, "material", visual, name=f"of visual '{visual.get('name', '')}'")
        writer.add(material, "color", visual, rgba=f"{text} {opacity:g}")


def _clipped(text: str, otherwise: float) -> float:
    return min(1.0, max(0.0, float(text))) if is_numbers(text, 1) else otherwise
