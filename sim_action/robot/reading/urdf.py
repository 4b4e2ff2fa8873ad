"""URDF (as read by ROS's urdfdom, wiki.ros.org/urdf/XML) -> RobotModel, with text that is safe for an engine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final, cast
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Box, Vector3
from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.robot.audit import elements, inertia, joints, kinematic_tree, shapes, unsupported_parts
from sim_action.robot.audit.inertia import proportions
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.series_joints import Series, expand_series
from sim_action.robot.documents.urdf_elements import (
    BALLS,
    SHAPES,
    axis,
    child_of,
    is_numbers,
    limits,
    number,
    origin,
    parent_of,
    plugins_of,
    spring_of,
    surface_of,
    vector,
)
from sim_action.robot.documents.xml_document import ModelDocument, read_document
from sim_action.robot.model.findings import Finding, refuse_errors
from sim_action.robot.model.robot_model import (
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
from sim_action.robot.reading.engine_urdf import (
    drop_empty_root,
    drop_empty_shapes,
    drop_invalid_mimics,
    drop_massless_frames,
    drop_zero_masses,
    engine_text,
    fill_in_inertia,
    repair_inertia,
    with_static_base,
)
from sim_action.robot.reading.mesh_references import Meshes, resolve_meshes

Check = Callable[[ModelDocument], Iterator[Finding]]

# A stage relies on the facts that the stages before it have established.
STAGES: Final[tuple[tuple[Check, ...], ...]] = (
    (elements.root, elements.required_attributes, elements.required_children),
    (elements.default_expressions, elements.numbers, unsupported_parts.coefficients),
    (
        kinematic_tree.names,
        kinematic_tree.joint_types,
        kinematic_tree.tree,
        kinematic_tree.joint_counts,
        shapes.kinds,
    ),
    (
        joints.axes,
        joints.limits,
        joints.motors,
        joints.passive,
        joints.mimics,
        joints.mimic_limits,
        shapes.sizes,
        shapes.extents,
        shapes.presence,
        inertia.masses,
        inertia.tensors,
        inertia.presence,
        unsupported_parts.references,
        unsupported_parts.frictions,
        unsupported_parts.unsupported_tags,
        elements.restitutions,
        shapes.angles,
        joints.limit_units,
        elements.misspelled_tags,
        unsupported_parts.misspelled_parts,
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
    """Read a URDF file. Raises ModelError with all problems.

    :param packages: finds the meshes; left out: only in the folder of the model and below.
    :param allow: rules whose errors are accepted.
    """
    return model_of(read_document(path), path, packages or _of_folder(path.resolve().parent), allow)


def model_of(document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str]) -> RobotModel:
    """Return the model of a document. Raises ModelError.

    :param path: the file from which relative paths start.
    """
    allowed = set(allow)
    document = with_static_base(document)
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
    drop_zero_masses(document)
    fill_in_inertia(document, series.links)
    repair_inertia(document)
    name = document.root.get("name", path.stem)
    parts, text = (*links, *between), engine_text(document)
    return RobotModel(name, str(path), parts, joints, text, tuple(findings), plugins, commanded=commanded)


def _of_folder(folder: Path) -> Packages:
    return Packages(Workspace(folder, folder))


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
    """Return the box around a shape whose frame is at its centre."""
    radius, length = number(shape, "radius") or 0.0, number(shape, "length") or 0.0
    if shape.tag == "box":
        width, depth, height = vector(shape, "size", geometry.ZERO)
    else:
        width = depth = 2 * radius
        height = length if shape.tag == "cylinder" else length + 2 * radius
    x, y, z = width / 2, depth / 2, height / 2
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
    kind, limit = cast(JointType, element.attrib["type"]), element.find("limit")
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


Paint = tuple[Color, float]
"""A colour and its opacity."""


def materials(document: ModelDocument) -> dict[str, Paint]:
    """Return the colours of all named materials, at the top level and in links."""
    found: dict[str, Paint] = {}
    for material in document.elements("link/visual/material", "material"):
        paint, name = _stated(material), material.get("name")
        if paint is not None and name:
            found[name] = paint
    return found


def visuals_of(link: Element, paints: Mapping[str, Paint], meshes: Mapping[Element, Path]) -> Iterator[Visual]:
    """Yield the visuals of a link that can be drawn.

    :param meshes: <mesh> element -> its file.
    """
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
