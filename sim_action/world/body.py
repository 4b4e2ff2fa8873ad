"""One object of the world, fixed, on a path or with a mass: of one shape, or of several with stated mass properties."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from sim_action.core import field_types, geometry
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy, symmetric_eigenvalues
from sim_action.core.records import dataclass
from sim_action.core.units import first_step
from sim_action.state.timeline import TimeMark
from sim_action.world.parts import BoxPart, CylinderPart, Part, SpherePart, lowest, moved
from sim_action.world.physics import MAX_MASS, MAX_SPEED, Friction
from sim_action.world.shapes import (
    MAX_LENGTH_M,
    Cylinder,
    Heightfield,
    MeshFile,
    OccupancyMap,
    Ramp,
    Size,
    Sphere,
    Stairs,
)

MAX_PACE: Final = 100.0  # the greatest multiple of the speed that a path states


class PathPoint(field_types.FrozenModel):
    """The pose of a body at one time, world frame; missing keys keep their last value."""

    at: Annotated[
        field_types.NonNegativeSeconds, Field(description="sim time; must be later than that of the previous point")
    ]
    x: field_types.Coordinate | None = None
    y: field_types.Coordinate | None = None
    z: field_types.Coordinate | None = None
    roll: field_types.Radians | None = None
    pitch: field_types.Radians | None = None
    yaw: Annotated[
        field_types.Radians | None, Field(description="absolute angle, not wrapped: 360 deg is one full turn")
    ] = None

    def after(self, before: field_types.Placement) -> field_types.Placement:
        """Return the placement at this point, given the previous one."""
        stated = self.model_dump(exclude={"at"}, exclude_none=True)
        return before.model_copy(update=stated)


class Pace(field_types.FrozenModel):
    """A change of the speed along a path, which then lasts longer or shorter, or stops."""

    at: Annotated[field_types.NonNegativeSeconds, Field(description="sim time of the change")]
    speed: Annotated[
        float, Field(ge=0, le=MAX_PACE, description="speed from then on, as a multiple of the stated one; 0: it stops")
    ]


def placements(start: field_types.Placement, points: Sequence[PathPoint]) -> tuple[field_types.Placement, ...]:
    """Return the placement at each point."""
    at_points: list[field_types.Placement] = []
    for point in points:
        at_points.append(point.after(at_points[-1] if at_points else start))
    return tuple(at_points)


Numbers = tuple[float, float, float, float, float, float]  # x, y, z in m and roll, pitch, yaw in rad


@dataclass(frozen=True, slots=True)
class PosePath:
    """A pose over time. Each of its six numbers is interpolated linearly; angles are not wrapped."""

    times: tuple[float, ...]  # of the points in s, ascending
    points: tuple[Numbers, ...]  # the numbers at those times
    loops: bool = False  # True if the path repeats; otherwise the pose stays at the last point
    # the changes of the speed along the path: sim time in s, and a multiple of the stated speed
    pace: tuple[Pace, ...] = ()

    @classmethod
    def of(
        cls,
        start: field_types.Placement,
        points: Sequence[PathPoint],
        *,
        loops: bool = False,
        pace: tuple[Pace, ...] = (),
    ) -> Self:
        """Return the path of a body; `start` gives the keys that its points omit."""
        numbers = tuple((p.x, p.y, p.z or 0.0, p.roll, p.pitch, p.yaw) for p in placements(start, points))
        return cls(tuple(point.at for point in points), numbers, loops, pace)

    def numbers(self, time: float) -> Numbers:
        """Return the numbers at a time in s; before the time of the first point, its numbers."""
        if self.pace:
            # The time in s of the path at a sim time in s.
            along, since, speed = 0.0, 0.0, 1.0
            for change in self.pace:
                if change.at >= time:
                    break
                along, since, speed = along + (change.at - since) * speed, change.at, change.speed
            time = along + (time - since) * speed
        first, last = self.times[0], self.times[-1]
        if self.loops and time > last:
            time = first + (time - first) % (last - first)
        after = bisect_right(self.times, time)
        if after == 0:
            return self.points[0]
        if after == len(self.times):
            return self.points[-1]
        begins, ends = self.times[after - 1], self.times[after]
        share = (time - begins) / (ends - begins)
        x, y, z, roll, pitch, yaw = (
            one + (other - one) * share for one, other in zip(self.points[after - 1], self.points[after], strict=True)
        )
        return x, y, z, roll, pitch, yaw

    def pose(self, time: float) -> Pose:
        """Return the pose at a time in s, world frame."""
        x, y, z, roll, pitch, yaw = self.numbers(time)
        return Pose((x, y, z), quaternion_from_rpy(roll, pitch, yaw))

    def fastest(self, reach: float) -> tuple[float, float]:
        """Return upper bounds in m/s and rad/s on the speed of points up to `reach` m from the origin, and on turns."""
        speed = turn = 0.0
        for (begins, one), (ends, other) in pairwise(zip(self.times, self.points, strict=True)):
            ways = [abs(after - before) / (ends - begins) for before, after in zip(one, other, strict=True)]
            speed, turn = max(speed, math.hypot(*ways[:3])), max(turn, sum(ways[3:]))
        most = max([1.0, *(change.speed for change in self.pace)])
        return most * (speed + turn * reach), most * turn


BODY_SHAPES: Final = ("box", "cylinder", "sphere", "ramp", "stairs", "mesh")
"""The keys of the shapes of which a body can have several."""

MAX_SHAPES: Final = 1000
Arm = Annotated[field_types.Metres, Field(ge=-MAX_LENGTH_M, le=MAX_LENGTH_M)]
_ROUNDING: Final = 1e-3  # moments may break the triangle inequality by this share: files are rounded
_SMALLEST_SHARE: Final = 1e-7  # the error of a computed principal moment, as a share of the largest one, is less


class ShapePose(field_types.RelativePose):
    """The pose of a shape in the frame of its object."""


class Shape(field_types.FrozenModel):
    """One of several shapes of an object, which are rigidly joined and touch others under one name."""

    box: Annotated[tuple[Size, Size, Size] | None, Field(description="full size in x, y and z")] = None
    cylinder: Annotated[Cylinder | None, Field(description="cylinder about its own z axis")] = None
    sphere: Sphere | None = None
    ramp: Annotated[Ramp | None, Field(description="wedge that rises along its own x axis")] = None
    stairs: Annotated[Stairs | None, Field(description="steps that rise along their own x axis")] = None
    mesh: Annotated[MeshFile | None, Field(description="triangle mesh from a file; with a mass, its convex hull")] = (
        None
    )
    pose: Annotated[ShapePose, Field(description="pose of the shape in the frame of the object")] = (
        ShapePose.model_construct()
    )

    @model_validator(mode="after")
    def _is_one_shape(self) -> Self:
        shapes = [f"'{shape}'" for shape in BODY_SHAPES if getattr(self, shape) is not None]
        if len(shapes) > 1:
            raise ValueError(f"{' and '.join(shapes)} are in one shape; begin each shape with '- '")
        if not shapes:
            raise ValueError(f"needs exactly one of {', '.join(BODY_SHAPES)}")
        return self

    @property
    def kind(self) -> str:
        """The YAML key of the shape."""
        return next(shape for shape in BODY_SHAPES if getattr(self, shape) is not None)

    def parts(self) -> Sequence[Part]:
        """Return the parts of a shape that is not read from a file, in the frame of the object."""
        return [moved(part, self.pose.pose) for part in solid_parts(self)]


def solid_parts(shape: Shape | Body) -> Sequence[Part]:
    """Return the parts of a box, cylinder, sphere, ramp or flight of stairs, in its own frame."""
    if shape.box is not None:
        return (BoxPart(shape.box),)
    if shape.cylinder is not None:
        return (CylinderPart(shape.cylinder.radius, shape.cylinder.height),)
    if shape.sphere is not None:
        return (SpherePart(shape.sphere.radius),)
    made = shape.ramp or shape.stairs
    assert made is not None
    return made.parts()


class Inertia(field_types.FrozenModel):
    """The moments of inertia about the centre of mass, along the axes of the object."""

    ixx: field_types.NonNegativeKilogramSquareMetres
    iyy: field_types.NonNegativeKilogramSquareMetres
    izz: field_types.NonNegativeKilogramSquareMetres
    ixy: field_types.KilogramSquareMetres = 0.0
    ixz: field_types.KilogramSquareMetres = 0.0
    iyz: field_types.KilogramSquareMetres = 0.0

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        diagonal, products = (self.ixx, self.iyy, self.izz), (self.ixy, self.ixz, self.iyz)
        is_turned = any(products)
        least, middle, most = sorted(symmetric_eigenvalues(diagonal, *products) if is_turned else diagonal)
        smallest = _SMALLEST_SHARE * most if is_turned else 0.0
        if least <= smallest or most > (least + middle) * (1 + _ROUNDING):
            moments = " ".join(f"{moment:g}" for moment in ((least, middle, most) if is_turned else diagonal))
            kind = "principal moments" if is_turned else "moments"
            rule = "each is greater than 0 and at most the sum of the others"
            raise ValueError(f"no body has the {kind} {moments}: {rule}")
        return self

    @property
    def rows(self) -> tuple[tuple[float, float, float], ...]:
        """The tensor in kg m^2."""
        return (self.ixx, self.ixy, self.ixz), (self.ixy, self.iyy, self.iyz), (self.ixz, self.iyz, self.izz)


SurfaceSpeed = Annotated[field_types.MetresPerSecond, Field(ge=-MAX_SPEED, le=MAX_SPEED)]


class SurfaceVelocity(field_types.FrozenModel):
    """The motion of the surface of an object that stands still itself: a belt, a roller or a turntable."""

    linear: Annotated[
        tuple[SurfaceSpeed, SurfaceSpeed, SurfaceSpeed], Field(description="along the x, y and z axes of the object")
    ] = geometry.ZERO
    angular: Annotated[
        field_types.RadiansPerSecond, Field(ge=-MAX_SPEED, le=MAX_SPEED, description="about the z axis of the object")
    ] = 0.0

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if not (any(self.linear) or self.angular):
            raise ValueError("a surface that does not move needs no 'surface_velocity': give 'linear' or 'angular'")
        return self

    @property
    def twist(self) -> Twist:
        """The twist in the frame of the object."""
        return Twist(self.linear, (0.0, 0.0, self.angular))


SHAPES: Final = ("box", "cylinder", "sphere", "ramp", "stairs", "mesh", "heightfield", "map", "shapes")
_MAY_MOVE: Final = ("box", "cylinder", "sphere", "mesh", "shapes")
_MAX_LOOP_GAP: Final = 1e-6  # m and rad: the start and the end of a loop may differ by this
Share = Annotated[float, Field(ge=0, le=1)]
Mass = Annotated[field_types.PositiveKilograms, Field(ge=1e-6, le=MAX_MASS)]


def _listed(names: Sequence[str]) -> str:
    quoted = [f"'{name}'" for name in names]
    return f"{', '.join(quoted[:-1])} and {quoted[-1]}"


class Body(field_types.FrozenModel):
    """An object of one or several shapes: fixed, or movable with a mass."""

    name: field_types.Name
    box: Annotated[tuple[Size, Size, Size] | None, Field(description="full size in x, y and z")] = None
    cylinder: Annotated[Cylinder | None, Field(description="upright cylinder about its own z axis")] = None
    sphere: Sphere | None = None
    ramp: Annotated[Ramp | None, Field(description="wedge that rises along its own x axis; fixed")] = None
    stairs: Annotated[Stairs | None, Field(description="steps that rise along their own x axis; fixed")] = None
    mesh: Annotated[MeshFile | None, Field(description="triangle mesh from a file; with a mass, its convex hull")] = (
        None
    )
    heightfield: Annotated[Heightfield | None, Field(description="terrain from a grid of heights; fixed")] = None
    map: Annotated[OccupancyMap | None, Field(description="walls from an occupancy map of ROS's map_server; fixed")] = (
        None
    )
    shapes: Annotated[
        tuple[Shape, ...] | None,
        Field(
            min_length=1, max_length=MAX_SHAPES, description="several shapes in one rigid object, each with a 'pose'"
        ),
    ] = None
    pose: Annotated[
        field_types.Placement,
        Field(
            description="pose of the centre of its bounding box; mesh and map: of the file's origin; heightfield: the "
            "centre at height 0; shapes: of the frame in which they are placed"
        ),
    ] = field_types.Placement.model_construct()
    mass: Annotated[Mass | None, Field(description="mass of the object; default: the object is fixed")] = None
    center_of_mass: Annotated[
        tuple[Arm, Arm, Arm] | None,
        Field(description="centre of mass in the frame of the object; default: that of uniform density"),
    ] = None
    inertia: Annotated[Inertia | None, Field(description="moments of inertia; default: those of uniform density")] = (
        None
    )
    friction: Friction = 0.5
    color: Annotated[
        tuple[Share, Share, Share] | None,
        Field(description="red, green and blue, each 0 to 1, for cameras; default: one of several, none of them red"),
    ] = None
    path: Annotated[
        tuple[PathPoint, ...],
        Field(description="poses over time, joined by straight lines; it pushes what it meets and is never stopped"),
    ] = ()
    loop: Annotated[bool, Field(description="repeat the path from its end")] = False
    pace: Annotated[
        tuple[Pace, ...], Field(description="changes of the speed along the path, in the order of time")
    ] = ()
    surface_velocity: Annotated[
        SurfaceVelocity | None,
        Field(description="motion of the surface of a fixed object from 0 s on, which carries what touches it"),
    ] = None
    appears: Annotated[
        field_types.PositiveSeconds | None,
        Field(description="sim time at which the object appears; with a mass, it falls from then on"),
    ] = None
    disappears: Annotated[
        field_types.PositiveSeconds | None, Field(description="sim time at which the object is removed")
    ] = None

    def time_marks(self) -> Iterator[TimeMark]:
        """Yield the marks of the timeline: when it appears, and when its path begins and ends."""
        if self.appears is not None:
            yield TimeMark(self.appears, self.appears, f"body '{self.name}' appeared")
        if self.disappears is not None:
            yield TimeMark(self.disappears, self.disappears, f"body '{self.name}' disappeared")
        for change in self.pace:
            share = "" if change.speed == 1 else f" at {change.speed:g} times its speed"
            moves = f"moved along its path{share}" if change.speed else "stopped on its path"
            if change.at or change.speed:
                yield TimeMark(change.at, change.at, f"body '{self.name}' {moves}")
        if self.pace:
            return
        ends = self.path[:1] if self.loop else self.path[:1] + self.path[-1:]
        for point, what in zip(ends, ("began", "ended"), strict=False):
            yield TimeMark(point.at, point.at, f"body '{self.name}' {what} its path")

    def presence(self, rate: float) -> tuple[float, float]:
        """Return the steps, at `rate` Hz, from which on it is there, and from which on it is gone; or infinities."""
        first = -math.inf if self.appears is None else first_step(self.appears, rate)
        return first, math.inf if self.disappears is None else first_step(self.disappears, rate)

    @property
    def beginning(self) -> field_types.Placement:
        """The initial placement; on a path, the placement of its first point."""
        return placements(self.pose, self.path[:1])[0] if self.path else self.pose

    @model_validator(mode="after")
    def _moves_as_it_can(self) -> Self:
        _refuse_impossible_path(self)
        _refuse_impossible_times(self)
        return self

    @model_validator(mode="after")
    def _has_one_shape(self) -> Self:
        shapes = [shape for shape in SHAPES if getattr(self, shape) is not None]
        if len(shapes) != 1:
            but = f", found {_listed(shapes)}; 'shapes' takes a list of several" if shapes else ""
            raise ValueError(f"an object needs exactly one shape of {_listed(SHAPES)}{but}")
        if self.mass is not None and self.shape not in _MAY_MOVE:
            raise ValueError(f"'{self.shape}' is always fixed: remove 'mass'; {_listed(_MAY_MOVE)} can have one")
        stated = next((key for key in ("center_of_mass", "inertia") if getattr(self, key) is not None), None)
        if self.mass is None and stated is not None:
            raise ValueError(f"'{stated}' needs a 'mass': an object without one is fixed")
        return self

    @property
    def has_own_inertia(self) -> bool:
        """True if it can move, and its mass properties do not follow from a single shape."""
        stated = self.center_of_mass is not None or self.inertia is not None
        return self.mass is not None and (self.shapes is not None or stated)

    @property
    def shape(self) -> str:
        """The YAML key of the shape."""
        return next(shape for shape in SHAPES if getattr(self, shape) is not None)

    @property
    def is_read(self) -> bool:
        """True if the shape comes from a file or an array; `shape_files` then makes the parts."""
        has_file = any(shape.mesh is not None for shape in self.shapes or ())
        return has_file or self.mesh is not None or self.heightfield is not None or self.map is not None

    def parts(self) -> Sequence[Part]:
        """Return the parts of a shape that is not read from a file."""
        if self.shapes is not None:
            return [part for shape in self.shapes for part in shape.parts()]
        return solid_parts(self)


def placed(body: Body, parts: Sequence[Part]) -> Pose:
    """Return the initial pose of a body with these parts, world frame; without a z it stands on the ground."""
    at = body.beginning
    z = -lowest(parts, at.orientation_xyzw) if at.z is None else at.z
    return Pose((at.x, at.y, z), at.orientation_xyzw)


def path_of(body: Body, parts: Sequence[Part]) -> PosePath:
    """Return the path of a body with these parts; without a z it stands on the ground."""
    at = body.pose.model_copy(update={"z": placed(body, parts).position_xyz[2]})
    return PosePath.of(at, body.path, loops=body.loop, pace=body.pace)


def _refuse_impossible_path(body: Body) -> None:
    """Raise ValueError if the keys on the motion of a body contradict each other."""
    if body.surface_velocity is not None:
        others = {
            "mass": body.mass is not None,
            "path": body.path,
            "appears": body.appears is not None,
            "disappears": body.disappears is not None,
        }
        if stated := [name for name, is_stated in others.items() if is_stated]:
            raise ValueError(f"'surface_velocity' is of an object that is fixed from the start; remove '{stated[0]}'")
    if body.loop and not body.path:
        raise ValueError("'loop' needs a 'path'")
    if not body.path:
        return
    if body.mass is not None:
        raise ValueError("a body on a 'path' moves regardless of its weight and of contacts; remove 'mass'")
    if body.appears is not None:
        raise ValueError("a body on a 'path' exists from the start; remove 'appears' or 'path'")
    if len(body.path) < 2:
        raise ValueError("a path needs at least two points; for a body at rest use 'pose'")
    if body.loop and _differ(placements(body.pose, body.path)):
        raise ValueError(
            "a path with 'loop: true' must end where it starts; give its last point the pose of its first, including z"
        )


def _refuse_impossible_times(body: Body) -> None:
    """Raise ValueError if the times of a body contradict each other."""
    if body.pace and not body.path:
        raise ValueError("'pace' needs a 'path'")
    if any(later.at <= earlier.at for earlier, later in pairwise(body.pace)):
        raise ValueError("the changes of 'pace' must be in the order of time")
    if body.disappears is not None and body.appears is not None and body.disappears <= body.appears:
        raise ValueError(f"'disappears' must be later than 'appears' ({body.appears:g} s)")


def _differ(places: Sequence[field_types.Placement]) -> bool:
    """Return True if the last placement differs from the first, apart from whole turns."""
    first, last = places[0], places[-1]
    if (first.z is None) != (last.z is None):
        return True
    ways = [last.x - first.x, last.y - first.y, (last.z or 0.0) - (first.z or 0.0)]
    turns = [last.roll - first.roll, last.pitch - first.pitch, last.yaw - first.yaw]
    return any(abs(way) > _MAX_LOOP_GAP for way in (*ways, *(math.remainder(turn, 2 * math.pi) for turn in turns)))
