"""Read the shapes of bodies from files or arrays: meshes, heightfields and occupancy maps become parts.

Files must lie in the workspace and are limited in size. Engines get numbers, never a path.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from types import MappingProxyType

from sim_action.core.records import dataclass, field
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import SpecProblem
from sim_action.world import Body, Shape, World
from sim_action.world.parts import Part, moved
from sim_action.world.shapes import ShapeError


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The shapes of a world that were read."""

    # name of a body -> its parts, for bodies with shapes from files
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    problems: tuple[SpecProblem, ...] = ()  # problems, each with its path of keys


class ShapeLibrary:
    """A cache of shapes, so that the variations of a scenario read each file only once."""

    def __init__(self) -> None:
        self._shapes: dict[Hashable, tuple[Part, ...] | ShapeError] = {}

    def parts(self, body: Body, workspace: Workspace) -> tuple[Part, ...]:
        """Return the parts of a body, from the cache if possible. Raises ShapeError."""
        key = (workspace, body.mesh, body.heightfield, body.map, body.shapes, body.mass is not None)
        if key not in self._shapes:
            self._shapes[key] = _read(body, workspace)
        parts = self._shapes[key]
        if isinstance(parts, ShapeError):
            raise parts.with_traceback(None)
        return parts


def read_surroundings(
    world: World,
    workspace: Workspace,
    shapes: ShapeLibrary | None = None,
    already_read: Mapping[str, tuple[Part, ...]] = MappingProxyType({}),
) -> Surroundings:
    """Read the shapes of a world's bodies from files or arrays; `already_read`: name of a body -> its parts."""
    shapes = shapes or ShapeLibrary()
    parts = dict(already_read)
    problems: list[SpecProblem] = []
    for index, body in enumerate(world.objects):
        if body.is_read and body.name not in already_read:
            try:
                parts[body.name] = shapes.parts(body, workspace)
            except ShapeError as error:
                inside = (error.number, "mesh") if error.number is not None else ()
                problems.append((("world", "objects", index, body.shape, *inside, error.key), str(error)))
    return Surroundings(parts, tuple(problems))


def _read(body: Body, workspace: Workspace) -> tuple[Part, ...] | ShapeError:
    try:
        return tuple(_parts(body, workspace))
    except ShapeError as error:
        # The context would keep the data of the file alive.
        error.__context__ = error.__cause__ = None
        return error.with_traceback(None)


def _parts(body: Body, workspace: Workspace) -> Iterator[Part]:
    # These modules import numpy, which most scenarios do not need before they run.
    if body.mesh is not None:
        from sim_action.world.shape_files.mesh_file import mesh_parts  # it imports this module

        yield from mesh_parts(body.mesh, workspace, moves=body.mass is not None)
    elif body.shapes is not None:
        for number, shape in enumerate(body.shapes):
            yield from _parts_of_shape(shape, number, workspace, moves=body.mass is not None)
    elif body.heightfield is not None:
        from sim_action.world.shape_files.grids import grid_of  # it imports this module

        yield grid_of(body.heightfield, workspace)
    elif body.map is not None:
        from sim_action.world.shape_files.grids import walls  # it imports this module

        yield from walls(body.map, workspace)


def _parts_of_shape(shape: Shape, number: int, workspace: Workspace, *, moves: bool) -> Iterator[Part]:
    """Yield the parts of one of several shapes. Raises ShapeError."""
    if shape.mesh is None:
        yield from shape.parts()
        return
    from sim_action.world.shape_files.mesh_file import mesh_parts  # it imports this module

    try:
        for part in mesh_parts(shape.mesh, workspace, moves=moves):
            yield moved(part, shape.pose.pose)
    except ShapeError as error:
        error.number = number
        raise
