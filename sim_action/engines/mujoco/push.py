"""Pushing a robot over the ground in MuJoCo."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.engines.mujoco.model import Compiled
from sim_action.engines.push import Pushed, wrench
from sim_action.state.command import BasePush


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
