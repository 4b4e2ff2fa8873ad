"""A scene in PyBullet: what is made once, before the first step."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import pybullet

from sim_action.core import geometry
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Vector3
from sim_action.engines.pybullet.bodies import pieces
from sim_action.robot.robot_model import Mimic, Surface
from sim_action.world import FASTEST, Body, World, placed
from sim_action.world.parts import Part
from sim_action.world.scene import Scene
from sim_action.world.tiles import ground_tiles

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
