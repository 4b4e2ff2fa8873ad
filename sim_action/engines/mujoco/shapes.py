"""Collision shapes of a robot as geoms, and how low they reach."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from sim_action.core.geometry import Pose, Quaternion
from sim_action.engines.mujoco.hulls import read_hulls
from sim_action.state.trace import FloatArray

GEOM: Final = mujoco.mjtGeom


def wxyz(orientation: Quaternion) -> list[float]:
    """MuJoCo's order of a quaternion."""
    x, y, z, w = orientation
    return [w, x, y, z]


def add_collision(spec: Any, body: Any, name: str, shape: Element, pose: Pose) -> Iterator[str]:
    """Adds a shape of URDF to a body; yields the names of its geoms, several if it is a mesh of several hulls."""
    if shape.tag != "mesh":
        yield add_geom(body, name, pose, **_primitive(shape))
        return
    for number, mesh in enumerate(_meshes(spec, shape.attrib["filename"])):
        yield add_geom(body, f"{name}.{number}", pose, type=GEOM.mjGEOM_MESH, meshname=mesh)


def add_geom(body: Any, name: str, pose: Pose, **properties: Any) -> str:
    """Adds a geom that weighs nothing and touches what it is paired with alone."""
    passive = {"contype": 0, "conaffinity": 0, "mass": 0.0}
    place = {"pos": list(pose.position_xyz), "quat": wxyz(pose.orientation_xyzw)}
    body.add_geom(name=name, **passive | place | properties)
    return name


def lowest_geom(model: Any, data: Any, geoms: Sequence[int]) -> float | None:
    """The z in m of the lowest point of geoms, world frame; None if there are none."""
    return min((_lowest(model, data, geom) for geom in geoms), default=None)


def _primitive(shape: Element) -> dict[str, Any]:
    radius, half_length = (float(shape.get(name, 0)) for name in ("radius", "length"))
    half_length /= 2
    sizes: dict[str, tuple[Any, list[float]]] = {
        "box": (GEOM.mjGEOM_BOX, [float(size) / 2 for size in shape.get("size", "0 0 0").split()]),
        "sphere": (GEOM.mjGEOM_SPHERE, [radius, 0, 0]),
        "cylinder": (GEOM.mjGEOM_CYLINDER, [radius, half_length, 0]),
        "capsule": (GEOM.mjGEOM_CAPSULE, [radius, half_length, 0]),
    }
    kind, size = sizes[shape.tag]
    return {"type": kind, "size": size}


def _meshes(spec: Any, filename: str) -> list[str]:
    """The names of a file's hulls, which are added once."""
    known = [mesh.name for mesh in spec.meshes if mesh.name.rpartition("#")[0] == filename]
    if known:
        return known
    names = []
    for number, points in enumerate(read_hulls(Path(filename))):
        names.append(f"{filename}#{number}")
        # What links weigh is stated; "shell" spares the compiler the volume of what is thin.
        shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.add_mesh(name=names[-1], uservert=points.ravel().tolist(), inertia=shell)
    return names


def _lowest(model: Any, data: Any, geom: int) -> float:
    z, down = float(data.geom_xpos[geom, 2]), np.abs(data.geom_xmat[geom][6:9])
    a, b, c = model.geom_size[geom]
    kind = model.geom_type[geom]
    if kind == GEOM.mjGEOM_MESH:
        return z + float((_points(model, geom) * data.geom_xmat[geom][6:9]).sum(axis=1).min())
    if kind == GEOM.mjGEOM_BOX:
        return z - float(down[0] * a + down[1] * b + down[2] * c)
    if kind == GEOM.mjGEOM_ELLIPSOID:
        return z - float(np.sqrt(((down * (a, b, c)) ** 2).sum()))
    if kind == GEOM.mjGEOM_CYLINDER:
        return z - float(down[2] * b + a * np.hypot(down[0], down[1]))
    # A capsule is a ball that was drawn along its axis; a sphere was not.
    return z - float(a + (down[2] * b if kind == GEOM.mjGEOM_CAPSULE else 0.0))


def _points(model: Any, geom: int) -> FloatArray:
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    points: FloatArray = model.mesh_vert[first : first + count].astype(np.float64)
    return points
