"""One object of the world, fixed or with a mass."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Final, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel, Name, Placement, PositiveKilograms, PositiveSeconds
from sim_action.core.geometry import Pose
from sim_action.world.body_path import PathPoint, placements
from sim_action.world.ground import Friction
from sim_action.world.shapes import Cylinder, Heightfield, MeshFile, OccupancyMap, Ramp, Size, Sphere, Stairs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_action.world.parts import Part

SHAPES: Final = ("box", "cylinder", "sphere", "ramp", "stairs", "mesh", "heightfield", "map")

_MAY_MOVE: Final = ("box", "cylinder", "sphere", "mesh")

# In m and rad: what is no farther apart is the same place.
_MAX_LOOP_GAP: Final = 1e-6

Share = Annotated[float, Field(ge=0, le=1)]

Mass = Annotated[PositiveKilograms, Field(ge=1e-6, le=1e6)]


def _listed(names: Sequence[str]) -> str:
    quoted = [f"'{name}'" for name in names]
    return f"{', '.join(quoted[:-1])} and {quoted[-1]}"


class Body(FrozenModel):
    """A thing of one shape, which is fixed, or has a mass and moves."""

    name: Name
    box: Annotated[tuple[Size, Size, Size] | None, Field(description="full x, y, z")] = None
    cylinder: Annotated[Cylinder | None, Field(description="upright, about its own z axis")] = None
    sphere: Sphere | None = None
    ramp: Annotated[Ramp | None, Field(description="a wedge that rises along its own x axis; fixed")] = None
    stairs: Annotated[Stairs | None, Field(description="steps that rise along their own x axis; fixed")] = None
    mesh: Annotated[
        MeshFile | None, Field(description="triangles of a file, as they are; with a mass, their convex hull")
    ] = None
    heightfield: Annotated[Heightfield | None, Field(description="ground of many heights; fixed")] = None
    map: Annotated[OccupancyMap | None, Field(description="walls from a map of ROS's map_server; fixed")] = None
    pose: Annotated[
        Placement,
        Field(
            description="of the middle of the box around it; of a mesh or a map of its own origin, of a heightfield "
            "of the middle at height 0"
        ),
    ] = Placement.model_construct()
    mass: Annotated[Mass | None, Field(description="left out: it is fixed")] = None
    friction: Friction = 0.5
    color: Annotated[
        tuple[Share, Share, Share] | None,
        Field(description="red, green, blue, each 0 to 1, for cameras; left out: one of a row that has no red in it"),
    ] = None
    path: Annotated[
        tuple[PathPoint, ...],
        Field(description="where it is over time, in straight lines: it pushes what it meets, and nothing stops it"),
    ] = ()
    loop: Annotated[bool, Field(description="whether its path begins again at its end")] = False
    appears: Annotated[
        PositiveSeconds | None,
        Field(description="sim time before which it is not there; with a mass, it falls from then"),
    ] = None

    @property
    def beginning(self) -> Placement:
        """Where it is at first: on a path, at its first point."""
        return placements(self.pose, self.path[:1])[0] if self.path else self.pose

    @model_validator(mode="after")
    def _moves_as_it_can(self) -> Self:
        _refuse_impossible_path(self)
        return self

    @model_validator(mode="after")
    def _has_one_shape(self) -> Self:
        if sum(getattr(self, shape) is not None for shape in SHAPES) != 1:
            raise ValueError(f"an object has exactly one of {_listed(SHAPES)}")
        if self.mass is not None and self.shape not in _MAY_MOVE:
            raise ValueError(f"'{self.shape}' is fixed: leave 'mass' out; {_listed(_MAY_MOVE)} can have one")
        return self

    @property
    def shape(self) -> str:
        """The key of its shape."""
        return next(shape for shape in SHAPES if getattr(self, shape) is not None)

    @property
    def is_read(self) -> bool:
        """Whether its shape is in a file, or takes arrays: what reads files makes its parts."""
        return self.mesh is not None or self.heightfield is not None or self.map is not None

    def parts(self) -> Sequence[Part]:
        """What it is made of; not for what is read."""
        from sim_action.world.parts import BoxPart, CylinderPart, SpherePart

        if self.box is not None:
            return (BoxPart(self.box),)
        if self.cylinder is not None:
            return (CylinderPart(self.cylinder.radius, self.cylinder.height),)
        if self.sphere is not None:
            return (SpherePart(self.sphere.radius),)
        made = self.ramp or self.stairs
        assert made is not None
        return made.parts()


def placed(body: Body, parts: Sequence[Part]) -> Pose:
    """Where a body of these parts begins, in the world frame; without a z, it stands on the ground."""
    from sim_action.world.parts import lowest

    at = body.beginning
    z = -lowest(parts, at.orientation_xyzw) if at.z is None else at.z
    return Pose((at.x, at.y, z), at.orientation_xyzw)


def _refuse_impossible_path(body: Body) -> None:
    """Raises ValueError if what a body says of its motion does not fit together."""
    if body.loop and not body.path:
        raise ValueError("'loop' goes with a 'path'")
    if not body.path:
        return
    if body.mass is not None:
        raise ValueError("a body on a 'path' goes its way whatever it weighs and whatever it meets; leave 'mass' out")
    if body.appears is not None:
        raise ValueError("a body on a 'path' is there from the start; leave out 'appears', or 'path'")
    if len(body.path) < 2:
        raise ValueError("a path has two points at the least; where a body stays, 'pose' says where")
    if body.loop and _differ(placements(body.pose, body.path)):
        raise ValueError(
            "a path with 'loop: true' ends where it begins; let its last point be at the pose of its first, with its z"
        )


def _differ(places: Sequence[Placement]) -> bool:
    """Whether the last is not at the first; turned by whole turns, it is."""
    first, last = places[0], places[-1]
    if (first.z is None) != (last.z is None):
        return True
    ways = [last.x - first.x, last.y - first.y, (last.z or 0.0) - (first.z or 0.0)]
    turns = [last.roll - first.roll, last.pitch - first.pitch, last.yaw - first.yaw]
    return any(abs(way) > _MAX_LOOP_GAP for way in (*ways, *(math.remainder(turn, 2 * math.pi) for turn in turns)))
