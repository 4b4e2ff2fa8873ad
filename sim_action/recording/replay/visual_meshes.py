"""The visual meshes of a robot, read from their files and simplified; results are cached by content."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from sim_action.core.files import whole_file
from sim_action.meshes import MeshError, mesh_bytes, parsed_mesh
from sim_action.meshes.hull_file import read_hull_points
from sim_action.recording.replay.surfaces import Triangles, hull_surface, simplified
from sim_action.robot.mesh_references import cache_folder
from sim_action.robot.robot_model import RobotModel

# The version of cached files; a new number makes older files invalid.
_VERSION: Final = 1

_MAX_BYTES: Final = 20_000_000
"""The largest mesh file that is read; a larger one would take longer than most runs."""


class VisualMeshes:
    """The surfaces of a robot's meshes; each file is read once."""

    def __init__(self, model: RobotModel, most: int) -> None:
        """Simplify each surface to at most `most` triangles."""
        self._text, self._most = model.mjcf, most
        self._known: dict[str, Triangles | None] = {}
        self._known_hulls: dict[str, Triangles | None] = {}

    def surface(self, file: str) -> Triangles | None:
        """Return the surface in a file (see `Visual`) in its own units; None if it cannot be read."""
        if self._text and not self._known:
            self._known = dict(self._of_text())
        if file not in self._known:
            self._known[file] = None if self._text else self._read(Path(file))
        return self._known[file]

    def hulls(self, file: str) -> Triangles | None:
        """Return the convex hulls in a cached hull file (see `Shape`); its name is the digest of its content."""
        if file not in self._known_hulls:
            self._known_hulls[file] = self._read_hulls(Path(file))
        return self._known_hulls[file]

    def _read_hulls(self, path: Path) -> Triangles | None:
        cached = path.with_name(f"{path.stem}-{_VERSION}-{self._most}.npz")
        if (known := _stored(cached)) is not None:
            return known
        try:
            found = hull_surface(read_hull_points(path))
            if found is not None:
                found = simplified(found, self._most)
                _store(found, cached)
        except OSError:
            return None
        return found

    def _of_text(self) -> Iterator[tuple[str, Triangles]]:
        from sim_action.robot.mjcf import surfaces_of_text

        for name, (points, corners) in surfaces_of_text(self._text).items():
            yield name, simplified(Triangles(points, corners), self._most)

    def _read(self, path: Path) -> Triangles | None:
        try:
            data = mesh_bytes(path)
            if len(data) > _MAX_BYTES:
                return None
            cached = cache_folder() / self._name(path, data)
            known = _stored(cached)
            if known is None:
                mesh = parsed_mesh(path)
                known = simplified(Triangles(mesh.points_xyz, np.concatenate(mesh.parts)), self._most)
                _store(known, cached)
        except (MeshError, OSError):
            return None
        return known

    def _name(self, path: Path, data: bytes) -> str:
        digest = hashlib.sha256(json.dumps([_VERSION, "visual", path.suffix.lower(), self._most]).encode())
        digest.update(data)
        return f"{digest.hexdigest()}.npz"


def _stored(path: Path) -> Triangles | None:
    try:
        with np.load(path, allow_pickle=False) as stored:
            points, corners = stored["points_xyz"].astype(np.float64), stored["corners"].astype(np.int64)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    return Triangles(points, corners)


def _store(surface: Triangles, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:  # another process may be at the same mesh
        np.savez(file, points_xyz=surface.points_xyz.astype(np.float32), corners=surface.corners.astype(np.int32))
