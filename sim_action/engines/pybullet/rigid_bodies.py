"""Add moving bodies of several shapes, or of stated inertia, to PyBullet.

They are read as a URDF of one link: an array of shapes takes at most 16 of them and no mesh, and PyBullet would put the
mass of a hull at its centre.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import numpy as np
import pybullet

from sim_action.core.geometry import Pose, rpy_from_quaternion
from sim_action.meshes.collision_hulls import hull_lines, shrunk
from sim_action.world import Body
from sim_action.world.parts import BoxPart, CylinderPart, HullPart, Part, SpherePart, mass_properties_of

_FLAGS: Final = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE
_MARGIN_M: Final = 0.001  # PyBullet adds this margin around every hull of a file


def add_rigid_body(client: int, body: Body, parts: Sequence[Part]) -> tuple[int, Pose]:
    """Add a body at the origin; return number and pose of its inertial frame. Raise OSError, pybullet.error."""
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder:
        path = Path(folder, "body.urdf")
        path.write_bytes(ET.tostring(_urdf(body, parts, Path(folder))))
        number = int(pybullet.loadURDF(str(path), flags=_FLAGS, physicsClientId=client))
    if len(pybullet.getCollisionShapeData(number, -1, client)) < len(parts):
        raise pybullet.error(f"PyBullet did not make all shapes of body '{body.name}'; it may lack files or memory")
    _, _, _, position, orientation, *_ = pybullet.getDynamicsInfo(number, -1, client)
    return number, Pose(position, orientation)


def _urdf(body: Body, parts: Sequence[Part], folder: Path) -> Element:
    root = ET.Element("robot", name="body")
    link = ET.SubElement(root, "link", name="body")
    properties = mass_properties_of(body, parts)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_text(properties.centre_xyz))
    ET.SubElement(inertial, "mass", value=repr(properties.mass))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = properties.inertia.tolist()
    moments = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    ET.SubElement(inertial, "inertia", {name: repr(moment) for name, moment in moments.items()})
    # See `look` of connections.
    ET.SubElement(ET.SubElement(ET.SubElement(link, "visual"), "geometry"), "box", size="1 1 1")
    for number, part in enumerate(parts):
        collision = ET.SubElement(link, "collision")
        if isinstance(part, BoxPart | CylinderPart | SpherePart):
            turned = _text(rpy_from_quaternion(part.pose.orientation_xyzw))
            ET.SubElement(collision, "origin", xyz=_text(part.pose.position_xyz), rpy=turned)
        _add_shape(ET.SubElement(collision, "geometry"), part, folder / f"{number}.obj")
    return root


def _add_shape(geometry: Element, part: Part, file: Path) -> None:
    if isinstance(part, BoxPart):
        ET.SubElement(geometry, "box", size=_text(part.size_xyz))
    elif isinstance(part, CylinderPart):
        ET.SubElement(geometry, "cylinder", radius=repr(part.radius), length=repr(part.height))
    elif isinstance(part, SpherePart):
        ET.SubElement(geometry, "sphere", radius=repr(part.radius))
    else:
        assert isinstance(part, HullPart), "terrain and surfaces have no mass"
        file.write_text(hull_lines(shrunk(np.array(part.points_xyz), _MARGIN_M), 0), encoding="ascii")
        ET.SubElement(geometry, "mesh", filename=file.name)


def _text(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))
