"""PyBullet behind the Backend protocol.

What it has to straighten out (Bullet's quickstart guide, and measurements in the tests): base poses are those of the
centre of mass, joints come with a motor switched on, links with a damping of 0.04, torques last for one step, and
contact points are reported before anything touches.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
import pybullet

from sim_action import geometry
from sim_action.command import JointTargets
from sim_action.errors import EngineError
from sim_action.geometry import Pose, Twist
from sim_action.observation import Contact, JointState, Observation
from sim_action.scene import Scene
from sim_action.trace import Trace
from sim_action.world import GROUND, Body, Placement

GRAVITY: Final = 9.80665
"""m/s^2, standard gravity (CGPM 1901)."""

_BASE: Final = -1
# From where things are let down to the ground, in m; no robot reaches further below its base.
_ABOVE_GROUND: Final = 100.0
# For joints whose model states no limit; N m or N.
_UNLIMITED_EFFORT: Final = 1000.0
# Bullet's own default. It outlives a connection, so it is set for every one.
_CONTACT_BREAKING_THRESHOLD: Final = 0.02
# Hull cylinders ride 1 mm high and cost twice as much. Inertia would be that of the collision shapes, filled evenly.
_LOAD_FLAGS: Final = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE


class PyBulletBackend:
    """One DIRECT connection with the scene in it."""

    version = f"pybullet {version('pybullet')}"

    def __init__(self, scene: Scene, *, contacts: bool) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        try:
            self._configure(scene.physics.rate)
            self._ground = self._add_ground(scene)
            self._body_names = {self._ground: GROUND}
            self._body_names |= {self._add_object(body): body.name for body in scene.world.objects}
            self._robot = self._load_robot(scene)
        except pybullet.error as error:
            self.close()
            raise EngineError(f"the engine refused the world: {error}") from None
        self._rate = scene.physics.rate
        self._watches_contacts = contacts and len(self._body_names) > 1
        self._read_joints(scene)
        self._place_robot(scene)
        self._held_efforts: dict[int, float] = {}
        self._rows: list[tuple[float, ...]] = []
        self._touches: list[Contact] = []

    def advance(self, first_step: int, targets: Sequence[JointTargets | None]) -> None:
        """See Backend.advance."""
        for step, wanted in enumerate(targets, start=first_step + 1):
            if wanted is not None:
                self._apply(wanted)
            if self._held_efforts:
                self._push(self._held_efforts)
            pybullet.stepSimulation(self._client)
            self._rows.append(self._row(step))
            if self._watches_contacts:
                self._touches += self._contacts(step, ground=False)

    def collect(self) -> Trace:
        """See Backend.collect."""
        columns = 14 + 3 * len(self._indices)
        state = np.array(self._rows, dtype=np.float64).reshape(-1, columns)
        for column, values in enumerate(_in_link_frame(tuple(state[:, 1:14].T), self._com_in_link), start=1):
            state[:, column] = values
        trace = Trace(self._joint_names, state, tuple(self._touches))
        self._rows, self._touches = [], []
        return trace

    def observe(self, step: int, *, contacts: bool) -> Observation:
        """See Backend.observe."""
        time, *row = self._row(step)
        px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = _in_link_frame(row[:13], self._com_in_link)
        joints = len(self._indices)
        states = map(JointState, row[13 : 13 + joints], row[13 + joints : 13 + 2 * joints], row[13 + 2 * joints :])
        return Observation(
            time=time,
            pose=Pose((px, py, pz), (qx, qy, qz, qw)),
            twist=Twist((vx, vy, vz), (wx, wy, wz)),
            joints=dict(zip(self._joint_names, states, strict=True)),
            contacts=tuple(self._contacts(step, ground=True)) if contacts else (),
        )

    def close(self) -> None:
        """See Backend.close."""
        pybullet.disconnect(self._client)

    def _configure(self, rate: float) -> None:
        pybullet.setGravity(0, 0, -GRAVITY, self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / rate,
            contactBreakingThreshold=_CONTACT_BREAKING_THRESHOLD,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            physicsClientId=self._client,
        )

    def _add_ground(self, scene: Scene) -> int:
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        ground = int(pybullet.createMultiBody(0, shape, physicsClientId=self._client))
        self._set_dynamics(ground, lateralFriction=scene.world.ground.friction)
        return ground

    def _add_object(self, body: Body) -> int:
        shape = pybullet.createCollisionShape(**_shape(body), physicsClientId=self._client)
        identifier = int(pybullet.createMultiBody(body.mass or 0.0, shape, physicsClientId=self._client))
        self._set_dynamics(identifier, lateralFriction=body.friction)
        self._place(identifier, body.pose)
        return identifier

    def _load_robot(self, scene: Scene) -> int:
        # The engine reads models from files only.
        with tempfile.TemporaryDirectory(prefix="sim-action-") as folder:
            path = Path(folder, "robot.urdf")
            path.write_text(scene.model.urdf, encoding="utf-8")
            fixed = scene.robot.base == "fixed"
            return int(
                pybullet.loadURDF(str(path), useFixedBase=fixed, flags=_LOAD_FLAGS, physicsClientId=self._client)
            )

    def _read_joints(self, scene: Scene) -> None:
        count = pybullet.getNumJoints(self._robot, self._client)
        infos = [pybullet.getJointInfo(self._robot, index, self._client) for index in range(count)]
        self._link_names = {_BASE: scene.model.root, **{info[0]: info[12].decode() for info in infos}}
        by_name = {info[1].decode(): info for info in infos}
        self._joint_names = tuple(joint.name for joint in scene.model.moving_joints)
        self._index = {name: by_name[name][0] for name in self._joint_names}
        self._indices = list(self._index.values())
        self._friction = {name: by_name[name][7] for name in self._joint_names}
        self._max_effort = {name: by_name[name][10] or _UNLIMITED_EFFORT for name in self._joint_names}
        self._max_velocity = {name: by_name[name][11] for name in self._joint_names}
        self._set_dynamics(self._robot)
        _, _, _, com_position, com_orientation, *_ = pybullet.getDynamicsInfo(self._robot, _BASE, self._client)
        self._com_in_link = Pose(com_position, com_orientation)

    def _place_robot(self, scene: Scene) -> None:
        positions = scene.joint_positions
        for joint in scene.model.moving_joints:
            position = positions.get(joint.name, 0.0)
            pybullet.resetJointState(self._robot, self._index[joint.name], position, physicsClientId=self._client)
            if joint.type == "continuous":
                # Switches the default motor off; what remains is the joint's own friction.
                self._motor(joint.name, pybullet.VELOCITY_CONTROL, force=self._friction[joint.name])
            else:
                self._servo(joint.name, position, self._max_effort[joint.name])
        self._place(self._robot, scene.robot.pose, self._com_in_link)

    def _place(self, body: int, placement: Placement, com_in_link: Pose | None = None) -> None:
        """Puts a body's link frame where the scenario wants it; without a z, onto the ground."""

        def put(z: float) -> None:
            pose = Pose((placement.x, placement.y, z), placement.orientation_xyzw)
            com = geometry.compose(pose, com_in_link) if com_in_link else pose
            pybullet.resetBasePositionAndOrientation(body, com.position_xyz, com.orientation_xyzw, self._client)

        put(_ABOVE_GROUND if placement.z is None else placement.z)
        if placement.z is None:
            put(_ABOVE_GROUND - self._height_above_ground(body))

    def _height_above_ground(self, body: int) -> float:
        # Bounding boxes are loose where an inertial frame is turned; distances are exact.
        points = pybullet.getClosestPoints(body, self._ground, 2 * _ABOVE_GROUND, physicsClientId=self._client)
        return min((float(point[8]) for point in points), default=_ABOVE_GROUND)

    def _set_dynamics(self, body: int, **dynamics: float) -> None:
        for link in range(_BASE, pybullet.getNumJoints(body, self._client)):
            pybullet.changeDynamics(
                body, link, linearDamping=0, angularDamping=0, physicsClientId=self._client, **dynamics
            )

    def _apply(self, targets: JointTargets) -> None:
        limits = {name: targets.max_effort.get(name, self._max_effort[name]) for name in targets.names()}
        for name in limits:
            self._held_efforts.pop(self._index[name], None)
        if targets.velocity:
            self._motors(targets.velocity, [limits[name] for name in targets.velocity])
        for name, position in targets.position.items():
            self._servo(name, position, limits[name])
        for name, effort in targets.effort.items():
            self._motor(name, pybullet.VELOCITY_CONTROL, force=0)
            self._held_efforts[self._index[name]] = effort

    def _servo(self, joint: str, position: float, max_effort: float) -> None:
        fastest = self._max_velocity[joint]
        speed = {"maxVelocity": fastest} if fastest > 0 else {}
        self._motor(joint, pybullet.POSITION_CONTROL, targetPosition=position, force=max_effort, **speed)

    def _motor(self, joint: str, mode: int, **target: float) -> None:
        pybullet.setJointMotorControl2(self._robot, self._index[joint], mode, physicsClientId=self._client, **target)

    def _motors(self, velocities: Mapping[str, float], forces: Sequence[float]) -> None:
        pybullet.setJointMotorControlArray(
            self._robot,
            [self._index[name] for name in velocities],
            pybullet.VELOCITY_CONTROL,
            targetVelocities=list(velocities.values()),
            forces=forces,
            physicsClientId=self._client,
        )

    def _push(self, efforts: Mapping[int, float]) -> None:
        pybullet.setJointMotorControlArray(
            self._robot,
            list(efforts),
            pybullet.TORQUE_CONTROL,
            forces=list(efforts.values()),
            physicsClientId=self._client,
        )

    def _contacts(self, step: int, *, ground: bool) -> Iterator[Contact]:
        for point in pybullet.getContactPoints(self._robot, physicsClientId=self._client):
            body, distance, force = self._body_names.get(point[2]), point[8], point[9]
            # A point is reported from 2 cm on; it is a contact once it carries a force or the shapes overlap.
            if body is not None and (ground or body != GROUND) and (force > 0 or distance <= 0):
                yield Contact(step / self._rate, self._link_names[point[3]], body, point[5], force)

    def _row(self, step: int) -> tuple[float, ...]:
        """A row of `Trace.state`, but for its frame: it is taken at every step, so it stays as cheap as it can be."""
        position, orientation = pybullet.getBasePositionAndOrientation(self._robot, self._client)
        linear, angular = pybullet.getBaseVelocity(self._robot, self._client)
        if not self._indices:
            return (step / self._rate, *position, *orientation, *linear, *angular)
        states = pybullet.getJointStates(self._robot, self._indices, self._client)
        positions, velocities, _, efforts = zip(*states, strict=True)
        if self._held_efforts:
            # The engine tells what its own motors do; these are off, and what they last did would be reported.
            told = zip(self._indices, efforts, strict=True)
            efforts = tuple(self._held_efforts.get(index, effort) for index, effort in told)
        time = step / self._rate
        return (time, *position, *orientation, *linear, *angular, *positions, *velocities, *efforts)


