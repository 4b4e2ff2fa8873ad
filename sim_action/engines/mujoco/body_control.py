"""Moving bodies and pushing a robot in MuJoCo.

A body that no joint holds has no velocity here, wherever it is put. But a constraint knows how fast what it holds
together moves apart only by its reference acceleration, -b v of the two points that touch: with what is missing in v
added between the two halves of a step, friction carries along what stands on a body, and what is hit is pushed.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.engines.body_control import Pushed, Target, wrench
from sim_action.engines.mujoco.names import engine_name
from sim_action.engines.mujoco.queries import Objects
from sim_action.engines.mujoco.scene import Compiled
from sim_action.state.command import BasePush


class MuJoCoStage:
    """See Stage."""

    def __init__(self, compiled: Compiled, objects: Objects) -> None:
        self._model, self._data, self._objects = compiled.model, compiled.data, objects
        self._names = compiled.bodies
        self._moving: dict[str, Twist] = {}
        self._pressed: set[int] = set()

    def pose(self, body: str) -> Pose:
        """See Stage.pose."""
        return self._objects.pose(body)

    def put(self, body: str, pose: Pose, twist: Twist) -> None:
        """See Stage.put."""
        if self._objects.put(body, pose, twist):
            return
        if twist == Twist():
            self._moving.pop(body, None)
        else:
            self._moving[body] = twist

    def press(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        """See Stage.press."""
        body = self._number(target)
        turning: Any = torque_xyz
        if point_xyz is not None:
            arm = np.subtract(point_xyz, self._model.body_ipos[body])
            turning = np.add(torque_xyz, np.cross(self._turned(body) @ arm, force_xyz))
        # Others may push as well.
        self._data.xfrc_applied[body] += [*force_xyz, *turning]
        self._pressed.add(body)

    def release(self) -> None:
        """See Stage.release."""
        for body in self._pressed:
            self._data.xfrc_applied[body] = 0.0
        self._pressed.clear()

    def push(self, target: Target, velocity_xyz: Vector3) -> None:
        """See Stage.push."""
        first = int(self._model.body_dofadr[self._number(target)])
        self._data.qvel[first : first + 3] += velocity_xyz

    def carry(self) -> None:
        """Between the halves of a step: tells the contacts of moving bodies how fast these move."""
        if not self._moving or not self._data.ncon:
            return
        contacts = self._data.contact
        for number, geoms in enumerate(contacts.geom.tolist()):
            for geom, sign in zip(geoms, (1.0, -1.0), strict=True):
                twist = self._moving.get(self._names.get(geom, ""))
                if twist is not None and contacts.efc_address[number] >= 0:
                    self._correct(self._data.contact[number], sign, geom, twist)

    def _correct(self, contact: Any, sign: float, geom: int, twist: Twist) -> None:
        """`sign`: of the body's velocity in that of the contact, which is the second geom's less the first's."""
        arm = np.subtract(contact.pos, self._data.xpos[self._model.geom_bodyid[geom]])
        velocity = np.add(twist.linear_xyz, np.cross(twist.angular_xyz, arm))
        along = contact.frame.reshape(3, 3)[: contact.dim] @ velocity
        rows = slice(contact.efc_address, contact.efc_address + contact.dim)
        self._data.efc_aref[rows] += sign * self._data.efc_KBIP[rows, 1] * along

    def _number(self, target: Target) -> int:
        return (
            int(self._model.body(engine_name(target.name)).id) if target.is_link else self._objects.number(target.name)
        )

    def _turned(self, body: int) -> NDArray[np.float64]:
        """(3, 3): how a body is turned in the world; after a step, the engine has but how it was before."""
        mujoco.mj_kinematics(self._model, self._data)
        turned: NDArray[np.float64] = self._data.xmat[body].reshape(3, 3)
        return turned


class Pusher:
    """The force on a base, until told otherwise; one that is bolted is not moved by it."""

    def __init__(self, compiled: Compiled, rate: float) -> None:
        self._model, self._data, self._base = compiled.model, compiled.data, compiled.base
        self._time_step = 1 / rate
        self._robot = _pushed(compiled)
        self._push: BasePush | None = None

    def apply(self, push: BasePush) -> None:
        """From now on."""
        self._push = push

    def step(self, pose: Pose, twist: Twist) -> None:
        """Sets the force of the next step; `pose`, `twist`: of the base link's origin, world frame."""
        if self._push is None:
            return
        found = wrench(self._push, self._robot, pose, twist, self._time_step)
        # The engine takes forces at the centre of mass of a body.
        x, y, z = self._model.body_ipos[self._base]
        arm = np.subtract(found.point_xyz, geometry.compose(pose, Pose((x, y, z))).position_xyz)
        self._data.xfrc_applied[self._base, :3] = found.force_xyz
        self._data.xfrc_applied[self._base, 3:] = np.add(found.torque_xyz, np.cross(arm, found.force_xyz))


def _pushed(compiled: Compiled) -> Pushed:
    """What is pushed; joints are where they are now."""
    model, data, base = compiled.model, compiled.data, compiled.base
    inertia = 0.0
    for body in range(base, model.nbody):
        if base in _above(model.body_parentid, body):
            away = np.linalg.norm(data.xipos[body, :2] - data.xipos[base, :2])
            inertia += float(model.body_mass[body] * away**2 + model.body_inertia[body].min())
    return Pushed(float(model.body_subtreemass[base]), inertia)


def _above(parents: NDArray[np.int32], body: int) -> set[int]:
    """A body and all that it hangs on."""
    found = {body}
    while body:
        body = int(parents[body])
        found.add(body)
    return found
