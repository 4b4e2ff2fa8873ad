"""URDF (the XML of ROS's urdfdom, wiki.ros.org/urdf/XML) -> RobotModel, with the text made safe for an engine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final, cast, get_args
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element
from xml.parsers import expat

from sim_action import geometry
from sim_action.errors import ModelError
from sim_action.geometry import Pose, Vector3
from sim_action.location import Location
from sim_action.robot_model import Joint, JointType, Link, RobotModel, Shape
from sim_action.workspace import PathError, Workspace

_MAX_BYTES: Final = 20_000_000
_MAX_DEPTH: Final = 100
_LIMITS: Final = ("lower", "upper", "effort", "velocity")


def read_urdf(path: Path, workspace: Workspace | None = None) -> RobotModel:
    """Reads a URDF file, whose meshes lie in the workspace; left out: in the model's own folder and below.

    Raises ModelError with the line that has to change.
    """
    folder = path.resolve().parent
    return _Reader(path, replace(workspace or Workspace(folder, folder), directory=folder)).model()


class _Reader:
    """One file while it is read: its elements, and the line that each began on."""

    def __init__(self, path: Path, workspace: Workspace) -> None:
        self._path = path
        self._workspace = workspace
        self._lines: dict[Element, int] = {}
        self._depth = 0
        self._root = self._parse()

    def model(self) -> RobotModel:
        if self._root.tag != "robot":
            raise self._error(self._root, f"a URDF begins with <robot>, this file with <{self._root.tag}>")
        self._make_meshes_absolute()
        self._drop_textures()
        links = tuple(self._link(element) for element in self._root.findall("link"))
        joints = tuple(self._joint(element) for element in self._root.findall("joint"))
        self._check_tree(links, joints)
        # The engine's parser cuts long lines inside a token.
        ET.indent(self._root)
        urdf = ET.tostring(self._root, encoding="unicode")
        return RobotModel(self._root.get("name", self._path.stem), str(self._path), links, joints, urdf)

    def _parse(self) -> Element:
        builder = ET.TreeBuilder()
        parser = expat.ParserCreate()

        def start(tag: str, attributes: dict[str, str]) -> None:
            self._depth += 1
            if self._depth > _MAX_DEPTH:
                raise self._fault(parser.CurrentLineNumber, f"more than {_MAX_DEPTH} elements inside each other")
            self._lines[builder.start(tag, attributes)] = parser.CurrentLineNumber

        def end(tag: str) -> None:
            self._depth -= 1
            builder.end(tag)

        def doctype(*_: object) -> None:
            raise self._fault(parser.CurrentLineNumber, "a DOCTYPE is not allowed in a model")

        parser.StartElementHandler, parser.EndElementHandler = start, end
        parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, doctype
        try:
            parser.Parse(self._bytes(), True)
            return builder.close()
        except expat.ExpatError as error:
            raise self._fault(error.lineno, f"not well-formed XML: {expat.errors.messages[error.code]}") from None
        except (LookupError, ValueError) as error:  # an encoding that Python does not know
            raise self._fault(1, f"{error}; save the model as UTF-8") from None

    def _bytes(self) -> bytes:
        where = Location(str(self._path))
        try:
            with self._path.open("rb") as file:
                data = file.read(_MAX_BYTES + 1)
        except OSError as error:
            raise ModelError(f"cannot be read: {error.strerror}", where) from None
        if len(data) > _MAX_BYTES:
            raise ModelError(f"a model of more than {_MAX_BYTES // 1_000_000} MB is not read", where)
        return data

    def _link(self, element: Element) -> Link:
        stated = element.find("inertial/mass")
        mass = None if stated is None else self._number(stated, "value")
        if stated is not None and mass is not None and mass < 0:
            raise self._error(stated, f'<mass value="{mass:g}">: a mass is not negative')
        shapes = tuple(self._shape(collision) for collision in element.findall("collision"))
        return Link(self._name(element), mass, shapes)

    def _shape(self, collision: Element) -> Shape:
        kind = next(iter(self._child(collision, "geometry")), None)
        if kind is None:
            raise self._error(collision, "a <geometry> without a shape")
        radius = self._number(kind, "radius") if "radius" in kind.attrib else None
        if radius is not None and radius <= 0:
            raise self._error(kind, f'<{kind.tag} radius="{radius:g}">: a radius is greater than 0')
        return Shape(kind.tag, self._origin(collision), radius)

    def _joint(self, element: Element) -> Joint:
        kind = element.get("type", "")
        if kind not in get_args(JointType):
            raise self._error(element, f"joint type '{kind}' is none of {', '.join(get_args(JointType))}")
        limit = element.find("limit")
        limits = {} if limit is None else {key: self._number(limit, key) for key in _LIMITS if key in limit.attrib}
        turns_freely = kind == "continuous"
        return Joint(
            name=self._name(element),
            type=cast(JointType, kind),
            parent=self._attribute(self._child(element, "parent"), "link"),
            child=self._attribute(self._child(element, "child"), "link"),
            origin=self._origin(element),
            axis_xyz=self._axis(element),
            lower=None if turns_freely else limits.get("lower"),
            upper=None if turns_freely else limits.get("upper"),
            max_effort=limits.get("effort"),
            max_velocity=limits.get("velocity"),
        )

    def _axis(self, joint: Element) -> Vector3:
        """Of length 1; exporters write 0 0 0 for joints that do not move."""
        axis = joint.find("axis")
        x, y, z = (1.0, 0.0, 0.0) if axis is None else self._vector(axis, "xyz")
        length = math.hypot(x, y, z)
        if axis is not None and length == 0 and joint.get("type") not in ("fixed", "floating"):
            raise self._error(axis, f"joint '{self._name(joint)}' turns about an axis of length 0")
        return (x / length, y / length, z / length) if length else (1.0, 0.0, 0.0)

    def _make_meshes_absolute(self) -> None:
        for mesh in self._root.iter("mesh"):
            name = self._attribute(mesh, "filename")
            if "://" in name:
                raise self._error(mesh, f"'{name}': addresses are not read yet; use a path relative to the model")
            try:
                mesh.set("filename", str(self._workspace.file(name)))
            except PathError as error:
                raise self._error(mesh, f"mesh {error}") from None

    def _drop_textures(self) -> None:
        """Nothing is rendered, and a texture is one more file that an engine would open."""
        for material in self._root.iter("material"):
            for texture in material.findall("texture"):
                material.remove(texture)

    def _check_tree(self, links: tuple[Link, ...], joints: tuple[Joint, ...]) -> None:
        """One root, no link twice, no two parents: an engine dies of anything else."""
        if not links:
            raise self._error(self._root, "a model has at least one <link>, this one has none")
        elements = {**self._by_name("link"), **self._by_name("joint")}
        names = {link.name for link in links}
        children: set[str] = set()
        for joint in joints:
            for link in (joint.parent, joint.child):
                if link not in names:
                    raise self._error(elements[joint.name], f"joint '{joint.name}' names the unknown link '{link}'")
            if joint.child in children:
                raise self._error(elements[joint.name], f"link '{joint.child}' is the child of two joints")
            children.add(joint.child)
        roots = sorted(names - children)
        if len(roots) != 1:
            found = f"{len(roots)}: {', '.join(roots)}" if roots else "none: its joints form a loop"
            raise self._error(self._root, f"a model has one root link, this one has {found}")
        self._check_reachable(roots[0], names, joints)

    def _check_reachable(self, root: str, names: set[str], joints: tuple[Joint, ...]) -> None:
        children: dict[str, list[str]] = {}
        for joint in joints:
            children.setdefault(joint.parent, []).append(joint.child)
        reached, waiting = set[str](), [root]
        while waiting:
            link = waiting.pop()
            reached.add(link)
            waiting += children.get(link, [])
        if lost := sorted(names - reached):
            raise self._error(self._root, f"joints form a loop among the links {', '.join(lost)}")

    def _by_name(self, tag: str) -> dict[str, Element]:
        found: dict[str, Element] = {}
        for element in self._root.findall(tag):
            name = self._name(element)
            if name in found:
                raise self._error(element, f"a second {tag} named '{name}'")
            found[name] = element
        return found

    def _origin(self, element: Element) -> Pose:
        origin = element.find("origin")
        if origin is None:
            return Pose()
        rpy = self._vector(origin, "rpy") if "rpy" in origin.attrib else geometry.ZERO
        xyz = self._vector(origin, "xyz") if "xyz" in origin.attrib else geometry.ZERO
        return Pose(xyz, geometry.quaternion_from_rpy(*rpy))

    def _name(self, element: Element) -> str:
        return self._attribute(element, "name")

    def _child(self, element: Element, tag: str) -> Element:
        child = element.find(tag)
        if child is None:
            raise self._error(element, f"<{element.tag}> without <{tag}>")
        return child

    def _attribute(self, element: Element, name: str) -> str:
        value = element.get(name)
        if not value:
            raise self._error(element, f"<{element.tag}> without '{name}'")
        return value

    def _number(self, element: Element, name: str) -> float:
        return next(self._numbers(element, name, 1))

    def _vector(self, element: Element, name: str) -> Vector3:
        x, y, z = self._numbers(element, name, 3)
        return (x, y, z)

    def _numbers(self, element: Element, name: str, count: int) -> Iterator[float]:
        text = self._attribute(element, name)
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or not all(map(math.isfinite, values)):
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self._error(element, f'<{element.tag} {name}="{text}">: expected {wanted}')
        return iter(values)

    def _error(self, element: Element, message: str) -> ModelError:
        return self._fault(self._lines[element], message)

    def _fault(self, line: int, message: str) -> ModelError:
        return ModelError(message, Location(str(self._path), line))
