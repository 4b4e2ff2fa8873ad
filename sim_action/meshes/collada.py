"""COLLADA (.dae): the surfaces that its scene shows, in metres.

The unit is applied and `up_axis` is not, as in RViz, MoveIt and PyBullet: robots are drawn as they stand, whatever
their files say is up. Each surface that the scene shows is a part of its own, where PyBullet takes one hull of all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_action.meshes.collada_document import Document
from sim_action.meshes.collada_geometry import read_geometry
from sim_action.meshes.collada_scene import shown_geometries
from sim_action.meshes.collada_xml import parse
from sim_action.meshes.mesh import (
    Mesh,
    MeshError,
    mesh_of,
    refuse_more_parts,
    refuse_more_points,
    refuse_more_triangles,
)

if TYPE_CHECKING:
    from collections.abc import Iterable
    from xml.etree.ElementTree import Element

    import numpy as np
    from numpy.typing import NDArray


def read_collada(data: bytes) -> Mesh:
    """Reads the bytes of a file. Raises MeshError."""
    root, lines = parse(data)
    if root.tag != "COLLADA":
        raise MeshError("broken-mesh", f"is no COLLADA: it begins with <{root.tag[:40]}>", 1)
    document = Document(root, lines)
    return _assembled(document, shown_geometries(document))


def _assembled(document: Document, shown: Iterable[tuple[Element, NDArray[np.float64]]]) -> Mesh:
    """One mesh of geometries, each with where it is."""
    import numpy as np

    geometries: dict[Element, tuple[NDArray[np.float64], NDArray[np.int64]]] = {}
    points, parts, counts = [np.zeros((0, 3))], [], [0, 0]
    for geometry, placed in shown:
        if geometry not in geometries:
            geometries[geometry] = read_geometry(document, geometry)
        found, triangles = geometries[geometry]
        parts.append(triangles + counts[0])
        counts = [counts[0] + len(found), counts[1] + len(triangles)]
        refuse_more_points(counts[0])
        refuse_more_triangles(counts[1])
        refuse_more_parts(len(parts))
        with np.errstate(over="ignore", invalid="ignore"):  # refused below
            # Not by a product of matrices: its last digit is not the same on every machine.
            points.append((found[:, None, :] * placed[:3, :3]).sum(axis=2) + placed[:3, 3])
    return mesh_of(np.concatenate(points), parts)
