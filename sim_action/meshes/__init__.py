"""Read mesh files (STL, OBJ, COLLADA) and rewrite them as convex hulls for the engines.

The engines' own readers crash on a wrong index, hang on a material that is a pipe, and turn unreadable files into
shapes without contacts (see tests/integration/test_meshes.py for PyBullet). They therefore get only text that
`clean_mesh` has made, which holds the points of convex hulls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from sim_action.core.content_cache import Entry
from sim_action.core.files import read_at_most
from sim_action.core.geometry import Vector3
from sim_action.meshes.collada import read_collada
from sim_action.meshes.collision_hulls import MeshFacts, facts_of
from sim_action.meshes.hull_file import FORMAT, CleanMesh, read_clean_mesh, write_clean_mesh
from sim_action.meshes.mesh import MAX_BYTES, MAX_TRIANGLES, Mesh, MeshError
from sim_action.meshes.obj_and_stl import read_obj, read_stl

__all__ = [
    "MAX_BYTES",
    "MAX_TRIANGLES",
    "READERS",
    "CleanMesh",
    "MeshError",
    "MeshFacts",
    "clean_mesh",
    "mesh_bytes",
    "parsed_mesh",
    "read_mesh",
]

READERS: Final[Mapping[str, Callable[[bytes], Mesh]]] = MappingProxyType(
    {"stl": read_stl, "obj": read_obj, "dae": read_collada}
)
"""File extension -> reader."""

_LFS_POINTER: Final = b"version https://git-lfs"


def read_mesh(path: Path) -> MeshFacts:
    """Return the facts of a mesh file. Raises MeshError."""
    return facts_of(_format(path), _parsed(path, mesh_bytes(path)))


def parsed_mesh(path: Path, data: bytes | None = None) -> Mesh:
    """Return the triangles of a mesh file; `data`: its bytes, if they are known. Raises MeshError."""
    return _parsed(path, mesh_bytes(path) if data is None else data)


def clean_mesh(path: Path, folder: Path | None, scale: Vector3 = (1.0, 1.0, 1.0), margin: float = 0.0) -> CleanMesh:
    """Rewrite a mesh as an OBJ of hulls in metres, for use without a scale; equal files share a cache entry.

    Args:
        path: of the mesh.
        folder: the cache of rewritten meshes; None: there is none.
        scale: `<mesh scale>` of the URDF: the length in m of one unit of the file.
        margin: collision margin in m that the engine adds around a hull; the hulls are shrunk by it.

    Raises MeshError.
    """
    data = mesh_bytes(path)
    entry = Entry.of(folder, "obj", data, FORMAT, "hulls", _format(path), scale, margin)
    known = read_clean_mesh(entry, scale)
    if known is not None:
        return known
    mesh = _parsed(path, data)
    return write_clean_mesh(entry, mesh, facts_of(_format(path), mesh), scale, margin)


def _format(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")


def _parsed(path: Path, data: bytes) -> Mesh:
    if data.startswith(_LFS_POINTER):
        message = "is a Git LFS pointer, not the mesh; fetch it: git lfs pull, or actions/checkout with lfs: true"
        raise MeshError("broken-mesh", message)
    return READERS[_format(path)](data)


def mesh_bytes(path: Path) -> bytes:
    """Return the bytes of a mesh file. Raises MeshError."""
    if _format(path) not in READERS:
        message = f"'{path.suffix}' files are not supported; convert it to one of .{', .'.join(READERS)}"
        raise MeshError("unknown-mesh-format", message)
    try:
        data = read_at_most(path, MAX_BYTES)
    except FileNotFoundError:
        raise MeshError("missing-mesh", "does not exist") from None
    except (OSError, ValueError) as error:  # a NUL in the name
        raise MeshError("broken-mesh", f"cannot be read: {error}") from None
    if data is None:
        message = f"is larger than {MAX_BYTES // 1_000_000} MB; a few thousand triangles are enough for collisions"
        raise MeshError("too-large-mesh", message)
    return data
