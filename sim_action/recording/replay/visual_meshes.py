"""The visual meshes of a robot, read from their files and simplified; results are cached by content."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from sim_action.core.files import Entry, cache_folder
from sim_action.meshes import MeshError, mesh_bytes, parsed_mesh
from sim_action.meshes.collada import Colour, colour_of, stated_colour
from sim_action.meshes.collision_hulls import read_hull_points
from sim_action.recording.replay.surfaces import Triangles, hull_surface, simplified
from sim_action.robot.model.robot_model import MESH_OF_TEXT, Mjcf, RobotModel
from sim_action.robot.reading.mjcf.mujoco_spec import surfaces_of

_VERSION: Final = 3  # the version of cache entries; a new number makes older ones unused
_MAX_BYTES: Final = 20_000_000  # the largest mesh file that is read; a larger one would take longer than most runs


class VisualMeshes:
    """The surfaces of a robot's meshes, each read once; `unreadable`: name of a file -> the reason."""

    def __init__(self, model: RobotModel, most: int) -> None:
        """Simplify each surface to at most `most` triangles."""
        self._mjcf, self._most = model.mjcf, most
        self.unreadable: dict[str, str] = {}
        self._colours: dict[str, Colour | None] = {}
        self._surfaces: dict[str, Triangles | None] = {}
        self._text_surfaces: dict[str, Triangles] | None = None
        self._hulls: dict[bytes, Triangles | None] = {}

    def surface(self, file: str) -> Triangles | None:
        """Return the surface in a file (see `Visual`) in its own units; None if it cannot be read."""
        if self._mjcf is not None and file.startswith(MESH_OF_TEXT):
            if self._text_surfaces is None:
                self._text_surfaces = dict(self._of_text(self._mjcf))
            return self._text_surfaces.get(file.removeprefix(MESH_OF_TEXT))
        if file not in self._surfaces:
            self._surfaces[file] = self._read(Path(file))
        return self._surfaces[file]

    def colour(self, file: str) -> Colour | None:
        """Return the colour that a file states; None if it states none, or is a mesh in MJCF."""
        if file not in self._colours:
            self._colours[file] = None if file.startswith(MESH_OF_TEXT) else self._colour(Path(file))
        return self._colours[file]

    def hulls(self, text: bytes) -> Triangles | None:
        """Return the convex hulls of a clean mesh (see `Shape`); None if none of them has a volume."""
        if text not in self._hulls:
            entry = self._entry(text, "hulls")
            surface = _stored(entry)
            if surface is None:
                surface = hull_surface(read_hull_points(text))
                if surface is not None:
                    surface = simplified(surface, self._most)
                    _store(surface, entry)
            self._hulls[text] = surface
        return self._hulls[text]

    def _of_text(self, mjcf: Mjcf) -> Iterator[tuple[str, Triangles]]:
        for name, (points, corners) in surfaces_of(mjcf).items():
            yield name, simplified(Triangles(points, corners), self._most)

    def _read(self, path: Path) -> Triangles | None:
        try:
            return self._surface(path, _small_enough(mesh_bytes(path)))
        except MeshError as error:
            self.unreadable[path.name] = str(error)
            return None

    def _colour(self, path: Path) -> Colour | None:
        try:
            data = _small_enough(mesh_bytes(path))
        except MeshError:
            return None
        # The material file of an OBJ may change on its own, and a COLLADA file takes long to parse.
        if path.suffix.lower() != ".dae":
            return colour_of(path, data)
        entry = Entry.of(cache_folder("meshes"), "txt", data, _VERSION, "colour")
        colour = entry.read()
        if colour is None:
            colour = " ".join(map(str, colour_of(path, data) or ())).encode()
            entry.write(colour)
        return stated_colour(colour.decode(errors="replace"))

    def _surface(self, path: Path, data: bytes) -> Triangles:
        entry = self._entry(data, path.suffix.lower())
        surface = _stored(entry)
        if surface is None:
            mesh = parsed_mesh(path, data)
            surface = simplified(Triangles(mesh.points_xyz, np.concatenate(mesh.parts)), self._most)
            _store(surface, entry)
        return surface

    def _entry(self, source: bytes, kind: str) -> Entry:
        return Entry.of(cache_folder("meshes"), "npz", source, _VERSION, "surface", kind, self._most)


def _small_enough(data: bytes) -> bytes:
    if len(data) > _MAX_BYTES:
        message = f"has {len(data) / 1e6:.0f} MB; meshes are drawn up to {_MAX_BYTES / 1e6:.0f} MB"
        raise MeshError("too-large-mesh", message)
    return data


def _stored(entry: Entry) -> Triangles | None:
    content = entry.read()
    if content is None:
        return None
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as stored:
            points = stored["points_xyz"].astype(np.float64)
            corners = stored["corners"].astype(np.int64)
            stated = int(stored["stated"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    return Triangles(points, corners, stated)


def _store(surface: Triangles, entry: Entry) -> None:
    content = io.BytesIO()
    points = surface.points_xyz.astype(np.float32)
    corners = surface.corners.astype(np.int32)
    np.savez(content, points_xyz=points, corners=corners, stated=np.int64(surface.stated))
    entry.write(content.getvalue())
