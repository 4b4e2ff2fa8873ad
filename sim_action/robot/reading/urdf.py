"""URDF (as read by ROS's urdfdom, wiki.ros.org/urdf/XML) -> RobotModel, with text that is safe for an engine.

The model is repaired, then written with only the parts that were understood: an engine may read other parts differently
from URDF, or from this reader. So they are left out, or normalised: tabs between numbers, missing limits, an empty
<dynamics> or <axis>, elements of a dialect, namespace prefixes, a second <inertial>. tests/integration/test_fuzz.py
compares both readers.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final, cast
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Box, Vector3
from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.robot.audit import elements, joints
from sim_action.robot.audit import links as link_rules
from sim_action.robot.audit.joints import is_free_base, mimic_problem, still_position
from sim_action.robot.audit.links import (
    Meshes,
    RigidBodies,
    increase,
    is_empty,
    principal_moments,
    proportions,
    resolve_meshes,
)
from sim_action.robot.documents.extensions import Series, expand_series, start_positions, with_extensions
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.urdf_elements import (
    BALLS,
    CONTACT,
    MOMENTS,
    SHAPES,
    UNLIMITED,
    axis,
    child_of,
    flag,
    is_numbers,
    limits,
    number,
    number_text,
    numbers,
    origin,
    parent_of,
    plugins_of,
    spring_of,
    surface_of,
    vector,
)
from sim_action.robot.documents.xml_document import ModelDocument, read_document
from sim_action.robot.model.findings import Finding, refuse_errors, without_harmless
from sim_action.robot.model.kinematics import joint_motion
from sim_action.robot.model.robot_model import (
    MOVING_TYPES,
    STOP_PLAY,
    WORLD,
    Color,
    Joint,
    JointType,
    Link,
    Mimic,
    RobotModel,
    Shape,
    Visual,
    ball_joints,
)
from sim_action.robot.reading.control_tags import commanded_joints, with_controllers

Check = Callable[[ModelDocument], Iterator[Finding]]

# A stage relies on the facts that the stages before it have established.
STAGES: Final[tuple[tuple[Check, ...], ...]] = (
    (elements.root, elements.required_attributes, elements.required_children),
    (elements.default_expressions, elements.numbers, elements.coefficients),
    (joints.names, joints.joint_types, joints.tree, joints.joint_counts, link_rules.kinds),
    (
        joints.axes,
        joints.limits,
        joints.motors,
        joints.passive,
        joints.mimics,
        joints.mimic_limits,
        link_rules.sizes,
        link_rules.extents,
        link_rules.collisions,
        link_rules.masses,
        link_rules.tensors,
        link_rules.inertials,
        elements.references,
        elements.frictions,
        elements.unread_parts,
        elements.restitutions,
        link_rules.angles,
        joints.limit_units,
        elements.repeated_inertials,
    ),
)


def audit(document: ModelDocument) -> list[Finding]:
    """Return the findings of all stages, up to and including the first stage with a fatal finding."""
    findings = list(document.findings)
    for stage in STAGES:
        findings += [finding for check in stage for finding in check(document)]
        if any(finding.level == "fatal" for finding in findings):
            break
    return findings


_LENGTHS: Final = {"size": 3}


def read_urdf(path: Path, packages: Packages | None = None, allow: Iterable[str] = ()) -> RobotModel:
    """Read a URDF file, by default with meshes of its folder; `allow`: accepted rules. Raises ModelError."""
    return model_of(
        read_document(path), path, packages or Packages(Workspace(path.resolve().parent, path.resolve().parent)), allow
    )


def model_of(document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str]) -> RobotModel:
    """Return the model of a document. `path`: the file from which relative paths start. Raises ModelError."""
    allowed = set(allow)
    document = with_extensions(with_static_base(document))
    findings = audit(document)
    refuse_errors(findings, allowed)
    meshes = resolve_meshes(document, path, packages)
    findings += meshes.findings
    refuse_errors(findings, allowed)
    for mend in (drop_empty_root, drop_invalid_mimics, drop_massless_frames, drop_empty_shapes):
        mend(document)
    series = expand_series(document)
    plugins = with_controllers(plugins_of(document), path, packages)
    commanded = commanded_joints(document)
    paints = materials(document)
    links = tuple(
        replace(_link(document, link, meshes), visuals=tuple(visuals_of(link, paints, meshes.visuals)))
        for link in document.elements("link")
    )
    findings += proportions(document, links)
    joints, between = _joints(document, series)
    starts = start_positions(document)
    joints = tuple(replace(joint, start=starts[joint.name]) if joint.name in starts else joint for joint in joints)
    # Remove an <inertial> with a mass of 0, if the audit allowed it. The base link keeps it, which fixes the base.
    children = {child_of(joint) for joint in document.elements("joint")}
    for link in document.elements("link"):
        inertial = link.find("inertial")
        if inertial is not None and link.get("name") in children and number(inertial.find("mass"), "value") == 0:
            link.remove(inertial)
    fill_in_inertia(document, series.links)
    repair_inertia(document)
    name = document.root.get("name", path.stem)
    parts, text = (*links, *between), engine_text(document)
    kept, harmless = without_harmless(findings)
    return RobotModel(name, str(path), parts, joints, text, kept, plugins, commanded=commanded, harmless=harmless)


def _link(document: ModelDocument, element: Element, meshes: Meshes) -> Link:
    shapes = tuple(_shape(collision, meshes) for collision in element.findall("collision"))
    mass = number(element.find("inertial/mass"), "value")
    inertial = element.find("inertial")
    middle = geometry.ZERO if inertial is None else origin(inertial).position_xyz
    return Link(element.attrib["name"], mass, shapes, surface_of(document, element), middle)


def _shape(collision: Element, meshes: Meshes) -> Shape:
    kind = next(iter(cast(Element, collision.find("geometry"))))
    lower, upper = meshes.boxes[kind] if kind in meshes.boxes else _box(kind)
    hulls = meshes.hulls.get(kind, b"")
    return Shape(kind.tag, origin(collision), number(kind, "radius"), lower, upper, hulls)


def _box(shape: Element) -> Box:
    """Return the box around a shape whose frame is at its centre; the audit has checked its sizes."""
    x, y, z = (size / 2 for size in cast(Vector3, _size(shape)))
    return (-x, -y, -z), (x, y, z)


def _joints(document: ModelDocument, series: Series) -> tuple[tuple[Joint, ...], tuple[Link, ...]]:
    """Return the joints, and the massless links between the parts of ball joints."""
    joints: list[Joint] = []
    links: list[Link] = []
    for element in document.elements("joint"):
        if element.attrib["type"] in BALLS:
            parts, between = ball_joints(element.attrib["name"], parent_of(element), child_of(element), origin(element))
            joints += parts
            links += between
        else:
            joints.append(replace(_joint(document, element), series=series.joints.get(element.attrib["name"], "")))
    return tuple(joints), tuple(links)


def _joint(document: ModelDocument, element: Element) -> Joint:
    kind = cast(JointType, element.attrib["type"])
    limit = element.find("limit")
    lower, upper = limits(element)
    stiffness, at_rest = spring_of(document, element)
    return Joint(
        name=element.attrib["name"],
        type=kind,
        parent=parent_of(element),
        child=child_of(element),
        origin=origin(element),
        axis_xyz=axis(element),
        lower=lower,
        upper=upper,
        max_effort=_most(limit, "effort"),
        max_velocity=_most(limit, "velocity"),
        mimic=_mimic(element.find("mimic")),
        stiffness=stiffness,
        spring_reference=at_rest,
    )


def _most(limit: Element | None, name: str) -> float | None:
    value = number(limit, name) or 0.0
    return value if value > 0 else None


def _mimic(element: Element | None) -> Mimic | None:
    if element is None:
        return None
    stated = {name: number(element, name) for name in ("multiplier", "offset")}
    return Mimic(element.attrib["joint"], **{name: value for name, value in stated.items() if value is not None})


Paint = tuple[Color, float]  # a colour and its opacity


def materials(document: ModelDocument) -> dict[str, Paint]:
    """Return the colours of all named materials, at the top level and in link_rules."""
    paints: dict[str, Paint] = {}
    for material in document.elements("link/visual/material", "material"):
        paint = _stated(material)
        name = material.get("name")
        if paint is not None and name:
            paints[name] = paint
    return paints


def visuals_of(link: Element, paints: Mapping[str, Paint], meshes: Mapping[Element, Path]) -> Iterator[Visual]:
    """Yield the visuals of a link that can be drawn. `meshes`: <mesh> element -> its file."""
    for visual in link.findall("visual"):
        shape = next(iter(visual.findall("geometry/*")), None)
        if shape is None:
            continue
        material = visual.find("material")
        paint = None if material is None else _stated(material) or paints.get(material.get("name", ""))
        color, opacity = paint or (None, 1.0)
        if shape in meshes:
            scale = vector(shape, "scale", (1.0, 1.0, 1.0))
            yield Visual("mesh", origin(visual), color, file=str(meshes[shape]), scale=scale, opacity=opacity)
        elif (size := _size(shape)) is not None:
            yield Visual(shape.tag, origin(visual), color, size, opacity=opacity)


def _stated(material: Element) -> Paint | None:
    """Return the colour of a material; None if it states no valid one."""
    color = material.find("color")
    text = "" if color is None else color.get("rgba", "")
    if not is_numbers(text, 4):
        return None
    red, green, blue, opacity = (min(1.0, max(0.0, float(part))) for part in text.split())
    return (red, green, blue), opacity


def _size(shape: Element) -> Vector3 | None:
    """Return the size in m of the box around a shape; None if it is not a plain shape, or has no valid size."""
    names = SHAPES.get(shape.tag)
    if names is None or not all(is_numbers(shape.get(name, ""), _LENGTHS.get(name, 1)) for name in names):
        return None
    numbers = [float(part) for name in names for part in shape.get(name, "").split()]
    if min(numbers) <= 0:
        return None
    if shape.tag == "box":
        x, y, z = numbers
        return (x, y, z)
    across = 2 * numbers[0]
    height = {"sphere": across, "cylinder": numbers[-1], "capsule": numbers[-1] + across}[shape.tag]
    return (across, across, height)


# A link without <inertial> gets this share of the mass of the others, as a ball of this radius.
_NEGLIGIBLE_SHARE: Final = 1e-4
_NEGLIGIBLE_RADIUS_M: Final = 0.05
_LEAST_MASS: Final = 1e-6


def with_static_base(document: ModelDocument) -> ModelDocument:
    """Return the document of a model whose <gazebo> says <static>, with its root link fixed to a new link `world`."""
    links = {link.get("name", "") for link in document.elements("link")}
    roots = links.difference(map(child_of, document.elements("joint")))
    tags = (tag for tag in document.elements("gazebo") if tag.get("reference") is None)
    stated = next((tag for tag in tags if flag(number_text(tag, "static") or "")), None)
    if stated is None or WORLD in links or len(roots) != 1:
        return document
    world = ET.SubElement(document.root, "link", name=WORLD)
    (root,) = roots
    joint = ET.SubElement(document.root, "joint", name=f"{WORLD}_{root}", type="fixed")
    parts = (world, joint, ET.SubElement(joint, "parent", link=WORLD), ET.SubElement(joint, "child", link=root))
    return replace(document, places={**document.places, **dict.fromkeys(parts, document.places[stated])})


def fill_in_inertia(document: ModelDocument, massless: Collection[str]) -> None:
    """Add a negligible <inertial> to links without one, and one of 0 to massless links; an engine would assume 1 kg."""
    stated = sum(number(mass, "value") or 0.0 for mass in document.elements("link/inertial/mass"))
    mass = max(_LEAST_MASS, _NEGLIGIBLE_SHARE * stated)
    for link in document.elements("link"):
        if link.find("inertial") is None:
            link.append(_ball(0.0 if link.get("name") in massless else mass))


def _ball(mass: float) -> Element:
    moment = f"{0.4 * mass * _NEGLIGIBLE_RADIUS_M**2:.6g}"
    inertial = Element("inertial")
    ET.SubElement(inertial, "mass", value=f"{mass:.6g}")
    axes = {"ixx": moment, "iyy": moment, "izz": moment, "ixy": "0", "ixz": "0", "iyz": "0"}
    ET.SubElement(inertial, "inertia", axes)
    return inertial


def drop_massless_frames(document: ModelDocument) -> None:
    """Remove an <inertial> with a mass of 0 from links that are fixed to others with a mass."""
    bodies = RigidBodies(document)
    for link in document.elements("link"):
        inertial = link.find("inertial")
        if (
            inertial is not None
            and number(inertial.find("mass"), "value") == 0
            and bodies.holds_mass(link.attrib["name"])
        ):
            link.remove(inertial)


def drop_empty_shapes(document: ModelDocument) -> None:
    """Remove collision shapes without any extent."""
    for link in document.elements("link"):
        for collision in link.findall("collision"):
            shape = collision.find("geometry/*")
            if shape is not None and is_empty(shape):
                link.remove(collision)


def repair_inertia(document: ModelDocument) -> None:
    """Repair inertias that are impossible. An engine would ignore them, and no torque could turn the link."""
    for inertial in document.elements("link/inertial"):
        inertia = inertial.find("inertia")
        if inertia is None or (
            number(inertial.find("mass"), "value") == 0 and not any(number(inertia, name) for name in MOMENTS)
        ):
            continue
        if max(principal_moments(inertia)) <= 0:
            ball = _ball(number(inertial.find("mass"), "value") or _LEAST_MASS)
            inertia.attrib.update(cast(Element, ball.find("inertia")).attrib)
        elif (moment := increase(inertia)) > 0:
            for name in ("ixx", "iyy", "izz"):
                inertia.set(name, repr((number(inertia, name) or 0.0) + moment))


def drop_empty_root(document: ModelDocument) -> None:
    """Remove an empty root link and its floating joint. They mean that the base is free, which is the default."""
    for joint in list(document.elements("joint")):
        if is_free_base(document, joint):
            (root,) = (link for link in document.elements("link") if link.attrib["name"] == parent_of(joint))
            document.root.remove(root)
            document.root.remove(joint)


def drop_invalid_mimics(document: ModelDocument) -> None:
    """Remove each <mimic> that cannot work; a joint that its <mimic> never moves becomes fixed, where it is held."""
    joints = {joint.attrib["name"]: joint for joint in document.elements("joint")}
    for joint in joints.values():
        if (position := still_position(joint, joints)) is not None:
            at = origin(joint)
            if position and joint.attrib["type"] in MOVING_TYPES:
                moving = Joint("", joint.attrib["type"], "", "", at, axis(joint))
                at = geometry.compose(at, joint_motion(moving, position))
            for part in (*joint.findall("origin"), *joint.findall("mimic")):
                joint.remove(part)
            rpy = geometry.rpy_from_quaternion(at.orientation_xyzw)
            ET.SubElement(joint, "origin", xyz=_spelled(at.position_xyz), rpy=_spelled(rpy))
            joint.set("type", "fixed")
    odd = [joint for joint in joints.values() if mimic_problem(joint, joints) is not None]
    for joint in odd:
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)


def engine_text(document: ModelDocument) -> str:
    """Return the URDF text, in short lines: the engine's parser splits long lines inside a token."""
    robot = Element("robot", name="robot")
    robot.extend(map(_written_link, document.elements("link")))
    robot.extend(map(_written_joint, document.elements("joint")))
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode")


