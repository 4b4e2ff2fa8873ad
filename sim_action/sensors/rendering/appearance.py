"""The collision shapes of a scene as coloured solids, each in the frame of its link or body."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import RobotModel, Shape
from sim_action.sensors.rendering import PALETTE, ROBOT, Colour
from sim_action.sensors.rendering.solids import (
    Capsule,
    Cylinder,
    Ellipsoid,
    Polyhedron,
    Solid,
    Triangle,
    centred_hull,
    read_hull_polyhedra,
)
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, SpherePart, grid_surface
from sim_action.world.parts import Part as BodyPart
from sim_action.world.scene import Scene


@dataclass(frozen=True, slots=True)
class Part:
    """A solid of a link or a body.

    Attributes:
        owner: name of the link or the body.
        pose: of the solid, in the frame of its owner.
    """

    owner: str
    solid: Solid
    pose: Pose
    colour: Colour


def robot_parts(model: RobotModel) -> Iterator[Part]:
    """Yield the collision shapes of a robot's links. Raises OSError."""
    for link in model.links:
        for shape in link.collisions:
            for solid, pose in _solids(shape):
                yield Part(link.name, solid, pose, ROBOT)


def world_parts(scene: Scene) -> Iterator[Part]:
    """Yield the bodies of the world, without the ground."""
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
