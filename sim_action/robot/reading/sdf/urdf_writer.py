"""Write a URDF document from SDF: each element keeps the place of its source."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3
from sim_action.robot.documents.xml_document import ModelDocument


class UrdfWriter:
    """A URDF document that is being written.

    Args:
        name: name of the robot.
        source: the <model> element.
        sources: the file and line of each element of the SDF.
    """

    def __init__(self, name: str, source: Element, sources: Mapping[Element, Location]) -> None:
        self.root = Element("robot", name=name)
        self._sources = sources
        self._places = {self.root: sources[source]}
        self._files: dict[Element, Path] = {}

    def add(self, parent: Element, tag: str, source: Element, **attributes: str) -> Element:
        """Add an element with the place of `source`."""
        element = ET.SubElement(parent, tag, attributes)
        self._places[element] = self._sources[source]
        return element

    def add_origin(self, parent: Element, source: Element, pose: Pose) -> None:
        """Add an <origin>."""
        rpy = geometry.rpy_from_quaternion(pose.orientation_xyzw)
        self.add(parent, "origin", source, xyz=numbers(*pose.position_xyz), rpy=numbers(*rpy))

    def add_mesh(self, parent: Element, source: Element, uri: str, scale: Vector3, file: Path) -> None:
        """Add a <mesh>, whose relative paths start from `file`."""
        mesh = self.add(parent, "mesh", source, filename=uri, scale=numbers(*scale))
        self._files[mesh] = file

    def copy(self, parent: Element, source: Element) -> None:
        """Copy an element of the SDF with all its children."""
        waiting = [(parent, source)]
        while waiting:
            outer, original = waiting.pop()
            element = self.add(outer, original.tag, original)
            element.attrib.update(original.attrib)
            element.text = original.text
            waiting += [(element, child) for child in reversed(original)]

    def document(self) -> ModelDocument:
        """Return the document."""
        return ModelDocument(self.root, self._places, self._files)


def numbers(*values: float) -> str:
    """Return numbers as text for URDF, with all digits."""
    return " ".join(repr(value + 0.0) for value in values)  # + 0.0 turns -0.0 into 0.0
