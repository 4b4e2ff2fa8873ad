"""URDF (as read by ROS's urdfdom, wiki.ros.org/urdf/XML) -> draft of a robot -> `RobotModel`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.robot.audit import elements
from sim_action.robot.documents.extensions import start_positions, with_extensions
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.urdf_elements import (
    CONTACT,
    LENGTHS,
    child_of,
    flag,
    is_numbers,
    number,
    number_text,
    numbers,
    parent_of,
    plugins_of,
    spring_of,
    surface_of,
    vector,
)
from sim_action.robot.documents.xml_document import ModelDocument, read_document
from sim_action.robot.model.draft import (
    SHAPES,
    ContactDraft,
    InertialDraft,
    JointDraft,
    LimitDraft,
    LinkDraft,
    MeshDraft,
    MotionDraft,
    OriginDraft,
    Paint,
    RobotDraft,
    ShapeDraft,
    last_digit,
)
from sim_action.robot.model.findings import Finding
from sim_action.robot.model.robot_model import MOMENTS, WORLD, Mimic, RobotModel
from sim_action.robot.reading.building import built
from sim_action.robot.reading.control_tags import commanded_joints

# A stage relies on the facts that the stages before it have established.
STAGES: Final[tuple[tuple[Callable[[ModelDocument], Iterator[Finding]], ...], ...]] = (
    (elements.root, elements.required_attributes, elements.required_children),
    (elements.default_expressions, elements.numbers, elements.coefficients),
    (
        elements.references,
        elements.frictions,
        elements.unread_parts,
        elements.restitutions,
        elements.repeated_inertials,
    ),
)


def read_urdf(path: Path, packages: Packages | None = None, allow: Iterable[str] = ()) -> RobotModel:
    """Read a URDF file, by default with meshes of its folder; `allow`: accepted rules. Raises ModelError."""
    return model_of(
        read_document(path), path, packages or Packages(Workspace(path.resolve().parent, path.resolve().parent)), allow
    )


def model_of(document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str]) -> RobotModel:
    """Return the model of a document. `path`: the file from which relative paths start. Raises ModelError."""
    draft, findings = draft_of(document)
    return built(draft, findings, path, packages, allow)


def draft_of(document: ModelDocument) -> tuple[RobotDraft | None, list[Finding]]:
    """Return the robot of a document, and findings about its elements; no robot if one of them is fatal."""
    document = with_extensions(with_static_base(document))
    findings = list(document.findings)
    for stage in STAGES:
        findings += [finding for check in stage for finding in check(document)]
        if any(finding.level == "fatal" for finding in findings):
            return None, findings
    return _Reader(document).read(), findings


class _Reader:
    """Reads a document whose elements and numbers are checked."""

    def __init__(self, document: ModelDocument) -> None:
        self._document = document
        self._places = document.places
        self._paints = _materials(document)

    def read(self) -> RobotDraft:
        document = self._document
        return RobotDraft(
            document.root.get("name", ""),
            self._places[document.root],
            tuple(map(self._link, document.elements("link"))),
            tuple(map(self._joint, document.elements("joint"))),
            plugins_of(document),
            commanded_joints(document),
            start_positions(document),
        )

    def _origin(self, holder: Element) -> OriginDraft:
        stated = holder.find("origin")
        if stated is None:
            return OriginDraft()
        return OriginDraft(vector(stated, "xyz"), vector(stated, "rpy"), self._places[stated])

    def _link(self, link: Element) -> LinkDraft:
        contact = link.find("contact")
        return LinkDraft(
            link.attrib["name"],
            self._places[link],
            self._inertial(link.find("inertial")),
            tuple(map(self._shape, link.findall("collision"))),
            tuple(self._shape(visual) for visual in link.findall("visual") if visual.find("geometry/*") is not None),
            None if contact is None else _contact(contact),
            surface_of(self._document, link),
        )

    def _inertial(self, inertial: Element | None) -> InertialDraft | None:
        mass, inertia = (None, None) if inertial is None else (inertial.find("mass"), inertial.find("inertia"))
        if inertial is None or mass is None or inertia is None:
            return None
        xx, xy, xz, yy, yz, zz = (float(inertia.attrib[name]) for name in MOMENTS)
        return InertialDraft(
            self._origin(inertial),
            float(mass.attrib["value"]),
            (xx, xy, xz, yy, yz, zz),
            max(last_digit(inertia.attrib[name]) for name in MOMENTS),
            self._places[mass],
            self._places[inertia],
        )

    def _shape(self, holder: Element) -> ShapeDraft:
        """Return the shape of a <collision> or <visual>: the first child of its <geometry>."""
        shape = next(holder.iterfind("geometry/*"))
        names = SHAPES.get(shape.tag, ())
        # Only the sizes of collisions are checked.
        is_sized = all(is_numbers(shape.get(name, ""), LENGTHS.get(name, 1)) for name in names)
        material = holder.find("material")
        paint = None if material is None else _stated(material) or self._paints.get(material.get("name", ""))
        return ShapeDraft(
            shape.tag,
            self._origin(holder),
            self._places[shape],
            {name: numbers(shape, name) or () for name in names} if is_sized else {},
            self._mesh(shape) if shape.tag == "mesh" else None,
            paint,
        )

    def _mesh(self, mesh: Element) -> MeshDraft:
        return MeshDraft(mesh.attrib["filename"], self._document.files.get(mesh), vector(mesh, "scale"))

    def _joint(self, joint: Element) -> JointDraft:
        name, mimic = joint.attrib["name"], joint.find("mimic")
        is_universal = joint.attrib["type"] == "universal"
        return JointDraft(
            name,
            joint.attrib["type"],
            parent_of(joint),
            child_of(joint),
            self._places[joint],
            self._origin(joint),
            replace(self._motion(joint), spring=spring_of(self._document, joint)),
            self._motion(joint, "2") if is_universal else None,
            None if mimic is None else _mimic(mimic),
        )

    def _motion(self, joint: Element, end: str = "") -> MotionDraft:
        """Return a motion; `end`: at the end of the tags."""
        axis, limit, dynamics = (joint.find(f"{tag}{end}") for tag in ("axis", "limit", "dynamics"))
        return MotionDraft(
            vector(axis, "xyz"),
            None if axis is None else self._places[axis],
            None if limit is None else self._limit(limit),
            number(dynamics, "damping"),
            number(dynamics, "friction"),
            (number(dynamics, "spring_stiffness") or 0.0, number(dynamics, "spring_reference") or 0.0),
        )

    def _limit(self, limit: Element) -> LimitDraft:
        lower, upper, effort, velocity = (number(limit, name) for name in ("lower", "upper", "effort", "velocity"))
        return LimitDraft(self._places[limit], lower, upper, effort, velocity)


def _mimic(mimic: Element) -> Mimic:
    multiplier = number(mimic, "multiplier")
    return Mimic(mimic.attrib["joint"], 1.0 if multiplier is None else multiplier, number(mimic, "offset") or 0.0)


def _contact(contact: Element) -> ContactDraft:
    stated = {tag: number(contact.find(tag), "value") for tag in CONTACT}
    scaling = number(contact.find("inertia_scaling"), "value")
    return ContactDraft(
        {tag: value for tag, value in stated.items() if value is not None},
        contact.find("friction_anchor") is not None,
        1.0 if scaling is None else scaling,
    )


def _materials(document: ModelDocument) -> dict[str, Paint]:
    """Return the colours of all named materials, at the top level and in links."""
    paints: dict[str, Paint] = {}
    for material in document.elements("link/visual/material", "material"):
        paint = _stated(material)
        name = material.get("name")
        if paint is not None and name:
            paints[name] = paint
    return paints


def _stated(material: Element) -> Paint | None:
    """Return the colour of a material; None if it states no valid one."""
    color = material.find("color")
    text = "" if color is None else color.get("rgba", "")
    if not is_numbers(text, 4):
        return None
    red, green, blue, opacity = (min(1.0, max(0.0, float(part))) for part in text.split())
    return (red, green, blue), opacity


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