def _in_link_frame(com: Sequence[Any], com_in_link: Pose) -> tuple[Any, ...]:
    """Base pose and twist of the link frame from those of the centre of mass: 13 numbers, or as many columns.

    Only element by element: what is computed for a moment must not depend on how many moments are computed with it,
    which products of matrices do not promise.
    """
    px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = com
    orientation = (qx, qy, qz, qw)
    if com_in_link.orientation_xyzw != geometry.IDENTITY:
        orientation = geometry.multiply(orientation, geometry.conjugate(com_in_link.orientation_xyzw))
    ox, oy, oz = offset = geometry.rotate(orientation, com_in_link.position_xyz)
    ux, uy, uz = geometry.cross((wx, wy, wz), offset)
    return (px - ox, py - oy, pz - oz, *orientation, vx - ux, vy - uy, vz - uz, wx, wy, wz)


def _shape(body: Body) -> dict[str, Any]:
    if body.box is not None:
        return {"shapeType": pybullet.GEOM_BOX, "halfExtents": [size / 2 for size in body.box]}
    if body.cylinder is not None:
        return {"shapeType": pybullet.GEOM_CYLINDER, "radius": body.cylinder.radius, "height": body.cylinder.height}
    assert body.sphere is not None
    return {"shapeType": pybullet.GEOM_SPHERE, "radius": body.sphere.radius}
