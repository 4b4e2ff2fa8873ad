"""Where the bodies of the world are in MuJoCo."""

from __future__ import annotations

from sim_action.backends.mujoco.model import Compiled
from sim_action.geometry import Pose


class Objects:
    """The bodies of the world at present, as the joint positions have it: those of a step are up to date after it."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._numbers = {name: int(self._model.geom_bodyid[geom]) for geom, name in compiled.bodies.items()}

    def pose(self, name: str) -> Pose:
        """Of its middle, world frame."""
        body = self._numbers[name]
        if self._model.body_dofnum[body]:
            start = self._model.jnt_qposadr[self._model.body_jntadr[body]]
            px, py, pz, qw, qx, qy, qz = self._data.qpos[start : start + 7].tolist()
        else:
            px, py, pz = self._model.body_pos[body].tolist()
            qw, qx, qy, qz = self._model.body_quat[body].tolist()
        return Pose((px, py, pz), (qx, qy, qz, qw))
