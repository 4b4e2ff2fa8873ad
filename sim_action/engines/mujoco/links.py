"""Where the links of a robot are in MuJoCo, and how they move."""

from __future__ import annotations

import mujoco
import numpy as np

from sim_action.core.geometry import Pose, Twist
from sim_action.engines.mujoco.model import Compiled
from sim_action.engines.mujoco.wording import engine_name


class Links:
    """The robot's links at present, which is worked out: after a step, the engine has but where they were before it."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._data = compiled.model, compiled.data

    def pose(self, link: str) -> Pose:
        """Of its frame, world frame."""
        mujoco.mj_kinematics(self._model, self._data)
        body = self._number(link)
        px, py, pz = self._data.xpos[body].tolist()
        qw, qx, qy, qz = self._data.xquat[body].tolist()
        return Pose((px, py, pz), (qx, qy, qz, qw))

    def twist(self, link: str) -> Twist:
        """Of the origin of its frame, world frame."""
        for work_out in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
            work_out(self._model, self._data)
        body, found = self._number(link), np.empty(6)
        # An XBODY is a body's own frame, a BODY the one at its centre of mass.
        mujoco.mj_objectVelocity(self._model, self._data, mujoco.mjtObj.mjOBJ_XBODY, body, found, 0)
        wx, wy, wz, vx, vy, vz = found.tolist()
        return Twist((vx, vy, vz), (wx, wy, wz))

    def _number(self, link: str) -> int:
        """Of its body."""
        return int(self._model.body(engine_name(link)).id)
