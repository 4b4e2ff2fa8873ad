"""The URDF that an SDF becomes, while it is written: each element keeps the place that it came from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3
from sim_action.robot.xml_document import ModelDocument


class UrdfWriter:
    """A URDF document that grows.

    Args:
        name: of the robot.
        source: the <model>.
        sources: where elements of the SDF were written.
    """

    def __init__(self, name: str, source: Element, sources: Mapping[Element, Location]) -> None:
        self.root = Element("robot", name=name)
        self._sources = sources
        self._places = {self.root: sources[source]}
        self._files: dict[Element, Path] = {}

    def add(self, parent: Element, tag: str, source: Element, **attributes: str) -> Element:
        """An element that came from `source`."""
        element = ET.SubElement(parent, tag, attributes)
        self._places[element] = self._sources[source]
        return element

    def add_origin(self, parent: Element, source: Element, pose: Pose) -> None:
        """Where an element is."""
        rpy = geometry.rpy_from_quaternion(pose.orientation_xyzw)
        self.add(parent, "origin", source, xyz=numbers(*pose.position_xyz), rpy=numbers(*rpy))

    def add_mesh(self, parent: Element, source: Element, uri: str, scale: Vector3, file: Path) -> None:
        """A mesh, whose relative paths start from `file`."""
        mesh = self.add(parent, "mesh", source, filename=uri, scale=numbers(*scale))
        self._files[mesh] = file

    def copy(self, parent: Element, source: Element) -> None:
        """An element of the SDF as it stands, with all that is in it."""
        waiting = [(parent, source)]
        while waiting:
            outer, original = waiting.pop()
            element = self.add(outer, original.tag, original)
            element.attrib.update(original.attrib)
            element.text = original.text
            waiting += [(element, child) for child in reversed(original)]

    def document(self) -> ModelDocument:
        """What was written."""
        return ModelDocument(self.root, self._places, self._files)


def numbers(*values: float) -> str:
    """Numbers as URDF writes them, to the last digit."""
    return " ".join(repr(value + 0.0) for value in values)  # 0.0: no minus before a zero
