"""Move bodies and apply forces in MuJoCo.

A body without a joint has no velocity in MuJoCo, even if its pose changes at every step. A contact constraint uses the
relative velocity v of the touching points only in its reference acceleration, -b v. The missing part of v is therefore
added there, between the two halves of a step: then friction carries what stands on such a body, and impacts push.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.engines.body_control import MAX_ATTRACTION_M, BodyControl, RobotInertia, Target, base_wrench
from sim_action.engines.mujoco.queries import Objects
from sim_action.engines.mujoco.scene import CompiledScene
from sim_action.state.command import BasePush
from sim_action.world import GROUND


class MuJoCoBodyControl(BodyControl):
    """The bodies of a MuJoCo model."""

    def __init__(self, compiled: CompiledScene, objects: Objects, forget_frictions: Callable[[], None]) -> None:
        """`forget_frictions`: called when the friction of contacts has changed."""
        self._forget_frictions = forget_frictions
        self._model, self._data, self._objects = compiled.model, compiled.data, objects
        self._names, self._name = compiled.bodies, compiled.name
        self._moving: dict[str, Twist] = {}
        self._pressed: set[int] = set()

    @override
    def pose(self, body: str) -> Pose:
        return self._objects.pose(body)

    @override
    def set_pose(self, body: str, pose: Pose, twist: Twist) -> None:
        if self._objects.set_pose(body, pose, twist):
            return
        if twist == Twist():
            self._moving.pop(body, None)
        else:
            self._moving[body] = twist

    @override
    def apply_force(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        body = self._number(target)
        turning: Any = torque_xyz
        if point_xyz is not None:
            arm = np.subtract(point_xyz, self._model.body_ipos[body])
            turning = np.add(torque_xyz, np.cross(self._turned(body) @ arm, force_xyz))
        # Other sources may act on the same body.
        self._data.xfrc_applied[body] += [*force_xyz, *turning]
        self._pressed.add(body)

    @override
    def attract(self, target: Target, force: float) -> None:
        body, data, owners = self._number(target), self._data, self._model.geom_bodyid
        touching: dict[int, list[Any]] = {}
        for contact in data.contact:
            one, other = owners[contact.geom].tolist()
            is_of_world = not self._names.keys().isdisjoint(contact.geom.tolist())
            if body in {one, other} and is_of_world and contact.dist < MAX_ATTRACTION_M:
                touching.setdefault(other if one == body else one, []).append(contact)
        for contacts in touching.values():
            for contact in contacts:
                # The normal points from the first geom to the second.
                pull = contact.frame[:3] * force / len(contacts)
                for number, pulled in zip(owners[contact.geom].tolist(), (pull, -pull), strict=True):
                    data.xfrc_applied[number, :3] += pulled
                    data.xfrc_applied[number, 3:] += np.cross(contact.pos - data.xipos[number], pulled)
                    self._pressed.add(number)

    @override
    def clear_forces(self) -> None:
        for body in self._pressed:
            self._data.xfrc_applied[body] = 0.0
        self._pressed.clear()

    @override
    def add_mass(self, link: str, mass: float) -> None:
        self._model.body_mass[self._number(Target(link, is_link=True))] += mass
        # It needs data of its own, because it moves the robot to its reference pose.
        mujoco.mj_setConst(self._model, mujoco.MjData(self._model))

    @override
    def scale_friction(self, patch: int, factor: float) -> None:
        model, tile = self._model, self._model.geom(f"{GROUND}/{patch}").id
        pairs = np.flatnonzero((model.pair_geom1 == tile) | (model.pair_geom2 == tile))
        # All coefficients of a pair are proportional to that of the ground.
        model.pair_friction[pairs] *= factor
        if not factor:
            model.pair_dim[pairs] = 1
        self._forget_frictions()

    @override
    def add_velocity(self, target: Target, velocity_xyz: Vector3) -> None:
        first = int(self._model.body_dofadr[self._number(target)])
        self._data.qvel[first : first + 3] += velocity_xyz

    def carry(self) -> None:
        """Correct the contacts of moved bodies for their velocities, between the halves of a step."""
        if not self._moving or not self._data.ncon:
            return
        contacts = self._data.contact
        for number, geoms in enumerate(contacts.geom.tolist()):
            for geom, sign in zip(geoms, (1.0, -1.0), strict=True):
                twist = self._moving.get(self._names.get(geom, ""))
                if twist is not None and contacts.efc_address[number] >= 0:
                    self._correct(self._data.contact[number], sign, geom, twist)

    def _correct(self, contact: Any, sign: float, geom: int, twist: Twist) -> None:
        """Correct one contact; `sign`: of the body's velocity in the contact's, which is second geom minus first."""
        arm = np.subtract(contact.pos, self._data.xpos[self._model.geom_bodyid[geom]])
        velocity = np.add(twist.linear_xyz, np.cross(twist.angular_xyz, arm))
        along = contact.frame.reshape(3, 3)[: contact.dim] @ velocity
        rows = slice(contact.efc_address, contact.efc_address + contact.dim)
        self._data.efc_aref[rows] += sign * self._data.efc_KBIP[rows, 1] * along

    def _number(self, target: Target) -> int:
        return (
            int(self._model.body(self._name(target.name)).id) if target.is_link else self._objects.number(target.name)
        )

    def _turned(self, body: int) -> NDArray[np.float64]:
        mujoco.mj_kinematics(self._model, self._data)
        turned: NDArray[np.float64] = self._data.xmat[body].reshape(3, 3)
        return turned


class BasePusher:
    """Applies the last push of the base at every step; a fixed base does not move."""

    def __init__(self, compiled: CompiledScene, rate: float) -> None:
        self._model, self._data, self._base = compiled.model, compiled.data, compiled.base
        self._time_step = 1 / rate
        self._robot = _robot_inertia(compiled)
        self._push: BasePush | None = None

    def apply(self, push: BasePush) -> None:
        """Use this push from now on."""
        self._push = push

    def step(self, pose: Pose, twist: Twist) -> None:
        """Set the force of the next step; `pose`, `twist`: of the base link's origin, world frame."""
        if self._push is None:
            return
        found = base_wrench(self._push, self._robot, pose, twist, self._time_step)
        # MuJoCo applies forces at the centre of mass of a body.
        x, y, z = self._model.body_ipos[self._base]
        arm = np.subtract(found.point_xyz, geometry.compose(pose, Pose((x, y, z))).position_xyz)
        self._data.xfrc_applied[self._base, :3] = found.force_xyz
        self._data.xfrc_applied[self._base, 3:] = np.add(found.torque_xyz, np.cross(arm, found.force_xyz))


def _robot_inertia(compiled: CompiledScene) -> RobotInertia:
    """Return the inertia of the whole robot with its joints at their present positions."""
    model, data, base = compiled.model, compiled.data, compiled.base
    inertia = 0.0
    for body in range(base, model.nbody):
        if base in _above(model.body_parentid, body):
            away = np.linalg.norm(data.xipos[body, :2] - data.xipos[base, :2])
            inertia += float(model.body_mass[body] * away**2 + model.body_inertia[body].min())
    return RobotInertia(float(model.body_subtreemass[base]), inertia)


def _above(parents: NDArray[np.int32], body: int) -> set[int]:
    """Return a body and all its ancestors."""
    found = {body}
    while body:
        body = int(parents[body])
        found.add(body)
    return found
