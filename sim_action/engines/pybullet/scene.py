"""A scene in PyBullet: what is made once, before the first step."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pybullet

from sim_action.core import geometry
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Vector3
from sim_action.meshes.convex_hull import mass_properties
from sim_action.robot.robot_model import Mimic, Surface
from sim_action.world import FASTEST, Body, World, placed
from sim_action.world.ground import ground_tiles
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart
from sim_action.world.scene import Scene

BASE: Final = -1
"""The number of a body's base link."""

# From where things are let down to the ground, in m; no robot reaches further below its base.
_ABOVE_GROUND: Final = 100.0
# Bullet's own default. It outlives a connection, so it is set for every one.
_CONTACT_BREAKING_THRESHOLD: Final = 0.02
# Hull cylinders ride 1 mm high and cost twice as much. Inertia would be that of the collision shapes, filled evenly.
_LOAD_FLAGS: Final = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE
# A gear gives way to nothing that a motor could do, and makes up within a step for most of what it was off.
_GEAR_FORCE: Final = 1e5
_GEAR_CORRECTION: Final = 0.8


def configure(client: int, rate: float, gravity_xyz: Vector3) -> None:
    """Sets what holds for everything."""
    pybullet.setGravity(*gravity_xyz, client)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=1 / rate,
        contactBreakingThreshold=_CONTACT_BREAKING_THRESHOLD,
        deterministicOverlappingPairs=1,
        # Bodies touch if each is in a group that the other one looks for: both, which is not the default.
        collisionFilterMode=0,
        enableFileCaching=0,
        physicsClientId=client,
    )


def pave(client: int, plane: int, world: World) -> list[int]:
    """Makes the plane z = 0 the ground of a world; returns the engine's numbers for tiles that take its place."""
    _set_dynamics(client, plane, BASE, lateralFriction=world.ground.friction)
    tiles = [
        number
        for tile in ground_tiles(world.ground, world.patches)
        for number, _ in add_pieces(client, [tile.part], Pose(), tile.friction)
    ]
    if tiles:
        # What is asked for how far it is from the ground asks the plane, which nothing touches.
        pybullet.setCollisionFilterGroupMask(plane, BASE, 0, 0, physicsClientId=client)
    return tiles


def add_object(client: int, body: Body, parts: Sequence[Part]) -> list[tuple[int, Pose]]:
    """Adds a body where it begins; returns the engine's number for each of its pieces, and its pose in the body."""
    pose, moves = placed(body, parts), bool(body.path)
    return add_pieces(client, parts, pose, body.friction, body.mass or 0.0, moves=moves)


def add_pieces(
    client: int, parts: Sequence[Part], pose: Pose, friction: float, mass: float = 0.0, *, moves: bool = False
) -> list[tuple[int, Pose]]:
    """Adds what a body is made of; its pose is that of the body."""
    added = []
    for piece in pieces(client, parts, mass):
        # One that is more than a shape at a place costs time at every step, which adds up. But the velocity of a mere
        # shape is not felt by what it touches.
        plain = int(len(parts) > 1 and not moves)
        number = int(pybullet.createMultiBody(mass, piece.shape, useMaximalCoordinates=plain, physicsClientId=client))
        _set_dynamics(client, number, BASE, lateralFriction=friction)
        for name, value in piece.dynamics.items():
            pybullet.changeDynamics(number, BASE, **{name: value}, physicsClientId=client)
        at = geometry.compose(pose, piece.pose)
        pybullet.resetBasePositionAndOrientation(number, at.position_xyz, at.orientation_xyzw, client)
        added.append((number, piece.pose))
    return added


def load_robot(client: int, scene: Scene) -> int:
    """Adds the robot at the origin; returns the engine's number for it."""
    # The engine reads models from files only.
    with tempfile.TemporaryDirectory(prefix="sim-action-") as folder:
        path = Path(folder, "robot.urdf")
        path.write_text(scene.model.urdf, encoding="utf-8")
        return int(pybullet.loadURDF(str(path), useFixedBase=scene.bolted, flags=_LOAD_FLAGS, physicsClientId=client))


def set_surfaces(client: int, robot: int, surfaces: Mapping[int, Surface]) -> None:
    """Sets how the links of a robot touch, by the engine's number of each."""
    for link, surface in surfaces.items():
        soft: dict[str, float] = {}
        if surface.stiffness is not None:
            soft = {"contactStiffness": surface.stiffness, "contactDamping": surface.damping}
        _set_dynamics(client, robot, link, lateralFriction=surface.friction, **soft)


