"""Read mesh files as bodies of the world: as convex hulls if they are convex or have a mass, else as triangles."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core.workspace import Workspace
from sim_action.meshes import MeshError, mesh_bytes, parsed_mesh, sampled_triangles
from sim_action.meshes.collision_hulls import are_concave, facts_of, hulls_of
from sim_action.meshes.mesh import Mesh
from sim_action.world import MeshFile
from sim_action.world.parts import HullPart, SurfacePart
from sim_action.world.shapes import MAX_LENGTH_M, MIN_LENGTH_M, ShapeError, found_file

MAX_TRIANGLES: Final = 40_000  # PyBullet's limit for a body that is not convex
_SAMPLED: Final = 1000


def mesh_parts(mesh_file: MeshFile, workspace: Workspace, *, moves: bool) -> Iterator[HullPart | SurfacePart]:
    """Yield the parts of a mesh that a scenario names, in m. Raises ShapeError."""
    yield from read_mesh_parts(found_file(workspace, mesh_file.file), mesh_file, moves=moves)


def read_mesh_parts(path: Path, mesh_file: MeshFile, *, moves: bool) -> Iterator[HullPart | SurfacePart]:
    """Yield the parts of a mesh in m; `path` is the file, which may be read. Raises ShapeError."""
    name = mesh_file.file
    try:
        data = mesh_bytes(path)
        if not moves and path.suffix.lower() == ".stl" and (sample := sampled_triangles(data, _SAMPLED)) is not None:
            # Before the points are welded, which takes several times the memory of the file.
            count, corners = sample
            if count > MAX_TRIANGLES and are_concave(corners):
                raise _too_many(name, count)
        mesh = parsed_mesh(path, data)
    except MeshError as error:
        raise ShapeError(f"'{name}' {error}") from None
    scale = mesh_file.scale if isinstance(mesh_file.scale, tuple) else (mesh_file.scale,) * 3
    _check_size(name, np.ptp(mesh.points_xyz, axis=0) * scale)
    whole = Mesh(mesh.points_xyz, (np.concatenate(mesh.parts),))
    shape = facts_of(path.suffix, whole if moves else mesh).shape
    if moves and shape == "flat":
        raise ShapeError(f"'{name}' has no volume and cannot have a mass; remove 'mass', or give the mesh a thickness")
    if moves or shape == "convex":
        yield from (_hull(points) for points in hulls_of(whole if moves else mesh, scale, 0.0))
        return
    triangles = whole.parts[0]
    if len(triangles) > MAX_TRIANGLES:
        raise _too_many(name, len(triangles))
    yield SurfacePart(mesh.points_xyz * np.array(scale), triangles)


def _too_many(name: str, count: int) -> ShapeError:
    message = f"'{name}' is not convex and has {count:,} triangles; at most {MAX_TRIANGLES:,} are simulated"
    return ShapeError(f"{message}: simplify it")


def _hull(points: NDArray[np.float64]) -> HullPart:
    return HullPart(tuple((x, y, z) for x, y, z in points.tolist()))


def _check_size(name: str, extents: NDArray[np.float64]) -> None:
    largest = float(extents.max())
    if largest > MAX_LENGTH_M:
        raise ShapeError(f"'{name}' measures {largest:.4g} m; if the file is in millimetres, use scale: 0.001", "scale")
    if largest < MIN_LENGTH_M:
        raise ShapeError(
            f"'{name}' measures {largest:.4g} m, which is too small to simulate (at least {MIN_LENGTH_M:g} m)", "scale"
        )
