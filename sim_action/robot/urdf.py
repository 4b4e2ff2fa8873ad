"""URDF (the XML of ROS's urdfdom, wiki.ros.org/urdf/XML) -> RobotModel, with the text made safe for an engine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import cast
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Box
from sim_action.core.workspace import Workspace
from sim_action.robot import gazebo
from sim_action.robot.audit import audit
from sim_action.robot.audit.proportions import proportions
from sim_action.robot.cleaning import (
    drop_empty_root,
    drop_odd_mimics,
    drop_zero_masses,
    fill_in_inertia,
    hold_odd_joints,
    mend_inertia,
)
from sim_action.robot.document import ModelDocument, read_document
from sim_action.robot.engine_text import engine_text
from sim_action.robot.findings import refuse_errors
from sim_action.robot.packages import Packages
from sim_action.robot.references import resolve_meshes
from sim_action.robot.robot_model import Joint, JointType, Link, Mimic, RobotModel, Shape
from sim_action.robot.values import axis, child_of, limits, number, origin, parent_of, vector
from sim_action.robot.visuals import materials, visuals_of


def read_urdf(path: Path, packages: Packages | None = None, allow: Iterable[str] = ()) -> RobotModel:
    """Reads a URDF file, whose meshes are where `packages` finds them; left out: in the model's own folder and below.

    `allow`: rules whose findings are let go. Raises ModelError with everything that has to change.
    """
    return model_of(read_document(path), path, packages or _of_folder(path.resolve().parent), allow)


def model_of(document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str]) -> RobotModel:
    """The model that a document describes; `path`: where its relative paths start from. Raises ModelError."""
    allowed = set(allow)
    findings = audit(document)
    refuse_errors(findings, allowed)
    meshes = resolve_meshes(document, path, packages)
    findings += meshes.findings
    refuse_errors(findings, allowed)
    for mend in (drop_empty_root, hold_odd_joints, drop_odd_mimics):
        mend(document)
    plugins = gazebo.plugins(document)
    colors = materials(document)
    links = tuple(
        replace(_link(document, link, meshes.boxes), visuals=tuple(visuals_of(link, colors, meshes.visuals)))
        for link in document.elements("link")
    )
    findings += proportions(document, links)
    joints = tuple(map(_joint, document.elements("joint")))
    for mend in (drop_zero_masses, fill_in_inertia, mend_inertia):
        mend(document)
    name = document.root.get("name", path.stem)
    return RobotModel(name, str(path), links, joints, engine_text(document), tuple(findings), plugins)


def _of_folder(folder: Path) -> Packages:
    return Packages(Workspace(folder, folder))


def _link(document: ModelDocument, element: Element, meshes: Mapping[Element, Box]) -> Link:
    shapes = tuple(_shape(collision, meshes) for collision in element.findall("collision"))
    mass = number(element.find("inertial/mass"), "value")
    inertial = element.find("inertial")
    middle = geometry.ZERO if inertial is None else origin(inertial).position_xyz
    return Link(element.attrib["name"], mass, shapes, gazebo.surface(document, element), middle)


def _shape(collision: Element, meshes: Mapping[Element, Box]) -> Shape:
    kind = next(iter(cast(Element, collision.find("geometry"))))
    lower, upper = meshes[kind] if kind in meshes else _box(kind)
    return Shape(kind.tag, origin(collision), number(kind, "radius"), lower, upper, kind.get("filename", ""))


def _box(shape: Element) -> Box:
    """Around a shape that has its frame in the middle."""
    radius, length = number(shape, "radius") or 0.0, number(shape, "length") or 0.0
    if shape.tag == "box":
        width, depth, height = vector(shape, "size", geometry.ZERO)
    else:
        width = depth = 2 * radius
        height = length if shape.tag == "cylinder" else length + 2 * radius
    x, y, z = width / 2, depth / 2, height / 2
    return (-x, -y, -z), (x, y, z)


def _joint(element: Element) -> Joint:
    kind, limit = cast(JointType, element.attrib["type"]), element.find("limit")
    lower, upper = limits(element)
    return Joint(
        name=element.attrib["name"],
        type=kind,
        parent=parent_of(element),
        child=child_of(element),
        origin=origin(element),
        axis_xyz=axis(element),
        lower=lower,
        upper=upper,
        max_effort=number(limit, "effort") or None,
        max_velocity=number(limit, "velocity") or None,
        mimic=_mimic(element.find("mimic")),
    )


def _mimic(element: Element | None) -> Mimic | None:
    if element is None:
        return None
    stated = {name: number(element, name) for name in ("multiplier", "offset")}
    return Mimic(element.attrib["joint"], **{name: value for name, value in stated.items() if value is not None})
