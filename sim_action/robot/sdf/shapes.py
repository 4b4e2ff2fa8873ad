"""Shapes of SDF -> those of URDF."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.robot.sdf.problems import SdfProblem
from sim_action.robot.sdf.values import needed, numbers_of, text_of, vector_of
from sim_action.robot.sdf.writing import UrdfWriter, numbers

EMPTY: Final = "empty"
"""The shape of what cannot be touched."""

_INSTEAD: Final[Mapping[str, str]] = MappingProxyType(
    {
        "plane": "it is endless, and belongs to a world: a part of a robot is a <box>",
        "heightmap": "it belongs to a world",
        "image": "make a mesh of it",
        "polyline": "make a mesh of it",
        "cone": "make a mesh of it",
    }
)


def shape_in(holder: Element) -> Element | None:
    """The shape of a <collision> or <visual>; None is one that is empty on purpose. Raises SdfProblem."""
    shape = next(iter(needed(holder, "geometry")), None)
    if shape is None:
        raise SdfProblem("missing-part", holder, "a <geometry> without a shape")
    return None if shape.tag == EMPTY else shape


def write_shape(writer: UrdfWriter, parent: Element, shape: Element, file: Path) -> None:
    """Writes a shape into a <geometry> of URDF; `file`: where paths of meshes start from. Raises SdfProblem."""
    if shape.tag == "mesh":
        write_mesh(writer, parent, shape, file)
        return
    if shape.tag not in _WRITERS:
        instead = _INSTEAD.get(shape.tag, f"there are {', '.join((*_WRITERS, 'mesh'))}")
        raise SdfProblem("unknown-shape", shape, f"a <{shape.tag}> is not simulated: {instead}")
    _WRITERS[shape.tag](writer, parent, shape)


def write_mesh(writer: UrdfWriter, parent: Element, mesh: Element, file: Path) -> None:
    """Writes a mesh into a <geometry> of URDF. Raises SdfProblem."""
    uri = text_of(mesh, "uri")
    if not uri:
        raise SdfProblem("missing-part", mesh, "<mesh> without <uri>")
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
        raise SdfProblem("unknown-shape", shape, "an <ellipsoid> that is no sphere is not simulated: make a mesh of it")
    writer.add(parent, "sphere", shape, radius=numbers(radii[0]))


def _length(shape: Element, tag: str) -> str:
    return numbers(*numbers_of(needed(shape, tag), 1))


_WRITERS: Final[Mapping[str, Callable[[UrdfWriter, Element, Element], None]]] = MappingProxyType(
    {"box": _box, "sphere": _sphere, "cylinder": _cylinder, "capsule": _cylinder, "ellipsoid": _ellipsoid}
)
