"""What surrounds the robot and is read from files or comes as arrays: meshes, heightfields, maps -> parts.

Files are confined to the workspace, bounded, and read here alone: an engine gets numbers, never a path.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblem
from sim_action.world import Body, World
from sim_action.world.shape_files.shape_error import ShapeError

if TYPE_CHECKING:
    from sim_action.world.parts import Part


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What was read.

    Attributes:
        parts: name of a body -> what it is made of, for those that are read.
        problems: what is wrong, with the keys that lead there.
    """

    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    problems: tuple[SpecProblem, ...] = ()


class ShapeLibrary:
    """The shapes of a suite's bodies, each read once: variations share them, and a map of 16 million cells is one."""

    def __init__(self) -> None:
        self._shapes: dict[Hashable, tuple[Part, ...] | ShapeError] = {}

    def parts(self, body: Body, workspace: Workspace) -> tuple[Part, ...]:
        """Of a body whose shape is read, or what has come of the same before. Raises ShapeError."""
        key = (workspace, body.mesh, body.heightfield, body.map, body.mass is not None)
        if key not in self._shapes:
            self._shapes[key] = _read(body, workspace)
        found = self._shapes[key]
        if isinstance(found, ShapeError):
            raise found.with_traceback(None)
        return found


def read_surroundings(world: World, workspace: Workspace, shapes: ShapeLibrary | None = None) -> Surroundings:
    """Reads the bodies of a world whose shapes are in files or arrays; `shapes`: those that have been read."""
    shapes = shapes or ShapeLibrary()
    parts: dict[str, tuple[Part, ...]] = {}
    problems: list[SpecProblem] = []
    for index, body in enumerate(world.objects):
        if body.is_read:
            try:
                parts[body.name] = shapes.parts(body, workspace)
            except ShapeError as error:
                problems.append((("world", "objects", index, body.shape, error.key), str(error)))
    return Surroundings(parts, tuple(problems))


def _read(body: Body, workspace: Workspace) -> tuple[Part, ...] | ShapeError:
    try:
        return tuple(_parts(body, workspace))
    except ShapeError as error:
        # Without what was being read when it was raised, which would be kept with it.
        error.__context__ = error.__cause__ = None
        return error.with_traceback(None)


def _parts(body: Body, workspace: Workspace) -> Iterator[Part]:
    # All of it takes numpy, which most scenarios do without until they run.
    if body.mesh is not None:
        from sim_action.world.shape_files.mesh_file import mesh_parts

        yield from mesh_parts(body.mesh, workspace, moves=body.mass is not None)
    elif body.heightfield is not None:
        from sim_action.world.shape_files.heightfield import grid_of

        yield grid_of(body.heightfield, workspace)
    elif body.map is not None:
        from sim_action.world.shape_files.occupancy_map import walls

        yield from walls(body.map, workspace)