def add_rotor(client: int, robot: int, link: int, axis_xyz: Vector3, inertia: float) -> None:
    """Gives a joint the inertia of its motor, in kg m^2, about its axis, which is given in the frame of its link."""
    dynamics = pybullet.getDynamicsInfo(robot, link, client)
    principal_inertia, principal_axes = dynamics[2], dynamics[4]
    along = geometry.rotate(geometry.conjugate(principal_axes), axis_xyz)
    inertias = [own + inertia * part**2 for own, part in zip(principal_inertia, along, strict=True)]
    pybullet.changeDynamics(robot, link, localInertiaDiagonal=inertias, physicsClientId=client)


def add_gear(client: int, robot: int, follower: int, leader: int, mimic: Mimic) -> None:
    """Keeps a joint where another one wants it, as a gear without play would."""
    frames = ((0, 0, 1), (0, 0, 0), (0, 0, 0))
    gear = pybullet.createConstraint(
        robot, follower, robot, leader, pybullet.JOINT_GEAR, *frames, physicsClientId=client
    )
    # The engine holds follower + gearRatio x leader at the target.
    pybullet.changeConstraint(
        gear,
        gearRatio=-mimic.multiplier,
        relativePositionTarget=mimic.offset,
        maxForce=_GEAR_FORCE,
        erp=_GEAR_CORRECTION,
        physicsClientId=client,
    )


def place(client: int, body: int, ground: int, placement: Placement, com_in_link: Pose | None = None) -> None:
    """Puts a body's link frame where the scenario wants it; without a z, onto the ground."""

    def put(z: float) -> None:
        pose = Pose((placement.x, placement.y, z), placement.orientation_xyzw)
        com = geometry.compose(pose, com_in_link) if com_in_link else pose
        pybullet.resetBasePositionAndOrientation(body, com.position_xyz, com.orientation_xyzw, client)

    put(_ABOVE_GROUND if placement.z is None else placement.z)
    if placement.z is None:
        put(_ABOVE_GROUND - _height_above(client, ground, body))


def _height_above(client: int, ground: int, body: int) -> float:
    # Bounding boxes are loose where an inertial frame is turned; distances are exact.
    points = pybullet.getClosestPoints(body, ground, 2 * _ABOVE_GROUND, physicsClientId=client)
    return min((float(point[8]) for point in points), default=_ABOVE_GROUND)


def _set_dynamics(client: int, body: int, link: int, **dynamics: float) -> None:
    # Links come with a damping of 0.04, and everything stops at 100 m/s or rad/s. What is set in the same call for a
    # link other than the base is lost, silently.
    none = {"linearDamping": 0, "angularDamping": 0}
    pybullet.changeDynamics(body, link, **none, maxJointVelocity=FASTEST, physicsClientId=client)
    pybullet.changeDynamics(body, link, physicsClientId=client, **dynamics)


_MOST_SHAPES: Final = 16
# m, around a hull: without any, a third of all rays would go through it.
_MARGIN: Final = 1e-5
_ROUND: Final = geometry.quaternion_from_rpy(0.0, 0.0, math.pi / 2)


@dataclass(frozen=True, slots=True)
class Piece:
    """One of the engine's bodies, of which a body of the world may be several.

    Attributes:
        shape: the engine's number of its shape.
        pose: of what the engine takes for its middle, in the frame of the body of the world.
        dynamics: what is to be set for it.
    """

    shape: int
    pose: Pose = field(default_factory=Pose)
    dynamics: dict[str, Any] = field(default_factory=dict)


def pieces(client: int, parts: Sequence[Part], mass: float = 0.0) -> Iterator[Piece]:
    """Makes the shapes of a body; with a mass, it is of one part."""
    boxes = [part for part in parts if isinstance(part, BoxPart)]
    for first in range(0, len(boxes), _MOST_SHAPES) if len(boxes) > 1 else ():
        yield Piece(_compound(client, boxes[first : first + _MOST_SHAPES]))
    for part in parts:
        if not isinstance(part, BoxPart) or len(boxes) == 1:
            yield _piece(client, part, mass)