def _written_link(link: Element) -> Element:
    written = Element("link", name=link.attrib["name"])
    inertial, contact = link.find("inertial"), link.find("contact")
    if inertial is not None:
        written.append(_inertial(inertial, number(link.find("contact/inertia_scaling"), "value")))
    written.extend(map(_collision, link.findall("collision")))
    if contact is not None:
        written.append(_contact(contact))
    return written


def _inertial(inertial: Element, scaling: float | None) -> Element:
    """Write <inertial>. `scaling`: Bullet's factor on the moments; applied here, because other engines ignore it."""
    written = _with_origin(Element("inertial"), inertial)
    written.append(_numbers("mass", inertial.find("mass"), "value"))
    moments = _numbers("inertia", inertial.find("inertia"), *MOMENTS)
    if scaling is not None:
        moments.attrib.update({name: repr(scaling * float(text)) for name, text in moments.attrib.items()})
    written.append(moments)
    return written


def _collision(collision: Element) -> Element:
    written = _with_origin(Element("collision"), collision)
    shape = next(iter(cast(Element, collision.find("geometry"))))
    geometry = ET.SubElement(written, "geometry")
    if shape.tag == "mesh":
        ET.SubElement(geometry, "mesh", filename=shape.attrib["filename"])
    else:
        geometry.append(_numbers(shape.tag, shape, *SHAPES[shape.tag]))
    return written


