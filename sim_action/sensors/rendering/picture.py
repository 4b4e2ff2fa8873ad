"""Draw solids and the ground into a picture with colours and depth.

It shows the collision shapes of a scene as coloured solids, each in the frame of its link or body.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import RobotModel, Shape
from sim_action.sensors.rendering import ACTOR, GROUND, PALETTE, ROBOT, SKY, Colour
from sim_action.sensors.rendering.solids import (
    Capsule,
    Components,
    Cylinder,
    Ellipsoid,
    FloatArray,
    Patch,
    Pinhole,
    Polyhedron,
    Solid,
    Triangle,
    centred_hull,
    read_hull_polyhedra,
)
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, SpherePart, grid_surface
from sim_action.world.parts import Part as BodyPart
from sim_action.world.scene import Scene

SQUARE_M: Final = 0.5  # the side of the ground's squares in m
_LIGHT: Final[Vector3] = (-0.36, 0.48, 0.8)  # Unit vector towards the light, world frame. There are no shadows.
# Brightness where a surface faces the light, and where it faces away.
_MAX_BRIGHTNESS: Final = 1.0
_MIN_BRIGHTNESS: Final = 0.4


@dataclass(frozen=True, slots=True)
class Placed:
    """A solid at a pose in the world frame."""

    solid: Solid
    pose: Pose
    colour: Colour


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture: `rgb` (H, W, 3), 0 to 255; `depth` (H, W) in m, inf where nothing is seen."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]


def draw(pinhole: Pinhole, camera: Pose, solids: Iterable[Placed]) -> Picture:
    """Return the picture of the ground, z = 0, and of solids, for a camera at a pose in the world."""
    canvas = _Canvas(pinhole, camera)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        canvas.add_ground()
        for placed in solids:
            canvas.add(placed)
    return canvas.picture()


class _Canvas:
    def __init__(self, pinhole: Pinhole, camera: Pose) -> None:
        self._pinhole, self._camera = pinhole, camera
        self._to_camera = geometry.inverse(camera)
        self._depth: FloatArray = np.full((pinhole.height, pinhole.width), np.inf)
        self._colours: FloatArray = np.broadcast_to(np.array(SKY), (*self._depth.shape, 3)).copy()

    def add_ground(self) -> None:
        everything = slice(None), slice(None)
        rays = self._pinhole.rays(self._camera, everything)
        start, way = rays.start_xyz[2], rays.ways[2]
        # The ground is invisible from below.
        depth = np.where((way < 0) & (start > 0), -start / way, np.inf)
        x, y, _ = rays.points(depth)
        odd = (np.floor(x / SQUARE_M) + np.floor(y / SQUARE_M)) % 2 == 1
        colours = np.where(odd[..., None], GROUND[1], GROUND[0]) * _brightness((0.0, 0.0, 1.0), Pose())
        self._put(everything, depth, colours)

    def add(self, placed: Placed) -> None:
        middle = geometry.compose(self._to_camera, placed.pose).position_xyz
        patch = self._pinhole.patch_around(middle, placed.solid.radius)
        if patch is None:
            return
        rays = self._pinhole.rays(geometry.compose(geometry.inverse(placed.pose), self._camera), patch)
        depth, normals = placed.solid.enter(rays)
        self._put(patch, depth, _brightness(normals, placed.pose)[..., None] * np.array(placed.colour))

    def _put(self, patch: Patch, depth: FloatArray, colours: FloatArray) -> None:
        seen = (depth >= self._pinhole.near) & (depth <= self._pinhole.far) & (depth < self._depth[patch])
        np.copyto(self._depth[patch], depth, where=seen)
        np.copyto(self._colours[patch], colours, where=seen[..., None])

    def picture(self) -> Picture:
        rgb = (self._colours * 255).round().astype(np.uint8)
        depth = self._depth.astype(np.float32)
        for array in (rgb, depth):
            array.flags.writeable = False
        return Picture(rgb, depth)


def _brightness(normals: Components | Vector3, pose: Pose) -> FloatArray:
    lx, ly, lz = geometry.rotate(geometry.conjugate(pose.orientation_xyzw), _LIGHT)
    x, y, z = normals
    towards = np.asarray(lx * x + ly * y + lz * z)
    brightness: FloatArray = (_MAX_BRIGHTNESS + _MIN_BRIGHTNESS) / 2 + (_MAX_BRIGHTNESS - _MIN_BRIGHTNESS) / 2 * towards
    return brightness


@dataclass(frozen=True, slots=True)
class Part:
    """A solid of a link or a body."""

    owner: str  # name of the link or the body
    solid: Solid
    pose: Pose  # of the solid, in the frame of its owner
    colour: Colour


def robot_parts(model: RobotModel, colour: Colour = ROBOT) -> Iterator[Part]:
    """Yield the collision shapes of a robot's links. Raises OSError."""
    for link in model.links:
        for shape in link.collisions:
            for solid, pose in _solids(shape):
                yield Part(link.name, solid, pose, colour)


def world_parts(scene: Scene) -> Iterator[Part]:
    """Yield the bodies of the world, without the ground, and the links of other robots as NAME/LINK."""
    for name, actor in scene.actors.items():
        for own in robot_parts(actor.model, ACTOR):
            yield Part(f"{name}/{own.owner}", own.solid, own.pose, own.colour)
    for number, body in enumerate(scene.world.objects):
        colour = body.color or PALETTE[number % len(PALETTE)]
        for part in scene.parts_of(body):
            for solid, pose in _of_part(part):
                yield Part(body.name, solid, pose, colour)


def _of_part(part: BodyPart) -> Iterator[tuple[Solid, Pose]]:
    if isinstance(part, BoxPart):
        x, y, z = part.size_xyz
        yield Polyhedron.box((x / 2, y / 2, z / 2)), part.pose
    elif isinstance(part, CylinderPart):
        yield Cylinder(part.radius, part.height / 2), part.pose
    elif isinstance(part, SpherePart):
        yield Ellipsoid((part.radius,) * 3), part.pose
    elif isinstance(part, HullPart):
        hull, at_xyz = centred_hull(np.array(part.points_xyz))
        yield hull, Pose(at_xyz)
    else:
        surface = grid_surface(part) if isinstance(part, GridPart) else part
        for corners in surface.points_xyz[surface.triangles]:
            triangle, at_xyz = Triangle.centred(corners)
            yield triangle, Pose(at_xyz)


def _solids(shape: Shape) -> Iterator[tuple[Solid, Pose]]:
    """Yield the solids of a shape; an unknown shape is its bounding box, and a plane has none."""
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(shape.pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)))
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    if shape.hulls:
        for hull, at_xyz in read_hull_polyhedra(shape.hulls):
            yield hull, geometry.compose(shape.pose, Pose(at_xyz))
    elif shape.kind in {"sphere", "ellipsoid"}:
        yield Ellipsoid(half), middle
    elif shape.kind == "cylinder":
        yield Cylinder(half[0], half[2]), middle
    elif shape.kind == "capsule":
        yield Capsule(half[0], half[2] - half[0]), middle
    elif shape.kind != "plane":
        yield Polyhedron.box(half), middle