def _compound(client: int, boxes: Sequence[BoxPart]) -> int:
    return int(
        pybullet.createCollisionShapeArray(
            shapeTypes=[pybullet.GEOM_BOX] * len(boxes),
            halfExtents=[[size / 2 for size in box.size_xyz] for box in boxes],
            collisionFramePositions=[box.pose.position_xyz for box in boxes],
            collisionFrameOrientations=[box.pose.orientation_xyzw for box in boxes],
            physicsClientId=client,
        )
    )


def _piece(client: int, part: Part, mass: float) -> Piece:
    if isinstance(part, HullPart):
        return _hull(client, part, mass)
    if isinstance(part, GridPart):
        return _grid(client, part)
    pose = part.pose if isinstance(part, BoxPart) else Pose()
    return Piece(_shape(client, **_properties(part)), pose)


def _shape(client: int, **properties: Any) -> int:
    return int(pybullet.createCollisionShape(**properties, physicsClientId=client))


def _properties(part: BoxPart | CylinderPart | SpherePart | SurfacePart) -> dict[str, Any]:
    if isinstance(part, BoxPart):
        return {"shapeType": pybullet.GEOM_BOX, "halfExtents": [size / 2 for size in part.size_xyz]}
    if isinstance(part, CylinderPart):
        return {"shapeType": pybullet.GEOM_CYLINDER, "radius": part.radius, "height": part.height}
    if isinstance(part, SpherePart):
        return {"shapeType": pybullet.GEOM_SPHERE, "radius": part.radius}
    return {
        "shapeType": pybullet.GEOM_MESH,
        "vertices": part.points_xyz.tolist(),
        "indices": part.triangles.ravel().tolist(),
        "flags": pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
    }


def _hull(client: int, part: HullPart, mass: float) -> Piece:
    points = np.array(part.points_xyz)
    no_margin = {"collisionMargin": _MARGIN}
    if not mass:
        return Piece(_shape(client, shapeType=pybullet.GEOM_MESH, vertices=points.tolist()), Pose(), no_margin)
    # The engine would have its mass in the middle, and spread as that of the box around it.
    weighs = mass_properties(points)
    moments, axes = np.linalg.eigh(weighs.inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    x, y, z = weighs.centre_xyz.tolist()
    pose = Pose((x, y, z), _turned(axes))
    own = (points - weighs.centre_xyz) @ axes
    shape = _shape(client, shapeType=pybullet.GEOM_MESH, vertices=own.tolist())
    return Piece(shape, pose, {**no_margin, "localInertiaDiagonal": (mass * moments).tolist()})


def _turned(axes: Any) -> geometry.Quaternion:
    """The rotation whose columns these are."""
    found = np.linalg.eigh(_quaternion_matrix(axes))[1][:, -1]
    x, y, z, w = found.tolist()
    return (x, y, z, w)


def _quaternion_matrix(m: Any) -> Any:
    """Whose greatest eigenvector is the quaternion of a rotation matrix (Bar-Itzhack, 2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    rows = [
        [xx - yy - zz, 0, 0, 0],
        [yx + xy, yy - xx - zz, 0, 0],
        [zx + xz, zy + yz, zz - xx - yy, 0],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    return np.array(rows) / 3


def _grid(client: int, part: GridPart) -> Piece:
    # A quarter turn makes the other diagonal of each cell the one that it is folded along.
    heights = np.rot90(part.heights, 1)
    rows, columns = heights.shape
    width, depth = part.size_xy
    shape = _shape(
        client,
        shapeType=pybullet.GEOM_HEIGHTFIELD,
        meshScale=[depth / (columns - 1), width / (rows - 1), 1.0],
        heightfieldData=heights.ravel().tolist(),
        numHeightfieldRows=columns,
        numHeightfieldColumns=rows,
    )
    middle = float(heights.min() + heights.max()) / 2
    return Piece(shape, Pose((0.0, 0.0, middle), _ROUND))


class Connection(NamedTuple):
    """The engine's numbers for a DIRECT connection, and for the plane z = 0, which is alone in it."""

    client: int
    plane: int


_AHEAD: Final[list[Connection]] = []


def connect_ahead() -> None:
    """Makes the connection that this process, and each that is forked from it, is going to use next."""
    if not _AHEAD:
        _AHEAD.append(_made())


def connected() -> Connection:
    """A connection that nobody else uses."""
    return _AHEAD.pop() if _AHEAD else _made()


def _made() -> Connection:
    client = pybullet.connect(pybullet.DIRECT)
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    return Connection(client, int(pybullet.createMultiBody(0, shape, physicsClientId=client)))