def _contact(contact: Element) -> Element:
    """Write <contact> without stiffness and damping, which are in `Surface`: Bullet would guess the missing one."""
    written = Element("contact")
    parts = (_numbers(tag, contact.find(tag), "value") for tag in CONTACT if tag not in {"stiffness", "damping"})
    written.extend(part for part in parts if part.attrib)
    if contact.find("friction_anchor") is not None:
        ET.SubElement(written, "friction_anchor")
    return written


def _written_joint(joint: Element) -> Element:
    kind = joint.attrib["type"] if joint.attrib["type"] not in BALLS else "spherical"
    written = _with_origin(Element("joint", name=joint.attrib["name"], type=kind), joint)
    ET.SubElement(written, "parent", link=parent_of(joint))
    ET.SubElement(written, "child", link=child_of(joint))
    if kind == "spherical":
        # It has no axis, but PyBullet warns without one.
        ET.SubElement(written, "axis", xyz="1 0 0")
    elif kind in ("revolute", "continuous", "prismatic"):
        # Bullet scales the motion of a prismatic joint by the length of its axis.
        ET.SubElement(written, "axis", xyz=_spelled(axis(joint)))
        written.append(_limit(joint))
    dynamics = _numbers("dynamics", joint.find("dynamics"), "damping", *(() if kind == "spherical" else ("friction",)))
    if dynamics.attrib:
        written.append(dynamics)
    return written


def _limit(joint: Element) -> Element:
    """Write <limit>: no positions if neither side is limited, else both, because Bullet's default upper limit is -1."""
    written = _numbers("limit", joint.find("limit"), "effort", "velocity")
    for name in ("effort", "velocity"):
        if float(written.get(name, 0)) < 0:
            del written.attrib[name]
    lower, upper = limits(joint)
    if (lower, upper) != (None, None):
        below, above = -UNLIMITED if lower is None else lower, UNLIMITED if upper is None else upper
        written.attrib.update(lower=repr(below - STOP_PLAY), upper=repr(above + STOP_PLAY))
    return written


def _with_origin(written: Element, element: Element) -> Element:
    origin = _numbers("origin", element.find("origin"), "xyz", "rpy")
    if origin.attrib:
        written.append(origin)
    return written


def _numbers(tag: str, element: Element | None, *names: str) -> Element:
    attributes = {name: numbers(element, name) for name in names}
    return Element(tag, {name: _spelled(values) for name, values in attributes.items() if values is not None})


def _spelled(values: tuple[float, ...]) -> str:
    return " ".join(map(repr, values))
